"""How good a detector's traces are, against KITTI's labels: average precision and errors of places.

    python -m tools.make.evaluation --drive 2011_09_26/0005 --labels tracking/0000

Matching is that of PASCAL VOC: detections of all pictures in falling order of their score; each
takes the free label that it overlaps best, by ``MIN_IOU`` at least, and is wrong without one. Left
out, neither right nor wrong, are detections on an ignored label (``data.kitti.label``), mostly
inside a ``DontCare`` area, a tram or a trailer, or lower than ``MIN_HEIGHT_PX``.
"""

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import GROUPS
from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array
from genie_sim.core.messages import Box, Detection
from genie_sim.data.detectors.boxes import MIN_SCORE
from genie_sim.data.detectors.detector import DetectorSettings
from genie_sim.data.kitti.drive_truth import PictureLabels, read_labels
from genie_sim.data.kitti.label import ObjectLabel
from genie_sim.data.kitti.perceive import FrameSelection, kitti_folder, perceive
from genie_sim.data.trace import MIN_HEIGHT_PX, Trace

MIN_IOU = {"vehicles": 0.5, "persons": 0.4}
LOWEST_SCORE = 0.01  # weak detections count for average precision
NEAR_M = 30.0


class MatchedDetection(NamedTuple):
    """A detection, the label it belongs to (``None``: it is wrong), and its camera's distance from
    that label [m].
    """

    detection: Detection
    label: ObjectLabel | None
    range_m: float | None

    @property
    def error_m(self) -> float | None:
        """How far, in the ground plane, its location lies from the labelled centre."""
        if self.label is None or self.label.centre is None or self.detection.location is None:
            return None
        return math.dist(self.detection.location[:2], self.label.centre[:2])


@dataclass(frozen=True, slots=True)
class Group:
    """All judged detections of one group of classes, best score first, and how many labels
    count.
    """

    name: str
    detections: tuple[MatchedDetection, ...]
    labels: int

    def average_precision(self) -> float:
        """Area under the precision-recall curve, precision made monotonic (VOC 2010 and later); nan
        without labels.
        """
        if not self.labels:
            return math.nan
        right = np.array([item.label is not None for item in self.detections], dtype=float)
        precision = np.cumsum(right) / np.arange(1, len(right) + 1)
        best_from_here = np.maximum.accumulate(precision[::-1])[::-1]
        return float((best_from_here * right).sum() / self.labels)

    def precision_recall(self, min_score: float) -> tuple[float, float]:
        """Precision (nan: nothing was found) and recall (nan: there are no labels) of detections
        from a score on.
        """
        right = [
            item.label is not None for item in self.detections if item.detection.score >= min_score
        ]
        precision = float(np.mean(right)) if right else math.nan
        recall = sum(right) / self.labels if self.labels else math.nan
        return precision, recall


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A trace judged. ``min_score`` is that of the trace as it is used: average precision looks
    below it.
    """

    truth: PictureLabels
    groups: Mapping[str, Group]
    min_score: float

    def right(self, group: str, parked: bool = False) -> list[MatchedDetection]:
        """Right detections from ``min_score`` on, or only those of what does not move."""
        right = []
        for item in self.groups[group].detections:
            if item.label is None or item.detection.score < self.min_score:
                continue
            if not parked or item.label.track not in self.truth.moving:
                right.append(item)
        return right


def evaluate(trace: Trace, truth: PictureLabels, min_score: float) -> Evaluation:
    """Judge a trace, in the pictures that have labels. Average precision means most where the trace
    has weak detections too (``LOWEST_SCORE``).
    """
    return Evaluation(truth, {name: _judge(name, trace, truth) for name in GROUPS}, min_score)


def iou(box: Box, boxes: Array) -> Array:
    """Intersection over union of one box with boxes (n, 4)."""
    shared = _shared(box, boxes)
    union: Array = _area(np.array([box])) + _area(boxes) - shared
    return shared / np.maximum(union, 1e-9)


def _judge(group: str, trace: Trace, truth: PictureLabels) -> Group:
    detections = [
        (detection, detection.box, picture, frame.pose)
        for picture, frame in trace.by_picture.items()
        for detection in frame.detections
        if detection.label in GROUPS[group]
        and detection.box is not None
        and picture in truth.pictures
    ]
    detections.sort(key=lambda item: -item[0].score)
    matched: set[tuple[tuple[str, int], int]] = set()
    compared = []
    for detection, box, picture, pose in detections:
        labels = [label for label in truth.pictures[picture] if label.group in (group, "anything")]
        boxes = np.array([label.box for label in labels]).reshape(-1, 4)
        overlaps = iou(box, boxes)
        free = [i for i, label in enumerate(labels) if label.counts and (picture, i) not in matched]
        best = max(free, key=lambda i: overlaps[i], default=None)
        if best is not None and overlaps[best] >= MIN_IOU[group]:
            matched.add((picture, best))
            centre = labels[best].centre
            range_m = None if centre is None else math.dist((pose.east_m, pose.north_m), centre[:2])
            compared.append(MatchedDetection(detection, labels[best], range_m))
        elif not _is_ignored(box, [label for label in labels if not label.counts], MIN_IOU[group]):
            compared.append(MatchedDetection(detection, None, None))
    counted = sum(
        label.counts and label.group == group
        for labels in truth.pictures.values()
        for label in labels
    )
    return Group(group, tuple(compared), counted)


def _is_ignored(box: Box, ignored: Sequence[ObjectLabel], min_iou: float) -> bool:
    """Whether a detection is neither right nor wrong: it is too low, on an ignored label, or mostly
    inside an ignored area.
    """
    if box[3] - box[1] < MIN_HEIGHT_PX:
        return True
    boxes = np.array([label.box for label in ignored]).reshape(-1, 4)
    inside = _shared(box, boxes) / max(float(_area(np.array([box]))[0]), 1e-9)
    on_label = iou(box, boxes)
    is_area = np.array([label.is_area for label in ignored], dtype=bool)
    return bool(np.where(is_area, inside >= 0.5, on_label >= min_iou).any())


def _shared(box: Box, boxes: Array) -> Array:
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared: Array = np.clip(high - low, 0, None).prod(axis=1)
    return shared


def _area(boxes: Array) -> Array:
    area: Array = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    return area


def table(evaluation: Evaluation) -> str:
    """The evaluation as Markdown tables."""
    e = evaluation
    text = [
        f"Labels: {e.truth.source}. Scores from {e.min_score:g} on, "
        "average precision from all scores.",
        "",
        "| found | labels | average precision | precision | recall |",
        "|---|---|---|---|---|",
    ]
    for name, group in e.groups.items():
        precision, recall = group.precision_recall(e.min_score)
        figures = [(group.average_precision(), 3), (precision, 2), (recall, 2)]
        cells = [
            "-" if math.isnan(figure) else f"{figure:.{digits}f}" for figure, digits in figures
        ]
        text.append(f"| {name} (IoU {MIN_IOU[name]:g}) | {group.labels} | {' | '.join(cells)} |")
    unlabelled = [name for name, group in e.groups.items() if not group.labels]
    if unlabelled:
        text += [
            "",
            f"No labels of {' or '.join(unlabelled)} count in these pictures: "
            "what was missed is unknown.",
        ]
    text += ["", "| location error of | placed | median | 90 % below |", "|---|---|---|---|"]
    for name, rows in _places(e):
        errors = [item.error_m for item in rows if item.error_m is not None]
        if rows:
            cells = ["-", "-"]
            if errors:
                cells = [f"{value:.2f} m" for value in np.percentile(errors, [50, 90])]
            text.append(f"| {name} | {len(errors)} of {len(rows)} | {' | '.join(cells)} |")
    return "\n".join(text) + "\n"


def _places(e: Evaluation) -> list[tuple[str, list[MatchedDetection]]]:
    """Right detections by what is compared."""
    parked = e.right("vehicles", parked=True)
    near = [item for item in parked if item.range_m is not None and item.range_m <= NEAR_M]
    return [
        ("vehicles", e.right("vehicles")),
        ("persons", e.right("persons")),
        (f"parked vehicles within {NEAR_M:g} m", near),
    ]


def main(arguments: list[str] | None = None) -> int:
    """Prints the evaluation of a detector on a drive; returns the exit status."""
    parser = argparse.ArgumentParser(description="How good a detector is on a KITTI drive.")
    parser.add_argument("--drive", required=True, help="such as 2011_09_26/0005")
    parser.add_argument("--labels", help="such as tracking/0000; default: the drive's tracklets")
    parser.add_argument("--cameras", default="02", help="separated by commas")
    parser.add_argument("--detector", default="yolox_nano")
    parser.add_argument("--min-score", type=float, default=MIN_SCORE)
    given = parser.parse_args(arguments)
    try:
        root = kitti_folder(None)
        weak = DetectorSettings(given.detector, min_score=LOWEST_SCORE)
        trace = perceive(root, FrameSelection(given.drive, given.cameras.split(",")), weak)
        truth = read_labels(root, given.labels or given.drive, trace)
    except UserError as error:
        sys.stderr.write(f"evaluation: {error}\n")
        return 1
    sys.stdout.write(table(evaluate(trace, truth, given.min_score)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
