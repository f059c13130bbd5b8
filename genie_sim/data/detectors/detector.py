"""Object detectors by name: a picture in, labelled boxes out.

To add a network, write a class like these and name it ``package.module:Class``; to ship it, add a
line to ``_KINDS``, of which ``DETECTORS`` is made.
"""

import importlib.metadata
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np

from genie_sim.base import plugins
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import expanded
from genie_sim.core.messages import Encoding
from genie_sim.data.detectors.onnx_detector import (
    MIN_SCORE,
    SHARES,
    DetectedBox,
    OnnxDetector,
    Scored,
    is_share,
    letterbox,
)
from genie_sim.data.detectors.onnx_session import CPU

PACKAGES = ("numpy", "onnxruntime", "opencv-python-headless", "pymap3d")
FARTHEST_PX = 1e6  # that a box may lie from the corner of its picture
# Places of YOLOX are a few strides from their cells, before and after they are decoded.
DECODED = 4.0

__all__ = [
    "DETECTORS",
    "DetectedBox",
    "DetectorSettings",
    "ImageDetector",
    "find_weights",
]


class ImageDetector(Protocol):
    """What ``perceive`` needs of a detector. One that runs a network is best derived from
    ``OnnxDetector``.

    Parameters
    ----------
    weights : Path
        The file of its weights.
    size : tuple of int, optional
        Width and height of the network's input, in pixels; by default the network's own.
    min_score : float
        The lowest score, from 0 to 1, of what ``detect`` returns.
    """

    name: ClassVar[str]
    """What traces and scenarios call it."""

    file_name: ClassVar[str]
    """How the file of its weights is called."""

    size: tuple[int, int]
    """Width and height of its input, in pixels."""

    sha256: str
    """Of its weights, 64 hexadecimal digits."""

    def __init__(
        self, weights: Path, size: tuple[int, int] | None = None, min_score: float = MIN_SCORE
    ) -> None: ...

    def detect(self, image_bgr: np.ndarray) -> list[DetectedBox]:
        """Road users and furniture in a picture, best score first.

        Parameters
        ----------
        image_bgr : ndarray of uint8, shape (height, width, 3)
            The picture: blue, green and red from 0 to 255.
        """
        ...


class YoloxNano(OnnxDetector):
    """YOLOX-nano trained on COCO (Ge et al., 2021, https://arxiv.org/abs/2107.08430; Apache-2.0).

    The published networks have a square input; they are made rectangular when they are loaded,
    because KITTI's pictures are more than three times as wide as high. ``size`` is (width, height),
    multiples of 32.
    """

    name: ClassVar[str] = "yolox_nano"
    file_name: ClassVar[str] = "yolox_nano.onnx"
    default_size: ClassVar[tuple[int, int] | None] = (640, 192)
    strides = (8, 16, 32)
    gap = "yolox_gap"

    def doubt(self, outputs: Sequence[np.ndarray]) -> str:
        return SHARES if is_share(outputs[0][:, :4]) else ""

    def decodes(self, outputs: Sequence[np.ndarray]) -> bool:
        """If so, its centres are those of its cells in pixels."""
        places, cells = outputs[0][:, :2], (self.cells + 0.5) * self.cell_strides
        offset = np.median(np.abs(places - cells) / self.cell_strides)
        return bool(offset < DECODED and np.median(np.abs(places)) > DECODED)

    @property
    def notes(self) -> list[str]:
        return [f"{self.name}: the network decodes its boxes itself"] * self.is_decoded

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        """BGR from 0 to 255, as it is."""
        import cv2

        picture, scale = letterbox(image_bgr, self.size)
        blob = np.empty((1, 3, *picture.shape[:2]), np.float32)
        for plane, channel in zip(blob[0], cv2.split(picture), strict=True):
            plane[:] = channel
        return blob, scale

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(len(self.cells), 5 + len(self.labels))]

    def probabilities(self, outputs: Sequence[np.ndarray]) -> np.ndarray:
        return outputs[0][:, 4:]

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Centre = (p + cell) * stride, extent = exp(p) * stride, score = objectness * class; of a
        network that has done so itself, centre and extent are as they are.

        Cells whose objectness alone is too low for ``min_score`` are left out; they are all but a
        few.
        """
        likely = np.flatnonzero(outputs[0][:, 4] >= 0.99 * self.min_score)
        output, strides = outputs[0][likely].astype(np.float64), self.cell_strides[likely]
        if not self.is_decoded:
            output[:, 0:2] = (output[:, 0:2] + self.cells[likely]) * strides
            output[:, 2:4] = np.exp(np.minimum(output[:, 2:4], 10.0)) * strides
        return _corners(output), output[:, 4:5] * output[:, 5:]


class YoloxTiny(YoloxNano):
    """YOLOX-tiny: six times the weights of nano."""

    name = "yolox_tiny"
    file_name = "yolox_tiny.onnx"


class YoloxS(YoloxNano):
    """YOLOX-s: ten times the weights of nano."""

    name = "yolox_s"
    file_name = "yolox_s.onnx"
    default_size = (1248, 384)


class NanodetM(OnnxDetector):
    """NanoDet-m trained on COCO (https://github.com/RangiLyu/nanodet; Apache-2.0), exported for 416
    x 416.

    Its head is that of generalized focal loss (Li et al., 2020, https://arxiv.org/abs/2006.04388):
    each side's distance from the cell's centre is the mean of a distribution over 0 to 7 strides.
    """

    name = "nanodet_m"
    file_name = "nanodet_m_416.onnx"
    default_size = (416, 416)
    strides = (8, 16, 32)
    output_count = 6  # scores of each stride, then distances of each stride
    BINS = 8
    MEAN = np.array([103.53, 116.28, 123.675], dtype=np.float32)  # ImageNet's, in BGR
    STD = np.array([57.375, 57.12, 58.395], dtype=np.float32)

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        picture, scale = letterbox(image_bgr, self.size)
        return np.ascontiguousarray(
            ((picture - self.MEAN) / self.STD).transpose(2, 0, 1)[None]
        ), scale

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        cells = [self.size[0] // stride * (self.size[1] // stride) for stride in self.strides]
        return [(n, columns) for columns in (len(self.labels), 4 * self.BINS) for n in cells]

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        scales = len(self.strides)
        scores = np.concatenate(outputs[:scales]).astype(np.float64)
        logits = np.concatenate(outputs[scales:]).astype(np.float64).reshape(-1, 4, self.BINS)
        weights = np.exp(logits - logits.max(axis=2, keepdims=True))
        distances = weights @ np.arange(self.BINS) / weights.sum(axis=2) * self.cell_strides
        centre = (self.cells + 0.5) * self.cell_strides
        return np.hstack([centre - distances[:, :2], centre + distances[:, 2:]]), scores


class Yolov8(OnnxDetector):
    """Any detection network exported as Ultralytics' YOLOv8 to YOLO12 are: one output (4 + classes,
    boxes), no suppression.

    Classes are those in the file's metadata (``names``), else COCO's. The input has the size it was
    exported with, unless that is left open in the file.
    """

    name = "yolov8"
    file_name = "yolov8.onnx"
    default_size = None
    strides = (8, 16, 32)

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        """RGB from 0 to 1."""
        picture, scale = letterbox(image_bgr, self.size)
        blob = picture[:, :, ::-1].transpose(2, 0, 1)[None].astype(np.float32) / 255
        return np.ascontiguousarray(blob), scale

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(4 + len(self.labels), len(self.cells))]

    def doubt(self, outputs: Sequence[np.ndarray]) -> str:
        return SHARES if is_share(outputs[0][:4]) else ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Centre and extent in pixels of the network's picture, then the score of each class."""
        output = outputs[0].T.astype(np.float64)
        return _corners(output), output[:, 4:]


class Yolov10(Yolov8):
    """Networks that give their best boxes themselves: YOLOv10, and exports of Ultralytics with
    suppression inside (``nms=True``). One output (boxes, 6): left, top, right, bottom in pixels of
    the network's picture, score, class.
    """

    name = "yolov10"
    file_name = "yolov10.onnx"

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(None, 6)]

    def doubt(self, outputs: Sequence[np.ndarray]) -> str:
        rows = outputs[0]
        numbers = rows[:, 5]
        if (rows[:, 2:4] < rows[:, 0:2] - 1e-3).any() or (numbers != np.rint(numbers)).any():
            return "its rows are no left, top, right, bottom, score and class"
        return ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        rows = outputs[0].astype(np.float64)
        return rows[:, 0:4], _scores(rows[:, 5], rows[:, 4], len(self.labels))


def _corners(boxes: np.ndarray) -> np.ndarray:
    """Left, top, right and bottom (n, 4) of boxes whose columns begin with centre and extent."""
    centre, half = boxes[:, 0:2], boxes[:, 2:4] / 2
    return np.hstack([centre - half, centre + half])


def _scores(classes: np.ndarray, best: np.ndarray, count: int) -> np.ndarray:
    """The score (n, count) of every class, of boxes with the best one and its class."""
    scores, number = np.zeros((len(best), count)), classes.astype(np.int64)
    valid = np.flatnonzero((number >= 0) & (number < count))
    scores[valid, number[valid]] = best[valid]
    return scores


class RtDetr(Yolov8):
    """RT-DETR as Ultralytics exports it: one output (queries, 4 + classes), places as shares of the
    network's picture. Or as its authors do, and those of D-FINE and DEIM: the size of a picture as
    second input, and as outputs the class, the left, top, right and bottom in pixels, and the score
    of each query. Pictures are put into a letter box, not stretched.
    """

    name = "rtdetr"
    file_name = "rtdetr.onnx"
    sized_output_count = 3

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        if self.output_count == self.sized_output_count:
            return [(None,), (None, 4), (None,)]
        return [(None, 4 + len(self.labels))]

    def doubt(self, outputs: Sequence[np.ndarray]) -> str:
        if self.output_count == self.sized_output_count:
            classes, boxes, _ = outputs
            if (classes != np.rint(classes)).any() or (boxes[:, 2:] < boxes[:, :2] - 1e-3).any():
                return "its outputs are no classes, corners of boxes and scores"
            return ""
        if np.abs(outputs[0][:, :4]).max(initial=0.0) > 2:
            return "its places are no shares of the picture"
        return ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Centre and extent as shares, then the score of each class; or classes, corners and
        scores.
        """
        if self.output_count == self.sized_output_count:
            classes, boxes, best = outputs
            return boxes.astype(np.float64), _scores(classes, best, len(self.labels))
        output = outputs[0].astype(np.float64)
        return _corners(output[:, :4] * np.array([*self.size, *self.size])), output[:, 4:]


_KINDS: tuple[type[ImageDetector], ...] = (
    YoloxNano,
    YoloxTiny,
    YoloxS,
    NanodetM,
    Yolov8,
    Yolov10,
    RtDetr,
)
DETECTORS = {kind.name: kind for kind in _KINDS}


def look(
    image_bgr: np.ndarray, detector: ImageDetector
) -> tuple[list[DetectedBox], dict[str, bytes]]:
    """What a detector finds in a picture, and the features of its network by name. Raises
    ``UserError`` for what one of the user's own gives that is no list of boxes, or for boxes that
    are no pixels of this picture.
    """
    if isinstance(detector, OnnxDetector):
        return detector.look(image_bgr)
    boxes = detector.detect(image_bgr)
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
    return list(boxes), {}


def _is_detected_box(found: Any) -> bool:
    """Whether it is what a trace can hold: a label, a score, and a box whose ends are in order."""
    try:
        label, score, (x1, y1, x2, y2) = found
    except (TypeError, ValueError):
        return False
    if not (isinstance(found, tuple) and isinstance(label, str) and label):
        return False
    for value in (score, x1, y1, x2, y2):
        number: Any = value  # a Real, whose comparisons have no types
        if not isinstance(value, Real) or isinstance(value, bool) or not abs(number) < FARTHEST_PX:
            return False
    return bool(0 <= score <= 1 and x1 <= x2 and y1 <= y2)


@dataclass(frozen=True)
class DetectorSettings:
    """Which detector looks at frames, and how.

    Parameters
    ----------
    name : a detector, or ``package.module:Class``
    weights : the network's file or its folder; ``None``: the folder GENIE_SIM_WEIGHTS
    size : width and height of the network's input [pixels]; ``None``: the detector's usual one
    min_score : the lowest score kept, in [0, 1]
    providers : ONNX Runtime's execution providers, best first
    threads : of the network
    encoding : of the pictures before the detector sees them
    classes : the classes of labels of the network that have other names
    """

    name: str = "yolox_nano"
    weights: str | Path | None = None
    size: tuple[int, int] | None = None
    min_score: float = MIN_SCORE
    providers: Sequence[str] = (CPU,)
    threads: int = 1
    encoding: Encoding = "raw"
    classes: Mapping[str, str] = field(default_factory=dict)

    def opened(self) -> ImageDetector:
        """The detector with these settings. Raises UserError."""
        kind = plugins.resolve("detector", self.name, DETECTORS, ("detect", "file_name"))
        path = find_weights(kind.file_name, self.weights)
        network: dict[str, Any] = {}
        if isinstance(kind, type) and issubclass(kind, OnnxDetector):
            network = {"providers": self.providers, "threads": self.threads}
            network |= {"classes": self.classes} if self.classes else {}
        elif self.threads != 1 or self.classes or (*self.providers,) != (CPU,):
            raise UserError(
                f"{self.name}: is no OnnxDetector, which alone can have several threads, providers "
                "and other names of classes"
            )
        detector: ImageDetector = plugins.call(
            "detector",
            self.name,
            kind,
            path,
            size=self.size,
            min_score=self.min_score,
            **network,
        )
        return detector


def detector_facts(detector: ImageDetector) -> dict[str, Any]:
    """The detector, its weights, and the versions of the packages that decide what it finds and
    where, for a trace's provenance.
    """
    versions = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"detector": detector.name, "weights_sha256": detector.sha256, "versions": versions}


def find_weights(file_name: str, weights: str | Path | None = None) -> Path:
    """Path of a weights file, from an explicit file or folder or from the environment's
    GENIE_SIM_WEIGHTS.
    """
    place = weights or os.environ.get("GENIE_SIM_WEIGHTS")
    if not place:
        raise UserError(
            f"weights: where is {file_name}? Name the file, or set GENIE_SIM_WEIGHTS to its folder"
        )
    path = expanded(place)
    path = path / file_name if path.is_dir() else path
    if not path.is_file():
        raise UserError(f"{path}: no such weights file")
    return path
