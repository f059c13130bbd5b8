"""Frames through a detector in concurrent stages: reading ahead, the network, placing what was found."""

import hashlib
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from itertools import islice, starmap
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np

from genie_sim.core.caches.features import packed
from genie_sim.core.geometry import Array, transform
from genie_sim.messages import Encoding
from genie_sim.paths import read_bytes
from genie_sim.perception import placement
from genie_sim.perception.detector import Found, ImageDetector
from genie_sim.perception.encoding import difference_hash, hue_saturation, sent
from genie_sim.perception.kitti import CameraFrame, KittiDrive, decode_image
from genie_sim.perception.onnx_detector import OnnxDetector
from genie_sim.perception.placement import Placement, Plane
from genie_sim.perception.trace import TraceFrame, detection, trace_frame

READ_AHEAD = 4  # frames read while the network runs, and frames placed after it
MOST_WORKERS = 3  # read and place; more than the fastest networks here can use

Result = TypeVar("Result")


class _Picture(NamedTuple):
    """A frame that has been read, without what is found in it: what the network gets, and how much that was scaled."""

    world_SE3_camera: Array
    frame: TraceFrame
    placement: Placement
    blob: np.ndarray
    scale: float


class _InOneStep:
    """A detector that runs no network of its own: a whole picture goes in, and what comes out is found."""

    threads = batch = 1

    def __init__(self, detector: ImageDetector) -> None:
        self._detect = detector.detect

    def infer_many(self, images: Sequence[np.ndarray]) -> list[list[Found]]:
        return [self._detect(image) for image in images]

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        return image_bgr, 1.0

    def found(self, outputs: Any, scale: float, image_size: tuple[int, int]) -> list[Found]:
        return list(outputs)

    def features(self, outputs: Any) -> dict[str, bytes]:
        return {}


def trace_frames(
    drive: KittiDrive,
    frames: Iterable[CameraFrame],
    detector: ImageDetector,
    place_from: float = 0.0,
    encoding: Encoding = "raw",
) -> Iterator[TraceFrame]:
    """The frames as a trace keeps them, in order. The network has this thread for itself: the processors it leaves
    free read the frames that come, and place what was found in those that went."""
    steps = detector if isinstance(detector, OnnxDetector) else _InOneStep(detector)
    free = (os.cpu_count() or 1) - steps.threads
    scanned = lru_cache(2 * READ_AHEAD)(partial(_scanned, drive))
    with _one_thread_of_opencv(), ThreadPoolExecutor(min(max(free, 1), MOST_WORKERS)) as workers:
        read = partial(workers.submit, partial(_read, drive, steps, scanned, encoding))
        place = partial(workers.submit, partial(_placed, steps, place_from))
        pictures = _in_order(map(read, frames), READ_AHEAD + steps.batch)
        yield from _in_order(starmap(place, _inferred(steps, pictures)), READ_AHEAD)


def _inferred(
    steps: OnnxDetector | _InOneStep, pictures: Iterator[_Picture]
) -> Iterator[tuple[_Picture, Any]]:
    """Each picture with the network's outputs for it."""
    while together := list(islice(pictures, steps.batch)):
        yield from zip(
            together, steps.infer_many([picture.blob for picture in together]), strict=True
        )


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


def _scanned(drive: KittiDrive, index: int) -> tuple[Array | None, Plane]:
    scan = drive.scan(index)
    return scan, placement.TYPICAL_GROUND if scan is None else placement.fit_ground(scan)


def _read(
    drive: KittiDrive,
    steps: OnnxDetector | _InOneStep,
    scanned: Callable[[int], tuple[Array | None, Plane]],
    encoding: Encoding,
    frame: CameraFrame,
) -> _Picture:
    data = read_bytes(frame.image_path)
    image = decode_image(frame.image_path, data)
    size, size_bytes = (image.shape[1], image.shape[0]), None
    fingerprints = (hashlib.sha256(data).hexdigest(), difference_hash(image))
    if encoding != "raw":
        image, size_bytes = sent(image, encoding)
    here = Placement(
        frame.intrinsics, size, drive.camera_SE3_velo(frame.camera), *scanned(frame.index)
    )
    stamp_ns, pose = frame.stamp_ns - drive.first_stamp_ns, frame.world_SE3_camera
    seen = (
        size,
        fingerprints,
        pose,
        frame.intrinsics,
        (),
        {"hsv": packed(hue_saturation(image))},
        size_bytes,
    )
    return _Picture(
        pose, trace_frame(frame.camera, frame.index, stamp_ns, *seen), here, *steps.prepare(image)
    )


def _placed(
    steps: OnnxDetector | _InOneStep, place_from: float, picture: _Picture, outputs: Any
) -> TraceFrame:
    frame, detections = picture.frame, []
    for label, score, box in steps.found(outputs, picture.scale, (frame.width, frame.height)):
        point, method = (
            picture.placement.place(label, box) if score >= place_from else (None, "none")
        )
        place = None if point is None else transform(picture.world_SE3_camera, point)
        detections.append(detection(label, score, box, place, method))
    return replace(
        frame, detections=tuple(detections), features={**frame.features, **steps.features(outputs)}
    )
