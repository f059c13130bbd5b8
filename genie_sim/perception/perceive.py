"""Frames to a trace: every picture of a drive through a detector, every box placed in the world."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from genie_sim.core.geometry import Geodetic, transform
from genie_sim.errors import UserError
from genie_sim.perception import placement
from genie_sim.perception.detector import MIN_SCORE, NMS_IOU, Detector, make_detector
from genie_sim.perception.kitti import ATTRIBUTION, CameraFrame, Drive, open_drive, read_image
from genie_sim.perception.placement import Placement
from genie_sim.perception.trace import Trace, TraceFrame, detection, trace_frame

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pykitti", "pymap3d")

Progress = Callable[[int, int], None]


def perceive(
    kitti_root: str | Path | None,
    drive: str,
    cameras: Sequence[str] = ("02", "03"),
    detector_name: str = "yolox_nano",
    weights: str | Path | None = None,
    min_score: float = MIN_SCORE,
    size: tuple[int, int] | None = None,
    origin: Geodetic | None = None,
    progress: Progress | None = None,
    frames: Collection[int] | None = None,
    allow_missing_scans: bool = False,
) -> Trace:
    """The trace of a KITTI drive such as ``2011_09_26/0005``. The same input gives the same trace.

    ``kitti_root`` and ``weights`` are by default what GENIE_SIM_KITTI and GENIE_SIM_WEIGHTS say; ``origin`` is the
    geodetic origin, by default the drive's first GPS fix; ``size`` the network's (width, height); ``frames`` the frame
    numbers wanted, by default all. ``progress`` is called with the frames done and all frames. Raises UserError.
    """
    root = kitti_root or os.environ.get("GENIE_SIM_KITTI")
    if not root:
        raise UserError("kitti: where are the drives? Name KITTI's folder, or set GENIE_SIM_KITTI to it")
    opened = open_drive(root, drive, cameras, origin, allow_missing_scans)
    detector = make_detector(detector_name, weights, size, min_score)
    wanted = {
        camera: [frame for frame in sequence if frames is None or frame.index in frames]
        for camera, sequence in opened.frames.items()
    }
    total = sum(map(len, wanted.values()))
    if not total:
        raise UserError(f"{root}: drive {drive} has none of the frames that were asked for")
    perceived: dict[str, tuple[TraceFrame, ...]] = {}
    done = 0
    for camera in sorted(wanted):
        rows = []
        for frame in wanted[camera]:
            rows.append(_trace_frame(opened, frame, detector))
            done += 1
            if progress is not None:
                progress(done, total)
        perceived[camera] = tuple(rows)
    provenance = _provenance(opened, detector, min_score)
    return Trace(f"kitti_{drive.split('/')[1]}", opened.origin, perceived, provenance)


def difference_hash(image_bgr: np.ndarray) -> int:
    """64-bit dHash: of the grey picture shrunk to 9x8, one bit for each pixel brighter than its left neighbour."""
    grey = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
    small = cv2.resize(grey, (9, 8), interpolation=cv2.INTER_AREA).astype(np.int16)
    bits = np.packbits(small[:, 1:] > small[:, :-1])
    return int.from_bytes(bits.tobytes(), "big")


def _trace_frame(drive: Drive, frame: CameraFrame, detector: Detector) -> TraceFrame:
    image = read_image(frame.image_path)
    height, width = image.shape[:2]
    placement_here = Placement(
        frame.intrinsics, (width, height), drive.camera_SE3_velo(frame.camera), drive.scan(frame.index)
    )
    detections = []
    for label, score, box in detector.detect(image):
        point, method = placement_here.place(label, box)
        place = None if point is None else transform(frame.world_SE3_camera, point)
        detections.append(detection(label, score, box, place, method))
    fingerprints = (hashlib.sha256(frame.image_path.read_bytes()).hexdigest(), difference_hash(image))
    stamp_ns = frame.stamp_ns - drive.first_stamp_ns
    size, pose = (width, height), frame.world_SE3_camera
    return trace_frame(frame.camera, frame.index, stamp_ns, size, fingerprints, pose, frame.intrinsics, detections)


def _provenance(drive: Drive, detector: Detector, min_score: float) -> dict[str, Any]:
    return {
        "data": ATTRIBUTION,
        "drive": drive.name,
        "drive_sha256": drive.digest(),
        "detector": detector.name,
        "weights_sha256": detector.sha256,
        "parameters": {
            "cameras": sorted(drive.frames),
            "input_size": list(detector.size),
            "min_score": min_score,
            "nms_iou": NMS_IOU,
            "half_depth_m": placement.HALF_DEPTH_M,
        },
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }
