"""Detections that others published of KITTI's tracking benchmark, as traces without pictures.

    python -m tools.make.published --sequence 0003 --out sequence_0003.parquet

A published detector saw the pictures or scans; its boxes and scores are read here. PointRCNN gives
boxes in space, so its objects stand where the laser saw them; RRC gives boxes in the picture,
placed by where they meet flat ground.
"""

import argparse
import hashlib
import math
import sys
from collections.abc import Iterator
from pathlib import Path

from genie_sim.core.messages import Box, Location
from genie_sim.data.kitti.layouts import picture_size
from genie_sim.data.kitti.number_files import numbers
from genie_sim.data.kitti.perceive import kitti_folder
from genie_sim.data.kitti.pipeline import TYPICAL_GROUND
from genie_sim.data.kitti.tracking_sequence import CAMERA, TrackingSequence, open_sequence
from genie_sim.extend import (
    DetectedBox,
    Detection,
    Geodetic,
    ImportReport,
    Picture,
    Placement,
    Trace,
    UserError,
    new_detection,
    picture_frame,
    placed,
    read_bytes,
    traces,
    transform,
    unknown,
    write_told,
)

FRAME_NS = 100_000_000  # KITTI records at 10 Hz; tracking sequences carry no time stamps
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, tracking: A. Geiger, P. Lenz, R. Urtasun, "
    "'Are we ready for Autonomous Driving?', CVPR 2012, "
    "https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0; detections as published with "
    "AB3DMOT and DeepFusionMOT"
)

# PointRCNN's scores are logits from -0.85 to 15.6. A detection is right with probability 1 / (1 +
# exp(-(a logit + b))): (a, b) by logistic regression on the labels of 15 sequences
# (tools/make/pointrcnn_scores.py). On sequences left out of the fit the mean gap between score and
# share of right ones is 0.01 to 0.02 for cars, 0.08 to 0.09 for persons; that of the plain sigmoid
# is 0.18 to 0.37.
POINTRCNN_SCORES = {"car": (1.05, -3.15), "person": (1.21, -2.54)}
LABELS_OF = {"Car": "car", "Pedestrian": "person"}


def tracking_trace(
    root: str | Path,
    sequence: str,
    detections: str = "pointrcnn",
    *,
    min_score: float = 0.3,
    origin: Geodetic | None = None,
    report: ImportReport | None = None,
) -> Trace:
    """The trace of a tracking sequence such as ``0005``, with the detections that a detector's
    authors published.

    There are no pictures: a frame's digest and dhash stand for its detections, so that two frames
    are never the same picture. Raises UserError.

    Parameters
    ----------
    root : the folder that holds ``training`` and ``detections``
    sequence : its number
    detections : the name of the published detector
    min_score : the lowest score kept
    origin : of the world; ``None``: the sequence's first fix
    report : is told what was read
    """
    if detections not in PUBLISHED:
        raise UserError(f"{root}: {unknown('published detector', detections, PUBLISHED)}")
    root = Path(root)
    drive = open_sequence(root / "training", sequence, origin)
    by_frame: list[list[Detection]] = [[] for _ in drive.world_SE3_camera0]
    total = hashlib.sha256()
    for kind, label in LABELS_OF.items():
        path = root / "detections" / f"{detections}_{kind}" / f"{sequence}.txt"
        total.update(read_bytes(path))
        for index, published in _published(path, detections, label, drive):
            by_frame[index].append(published)
    frames = []
    for index, detected in enumerate(by_frame):
        likely = sorted(
            (d for d in detected if d.score >= min_score),
            key=lambda d: (-d.score, d.label, d.box or ()),
        )
        digest = hashlib.sha256(f"tracking/{sequence}/{detections}/{index}".encode()).hexdigest()
        frames.append(
            picture_frame(
                camera=CAMERA,
                index=index,
                stamp_ns=index * FRAME_NS,
                picture=Picture(_size(drive), digest, int(digest[:16], 16)),
                world_SE3_camera=drive.world_SE3_camera2(index),
                intrinsics=drive.intrinsics,
                detections=likely,
            )
        )
    provenance = {
        "data": ATTRIBUTION,
        "drive": f"tracking/{sequence}",
        "detector": detections,
        "detections_sha256": total.hexdigest(),
        "parameters": {
            "min_score": min_score,
            "pictures": False,
            "pointrcnn_scores": POINTRCNN_SCORES,
        },
    }
    name = f"tracking_{sequence}_{detections}"
    imported = traces(
        {name: frames},
        origin=drive.origin,
        provenance=provenance,
        report=report or ImportReport(root),
    )
    return imported[name].trace


def _size(drive: TrackingSequence) -> tuple[int, int]:
    """Width and height of the pictures, by the day that has their focal length."""
    focal_px = float(drive.intrinsics[0, 0])
    size = picture_size(focal_px)
    if size is None:
        where = f"calib/{drive.name}.txt: P2"
        raise UserError(f"{where}: none of KITTI's days has a focal length of {focal_px:g} pixels")
    return size


def _published(
    path: Path, detector: str, label: str, drive: TrackingSequence
) -> Iterator[tuple[int, Detection]]:
    """Frame number and detection of each line of a file."""
    columns, read = PUBLISHED[detector]
    no_scan = Placement(
        drive.intrinsics, _size(drive), drive.camera2_SE3_velo, None, ground=TYPICAL_GROUND
    )
    for row in numbers(path, columns).tolist():
        index = int(row[0])
        if row[0] != index:
            raise UserError(f"{path}: {row[0]} is no frame number")
        if not 0 <= index < len(drive.world_SE3_camera0):
            raise UserError(f"{path}: frame {index} has no line in oxts")
        score, box, centre = read(row, label)
        if not 0 <= score <= 1:
            raise UserError(f"{path}: score {score} is not between 0 and 1")
        if box[2] < box[0] or box[3] < box[1]:
            raise UserError(f"{path}: box {box} ends before it begins")
        if centre is None:
            on_ground = DetectedBox(label, score, box)
            yield index, placed(on_ground, no_scan, drive.world_SE3_camera2(index))
        else:
            place = transform(drive.world_SE3_camera0[index], centre)
            yield index, new_detection(label, score, box, place, placed_by="scan")


def _pointrcnn(row: list[float], label: str) -> tuple[float, Box, Location | None]:
    """Of ``frame,type,x1,y1,x2,y2,score,h,w,l,x,y,z,ry,alpha``; x, y, z is the middle of the
    bottom.
    """
    a, b = POINTRCNN_SCORES[label]
    score = 1.0 / (1.0 + math.exp(-(a * min(max(row[6], -50.0), 50.0) + b)))
    return score, (row[2], row[3], row[4], row[5]), (row[10], row[11] - row[7] / 2, row[12])


def _rrc(row: list[float], label: str) -> tuple[float, Box, Location | None]:
    """Of ``frame,x1,y1,x2,y2,score``, the score in [0, 1]."""
    return row[5], (row[1], row[2], row[3], row[4]), None


# How many columns a file of a published detector has; score, box and, in the frame of the rectified
# camera 0, centre.
PUBLISHED = {"pointrcnn": (15, _pointrcnn), "rrc": (6, _rrc)}


def main(arguments: list[str] | None = None) -> int:
    """Writes the trace of a sequence; returns the exit status."""
    parser = argparse.ArgumentParser(description="Published detections of a tracking sequence.")
    parser.add_argument("--kitti", type=Path, help="KITTI's root folder; default: $GENIE_SIM_KITTI")
    parser.add_argument("--sequence", required=True, help="such as 0003")
    parser.add_argument("--detector", default="pointrcnn", help=", ".join(PUBLISHED))
    parser.add_argument("--out", type=Path, required=True, help="the trace file to write")
    given = parser.parse_args(arguments)
    try:
        root = kitti_folder(given.kitti)
        report = ImportReport(root)
        trace = tracking_trace(root / "tracking", given.sequence, given.detector, report=report)
        line = write_told(given.out, trace)
    except UserError as error:
        sys.stderr.write(f"published: {error}\n")
        return 1
    sys.stdout.write("".join(f"{line}\n" for line in [line, *report.lines()]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
