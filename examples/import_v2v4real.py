"""Imports V2V4Real: two real cars that drove together, out of the text files that DMSTrack
publishes.

    python import_v2v4real.py DMSTrack --sequence train/0012 --out pair

R. Xu et al., 'V2V4Real: A Real-World Large-Scale Dataset for Vehicle-to-Vehicle Cooperative
Perception', CVPR 2023; detections and labels as text: H. Chiu et al., 'Probabilistic 3D
Multi-Object Cooperative Tracking', ICRA 2024 (github.com/eddyhkchiu/DMSTrack). The licence of the
data set forbids to pass on anything derived from it.

All files are in the frame of the ego's lidar at that instant, those of the other car too: x ahead,
y up, z to the left. The ego's pose is not given; it is recovered (``ego_motion``). What was found
becomes three tables, of which genie-sim makes a trace and a truth table of each car.
"""

import argparse
import hashlib
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import ego_motion
import numpy as np
import pandas as pd
from ego_motion import in_world

from genie_sim.extend import (
    Array,
    ImportedCar,
    ImportReport,
    Sensor,
    UserError,
    are_plausible,
    as_user_error,
    cars_of_tables,
    numbered_lines,
    read_bytes,
    write_cars,
)

LABELS = "AB3DMOT/scripts/KITTI/v2v4real_{split}_label/{number}.txt"
DETECTIONS = (
    "AB3DMOT/data/v2v4real/detection/"
    "multi_sensor_differentiable_kalman_filter_Car_{split}/{car}/{number}.txt"
)
SPLITS = ("train", "val")
LABEL_FIELDS, DETECTION_FIELDS = 17, 15
CARS = {"ego": "ego", "cav1": "1"}  # names of the traces, and of the folders with detections
FRAME_S = 0.1  # 10 Hz; the files have no time stamps
# A scan's 60,000 points of 16 bytes: assumed. Truth counts as far as KITTI's; these labels reach
# 100 m.
SENSOR = Sensor(size_bytes=960_000, range_m=40.0)
LOWEST_SCORE = 0.2  # the lowest in the files
OWN_M = 2.0  # a label or a detection nearer than this to a car's own place is the car itself
EGO = "ego"  # the ego in the truth of the other car: it is not labelled at all times
MAX_FRAMES = 100_000  # of a sequence; the longest has 405
# The label of the other car, which the ego sees and the other car never detects. Other sequences
# have several such labels, or none.
PARTNERS = {
    "train/0009": 7,
    "train/0010": 6,
    "train/0011": 38,
    "train/0012": 1,
    "train/0013": 17,
    "train/0015": 17,
    "train/0019": 11,
    "val/0004": 9,
    "val/0008": 3,
}
# Of a label that may be the other car: shares of the sequence in which it is labelled and of its
# frames in which the ego and the other car detect it.
OFTEN, SELDOM = 0.5, 0.05
ATTRIBUTION = (
    "V2V4Real: R. Xu et al., 'V2V4Real: A Real-World Large-Scale Dataset for Vehicle-to-Vehicle "
    "Cooperative Perception', CVPR 2023; text files of DMSTrack, H. Chiu et al., ICRA 2024; "
    "UCLA Academic Software License: not to be passed on, nor what is derived from it"
)


class Box(NamedTuple):
    """A labelled or detected car in the ego's frame: its middle [m] and its heading [rad]."""

    x_m: float
    z_m: float
    up_m: float
    heading_rad: float
    score: float = 1.0

    @property
    def ground(self) -> tuple[float, float]:
        return self.x_m, self.z_m


class Tables(NamedTuple):
    """Poses, detections and truth of both cars, and where they come from."""

    poses: pd.DataFrame
    detections: pd.DataFrame
    truth: pd.DataFrame
    about: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class SequenceFiles:
    """The files of one sequence, read: labels by frame and number, detections by car and frame."""

    name: str
    labels: Sequence[Mapping[int, Box]]
    detections: Mapping[str, Mapping[int, Sequence[Box]]]
    sha256: str


def imported(
    root: Path,
    sequence: str,
    *,
    partner: int | None = None,
    min_score: float = LOWEST_SCORE,
    report: ImportReport | None = None,
) -> dict[str, ImportedCar]:
    """What both cars of a sequence recorded, by the car's name, on one clock. The arguments are
    those of ``tables_of``; ``report`` is told what was read. Raises UserError.
    """
    tables = tables_of(root, sequence, partner=partner, min_score=min_score)
    return cars_of_tables(*tables[:3], SENSOR, provenance=tables.about, report=report)


def tables_of(
    root: Path, sequence: str, *, partner: int | None = None, min_score: float = LOWEST_SCORE
) -> Tables:
    """The tables of a sequence. They span the longest run of frames in which the other car is
    labelled. Raises UserError.

    Parameters
    ----------
    root : the folder with DMSTrack's files
    sequence : such as ``train/0012``
    partner : the label of the other car; ``None``: the one that is known of this sequence
    min_score : the lowest score of a detection that is kept
    """
    files = read_files(root, sequence)
    partner = _partner(files, partner)
    motion = ego_motion.recovered(
        [{item: box.ground for item, box in labels.items()} for labels in files.labels]
    )
    doubts = motion.doubts()
    if doubts:
        raise UserError(f"{sequence}: the ego's poses cannot be recovered: {'; '.join(doubts)}")
    first, end = longest_run([partner in labels for labels in files.labels])
    ego = motion.poses[first:end]
    poses_of = {"ego": ego, "cav1": _poses_of(partner, files.labels[first:end], ego)}
    poses, detections, truth = [], [], []
    for car, own in poses_of.items():
        itself = EGO if car == "ego" else str(partner)
        for number in range(first, end):
            row = {"car": car, "time_s": round((number - first) * FRAME_S, 3)}
            here = own[number - first]
            poses.append(
                row | _place(here[:2]) | {"heading_rad": math.remainder(here[2], math.tau)}
            )
            for box in files.detections[car].get(number, ()):
                place = in_world(motion.poses[number], np.array(box.ground))
                if box.score >= min_score and math.dist(place, here[:2]) >= OWN_M:
                    detections.append(row | _place(place, box.up_m) | {"score": box.score})
            for item, there in _objects(files.labels[number], motion.poses[number]).items():
                if item != itself:
                    truth.append(row | {"object": item} | there)
    about = {
        "data": ATTRIBUTION,
        "drive": f"v2v4real/{sequence}",
        "files_sha256": files.sha256,
        "frames": [first, end - 1],
        "origin": "made up: the data set has no geodetic place",
        "poses": "recovered from labels that stand",
        "scatter_m": round(motion.scatter_m, 3),
        "partner": partner,
        "min_score": min_score,
    }
    return Tables(
        pd.DataFrame(poses),
        pd.DataFrame(detections).assign(label="car"),
        pd.DataFrame(truth).assign(label="car"),
        about,
    )


def _place(place: Sequence[float] | Array, up_m: float = 0.0) -> dict[str, float]:
    """The columns of a place."""
    return {"east_m": float(place[0]), "north_m": float(place[1]), "up_m": up_m}


def _objects(labels: Mapping[int, Box], ego: Array) -> dict[str, dict[str, float]]:
    """Where every labelled car and the ego are in a frame, by name. Nobody knows what one car's
    sensor could see: what only the other car could see counts as missed.
    """
    placed = {EGO: _place(ego[:2])}
    for item, box in sorted(labels.items()):
        placed[str(item)] = _place(in_world(ego, np.array(box.ground)), box.up_m)
    return placed


def read_files(root: Path, sequence: str) -> SequenceFiles:
    """Reads and checks the files of a sequence. Raises UserError, naming file and line."""
    split, _, number = sequence.partition("/")
    if split not in SPLITS or not (number.isascii() and number.isdigit()):
        raise UserError(f"--sequence: must be such as train/0012 or val/0008, not {sequence!r}")
    labels_path = root / LABELS.format(split=split, number=number)
    content = read_bytes(labels_path)
    twin = root / LABELS.format(split="val", number=number)
    if split == "train" and twin.is_file() and read_bytes(twin) == content:
        raise UserError(f"{labels_path}: holds the same bytes as val/{number}: take that")
    digest = hashlib.sha256(content)
    labels: list[dict[int, Box]] = []
    for place, frame, fields in _rows(labels_path, LABEL_FIELDS, texts=[2]):
        with as_user_error(f"{place}: track {fields[1]!r} is no whole number", ValueError):
            item = int(fields[1])
        if fields[2] != "Car":
            raise UserError(f"{place}: type {fields[2]!r}; known: Car")
        labels += [{} for _ in range(frame + 1 - len(labels))]
        box = _box(place, fields[-7:])
        if math.hypot(*box.ground) >= OWN_M:
            labels[frame][item] = box
    if not labels:
        raise UserError(f"{labels_path}: has no labels")
    detections: dict[str, dict[int, list[Box]]] = {}
    for car, part in CARS.items():
        path = root / DETECTIONS.format(split=split, car=part, number=number)
        digest.update(read_bytes(path))
        of_car = detections[car] = {}
        for place, frame, fields in _rows(path, DETECTION_FIELDS):
            box = _box(place, fields[7:14], fields[6])
            if not 0 <= box.score <= 1:
                raise UserError(f"{place}: score {box.score} is not between 0 and 1")
            of_car.setdefault(frame, []).append(box)
    return SequenceFiles(sequence, labels, detections, digest.hexdigest())


def _rows(
    path: Path, columns: int, texts: Sequence[int] = ()
) -> Iterator[tuple[str, int, list[str]]]:
    """Place in the file, frame number and fields of each line; the frames never go back.

    ``texts`` are the places of fields that are no numbers.
    """
    last = 0
    for line, fields in numbered_lines(path):
        place = f"{path}: line {line}"
        if len(fields) != columns:
            raise UserError(f"{place}: {len(fields)} fields, expected {columns}")
        with as_user_error(place, ValueError):
            numbers = [float(text) for n, text in enumerate(fields) if n not in texts]
        if not are_plausible(numbers):
            raise UserError(f"{place}: a number is not finite, or too large")
        frame = int(numbers[0])
        if frame != numbers[0] or not 0 <= frame < MAX_FRAMES:
            raise UserError(f"{place}: {fields[0]!r} is no frame number")
        if frame < last:
            raise UserError(f"{place}: frame {frame} comes after frame {last}")
        last = frame
        yield place, frame, fields


def _box(place: str, fields: Sequence[str], score: str = "1") -> Box:
    """Of h, w, l, x, y, z and the turn about y."""
    _, _, _, x_m, up_m, z_m, heading_rad = (float(text) for text in fields)
    return Box(x_m, z_m, up_m=up_m, heading_rad=heading_rad, score=float(score))


def candidates(files: SequenceFiles) -> list[int]:
    """The labels that may be the other car: labelled for most of the sequence, detected by the ego
    and never by the other car itself.
    """
    frames: dict[int, list[tuple[int, Box]]] = {}
    for number, labels in enumerate(files.labels):
        for item, box in labels.items():
            frames.setdefault(item, []).append((number, box))
    possible = []
    for item, boxes in sorted(frames.items()):
        if len(boxes) < OFTEN * len(files.labels):
            continue
        shares = [
            sum(_is_near(box, files.detections[car].get(number, ())) for number, box in boxes)
            / len(boxes)
            for car in CARS
        ]
        if shares[0] >= OFTEN and shares[1] <= SELDOM:
            possible.append(item)
    return possible


def _is_near(box: Box, others: Sequence[Box]) -> bool:
    return any(math.dist(box.ground, other.ground) < OWN_M for other in others)


def _partner(files: SequenceFiles, partner: int | None) -> int:
    """The label of the other car. Raises UserError where it is not known."""
    labelled = {item for labels in files.labels for item in labels}
    if partner is None:
        partner = PARTNERS.get(files.name)
    if partner is None:
        possible = ", ".join(map(str, candidates(files))) or "none"
        raise UserError(
            f"{files.name}: which label is the other car? Say it with --partner; labels that it "
            f"may be: {possible}"
        )
    if partner not in labelled:
        raise UserError(f"{files.name}: --partner: there is no label {partner}")
    return partner


def longest_run(present: Sequence[bool]) -> tuple[int, int]:
    """Begin and end of the longest stretch of ``True``, the first of equal ones."""
    best, begin = (0, 0), 0
    for number, here in enumerate((*present, False)):
        if not here:
            if number - begin > best[1] - best[0]:
                best = begin, number
            begin = number + 1
    return best


def _poses_of(item: int, labels: Sequence[Mapping[int, Box]], poses: Array) -> Array:
    """Poses (n, 3) of a labelled car: its heading is its label's, without jumps by half a turn, and
    turned if the car would drive backwards.
    """
    places = np.array(
        [
            in_world(pose, np.array(boxes[item].ground))
            for pose, boxes in zip(poses, labels, strict=True)
        ]
    )
    headings = np.array([boxes[item].heading_rad for boxes in labels]) + poses[:, 2]
    headings = np.unwrap(headings, period=math.pi)
    moves = places[1:] - places[:-1]
    ahead_m = moves[:, 0] * np.cos(headings[:-1]) + moves[:, 1] * np.sin(headings[:-1])
    if float(ahead_m.sum()) < 0:
        headings += math.pi
    return np.column_stack([places, headings])


def main(arguments: list[str] | None = None) -> int:
    """Imports a sequence; returns the exit status."""
    parser = argparse.ArgumentParser(description="Import a sequence of V2V4Real.")
    parser.add_argument("root", type=Path, help="DMSTrack's folder")
    parser.add_argument("--sequence", required=True, help="such as train/0012")
    parser.add_argument("--partner", type=int, help="the label that is the other car")
    parser.add_argument("--min-score", type=float, default=LOWEST_SCORE)
    parser.add_argument("--out", type=Path, required=True, help="the folder for what is made")
    given = parser.parse_args(arguments)
    report = ImportReport(given.root)
    try:
        pair = imported(
            given.root,
            given.sequence,
            partner=given.partner,
            min_score=given.min_score,
            report=report,
        )
        told = write_cars(given.out, pair)
    except (UserError, OSError) as error:
        sys.stderr.write(f"import_v2v4real: {error}\n")
        return 1
    about = pair["ego"].trace.provenance
    told.append(
        f"the ego's poses are recovered: what stands scatters by {about['scatter_m']:.2f} m; "
        f"frames {about['frames'][0]} to {about['frames'][1]}, the other car is label "
        f"{about['partner']}"
    )
    sys.stdout.write("".join(f"{line}\n" for line in [*told, *report.lines()]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
