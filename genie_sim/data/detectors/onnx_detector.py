"""What all networks share: an ONNX Runtime session, the letter box a picture is put into, and the
checks of what they say.

One thread unless told otherwise: then sums are made in the same order, and the same picture gives
the same scores.
"""

import ast
import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from genie_sim.base.classes import ROAD_LABELS
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.features import packed
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors.boxes import (
    COCO_LABELS,
    MIN_SCORE,
    QUIET_LABELS,
    SHARES,
    DetectedBox,
    best_boxes,
    is_share,
)
from genie_sim.data.detectors.onnx_session import (
    CPU,
    add_last_activation,
    bounded_memory,
    bounded_time,
    open_session,
    read_network,
)

KINDS = {"tensor(float)": np.float32, "tensor(float16)": np.float16}  # of inputs
GREY = 114  # what fills the rest of a letter box
MAX_PIXELS = 2**25  # of a network's input: about 5800 x 5800
SCORE_SLACK = 0.01  # of half precision

# boxes (n, 4) in pixels of the network's picture, scores (n, classes)
Scored = tuple[np.ndarray, np.ndarray]


class OnnxDetector(ABC):
    """A detector: a picture in, labelled boxes out; pictures may be looked at on several threads.

    A subclass says its ``name``, the ``file_name`` of its weights, its usual ``default_size``
    (width, height; ``None``: what the file says), the ``strides`` of its cells, how many inputs
    (the second is the size of the picture) and outputs it has, the shapes of these, how it wants
    colours (``normalized``) and what its outputs mean (``decode``). ``gap`` names the feature that
    the mean over the backbone's last activation makes, for networks that pool at several sizes
    there.
    """

    name: ClassVar[str]
    file_name: ClassVar[str]
    default_size: ClassVar[tuple[int, int] | None]
    strides: ClassVar[tuple[int, ...]]
    input_count: ClassVar[int] = 1
    output_count: ClassVar[int] = 1
    gap: ClassVar[str] = ""
    grey_outputs: list[np.ndarray]
    """What the network says of a grey picture."""

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
        """Loads ``weights``: reads the network, checks size and classes, opens a session, and looks
        at a grey picture. Raises UserError where they are no such network, or a setting is
        impossible.

        Parameters
        ----------
        weights : the network's file
        size : width and height of its input [pixels]; ``None``: ``default_size``
        min_score : the lowest score kept, above 0 and below 1
        providers : ONNX Runtime's execution providers, best first
        threads : of the network
        classes : the classes of labels of the network that have other names
        """
        if not 0 < min_score < 1:
            raise UserError(
                f"detector {self.name}: min_score {min_score} is not above 0 and below 1"
            )
        self.weights, self.min_score, self.threads = weights, min_score, threads
        network, self.sha256 = read_network(weights, self.input_count, self.output_count)
        self._has_gap = bool(self.gap) and add_last_activation(network.graph)
        self.size = size or self.default_size or _own_size(weights, network)
        self._check_size()
        self.cells, self.cell_strides = _cells(self.size, self.strides)
        self.labels = _labels_of(weights, network)
        self._classes = tuple((classes or {}).get(label, label) for label in self.labels)
        self._check_classes()
        self._unused: Counter[str] = Counter()
        self._lock = threading.Lock()
        with bounded_memory(weights, network, self.size, providers):
            self._session = open_session(
                weights, network, self.size, providers=providers, threads=threads
            )
            self._input, self._kind = self._first_input()
            with bounded_time(weights) as options:
                self._look_at_grey(options)

    def _check_size(self) -> None:
        if any(side <= 0 or side % max(self.strides) for side in self.size):
            raise UserError(
                f"detector {self.name}: size {self.size} must be multiples of {max(self.strides)}"
            )
        width, height = self.size
        if width * height > MAX_PIXELS:
            raise UserError(
                f"detector {self.name}: size {width}x{height}: more than {MAX_PIXELS:,} pixels"
            )

    def _check_classes(self) -> None:
        if not ROAD_LABELS & {*self._classes}:
            some = ", ".join(self.labels[:8])
            raise UserError(
                f"{self.weights}: none of the network's classes ({some}) is of a road: say "
                f"--map LABEL=CLASS; classes: {', '.join(sorted(ROAD_LABELS))}"
            )

    def _first_input(self) -> tuple[str, Any]:
        """The name of the pictures' input, and of which kind its numbers are."""
        first = self._session.get_inputs()[0]
        if first.type not in KINDS:
            raise UserError(
                f"{self.weights}: its input is a {first.type}; known: {', '.join(KINDS)}: export "
                "it so"
            )
        return first.name, KINDS[first.type]

    def _look_at_grey(self, options: Any) -> None:
        """One run on a grey picture tells a network with other inputs or outputs."""
        blob, _ = self.prepare(np.full((self.size[1], self.size[0], 3), GREY, np.uint8))
        wrong = f"{self.weights}: is no {self.name} network"
        with as_user_error(wrong, Exception):
            self.grey_outputs = self.infer(blob, options)[: self.output_count]
        shapes = [output.shape for output in self.grey_outputs]
        expected = self.output_shapes()
        if not all(map(_fits, shapes, expected)):
            wanted = ", ".join(str(shape).replace("None", "any") for shape in expected)
            raise UserError(
                f"{wrong}: its output is {', '.join(map(str, shapes))}, expected {wanted}; "
                "--detector names other kinds, 'genie-sim list detectors' tells their outputs"
            )
        self._decoded(self.grey_outputs)
        if doubt := self.doubt():
            raise UserError(f"{wrong}: {doubt}")

    def tell(self, report: ImportReport) -> None:
        """How many objects were found, by each of the network's labels that is no class of a road;
        those of COCO, which nobody expects there, do not count.
        """
        for label in self._classes:
            if label not in QUIET_LABELS:
                report.leave_label(label, self._unused[label])

    def prepare(self, image_bgr: np.ndarray) -> tuple[np.ndarray, float]:
        """The network's input (1, 3, height, width) from a picture (height, width, 3), and how much
        it was scaled.
        """
        picture, scale = letterbox(image_bgr, self.size)
        return self.normalized(cv2.dnn.blobFromImage(picture)), scale

    def normalized(self, colours: np.ndarray) -> np.ndarray:
        """As the network wants them: blue, green and red from 0 to 255 (1, 3, height, width)."""
        return colours

    @abstractmethod
    def output_shapes(self) -> list[tuple[int | None, ...]]:
        """The shapes of the outputs of one picture; ``None``: any number."""

    def doubt(self) -> str:
        """Why ``grey_outputs`` cannot mean what ``decode`` takes them for; ``""``: they can."""
        return ""

    def probabilities(self, outputs: Sequence[np.ndarray], scores: np.ndarray) -> np.ndarray:
        """What must lie between 0 and 1 in the outputs of one picture, whose decoded scores are
        (n, classes).
        """
        return scores

    @abstractmethod
    def decode(self, outputs: Sequence[np.ndarray]) -> Scored:
        """Boxes and scores from the outputs of one picture."""

    def infer(self, blob: np.ndarray, options: Any = None) -> list[np.ndarray]:
        """The outputs for one prepared picture: nothing but the network itself. ``options`` are
        ONNX Runtime's of this run.
        """
        feed = {self._input: blob.astype(self._kind, copy=False)}
        return [
            output[0].astype(np.float32) if output.dtype == np.float16 else output[0]
            for output in self._session.run(None, feed, options)
        ]

    def _decoded(self, outputs: Sequence[np.ndarray]) -> Scored:
        """As ``decode``. Raises UserError for scores that are no probabilities, of whichever
        picture.
        """
        boxes, scores = self.decode(outputs)
        shares = self.probabilities(outputs, scores)
        low, high = shares.min(initial=0.0), shares.max(initial=0.0)
        if not (low >= -SCORE_SLACK and high <= 1 + SCORE_SLACK):
            raise UserError(
                f"{self.weights}: its scores, from {low:.3g} to {high:.3g}, are no probabilities: "
                "was it exported without the sigmoid?"
            )
        return boxes, scores

    def _best_boxes(
        self, outputs: Sequence[np.ndarray], scale: float, shape: tuple[int, ...]
    ) -> list[DetectedBox]:
        """Road users and furniture in a picture of (height, width), best score first."""
        boxes, scores = self._decoded(outputs)
        likely = boxes[scores.max(axis=1, initial=0.0) >= self.min_score]
        if is_share(likely):  # before the scale, which makes more than two pixels of a share
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
        gap = {self.gap: packed(outputs[-1].mean(axis=(1, 2)))} if self._has_gap else {}
        return boxes, gap


def _fits(shape: Sequence[int], layout: Sequence[int | None]) -> bool:
    return len(shape) == len(layout) and all(
        wanted in (None, size) for size, wanted in zip(shape, layout, strict=True)
    )


def letterbox(image_bgr: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, float]:
    """The picture scaled to fit ``size`` at the top left, the rest grey, and the scale that was
    used.
    """
    height, width = image_bgr.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    extent = (max(1, int(width * scale)), max(1, int(height * scale)))
    scaled = cv2.resize(image_bgr, extent, interpolation=cv2.INTER_LINEAR)
    right, below = size[0] - extent[0], size[1] - extent[1]
    grey = cv2.copyMakeBorder(
        scaled, 0, below, 0, right, borderType=cv2.BORDER_CONSTANT, value=(GREY, GREY, GREY)
    )
    return grey, scale


def _labels_of(weights: Path, network: Any) -> tuple[str, ...]:
    """The names of the network's classes, in the order of its outputs: those in the file's metadata
    (``names``), else COCO's. Raises UserError.
    """
    text = {entry.key: entry.value for entry in network.metadata_props}.get("names")
    if text is None:
        return COCO_LABELS
    try:
        names = ast.literal_eval(text)
        labels = tuple(str(names[number]) for number in range(len(names)))
    except (ValueError, SyntaxError, KeyError, TypeError, MemoryError, RecursionError) as error:
        raise UserError(
            f"{weights}: metadata: names: not a list of classes: {text[:60]!r}"
        ) from error
    if not labels:
        raise UserError(f"{weights}: metadata: names: the network has no classes")
    return labels


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
