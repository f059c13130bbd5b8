"""What all detectors share: an ONNX Runtime session, the letter box a picture is put into, and the
best of its boxes.

One thread unless told otherwise: then sums are made in the same order, and the same picture gives
the same scores.
"""

import ast
import re
import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import cv2
import numpy as np

from genie_sim.base.classes import NO_CLASS, ROAD_LABELS, class_of
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.features import packed
from genie_sim.core.messages import Box
from genie_sim.data.detectors.onnx_session import (
    CPU,
    bounded_memory,
    bounded_time,
    open_session,
    read_network,
)
from genie_sim.data.trace import SCORE_DECIMALS

# The 80 classes of COCO, in the order of every COCO-80 network's outputs.
COCO = """
person, bicycle, car, motorcycle, airplane, bus, train, truck, boat, traffic light, fire hydrant,
stop sign, parking meter, bench, bird, cat, dog, horse, sheep, cow, elephant, bear, zebra,
giraffe, backpack, umbrella, handbag, tie, suitcase, frisbee, skis, snowboard, sports ball, kite,
baseball bat, baseball glove, skateboard, surfboard, tennis racket, bottle, wine glass, cup, fork,
knife, spoon, bowl, banana, apple, sandwich, orange, broccoli, carrot, hot dog, pizza, donut,
cake, chair, couch, potted plant, bed, dining table, toilet, tv, laptop, mouse, remote, keyboard,
cell phone, microwave, oven, toaster, sink, refrigerator, book, clock, vase, scissors, teddy bear,
hair drier, toothbrush
"""
COCO_LABELS = tuple(re.split(r",\s+", COCO.strip()))

QUIET_LABELS = frozenset({*COCO_LABELS, *ROAD_LABELS, NO_CLASS})

KINDS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}  # of inputs

# autowarefoundation/autoware, vision_darknet_detect: score_threshold and nms_threshold of its
# launch file.
MIN_SCORE = 0.30
NMS_IOU = 0.30


GREY = 114  # what fills the rest of a letter box
# of a network's input: about 5800 x 5800
MAX_PIXELS = 2**25


SCORE_SLACK = 0.01  # of half precision
SHARES = "all its boxes are smaller than two pixels: are they shares of the picture, from 0 to 1?"


class DetectedBox(NamedTuple):
    """One object in a picture; ``box`` is (x1, y1, x2, y2) in its pixels."""

    label: str
    score: float
    box: Box


# boxes (n, 4) in pixels of the network's picture, scores (n, classes)
Scored = tuple[np.ndarray, np.ndarray]


class OnnxDetector(ABC):
    """A detector: a picture in, labelled boxes out; pictures may be looked at on several threads.

    A subclass says its ``name``, the ``file_name`` of its weights, its usual ``default_size``
    (width, height; ``None``: what the file says), the ``strides`` of its cells, the
    ``output_count`` and the shapes of its outputs, how it wants a picture (``prepare``) and what
    its outputs mean (``decode``). ``sized_output_count`` is that of a network with the size of the
    picture as second input. ``gap`` names the feature that the mean over the backbone's last
    activation makes, for networks that pool at several sizes there.
    """

    name: ClassVar[str]
    file_name: ClassVar[str]
    default_size: ClassVar[tuple[int, int] | None]
    strides: ClassVar[tuple[int, ...]]
    output_count: int = 1
    is_decoded: bool = False
    sized_output_count: ClassVar[int] = 0
    gap: ClassVar[str] = ""
    _kinds: ClassVar[list[type["OnnxDetector"]]] = []

    def __init_subclass__(cls) -> None:
        OnnxDetector._kinds.append(cls)

    def __init__(
        self,
        weights: Path,
        size: tuple[int, int] | None = None,
        min_score: float = MIN_SCORE,
        *,
        providers: Sequence[str] = (CPU,),
        threads: int = 1,
        classes: Mapping[str, str] | None = None,
    ) -> None:
        """Loads ``weights``. Raises UserError where they are no such network, or a setting is
        impossible.

        Parameters
        ----------
        weights : the network's file
        size : width and height of its input [pixels]; ``None``: ``default_size``
        min_score : the lowest score kept, in (0, 1)
        providers : ONNX Runtime's execution providers, best first
        threads : of the network
        classes : the classes of labels of the network that have other names
        """
        if not 0 < min_score < 1:
            raise UserError(f"detector {self.name}: min_score {min_score} is not between 0 and 1")
        counts = [
            (1, self.output_count),
            *([(2, self.sized_output_count)] * bool(self.sized_output_count)),
        ]
        network, self.sha256 = read_network(weights, counts)
        self.weights, self.output_count = weights, len(network.graph.output)
        self._activation = add_last_activation(network.graph) if self.gap else False
        self.size = size or self.default_size or _own_size(weights, network)
        width, height = self.size
        if any(side <= 0 or side % max(self.strides) for side in self.size):
            raise UserError(
                f"detector {self.name}: size {self.size} must be multiples of {max(self.strides)}"
            )
        if width * height > MAX_PIXELS:
            raise UserError(
                f"detector {self.name}: size {width}x{height}: more than {MAX_PIXELS:,} pixels"
            )
        self.min_score, self.threads = min_score, threads
        self.labels = self.labels_of(
            weights, {entry.key: entry.value for entry in network.metadata_props}
        )
        self._classes = tuple((classes or {}).get(label, label) for label in self.labels)
        if not ROAD_LABELS & {*self._classes}:
            some = ", ".join(self.labels[:8])
            raise UserError(
                f"{weights}: none of the network's classes ({some}) is of a road: say "
                f"--map LABEL=CLASS; classes: {', '.join(sorted(ROAD_LABELS))}"
            )
        self._unused: Counter[str] = Counter()
        self._lock = threading.Lock()
        self.cells, self.cell_strides = _cells(self.size, self.strides)
        with bounded_memory(weights, network, self.size, providers):
            self._session = open_session(
                weights, network, self.size, providers=providers, threads=threads
            )
            first = self._session.get_inputs()[0]
            if first.type not in KINDS:
                raise UserError(
                    f"{weights}: its input is a {first.type}; known: {', '.join(KINDS)}: export "
                    "it so"
                )
            self._input, self._kind = first.name, KINDS[first.type]
            with bounded_time(weights) as options:
                self._check_outputs(options)

    @classmethod
    def labels_of(cls, weights: Path, metadata: dict[str, str]) -> tuple[str, ...]:
        """The names of the network's classes, in the order of its outputs: those in the file's
        metadata (``names``), else COCO's.
        """
        if "names" not in metadata:
            return COCO_LABELS
        try:
            names = ast.literal_eval(metadata["names"])
            labels = tuple(str(names[number]) for number in range(len(names)))
        except (ValueError, SyntaxError, KeyError, TypeError, MemoryError, RecursionError) as error:
            raise UserError(
                f"{weights}: metadata: names: not a list of classes: {metadata['names'][:60]!r}"
            ) from error
        if not labels:
            raise UserError(f"{weights}: metadata: names: the network has no classes")
        return labels

    @property
    def unused(self) -> dict[str, int]:
        """How many objects were found so far, by each of the network's labels that is no class of a
        road; those of COCO, which nobody expects there, do not count.
        """
        return {label: self._unused[label] for label in self._classes if label not in QUIET_LABELS}

    @property
    def notes(self) -> list[str]:
        """What was found out about the network that a user may want to know."""
        return []

    @abstractmethod
    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        """The network's input (1, 3, height, width) from a picture (height, width, 3), and how much
        it was scaled.
        """

    @abstractmethod
    def output_shapes(self) -> list[tuple[int | None, ...]]:
        """The shapes of the outputs of one picture; ``None``: any number."""

    def doubt(self, outputs: Sequence[np.ndarray]) -> str:
        """Why the outputs for a grey picture cannot mean what ``decode`` takes them for; ``""``:
        they can.
        """
        return ""

    def decodes(self, outputs: Sequence[np.ndarray]) -> bool:
        """Whether the network decodes its boxes itself, by its outputs for a grey picture."""
        return False

    def probabilities(self, outputs: Sequence[np.ndarray]) -> np.ndarray:
        """What must lie between 0 and 1 in the outputs of one picture."""
        return self.decode(outputs)[1]

    @abstractmethod
    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Boxes and scores from the outputs of one picture."""

    def infer(self, blob: np.ndarray, options: Any = None) -> list[np.ndarray]:
        """The outputs for one prepared picture: nothing but the network itself. ``options`` are
        ONNX Runtime's of this run.
        """
        feed = {self._input: blob.astype(self._kind, copy=False)}
        outputs = self._session.run(None, feed, options)
        plain = [
            output.astype(np.float32) if output.dtype == np.float16 else output
            for output in outputs
        ]
        return self.of_picture(plain)

    def of_picture(self, outputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """What the outputs say of the one picture that the network got."""
        return [output[0] for output in outputs]

    def _best_boxes(
        self, outputs: Sequence[np.ndarray], scale: float, shape: tuple[int, ...]
    ) -> list[DetectedBox]:
        """Road users and furniture in a picture of (height, width), best score first."""
        boxes, scores = self.decode(outputs)
        self._check_scores(outputs)
        likely = boxes[scores.max(axis=1, initial=0.0) >= self.min_score]
        if is_share(likely):
            raise UserError(f"{self.weights}: {SHARES}")
        limits = np.array([shape[1], shape[0]] * 2, dtype=np.float64)
        unused: Counter[str] = Counter()
        detected = best_boxes(
            np.clip(boxes / scale, 0.0, limits),
            scores,
            self.min_score,
            self._classes,
            unused=unused,
        )
        with self._lock:
            self._unused += unused
        return detected

    def detect(self, image_bgr: np.ndarray) -> list[DetectedBox]:
        """As ``look``, without features."""
        return self.look(image_bgr)[0]

    def look(self, image_bgr: np.ndarray) -> tuple[list[DetectedBox], dict[str, bytes]]:
        """Road users and furniture in a picture, best score first, and what the network itself
        tells of the picture as a whole, by name.
        """
        blob, scale = self.prepare(image_bgr)
        outputs = self.infer(blob)
        boxes = self._best_boxes(outputs[: self.output_count], scale, image_bgr.shape)
        gap = {self.gap: packed(outputs[-1].mean(axis=(1, 2)))} if self._activation else {}
        return boxes, gap

    def _check_outputs(self, options: Any) -> None:
        """One run on a grey picture tells a network with other inputs or outputs."""
        weights = self.weights
        blob, _ = self.prepare(np.full((self.size[1], self.size[0], 3), GREY, np.uint8))
        with as_user_error(f"{weights}: is no {self.name} network", Exception):
            outputs = self.infer(blob, options)
        shapes = [output.shape for output in outputs[: self.output_count]]
        expected = self.output_shapes()
        if not all(map(_fits, shapes, expected)):
            wanted = ", ".join(str(shape).replace("None", "any") for shape in expected)
            raise UserError(
                f"{weights}: is no {self.name} network: its output is "
                f"{', '.join(map(str, shapes))}, expected {wanted}{self._other_kind(shapes)}"
            )
        self._check_scores(outputs[: self.output_count])
        if doubt := self.doubt(outputs):
            raise UserError(f"{weights}: is no {self.name} network: {doubt}")
        self.is_decoded = self.decodes(outputs)

    def _check_scores(self, outputs: Sequence[np.ndarray]) -> None:
        """Raises UserError for scores that are no probabilities, of whichever picture."""
        scores = self.probabilities(outputs)
        low, high = scores.min(initial=0.0), scores.max(initial=0.0)
        if not (low >= -SCORE_SLACK and high <= 1 + SCORE_SLACK):
            raise UserError(
                f"{self.weights}: its scores, from {low:.3g} to {high:.3g}, are no probabilities: "
                "was it exported without the sigmoid?"
            )

    def _other_kind(self, shapes: Sequence[tuple[int, ...]]) -> str:
        """Which other detector has outputs of such shapes."""
        shipped = __name__.rpartition(".")[0]  # any other is found as ``module:Class`` alone
        for kind in self._kinds:
            if kind.__abstractmethods__ or not kind.__module__.startswith(f"{shipped}."):
                continue
            # of a network that has what this kind needs
            with suppress(AttributeError):
                layout = kind.output_shapes(self)
                if len(shapes) == len(layout) and all(map(_fits, shapes, layout)):
                    return f"; --detector {kind.name} has such an output"
        return ""


def is_share(places: np.ndarray) -> bool:
    """Whether all of these places of boxes, of which one is not 0, lie between 0 and 1 [pixels], or
    hardly beyond.
    """
    return bool(places.any()) and float(np.abs(places).max()) <= 2.0


def _fits(shape: Sequence[int], layout: Sequence[int | None]) -> bool:
    return len(shape) == len(layout) and all(
        wanted in (None, size) for size, wanted in zip(shape, layout, strict=True)
    )


def add_last_activation(graph: Any) -> bool:
    """Adds an output: the activation that follows the concatenation of what the last poolings made
    (in YOLOX, spatial pyramid pooling at the end of the backbone). Whether there is one; it is
    found by the structure, not by a name.
    """
    from onnx import ValueInfoProto

    pooled = [node.output[0] for node in graph.node if node.op_type == "MaxPool"]
    ends = [
        node.output[0]
        for node in graph.node
        if node.op_type == "Concat" and len({*node.input} & {*pooled}) > 1
    ]
    for name in ends[-1:]:
        conv = [
            node.output[0] for node in graph.node if node.op_type == "Conv" and name in node.input
        ]
        after = [
            node.output[0]
            for node in graph.node
            if {*node.input} & {*conv[:1]} and node.op_type != "Sigmoid"
        ]
        if after:
            # without its type, which follows from the network: float or float16
            graph.output.append(ValueInfoProto(name=after[0]))
            return True
    return False


def letterbox(image_bgr: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, float]:
    """The picture scaled to fit ``size`` at the top left, the rest grey, and the scale that was
    used.
    """
    height, width = image_bgr.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    extent = (max(1, int(width * scale)), max(1, int(height * scale)))
    scaled = cv2.resize(image_bgr, extent, interpolation=cv2.INTER_LINEAR)
    picture = np.full((size[1], size[0], 3), GREY, np.uint8)
    picture[: scaled.shape[0], : scaled.shape[1]] = scaled
    return picture, scale


def best_boxes(
    boxes: np.ndarray,
    scores: np.ndarray,
    min_score: float,
    classes: Sequence[str] = COCO_LABELS,
    *,
    unused: Counter[str] | None = None,
) -> list[DetectedBox]:
    """Non-maximum suppression: of boxes (n, 4) of one class that overlap by more than ``NMS_IOU``,
    the best stays. Vehicles of several names (``class_of``) are of one class.

    A van is often found twice, as a car and as a truck. It is one object, so these classes suppress
    each other, as in the authors' own ONNX demo of YOLOX, where all classes do; a cyclist's person
    and bicycle stay two. Classes that are not of a road (a "tv" in a shop window) are dropped.

    Parameters
    ----------
    boxes : left, top, right and bottom of each [pixels], (n, 4)
    scores : of each box and class, (n, classes)
    min_score : the lowest score kept
    classes : the names of the columns of ``scores``
    unused : counts the boxes of labels that are neither of a road nor COCO's
    """
    if not len(scores):
        return []
    # As in a trace, so that an object at the threshold is in or out whatever the last bits are, and
    # what half precision puts above 1 (``SCORE_SLACK``) is a score.
    best = np.minimum(scores.max(axis=1).round(SCORE_DECIMALS), 1.0)
    likely = np.flatnonzero((best >= min_score) & np.isfinite(boxes).all(axis=1))
    labels = [classes[number] for number in scores[likely].argmax(axis=1)]
    if unused is not None:
        unused.update(label for label in labels if label not in QUIET_LABELS)
    candidates = [
        DetectedBox(label, float(best[i]), tuple(boxes[i].tolist()))
        for i, label in zip(likely, labels, strict=True)
        if label in ROAD_LABELS
    ]
    if not candidates:
        return []
    classes_of_road = sorted(ROAD_LABELS)
    numbers, extents = [], []
    for label, _, (x1, y1, x2, y2) in candidates:
        numbers.append(classes_of_road.index(class_of(label)))
        extents.append((x1, y1, x2 - x1, y2 - y1))
    order = cv2.dnn.NMSBoxesBatched(
        bboxes=extents,
        scores=[candidate.score for candidate in candidates],
        class_ids=numbers,
        score_threshold=0.0,
        nms_threshold=NMS_IOU,
    )
    best_candidates = (candidates[i] for i in np.ravel(order))
    return sorted(best_candidates, key=lambda box: (-box.score, box.label, box.box))


def _own_size(weights: Path, network: Any) -> tuple[int, int]:
    height, width = (dim.dim_value for dim in network.graph.input[0].type.tensor_type.shape.dim[2:])
    if width <= 0 or height <= 0:
        raise UserError(
            f"{weights}: leaves its input's size open: say which width and height it is to have"
        )
    return width, height


def _cells(size: tuple[int, int], strides: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Column and row (n, 2) of every cell of every scale, and its stride (n, 1), in the order of
    the outputs.
    """
    grids, steps = [], []
    for stride in strides:
        columns, rows = np.meshgrid(np.arange(size[0] // stride), np.arange(size[1] // stride))
        grids.append(np.stack([columns.ravel(), rows.ravel()], axis=1))
        steps.append(np.full((columns.size, 1), stride))
    return np.concatenate(grids), np.concatenate(steps)
