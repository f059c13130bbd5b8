"""Object detectors: a picture in, labelled boxes out, through ONNX Runtime on one thread.

A detector is a class with a ``name``, the ``file_name`` of its weights, an input ``size``, the weights' ``sha256``
and ``detect``. To add one, write the class and put it into ``DETECTORS``.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol

import cv2
import numpy as np

from genie_sim.errors import UserError, unknown
from genie_sim.messages import Box

# The 80 classes of COCO, in the order of every COCO-80 network's outputs.
# fmt: off
COCO_LABELS = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat", "traffic light",
    "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog", "horse", "sheep", "cow",
    "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella", "handbag", "tie", "suitcase", "frisbee",
    "skis", "snowboard", "sports ball", "kite", "baseball bat", "baseball glove", "skateboard", "surfboard",
    "tennis racket", "bottle", "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple",
    "sandwich", "orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch",
    "potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote", "keyboard", "cell phone",
    "microwave", "oven", "toaster", "sink", "refrigerator", "book", "clock", "vase", "scissors", "teddy bear",
    "hair drier", "toothbrush",
)

# What a road has: its users and its furniture. The rest of COCO (a "tv" in a shop window) is dropped.
ROAD_LABELS = frozenset((
    "person", "bicycle", "car", "motorcycle", "bus", "train", "truck", "traffic light", "stop sign",
    "fire hydrant", "parking meter", "bench",
))
# fmt: on

# autowarefoundation/autoware, vision_darknet_detect: score_threshold and nms_threshold of its launch file.
MIN_SCORE = 0.30
NMS_IOU = 0.30


class Found(NamedTuple):
    """One object in a picture; ``box`` is (x1, y1, x2, y2) in its pixels."""

    label: str
    score: float
    box: Box


class Detector(Protocol):
    """What ``perceive`` needs of a detector."""

    name: ClassVar[str]
    file_name: ClassVar[str]
    default_size: ClassVar[tuple[int, int]]
    size: tuple[int, int]
    sha256: str

    def __init__(self, weights: Path, size: tuple[int, int] | None = None, min_score: float = MIN_SCORE) -> None: ...

    def detect(self, image_bgr: np.ndarray) -> list[Found]:
        """Road users and furniture in a picture (height, width, 3), best score first."""
        ...


class YoloxNano:
    """YOLOX-nano trained on COCO (Ge et al., 2021, https://arxiv.org/abs/2107.08430; Apache-2.0).

    The shipped network has a square input; it is made rectangular when it is loaded, because KITTI's pictures are
    more than three times as wide as high. ``size`` is (width, height), multiples of 32.
    """

    name = "yolox_nano"
    file_name = "yolox_nano.onnx"
    default_size = (640, 192)
    STRIDES = (8, 16, 32)

    def __init__(self, weights: Path, size: tuple[int, int] | None = None, min_score: float = MIN_SCORE) -> None:
        self.size = size or self.default_size
        if any(side <= 0 or side % max(self.STRIDES) for side in self.size):
            raise UserError(f"detector {self.name}: size {self.size} must be multiples of {max(self.STRIDES)}")
        if not 0 < min_score < 1:
            raise UserError(f"detector {self.name}: min_score {min_score} is not between 0 and 1")
        self.min_score = min_score
        self.sha256 = hashlib.sha256(weights.read_bytes()).hexdigest()
        self._grid, self._stride = _cells(self.size, self.STRIDES)
        self._session = open_session(weights, self.size)
        self._check(weights)

    def detect(self, image_bgr: np.ndarray) -> list[Found]:
        picture, scale = letterbox(image_bgr, self.size)
        boxes, scores = self.decode(self._run(picture))
        height, width = image_bgr.shape[:2]
        limits = np.array([width, height, width, height], dtype=np.float64)
        return best_boxes(np.clip(boxes / scale, 0.0, limits), scores, self.min_score)

    def decode(self, output: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Boxes (n, 4) in letter-boxed pixels and scores (n, 80) of the network's output (n, 85).

        Centre = (p + cell) * stride, extent = exp(p) * stride, score = objectness * class.
        """
        output = output.astype(np.float64)
        centre = (output[:, 0:2] + self._grid) * self._stride
        half = np.exp(np.minimum(output[:, 2:4], 10.0)) * self._stride / 2
        return np.hstack([centre - half, centre + half]), output[:, 4:5] * output[:, 5:]

    def _run(self, picture: np.ndarray) -> np.ndarray:
        blob = picture.transpose(2, 0, 1)[None].astype(np.float32)
        return self._session.run(None, {self._session.get_inputs()[0].name: blob})[0][0]

    def _check(self, weights: Path) -> None:
        """One run on a grey picture tells a network with other inputs or outputs."""
        expected = (len(self._grid), 5 + len(COCO_LABELS))
        try:
            shape = self._run(np.full((self.size[1], self.size[0], 3), 114, np.uint8)).shape
        except Exception as error:  # ONNX Runtime's exceptions have no common base of their own
            raise UserError(f"{weights}: is no {self.name} network: {_first_line(error)}") from error
        if shape != expected:
            raise UserError(f"{weights}: is no {self.name} network: its output is {shape}, expected {expected}")


DETECTORS: dict[str, type[Detector]] = {YoloxNano.name: YoloxNano}


def make_detector(
    name: str,
    weights: str | Path | None = None,
    size: tuple[int, int] | None = None,
    min_score: float = MIN_SCORE,
) -> Detector:
    """The detector of that name; ``weights`` is its file or a folder, by default the folder GENIE_SIM_WEIGHTS."""
    if name not in DETECTORS:
        raise UserError(unknown("detector", name, DETECTORS))
    kind = DETECTORS[name]
    return kind(find_weights(kind.file_name, weights), size, min_score)


def find_weights(file_name: str, weights: str | Path | None = None) -> Path:
    """Path of a weights file, from an explicit file or folder or from the environment's GENIE_SIM_WEIGHTS."""
    place = weights or os.environ.get("GENIE_SIM_WEIGHTS")
    if not place:
        raise UserError(f"weights: where is {file_name}? Name the file, or set GENIE_SIM_WEIGHTS to its folder")
    path = Path(place) / file_name if Path(place).is_dir() else Path(place)
    if not path.is_file():
        raise UserError(f"{path}: no such weights file")
    return path


def open_session(weights: Path, size: tuple[int, int]) -> Any:
    """An ONNX Runtime session for pictures of (width, height), on one thread and in sequence: the same sums in the
    same order, so the same scores. The network must be free of the size it was exported with."""
    import onnx
    import onnxruntime
    from google.protobuf.message import DecodeError

    try:
        model = onnx.load(str(weights))
        onnx.checker.check_model(model)
    except (DecodeError, onnx.checker.ValidationError, ValueError, OSError) as error:
        raise UserError(f"{weights}: not an ONNX network: {_first_line(error)}") from error
    graph = model.graph
    constants = {tensor.name for tensor in graph.initializer}
    inputs = [value for value in graph.input if value.name not in constants]
    if len(inputs) != 1 or len(graph.output) != 1:
        raise UserError(f"{weights}: has {len(inputs)} inputs and {len(graph.output)} outputs, expected one of each")
    dims = inputs[0].type.tensor_type.shape.dim
    if len(dims) != 4:
        raise UserError(f"{weights}: its input has {len(dims)} dimensions, expected 4 (a picture)")
    for dim, value in zip(dims, (1, 3, size[1], size[0]), strict=True):
        dim.dim_value = value
    for number, dim in enumerate(graph.output[0].type.tensor_type.shape.dim):
        dim.dim_param = f"output_{number}"
    # Initializers listed as inputs cannot be folded, and recorded shapes are those of the exported size.
    del graph.input[:], graph.value_info[:]
    graph.input.extend(inputs)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's exceptions have no common base of their own
        raise UserError(f"{weights}: ONNX Runtime cannot use this network: {_first_line(error)}") from error


def letterbox(image_bgr: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, float]:
    """The picture scaled to fit ``size`` at the top left, the rest grey (114), and the scale that was used."""
    height, width = image_bgr.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    scaled = cv2.resize(image_bgr, (int(width * scale), int(height * scale)), interpolation=cv2.INTER_LINEAR)
    picture = np.full((size[1], size[0], 3), 114, np.uint8)
    picture[: scaled.shape[0], : scaled.shape[1]] = scaled
    return picture, scale


def best_boxes(boxes: np.ndarray, scores: np.ndarray, min_score: float, iou: float = NMS_IOU) -> list[Found]:
    """Non-maximum suppression within each class: of boxes (n, 4) that overlap by more than ``iou``, the best stays."""
    labels = scores.argmax(axis=1)
    best = scores[np.arange(len(scores)), labels]
    road = np.array([COCO_LABELS[label] in ROAD_LABELS for label in labels], dtype=bool)
    keep = np.flatnonzero(road & (best >= min_score))
    if not len(keep):
        return []
    extents = np.hstack([boxes[keep, :2], boxes[keep, 2:] - boxes[keep, :2]])
    order = cv2.dnn.NMSBoxesBatched(extents.tolist(), best[keep].tolist(), labels[keep].tolist(), min_score, iou)
    found = [Found(COCO_LABELS[labels[i]], float(best[i]), tuple(boxes[i].tolist())) for i in keep[np.ravel(order)]]
    return sorted(found, key=lambda f: (-f.score, f.label, f.box))


def _cells(size: tuple[int, int], strides: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Column and row (n, 2) of every cell of every scale, and its stride (n, 1), in the order of the outputs."""
    grids, steps = [], []
    for stride in strides:
        columns, rows = np.meshgrid(np.arange(size[0] // stride), np.arange(size[1] // stride))
        grids.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        steps.append(np.full((columns.size, 1), stride))
    return np.concatenate(grids), np.concatenate(steps)


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
