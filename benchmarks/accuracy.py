"""How much the settings around a network move its average precision on drive 0005: a table, one
line a setting.

    GENIE_SIM_KITTI=... GENIE_SIM_WEIGHTS=... python benchmarks/accuracy.py [--detector yolox_nano]

The first line is what ``genie-sim perceive --evaluate`` does; each other one changes what its name
says. Precision and recall are those from a score of 0.3 on. A network is run once on each picture,
and once more with the picture in the middle of its letter box instead of at its top.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np

from genie_sim.analysis.text_table import markdown
from genie_sim.classes import CANONICAL, ROAD_LABELS
from genie_sim.perception.detector import make_detector
from genie_sim.perception.evaluation import evaluate
from genie_sim.perception.kitti import KittiDrive, open_drive, read_image
from genie_sim.perception.onnx_detector import (
    GREY,
    OnnxDetector,
    Scored,
    best_boxes,
)
from genie_sim.perception.perceive import LOWEST_SCORE, kitti_folder
from genie_sim.perception.trace import Trace, detection, trace_frame
from genie_sim.perception.truth import read_truth

DRIVE, LABELS, CAMERA = "2011_09_26/0005", "tracking/0000", "02"
EACH_CLASS: Mapping[str, str] = {}
ALL_CLASSES = dict.fromkeys(ROAD_LABELS, "car")


class Setting(NamedTuple):
    """What suppression does, and where in the letter box the picture is."""

    name: str
    iou: float = 0.30
    same_object: Mapping[str, str] = CANONICAL
    lowest_score: float = LOWEST_SCORE
    middle: bool = False


SETTINGS = (
    Setting("as it is: IoU 0.30, car = truck = bus, scores from 0.01 on"),
    Setting("IoU 0.45", 0.45),
    Setting("IoU 0.65", 0.65),
    Setting("IoU 0.45, scores from 0.001 on", 0.45, lowest_score=0.001),
    Setting("IoU 0.45, each class by itself", 0.45, EACH_CLASS),
    Setting("IoU 0.45, all classes together", 0.45, ALL_CLASSES),
    Setting("picture in the middle of the letter box", middle=True),
    Setting("the same, IoU 0.45, each class by itself", 0.45, EACH_CLASS, middle=True),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--detector", default="yolox_nano")
    arguments = parser.parse_args()
    detector = make_detector(
        arguments.detector, min_score=min(setting.lowest_score for setting in SETTINGS)
    )
    assert isinstance(detector, OnnxDetector)
    drive = open_drive(kitti_folder(None), DRIVE, [CAMERA])
    scored = {middle: run(detector, drive, middle) for middle in (False, True)}
    truth = None
    heads = [detector.name, "vehicles", "precision, recall", "persons", "precision, recall"]
    rows = []
    for setting in SETTINGS:
        trace = as_trace(detector, drive, scored[setting.middle], setting)
        truth = truth or read_truth(kitti_folder(None), LABELS, trace)
        judged = evaluate(trace, truth, 0.3)
        cells = [setting.name]
        for group in judged.groups.values():
            precision, recall = group.precision_recall(0.3)
            cells += [f"{group.average_precision():.3f}", f"{precision:.2f}, {recall:.2f}"]
        rows.append(cells)
    print(markdown(heads, rows))


def run(detector: OnnxDetector, drive: KittiDrive, middle: bool) -> list[Scored]:
    """Every picture's boxes, in its own pixels, and their scores."""
    found = []
    for frame in drive.frames[CAMERA]:
        image = read_image(frame.image_path)
        height, width = image.shape[:2]
        above = (
            max(0, round((width * detector.size[1] / detector.size[0] - height) / 2))
            if middle
            else 0
        )
        framed = cv2.copyMakeBorder(
            image, above, above, 0, 0, cv2.BORDER_CONSTANT, value=(GREY,) * 3
        )
        blob, scale = detector.prepare(framed)
        boxes, scores = detector.decode(detector.infer(blob))
        found.append(
            (np.clip(boxes / scale - [0, above, 0, above], 0, [width, height] * 2), scores)
        )
    return found


def as_trace(
    detector: OnnxDetector, drive: KittiDrive, scored: list[Scored], setting: Setting
) -> Trace:
    """What a setting keeps, without places."""
    frames = []
    for frame, (boxes, scores) in zip(drive.frames[CAMERA], scored, strict=True):
        found = best_boxes(
            boxes,
            scores,
            setting.lowest_score,
            detector.labels,
            iou=setting.iou,
            same_object=setting.same_object,
        )
        kept = [detection(label, score, box, None, method="none") for label, score, box in found]
        stamp_ns, pose, size = (
            frame.stamp_ns - drive.first_stamp_ns,
            frame.world_SE3_camera,
            (1242, 375),
        )
        frames.append(
            trace_frame(
                camera=CAMERA,
                index=frame.index,
                stamp_ns=stamp_ns,
                size=size,
                digest="",
                dhash=0,
                world_SE3_camera=pose,
                intrinsics=frame.intrinsics,
                detections=kept,
            )
        )
    return Trace(detector.name, drive.origin, {CAMERA: tuple(frames)}, {})


if __name__ == "__main__":
    main()
