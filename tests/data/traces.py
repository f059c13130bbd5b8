"""A made-up trace and its frames."""

from __future__ import annotations

from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.trace import Trace, TraceFrame

KARLSRUHE = (49.0112, 8.4228, 112.8)


def frame(camera="02", index=0, **changes):
    parked = Detection("car", 0.81, (10.0, 20.0, 60.0, 50.0), (5.0, 17.5, -0.5), 0.81, "scan")
    sign = Detection("stop sign", 0.35, (1.0, 2.0, 3.0, 4.0), None, 0.35, "none")
    values = {
        "camera": camera,
        "index": index,
        "stamp_ns": 103_380_000 * index,
        "width": 1242,
        "height": 375,
        "size_bytes": 1_397_297,
        "digest": f"{index:064x}",
        "dhash": 2**63 + index,
        "pose": CameraPose(index * 1.0, 2.0, 0.7, 1.5),
        "horizontal_fov_rad": 1.42,
        "detections": (parked, sign) if index % 2 == 0 else (),
    }
    return TraceFrame(**(values | changes))


def trace(**cameras):
    frames = cameras or {
        "02": tuple(frame("02", i) for i in range(4)),
        "03": tuple(frame("03", i) for i in range(3)),
    }
    return Trace(
        "kitti_0005",
        KARLSRUHE,
        frames,
        {"detector": "yolox_nano", "versions": {"onnxruntime": "1.20"}},
    )
