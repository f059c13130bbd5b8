"""Frames to a trace: every picture of a drive through a detector, every box placed in the world."""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from genie_sim.core.geometry import Geodetic
from genie_sim.errors import UserError
from genie_sim.paths import expanded
from genie_sim.perception import placement, tuning
from genie_sim.perception.detector import ImageDetector, make_detector
from genie_sim.perception.kitti import ATTRIBUTION, CameraFrame, KittiDrive, open_drive
from genie_sim.perception.onnx_detector import CPU, MIN_SCORE, NMS_IOU
from genie_sim.perception.pipeline import trace_frames
from genie_sim.perception.trace import Trace, TraceFrame
from genie_sim.perception.tracking import tracking_trace

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pykitti", "pymap3d")
LOWEST_SCORE = 0.01  # for an evaluation: weak detections count for average precision
TRACKING = "tracking/"  # a drive of this name is a sequence of the tracking benchmark

Progress = Callable[[int, int], None]


def kitti_folder(root: str | Path | None) -> Path:
    """KITTI's folder: ``root``, else what GENIE_SIM_KITTI says. UserError where neither is given."""
    place = root or os.environ.get("GENIE_SIM_KITTI")
    if not place:
        raise UserError("kitti: where are the drives? Name KITTI's folder, or set GENIE_SIM_KITTI to it")
    return expanded(place)


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
    providers: Sequence[str] = (CPU,),
    place_from: float = 0.0,
    threads: int | None = 1,
    batch: int | None = 1,
    say: Callable[[str], None] | None = None,
) -> Trace:
    """The trace of a KITTI drive such as ``2011_09_26/0005``. The same input gives the same trace.

    A drive such as ``tracking/0005`` is a sequence of the tracking benchmark; its ``detector_name`` is that of
    published detections, ``pointrcnn`` or ``rrc``. ``kitti_root`` and ``weights`` are by default what GENIE_SIM_KITTI
    and GENIE_SIM_WEIGHTS say; ``origin`` is the geodetic origin, by default the drive's first GPS fix; ``size`` the
    network's (width, height); ``frames`` the frame numbers wanted, by default all; detections below ``place_from`` are
    kept without a location. ``threads`` are the network's, ``batch`` is how many pictures it gets at a time; ``None``:
    what is fastest on the first frames, and ``say`` is told. ``progress`` is called with the frames done and all
    frames. Raises UserError.
    """
    root = kitti_folder(kitti_root)
    if drive.startswith(TRACKING):
        if (threads, batch) != (1, 1):
            raise UserError(f"{drive}: its detections are published ones, so threads and batch say nothing")
        return tracking_trace(root / "tracking", drive.removeprefix(TRACKING), detector_name, min_score, origin)
    opened = open_drive(root, drive, cameras, origin, allow_missing_scans)
    make = partial(make_detector, detector_name, weights, size, min_score, providers)
    wanted = [frame for frame in in_turn(opened) if frames is None or frame.index in frames]
    if not wanted:
        raise UserError(f"{root}: drive {drive} has none of the frames that were asked for")
    if threads is None or batch is None:
        chosen = tuning.fastest(opened, wanted, make, threads, batch)
        threads, batch = chosen.threads, chosen.batch
        if say is not None:
            say(str(chosen))
    detector = make(threads, batch)
    perceived: dict[str, list[TraceFrame]] = {}
    for done, row in enumerate(trace_frames(opened, wanted, detector, place_from), start=1):
        perceived.setdefault(row.camera, []).append(row)
        if progress is not None:
            progress(done, len(wanted))
    provenance = _provenance(opened, detector, min_score)
    if (threads, batch) != (1, 1):
        provenance["parameters"] |= {"threads": threads, "batch": batch}
    by_camera = {camera: tuple(perceived[camera]) for camera in sorted(perceived)}
    return Trace(f"kitti_{drive.split('/')[1]}", opened.origin, by_camera, provenance)


def in_turn(drive: KittiDrive) -> list[CameraFrame]:
    """Frame by frame, all cameras of each: they share a scan."""
    frames = (frame for sequence in drive.frames.values() for frame in sequence)
    return sorted(frames, key=lambda frame: (frame.index, frame.camera))


def images(root: Path, drive: str, cameras: Sequence[str]) -> dict[tuple[str, int], Path]:
    """The image file of each camera and frame number; none for a tracking sequence."""
    if drive.startswith(TRACKING):
        return {}
    opened = open_drive(root, drive, cameras, allow_missing_scans=True)
    return {(camera, frame.index): frame.image_path for camera in opened.frames for frame in opened.frames[camera]}


def _provenance(drive: KittiDrive, detector: ImageDetector, min_score: float) -> dict[str, Any]:
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
            "vehicle_sizes_m": {label: list(size) for label, size in placement.VEHICLE_SIZES.items()},
        },
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }
