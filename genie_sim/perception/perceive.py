"""Frames to a trace: every picture of a drive through a detector, every box placed in the world."""

import importlib.metadata
import logging
import os
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from genie_sim.core.geometry import Geodetic
from genie_sim.errors import UserError
from genie_sim.messages import Encoding
from genie_sim.paths import expanded
from genie_sim.perception import placement, tuning
from genie_sim.perception.detector import ImageDetector, make_detector
from genie_sim.perception.kitti import ATTRIBUTION, CameraFrame, KittiDrive, open_drive
from genie_sim.perception.onnx_detector import CPU, MIN_SCORE, NMS_IOU
from genie_sim.perception.pipeline import trace_frames
from genie_sim.perception.trace import Trace, TraceFrame, feature_facts
from genie_sim.perception.tracking import tracking_trace

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pykitti", "pymap3d")
LOWEST_SCORE = 0.01  # for an evaluation: weak detections count for average precision
TRACKING = "tracking/"  # a drive of this name is a sequence of the tracking benchmark

Progress = Callable[[int, int], None]
log = logging.getLogger(__name__)


def kitti_folder(root: str | Path | None) -> Path:
    """KITTI's folder: ``root``, else what GENIE_SIM_KITTI says. UserError where neither is given."""
    place = root or os.environ.get("GENIE_SIM_KITTI")
    if not place:
        raise UserError(
            "kitti: where are the drives? Name KITTI's folder, or set GENIE_SIM_KITTI to it"
        )
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
    say: Callable[[str], None] = log.info,
    encoding: Encoding = "raw",
) -> Trace:
    """The trace of a KITTI drive. The same input gives the same trace. Raises UserError.

    Parameters:
        kitti_root: KITTI's folder; None: what GENIE_SIM_KITTI says.
        drive: such as ``2011_09_26/0005``, or ``tracking/0005`` for a tracking sequence.
        detector_name: a detector, or ``package.module:Class``; of a sequence ``pointrcnn`` or ``rrc``, as published.
        weights: the network's file or its folder; None: what GENIE_SIM_WEIGHTS says.
        min_score: the lowest score kept, in [0, 1].
        size: (width, height) of the network's input [pixels]; None: the detector's usual one.
        origin: of the world, (latitude [deg], longitude [deg], altitude [m]); None: the drive's first fix.
        progress: is called with the frames done and all frames.
        frames: the frame numbers to look at; None: all.
        providers: ONNX Runtime's, best first.
        place_from: detections with a lower score are kept without a location.
        encoding: of the pictures before the detector sees them.
        threads, batch: of the network, and its pictures at a time; None: what is fastest here, which ``say`` is told.
    """
    root = kitti_folder(kitti_root)
    if drive.startswith(TRACKING) and (threads, batch, encoding) != (1, 1, "raw"):
        raise UserError(
            f"{drive}: its detections are published ones: threads, batch and encoding mean nothing"
        )
    if drive.startswith(TRACKING):
        return tracking_trace(
            root / "tracking", drive.removeprefix(TRACKING), detector_name, min_score, origin
        )
    opened = open_drive(root, drive, cameras, origin, allow_missing_scans)
    chosen = in_turn(opened, frames)
    make = partial(make_detector, detector_name, weights, size, min_score, providers)
    if threads is None or batch is None:
        threads, batch = tuning.fastest(opened, chosen, make, threads, batch, say)
    detector = make(threads, batch)
    by_camera = _by_camera(
        trace_frames(opened, chosen, detector, place_from, encoding), len(chosen), progress
    )
    about = _provenance(opened, detector, min_score, threads, batch, encoding) | {
        "features": feature_facts(by_camera)
    }
    return Trace(f"kitti_{drive.split('/')[1]}", opened.origin, by_camera, about)


def _by_camera(
    frames: Iterable[TraceFrame], total: int, progress: Progress | None
) -> dict[str, tuple[TraceFrame, ...]]:
    found: dict[str, list[TraceFrame]] = {}
    for done, frame in enumerate(frames, start=1):
        found.setdefault(frame.camera, []).append(frame)
        if progress is not None:
            progress(done, total)
    return {camera: tuple(found[camera]) for camera in sorted(found)}


def in_turn(drive: KittiDrive, numbers: Collection[int] | None = None) -> list[CameraFrame]:
    """Frame by frame, all cameras of each: they share a scan. Only frames of these ``numbers``; UserError for none."""
    every = (frame for sequence in drive.frames.values() for frame in sequence)
    chosen = [frame for frame in every if numbers is None or frame.index in numbers]
    if not chosen:
        raise UserError(f"{drive.name}: has none of the frames that were asked for")
    return sorted(chosen, key=lambda frame: (frame.index, frame.camera))


def images(root: Path, drive: str, cameras: Sequence[str]) -> dict[tuple[str, int], Path]:
    """The image file of each camera and frame number; none for a tracking sequence."""
    if drive.startswith(TRACKING):
        return {}
    opened = open_drive(root, drive, cameras, allow_missing_scans=True)
    return {
        (camera, frame.index): frame.image_path
        for camera in opened.frames
        for frame in opened.frames[camera]
    }


def _provenance(
    drive: KittiDrive,
    detector: ImageDetector,
    min_score: float,
    threads: int,
    batch: int,
    encoding: Encoding,
) -> dict[str, Any]:
    unusual: dict[str, Any] = (
        {} if (threads, batch) == (1, 1) else {"threads": threads, "batch": batch}
    )
    unusual |= {} if encoding == "raw" else {"encoding": encoding}
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
            "vehicle_sizes_m": {
                label: list(size) for label, size in placement.VEHICLE_SIZES.items()
            },
            **unusual,
        },
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }
