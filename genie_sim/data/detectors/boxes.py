"""Boxes of objects in a picture: what every detector gives, and the best of a network's."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from genie_sim.base.classes import NO_CLASS, ROAD_LABELS, class_of
from genie_sim.core.messages import Box
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

# autowarefoundation/autoware, vision_darknet_detect: score_threshold and nms_threshold of its
# launch file.
MIN_SCORE = 0.30
NMS_IOU = 0.30

SHARES = "all its boxes lie within two pixels of the corner: are they shares of the picture?"


class DetectedBox(NamedTuple):
    """One object in a picture; ``box`` is (x1, y1, x2, y2) in its pixels."""

    label: str
    score: float
    box: Box


def is_share(places: np.ndarray) -> bool:
    """Whether all of these places of boxes, of which one is not 0, lie between 0 and 1 [pixels], or
    hardly beyond.
    """
    return bool(places.any()) and float(np.abs(places).max()) <= 2.0


def best_boxes(
    boxes: np.ndarray,
    scores: np.ndarray,
    min_score: float,
    names: Sequence[str] = COCO_LABELS,
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
    names : of the columns of ``scores``, a class each
    unused : counts the boxes of labels that are neither of a road nor COCO's
    """
    if not len(scores):
        return []
    # As in a trace, so that an object at the threshold is in or out whatever the last bits are, and
    # what half precision puts above 1 (``SCORE_SLACK``) is a score.
    best = np.minimum(scores.max(axis=1).round(SCORE_DECIMALS), 1.0)
    likely = np.flatnonzero((best >= min_score) & np.isfinite(boxes).all(axis=1))
    labels = [names[number] for number in scores[likely].argmax(axis=1)]
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
