"""Frames through a detector in concurrent stages: reading ahead, the network, placing what was
found.
"""

import hashlib
import os
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from numbers import Real
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.features import packed
from genie_sim.base.geometry import Array, transform
from genie_sim.base.paths import read_bytes
from genie_sim.core.messages import Encoding
from genie_sim.data.detectors import placement
from genie_sim.data.detectors.detector import DetectedBox, ImageDetector
from genie_sim.data.detectors.onnx_detector import SHARES, OnnxDetector, is_share
from genie_sim.data.detectors.placement import Placement, Plane
from genie_sim.data.encoding import difference_hash, hue_saturation, sent
from genie_sim.data.importers.trace_import import detection, picture_frame
from genie_sim.data.kitti.drive import CameraFrame, KittiDrive, decode_image
from genie_sim.data.trace import TraceFrame

READ_AHEAD = 4  # frames read while the network runs, and frames placed after it
MAX_WORKERS = 3  # read and place; more than the fastest networks here can use
MAX_PIXELS = 1e6  # that a box may lie from the corner of its picture

Result = TypeVar("Result")


class _ReadFrame(NamedTuple):
    """A frame that has been read, without what is found in it: what the network gets, and how much
    that was scaled.
    """

    world_SE3_camera: Array
    frame: TraceFrame
    placement: Placement
    blob: np.ndarray
    scale: float


class _InOneStep:
    """A detector that runs no network of its own: a whole picture goes in, and what comes out is
    found.
    """

    threads = 1

    def __init__(self, detector: ImageDetector) -> None:
        self._detector = detector

    def infer(self, image_bgr: np.ndarray) -> list[DetectedBox]:
        return boxes_in(image_bgr, self._detector)

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        return image_bgr, 1.0

    def found(self, outputs: Any, scale: float, image_size: tuple[int, int]) -> list[DetectedBox]:
        return list(outputs)

    def features(self, outputs: Any) -> dict[str, bytes]:
        return {}


def boxes_in(image_bgr: np.ndarray, detector: ImageDetector) -> list[DetectedBox]:
    """What a detector finds in a picture. Raises ``UserError`` for what one of the user's own gives
    that is no list of boxes, or for boxes that are no pixels of this picture.
    """
    boxes = detector.detect(image_bgr)
    if isinstance(detector, OnnxDetector):
        return list(boxes)
    name = type(detector).__name__
    wrong: list[Any] = [boxes]
    if isinstance(boxes, list | tuple):
        wrong = [box for box in boxes if not _is_detected_box(box)]
    if wrong:
        raise UserError(
            f"detector {name}: detect() gave {short_repr(wrong[0])}; it must give a "
            "list of DetectedBox(label, score from 0 to 1, (x1, y1, x2, y2) in pixels)"
        )
    places = np.array([box for _, _, box in boxes], dtype=float).reshape(-1, 4)
    if is_share(places):
        raise UserError(f"detector {name}: {SHARES}")
    height, width = image_bgr.shape[:2]
    outside = (places[:, :2] >= (width, height)) | (places[:, 2:] <= 0)
    if outside.any():
        first = short_repr(boxes[int(outside.any(axis=1).argmax())])
        raise UserError(
            f"detector {name}: detect() gave {first}, outside of its picture of "
            f"{width} x {height} pixels"
        )
    return list(boxes)


def _is_detected_box(found: Any) -> bool:
    """Whether it is what a trace can hold: a label, a score, and a box whose ends are in order."""
    if not isinstance(found, tuple) or len(found) != 3:
        return False
    label, score, box = found
    if not isinstance(label, str) or not label:
        return False
    if not isinstance(box, list | tuple | np.ndarray) or len(box) != 4:
        return False
    for value in (score, *box):
        number: Any = value  # a Real, whose comparisons have no types
        if not isinstance(value, Real) or isinstance(value, bool) or not abs(number) < MAX_PIXELS:
            return False
    return bool(0 <= score <= 1 and box[0] <= box[2] and box[1] <= box[3])


def trace_frames(
    drive: KittiDrive,
    frames: Iterable[CameraFrame],
    detector: ImageDetector,
    *,
    place_from: float = 0.0,
    encoding: Encoding = "raw",
) -> Iterator[TraceFrame]:
    """The frames for a trace, in order, with KITTI's stamps.

    The network has this thread for itself: the processors it leaves free read the frames that come,
    and place what was found in those that went.

    Parameters
    ----------
    drive : of the frames
    frames : what to look at
    detector : what looks
    place_from : detections with a lower score are kept without a location
    encoding : of the pictures before the detector sees them
    """
    stages = _Stages(drive, detector, place_from, encoding)
    free = (os.cpu_count() or 1) - stages.detector.threads
    with _one_thread_of_opencv(), ThreadPoolExecutor(min(max(free, 1), MAX_WORKERS)) as workers:
        reading = (workers.submit(stages.read, frame) for frame in frames)
        pictures = _in_order(reading, READ_AHEAD + 1)
        inferred = ((picture, stages.detector.infer(picture.blob)) for picture in pictures)
        placing = (workers.submit(stages.place, *picture) for picture in inferred)
        yield from _in_order(placing, READ_AHEAD)


class _Stages:
    """What is done with each frame before and after the network has it: read, place."""

    def __init__(
        self, drive: KittiDrive, detector: ImageDetector, place_from: float, encoding: Encoding
    ) -> None:
        self.detector = detector if isinstance(detector, OnnxDetector) else _InOneStep(detector)
        self._drive, self._place_from, self._encoding = drive, place_from, encoding
        # The cameras of a car share a scan.
        self._scanned = lru_cache(2 * READ_AHEAD)(partial(_scanned, drive))

    def read(self, frame: CameraFrame) -> _ReadFrame:
        """A frame from the disk, as the network gets it."""
        data = read_bytes(frame.image_path)
        image = decode_image(frame.image_path, data)
        height, width = image.shape[:2]
        dhash, size_bytes = difference_hash(image), None
        if self._encoding != "raw":
            image, size_bytes = sent(image, self._encoding)
        scan, ground = self._scanned(frame.index)
        camera_SE3_velo = self._drive.camera_SE3_velo(frame.camera)
        blob, scale = self.detector.prepare(image)
        intrinsics = frame.intrinsics_of((width, height))
        return _ReadFrame(
            world_SE3_camera=frame.world_SE3_camera,
            frame=picture_frame(
                camera=frame.camera,
                index=frame.index,
                stamp_ns=frame.stamp_ns,
                size=(width, height),
                digest=hashlib.sha256(data).hexdigest(),
                dhash=dhash,
                world_SE3_camera=frame.world_SE3_camera,
                intrinsics=intrinsics,
                features={"hsv": packed(hue_saturation(image))},
                size_bytes=size_bytes,
            ),
            placement=Placement(intrinsics, (width, height), camera_SE3_velo, scan, ground=ground),
            blob=blob,
            scale=scale,
        )

    def place(self, picture: _ReadFrame, outputs: Any) -> TraceFrame:
        """The frame with what was found in it, each object at its place in the world."""
        frame, detections = picture.frame, []
        boxes = self.detector.found(outputs, picture.scale, (frame.width, frame.height))
        for label, score, box in boxes:
            point, method = None, "none"
            if score >= self._place_from:
                point, method = picture.placement.place(label, box)
            location = None if point is None else transform(picture.world_SE3_camera, point)
            detections.append(detection(label, score, box, location, method=method))
        features = {**frame.features, **self.detector.features(outputs)}
        return replace(frame, detections=tuple(detections), features=features)


def _scanned(drive: KittiDrive, number: int) -> tuple[Array | None, Plane]:
    """A laser scan, if there is one, and the ground in it."""
    scan = drive.scan(number)
    return scan, placement.TYPICAL_GROUND if scan is None else placement.fit_ground(scan)


@contextmanager
def _one_thread_of_opencv() -> Iterator[None]:
    """OpenCV would put its own threads on the network's processor."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def _in_order(futures: Iterable[Future[Result]], ahead: int) -> Iterator[Result]:
    """The results of what was submitted, in order, while ``ahead`` more are pending."""
    pending: deque[Future[Result]] = deque()
    for future in futures:
        pending.append(future)
        if len(pending) > ahead:
            yield pending.popleft().result()
    while pending:
        yield pending.popleft().result()
