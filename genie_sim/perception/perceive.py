"""Frames to a trace: every picture of a drive through a detector, every box placed in the world."""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np

from genie_sim.core.geometry import Array, Geodetic, transform
from genie_sim.errors import UserError
from genie_sim.perception import placement
from genie_sim.perception.detector import Detector, Found, make_detector
from genie_sim.perception.fingerprint import difference_hash
from genie_sim.perception.kitti import ATTRIBUTION, CameraFrame, Drive, decode_image, open_drive
from genie_sim.perception.onnx_detector import CPU, MIN_SCORE, NMS_IOU, OnnxDetector
from genie_sim.perception.placement import Placement, Plane
from genie_sim.perception.trace import Trace, TraceFrame, detection, trace_frame
from genie_sim.perception.tracking import tracking_trace

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pykitti", "pymap3d")
LOWEST_SCORE = 0.01  # for an evaluation: weak detections count for average precision
READ_AHEAD = 4  # frames read while the network runs, and frames placed after it
MOST_WORKERS = 3  # read and place; more than the fastest networks here can use
TRACKING = "tracking/"  # a drive of this name is a sequence of the tracking benchmark

Progress = Callable[[int, int], None]
Result = TypeVar("Result")


class _Picture(NamedTuple):
    """A frame that has been read: what the network gets, how much it was scaled, and what the rest needs."""

    frame: CameraFrame
    size: tuple[int, int]
    fingerprints: tuple[str, int]
    placement: Placement
    blob: np.ndarray
    scale: float


class _InOneStep:
    """A detector that runs no network of its own: a whole picture goes in, and what comes out is found."""

    def __init__(self, detector: Detector) -> None:
        self.infer = detector.detect

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        return image_bgr, 1.0

    def found(self, outputs: Any, scale: float, image_size: tuple[int, int]) -> list[Found]:
        return list(outputs)


def kitti_folder(root: str | Path | None) -> Path:
    """KITTI's folder: ``root``, else what GENIE_SIM_KITTI says. UserError where neither is given."""
    place = root or os.environ.get("GENIE_SIM_KITTI")
    if not place:
        raise UserError("kitti: where are the drives? Name KITTI's folder, or set GENIE_SIM_KITTI to it")
    return Path(place)


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
) -> Trace:
    """The trace of a KITTI drive such as ``2011_09_26/0005``. The same input gives the same trace.

    A drive such as ``tracking/0005`` is a sequence of the tracking benchmark; its ``detector_name`` is that of
    published detections, ``pointrcnn`` or ``rrc``. ``kitti_root`` and ``weights`` are by default what GENIE_SIM_KITTI
    and GENIE_SIM_WEIGHTS say; ``origin`` is the geodetic origin, by default the drive's first GPS fix; ``size`` the
    network's (width, height); ``frames`` the frame numbers wanted, by default all; detections below ``place_from`` are
    kept without a location. ``progress`` is called with the frames done and all frames. Raises UserError.
    """
    root = kitti_folder(kitti_root)
    if drive.startswith(TRACKING):
        return tracking_trace(root / "tracking", drive.removeprefix(TRACKING), detector_name, min_score, origin)
    opened = open_drive(root, drive, cameras, origin, allow_missing_scans)
    detector = make_detector(detector_name, weights, size, min_score, providers)
    wanted = [frame for frame in in_turn(opened) if frames is None or frame.index in frames]
    if not wanted:
        raise UserError(f"{root}: drive {drive} has none of the frames that were asked for")
    perceived: dict[str, list[TraceFrame]] = {}
    for done, row in enumerate(trace_frames(opened, wanted, detector, place_from), start=1):
        perceived.setdefault(row.camera, []).append(row)
        if progress is not None:
            progress(done, len(wanted))
    provenance = _provenance(opened, detector, min_score)
    by_camera = {camera: tuple(perceived[camera]) for camera in sorted(perceived)}
    return Trace(f"kitti_{drive.split('/')[1]}", opened.origin, by_camera, provenance)


def in_turn(drive: Drive) -> list[CameraFrame]:
    """Frame by frame, all cameras of each: they share a scan."""
    frames = (frame for sequence in drive.frames.values() for frame in sequence)
    return sorted(frames, key=lambda frame: (frame.index, frame.camera))


def images(root: Path, drive: str, cameras: Sequence[str]) -> dict[tuple[str, int], Path]:
    """The image file of each camera and frame number; none for a tracking sequence."""
    if drive.startswith(TRACKING):
        return {}
    opened = open_drive(root, drive, cameras, allow_missing_scans=True)
    return {(camera, frame.index): frame.image_path for camera in opened.frames for frame in opened.frames[camera]}


def trace_frames(
    drive: Drive, frames: Iterable[CameraFrame], detector: Detector, place_from: float = 0.0
) -> Iterator[TraceFrame]:
    """The frames as a trace keeps them, in order. The network has this thread for itself: the processors it leaves
    free read the frames that come, and place what was found in those that went."""
    steps = detector if isinstance(detector, OnnxDetector) else _InOneStep(detector)
    free = (os.cpu_count() or 1) - (detector.threads if isinstance(detector, OnnxDetector) else 1)
    scanned = lru_cache(2 * READ_AHEAD)(partial(_scanned, drive))
    with _one_thread_of_opencv(), ThreadPoolExecutor(min(max(free, 1), MOST_WORKERS)) as workers:
        read = partial(workers.submit, partial(_read, drive, steps, scanned))
        place = partial(workers.submit, partial(_placed, drive, steps, place_from))
        pictures = _in_order(map(read, frames))
        yield from _in_order(place(picture, steps.infer(picture.blob)) for picture in pictures)


@contextmanager
def _one_thread_of_opencv() -> Iterator[None]:
    """OpenCV would put its own threads on the network's processor."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _in_order(futures: Iterator[Future[Result]]) -> Iterator[Result]:
    """The results of what was submitted, while ``READ_AHEAD`` more are under way."""
    pending: deque[Future[Result]] = deque()
    for future in futures:
        pending.append(future)
        if len(pending) > READ_AHEAD:
            yield pending.popleft().result()
    while pending:
        yield pending.popleft().result()


def _scanned(drive: Drive, index: int) -> tuple[Array | None, Plane]:
    scan = drive.scan(index)
    return scan, placement.TYPICAL_GROUND if scan is None else placement.fit_ground(scan)


def _read(
    drive: Drive,
    steps: OnnxDetector | _InOneStep,
    scanned: Callable[[int], tuple[Array | None, Plane]],
    frame: CameraFrame,
) -> _Picture:
    data = frame.image_path.read_bytes()
    image = decode_image(frame.image_path, data)
    size = (image.shape[1], image.shape[0])
    fingerprints = (hashlib.sha256(data).hexdigest(), difference_hash(image))
    here = Placement(frame.intrinsics, size, drive.camera_SE3_velo(frame.camera), *scanned(frame.index))
    return _Picture(frame, size, fingerprints, here, *steps.prepare(image))


def _placed(
    drive: Drive, steps: OnnxDetector | _InOneStep, place_from: float, picture: _Picture, outputs: Any
) -> TraceFrame:
    frame = picture.frame
    detections = []
    for label, score, box in steps.found(outputs, picture.scale, picture.size):
        point, method = picture.placement.place(label, box) if score >= place_from else (None, "none")
        place = None if point is None else transform(frame.world_SE3_camera, point)
        detections.append(detection(label, score, box, place, method))
    stamp_ns = frame.stamp_ns - drive.first_stamp_ns
    pose = frame.world_SE3_camera
    return trace_frame(
        frame.camera, frame.index, stamp_ns, picture.size, picture.fingerprints, pose, frame.intrinsics, detections
    )


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
            "vehicle_sizes_m": {label: list(size) for label, size in placement.VEHICLE_SIZES.items()},
        },
        "versions": {name: importlib.metadata.version(name) for name in PACKAGES},
    }
