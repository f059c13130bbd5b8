"""The families of networks that come with the simulator: what each wants to see, and what its
outputs mean.
"""

import functools
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors.boxes import SHARES, is_share
from genie_sim.data.detectors.onnx_detector import OnnxDetector, Scored

# Places of YOLOX are a few strides from their cells, before and after they are decoded.
DECODED = 4.0


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

    def doubt(self) -> str:
        return SHARES if is_share(self.grey_outputs[0][:, :4]) else ""

    @functools.cached_property
    def is_decoded(self) -> bool:
        """Whether the network decodes its boxes itself: its centres are those of its cells in
        pixels.
        """
        places, cells = self.grey_outputs[0][:, :2], (self.cells + 0.5) * self.cell_strides
        offset = np.median(np.abs(places - cells) / self.cell_strides)
        return bool(offset < DECODED and np.median(np.abs(places)) > DECODED)

    def tell(self, report: ImportReport) -> None:
        super().tell(report)
        if self.is_decoded:
            report.chosen.append(f"{self.name}: the network decodes its boxes itself")

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(len(self.cells), 5 + len(self.labels))]

    def probabilities(self, outputs: Sequence[np.ndarray], scores: np.ndarray) -> np.ndarray:
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
    # ImageNet's, of blue, green and red
    MEAN = np.array([103.53, 116.28, 123.675], dtype=np.float32)[:, None, None]
    STD = np.array([57.375, 57.12, 58.395], dtype=np.float32)[:, None, None]

    def normalized(self, colours: np.ndarray) -> np.ndarray:
        return (colours - self.MEAN) / self.STD

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


class RedGreenBlue(OnnxDetector):
    """Networks that want red, green and blue from 0 to 1, in the size they were exported with."""

    default_size = None
    strides = (8, 16, 32)

    def normalized(self, colours: np.ndarray) -> np.ndarray:
        return colours[:, ::-1] / 255


class Yolov8(RedGreenBlue):
    """Any detection network exported as Ultralytics' YOLOv8 to YOLO12 are: one output (4 + classes,
    boxes), no suppression.

    Classes are those in the file's metadata (``names``), else COCO's. The input has the size it was
    exported with, unless that is left open in the file.
    """

    name = "yolov8"
    file_name = "yolov8.onnx"

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(4 + len(self.labels), len(self.cells))]

    def doubt(self) -> str:
        return SHARES if is_share(self.grey_outputs[0][:4]) else ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Centre and extent in pixels of the network's picture, then the score of each class."""
        output = outputs[0].T.astype(np.float64)
        return _corners(output), output[:, 4:]


class Yolov10(RedGreenBlue):
    """Networks that give their best boxes themselves: YOLOv10, and exports of Ultralytics with
    suppression inside (``nms=True``). One output (boxes, 6): left, top, right, bottom in pixels of
    the network's picture, score, class.
    """

    name = "yolov10"
    file_name = "yolov10.onnx"

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(None, 6)]

    def rows(self, outputs: Sequence[np.ndarray]) -> np.ndarray:
        """Left, top, right, bottom, score and class (boxes, 6)."""
        return outputs[0].astype(np.float64)

    def doubt(self) -> str:
        rows = self.rows(self.grey_outputs)
        numbers = rows[:, 5]
        if (rows[:, 2:4] < rows[:, 0:2] - 1e-3).any() or (numbers != np.rint(numbers)).any():
            return "it gives no left, top, right, bottom, score and class"
        return ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        rows = self.rows(outputs)
        scores, classes = np.zeros((len(rows), len(self.labels))), rows[:, 5].astype(np.int64)
        valid = np.flatnonzero((classes >= 0) & (classes < len(self.labels)))
        scores[valid, classes[valid]] = rows[valid, 4]
        return rows[:, 0:4], scores


class SizedRtDetr(Yolov10):
    """RT-DETR as its authors export it, and D-FINE and DEIM: the size of a picture as second input,
    and as outputs the class, the left, top, right and bottom in pixels, and the score of each
    query. Pictures are put into a letter box, not stretched.
    """

    name = "rtdetr_sized"
    file_name = "rtdetr.onnx"
    input_count = 2
    output_count = 3

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(None,), (None, 4), (None,)]

    def rows(self, outputs: Sequence[np.ndarray]) -> np.ndarray:
        classes, boxes, scores = outputs
        return np.column_stack([boxes, scores, classes]).astype(np.float64)


class RtDetr(RedGreenBlue):
    """RT-DETR as Ultralytics exports it: one output (queries, 4 + classes), places as shares of the
    network's picture. Pictures are put into a letter box, not stretched.
    """

    name = "rtdetr"
    file_name = "rtdetr.onnx"

    def output_shapes(self) -> list[tuple[int | None, ...]]:
        return [(None, 4 + len(self.labels))]

    def doubt(self) -> str:
        is_far = np.abs(self.grey_outputs[0][:, :4]).max(initial=0.0) > 2
        return "its places are no shares of the picture" if is_far else ""

    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Centre and extent as shares, then the score of each class."""
        output = outputs[0].astype(np.float64)
        return _corners(output[:, :4] * np.tile(self.size, 2)), output[:, 4:]


def _corners(boxes: np.ndarray) -> np.ndarray:
    """Left, top, right and bottom (n, 4) of boxes whose columns begin with centre and extent."""
    centre, half = boxes[:, 0:2], boxes[:, 2:4] / 2
    return np.hstack([centre - half, centre + half])
