"""How good a trace is, against KITTI's labels: what was found, what scores are worth, where objects were placed.

Matching is that of PASCAL VOC: detections of all pictures in falling order of their score; each takes the free label
that it overlaps best, by ``MIN_IOU`` at least, and is wrong without one. Left out, neither right nor wrong, are
detections on an ignored label (``truth``), mostly inside a ``DontCare`` area, or lower than ``MIN_HEIGHT_PX``.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from genie_sim.core.geometry import Array
from genie_sim.messages import Box, Detection
from genie_sim.perception.trace import MIN_HEIGHT_PX, Trace
from genie_sim.perception.truth import Labelled, PictureLabels

LABELS = {"vehicles": ("car", "truck", "bus"), "persons": ("person",)}
MIN_IOU = {"vehicles": 0.5, "persons": 0.4}
SCORE_BINS = np.linspace(0.0, 1.0, 11)
RANGES_M = ((0.0, 15.0), (15.0, 30.0), (30.0, 50.0), (50.0, math.inf))
STABLE_RANGE_M = 30.0
STABLE_M = 1.0
STABLE_SHARE = 0.9
MIN_SIGHTINGS = 5


class Judged(NamedTuple):
    """A detection, the label it belongs to (``None``: it is wrong), and its camera's distance from that label [m]."""

    detection: Detection
    label: Labelled | None
    range_m: float | None

    @property
    def error_m(self) -> float | None:
        """How far, in the ground plane, its location lies from the labelled centre."""
        if self.label is None or self.label.centre is None or self.detection.location is None:
            return None
        return math.dist(self.detection.location[:2], self.label.centre[:2])


@dataclass(frozen=True, slots=True)
class Group:
    """All judged detections of one group of classes, best score first, and how many labels count."""

    name: str
    judged: tuple[Judged, ...]
    labels: int

    def average_precision(self) -> float:
        """Area under the precision-recall curve, precision made monotonic (VOC 2010 and later); nan without labels."""
        if not self.labels:
            return math.nan
        right = np.array([found.label is not None for found in self.judged], dtype=float)
        precision = np.cumsum(right) / np.arange(1, len(right) + 1)
        best_from_here = np.maximum.accumulate(precision[::-1])[::-1]
        return float((best_from_here * right).sum() / self.labels)

    def precision_recall(self, min_score: float) -> tuple[float, float]:
        """Precision (nan: nothing was found) and recall (nan: there are no labels) of detections from a score on."""
        right = [
            found.label is not None for found in self.judged if found.detection.score >= min_score
        ]
        return float(np.mean(right)) if right else math.nan, sum(
            right
        ) / self.labels if self.labels else math.nan

    def reliability(self, min_score: float = 0.0) -> list[tuple[float, float, int, float, float]]:
        """Of each bin of scores: its ends, how many detections, their mean score, and the share that are right."""
        kept = [found for found in self.judged if found.detection.score >= min_score]
        scores = np.array([found.detection.score for found in kept])
        right = np.array([found.label is not None for found in kept])
        rows = []
        for low, high in pairwise(SCORE_BINS):
            here = (scores >= low) & ((scores < high) | (high == 1.0))
            if here.any():
                rows.append(
                    (
                        low,
                        high,
                        int(here.sum()),
                        float(scores[here].mean()),
                        float(right[here].mean()),
                    )
                )
        return rows

    def calibration_error(self, min_score: float = 0.0) -> float:
        """Expected calibration error: the mean gap between score and share of right ones, over bins of 0.1."""
        rows = self.reliability(min_score)
        total = sum(count for _, _, count, _, _ in rows)
        return (
            sum(count * abs(score - right) for _, _, count, score, right in rows) / total
            if total
            else math.nan
        )


class Steadiness(NamedTuple):
    """One parked vehicle: how often it was placed, and the radius [m] around the median of its locations that holds
    ``STABLE_SHARE`` of them; the same radius of its labelled centres, which wander as well."""

    track: int
    sightings: int
    radius_m: float
    label_radius_m: float


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A trace judged. ``min_score`` is that of the trace as it is used: average precision looks below it."""

    truth: PictureLabels
    groups: Mapping[str, Group]
    min_score: float

    def kept(self, group: str | None = None, parked: bool = False) -> list[Judged]:
        """Right detections from ``min_score`` on; with ``parked`` only those of parked vehicles."""
        chosen = self.groups.values() if group is None else [self.groups[group]]
        kept = [
            j
            for g in chosen
            for j in g.judged
            if j.label is not None and j.detection.score >= self.min_score
        ]
        return [
            j
            for j in kept
            if not parked or (j.label is not None and j.label.track not in self.truth.moving)
        ]

    def steadiness(self) -> list[Steadiness]:
        """Parked vehicles that were placed at least ``MIN_SIGHTINGS`` times from within ``STABLE_RANGE_M``."""
        sightings: dict[int, list[Judged]] = {}
        for judged in self.kept("vehicles", parked=True):
            if (
                judged.error_m is not None
                and judged.range_m is not None
                and judged.range_m <= STABLE_RANGE_M
            ):
                assert judged.label is not None
                sightings.setdefault(judged.label.track, []).append(judged)
        rows = []
        for track, seen in sorted(sightings.items()):
            if len(seen) >= MIN_SIGHTINGS:
                placed = np.array([j.detection.location for j in seen])
                labelled = np.array([j.label.centre for j in seen if j.label is not None])
                rows.append(Steadiness(track, len(seen), _radius_m(placed), _radius_m(labelled)))
        return rows


def evaluate(trace: Trace, truth: PictureLabels, min_score: float) -> Evaluation:
    """Judge a trace, in the pictures that have labels. Average precision means most where the trace has weak detections
    too (``perceive.LOWEST_SCORE``)."""
    return Evaluation(truth, {name: _judge(name, trace, truth) for name in LABELS}, min_score)


def iou(box: Box, boxes: Array) -> Array:
    """Intersection over union of one box with boxes (n, 4)."""
    shared = _shared(box, boxes)
    union: Array = _area(np.array([box])) + _area(boxes) - shared
    return shared / np.maximum(union, 1e-9)


def _judge(group: str, trace: Trace, truth: PictureLabels) -> Group:
    found = [
        (detection, detection.box, (camera, frame.index), frame.pose)
        for camera, frames in trace.frames.items()
        for frame in frames
        for detection in frame.detections
        if detection.label in LABELS[group]
        and detection.box is not None
        and (camera, frame.index) in truth.pictures
    ]
    found.sort(key=lambda item: -item[0].score)
    taken: set[tuple[tuple[str, int], int]] = set()
    judged = []
    for detection, box, picture, pose in found:
        labels = [label for label in truth.pictures[picture] if label.group in (group, "anything")]
        boxes = np.array([label.box for label in labels]).reshape(-1, 4)
        overlaps = iou(box, boxes)
        free = [i for i, label in enumerate(labels) if label.counts and (picture, i) not in taken]
        best = max(free, key=lambda i: overlaps[i], default=None)
        if best is not None and overlaps[best] >= MIN_IOU[group]:
            taken.add((picture, best))
            centre = labels[best].centre
            range_m = None if centre is None else math.dist((pose.east_m, pose.north_m), centre[:2])
            judged.append(Judged(detection, labels[best], range_m))
        elif not _left_out(box, labels, boxes, overlaps, MIN_IOU[group]):
            judged.append(Judged(detection, None, None))
    counted = sum(
        label.counts and label.group == group for here in truth.pictures.values() for label in here
    )
    return Group(group, tuple(judged), counted)


def _left_out(
    box: Box, labels: list[Labelled], boxes: Array, overlaps: Array, min_iou: float
) -> bool:
    if box[3] - box[1] < MIN_HEIGHT_PX:
        return True
    inside = _shared(box, boxes) / max(float(_area(np.array([box]))[0]), 1e-9)
    return any(
        inside[i] >= 0.5 if label.centre is None else overlaps[i] >= min_iou
        for i, label in enumerate(labels)
        if not label.counts
    )


def _shared(box: Box, boxes: Array) -> Array:
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared: Array = np.clip(high - low, 0, None).prod(axis=1)
    return shared


def _area(boxes: Array) -> Array:
    area: Array = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    return area


def _radius_m(places: Array) -> float:
    offsets = (places - np.median(places, axis=0))[:, :2]
    return float(np.percentile(np.hypot(offsets[:, 0], offsets[:, 1]), 100 * STABLE_SHARE))


def table(evaluation: Evaluation) -> str:
    """The evaluation as Markdown tables."""
    e = evaluation
    text = [
        f"Labels: {e.truth.source}. Scores from {e.min_score:g} on, average precision from all scores.",
        "",
    ]
    text += [
        "| found | labels | average precision | precision | recall | calibration error |",
        "|---|---|---|---|---|---|",
    ]
    for name, group in e.groups.items():
        precision, recall = group.precision_recall(e.min_score)
        figures = [(group.average_precision(), 3), (precision, 2), (recall, 2)]
        figures.append((group.calibration_error(e.min_score), 3))
        cells = [
            "-" if math.isnan(figure) else f"{figure:.{digits}f}" for figure, digits in figures
        ]
        text.append(f"| {name} (IoU {MIN_IOU[name]:g}) | {group.labels} | {' | '.join(cells)} |")
    unlabelled = [name for name, group in e.groups.items() if not group.labels]
    if unlabelled:
        text += [
            "",
            f"No labels of {' or '.join(unlabelled)} count in these pictures: what was missed is unknown.",
        ]
    text += ["", "| score | vehicles: number, right | persons: number, right |", "|---|---|---|"]
    bins = {name: {row[0]: row for row in group.reliability()} for name, group in e.groups.items()}
    for low, high in pairwise(SCORE_BINS):
        cells = [f"{b[low][2]}, {b[low][4]:.2f}" if low in b else "-" for b in bins.values()]
        text.append(f"| {low:.1f} to {high:.1f} | {' | '.join(cells)} |")
    text += ["", "| location error of | placed | median | 90 % below |", "|---|---|---|---|"]
    for what, rows in _places(e):
        errors = [judged.error_m for judged in rows if judged.error_m is not None]
        if rows:
            cells = (
                [f"{value:.2f} m" for value in np.percentile(errors, [50, 90])]
                if errors
                else ["-", "-"]
            )
            text.append(f"| {what} | {len(errors)} of {len(rows)} | {' | '.join(cells)} |")
    steady = e.steadiness()
    if steady:
        stay = sum(row.radius_m <= STABLE_M for row in steady)
        radius_m, label_radius_m = (
            float(np.median(column)) for column in list(zip(*steady, strict=True))[2:]
        )
        text += [
            "",
            f"Of {len(steady)} parked vehicles seen {MIN_SIGHTINGS} times or more within {STABLE_RANGE_M:g} m, "
            f"{stay} stay within {STABLE_M:g} m of their median place, in {STABLE_SHARE:.0%} of sightings; "
            f"median radius {radius_m:.2f} m, that of the labels themselves {label_radius_m:.2f} m.",
        ]
    return "\n".join(text) + "\n"


def _places(e: Evaluation) -> list[tuple[str, list[Judged]]]:
    parked = e.kept("vehicles", parked=True)
    rows = [
        ("vehicles", e.kept("vehicles")),
        ("persons", e.kept("persons")),
        (
            "parked vehicles within 30 m",
            [j for j in parked if j.range_m is not None and j.range_m <= 30.0],
        ),
    ]
    for low, high in RANGES_M:
        name = f"all from {low:g} to {high:g} m" if high < math.inf else f"all beyond {low:g} m"
        rows.append(
            (name, [j for j in e.kept() if j.range_m is not None and low <= j.range_m < high])
        )
    for method, how in (("scan", "by the scan"), ("ground", "by the ground")):
        rows.append((f"all placed {how}", [j for j in e.kept() if j.detection.method == method]))
    return rows
