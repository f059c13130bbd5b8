"""KITTI's labels in the pictures of a trace, and the truth table that they make.

Which labels count is KITTI's own codes: an object counts when its box is at least ``MIN_HEIGHT_PX``
high, lies mostly in the picture (truncation 0 or 1) and how hidden it is was judged (occlusion 0 to
2). The others are ignored, found or not, and so are trams, ``Misc`` and the areas that KITTI calls
``DontCare``; tracklets have no such areas.

KITTI labels what its annotators saw in the laser scans; objects far away or never labelled are
missing, so an object without a label nearby is not always a ghost.
"""

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import GROUPS, MOVING_MPS
from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.geometry import Array, project, rotation_from_rpy, transform
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_bytes, sha256_of
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Box, Location
from genie_sim.data.importers.trace_import import check_distances
from genie_sim.data.kitti.drive import TRACKLETS, drive_folders, open_drive
from genie_sim.data.kitti.number_files import are_plausible, numbered_lines
from genie_sim.data.kitti.tracking_sequence import (
    CAMERA,
    TRACKING,
    TrackingSequence,
    open_sequence,
)
from genie_sim.data.trace import MIN_HEIGHT_PX, POSITION_DECIMALS, Trace
from genie_sim.data.truth import TruthRow, TruthTable

RAW_DRIVE = re.compile(r"\d{4}_\d{2}_\d{2}/\d{4}", re.ASCII)
BEHIND = 99  # KITTI's code of truncation for what is partly behind the image plane
# A trace's camera this near to a sequence's, at the same frame, has recorded the same drive.
SAME_PLACE_M = 1.0
# KITTI's types by what a detector can tell apart; others (Misc, Tram, DontCare) are no objects here
GROUP_OF = {
    "Car": "vehicles",
    "Van": "vehicles",
    "Truck": "vehicles",
    "Pedestrian": "persons",
    "Person": "persons",
    "Person_sitting": "persons",
    "Person (sitting)": "persons",
    "Cyclist": "persons",
}
IGNORED = {"Tram": "vehicles", "Misc": "vehicles", "DontCare": "anything"}  # by KITTI's type

Picture = tuple[str, int]  # camera and frame number


class ObjectLabel(NamedTuple):
    """One label in one picture. ``counts``: in KITTI's benchmark. ``centre`` is in the trace's
    world, ``None`` for an area that is no object.
    """

    track: int
    group: str
    box: Box
    counts: bool
    centre: Location | None


@dataclass(frozen=True, slots=True)
class PictureLabels:
    """The labels of all pictures of a trace, by picture, and the tracks that move, by number."""

    source: str
    pictures: Mapping[Picture, list[ObjectLabel]]
    moving: frozenset[int]


def read_labels(root: str | Path, drive: str, trace: Trace) -> PictureLabels:
    """The labels of ``2011_09_26/0005`` (tracklets) or ``tracking/0000`` for the pictures of a
    trace of that drive.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    in_sequence = drive.startswith(TRACKING)
    pictures: dict[Picture, list[ObjectLabel]] = {
        (camera, frame.index): []
        for camera in trace.frames
        for frame in trace.frames[camera]
        if camera == CAMERA or not in_sequence
    }
    labels = (_in_sequence if in_sequence else _in_raw_drive)(Path(root), drive, trace)
    for picture, label in labels:
        if label is not None:
            pictures[picture].append(label)
    source = f"label_02 of {drive}" if in_sequence else f"tracklets of {drive}"
    return PictureLabels(source, pictures, _moving(pictures, trace))


def _object_label(
    track: int, kind: str, box: Box, *, truncation: int, occlusion: int, centre: Array
) -> ObjectLabel | None:
    """What a label counts for in KITTI's benchmark, by KITTI's type and codes; ``None`` for a type
    that is no object here.
    """
    if kind in IGNORED:
        return ObjectLabel(track, IGNORED[kind], box, counts=False, centre=None)
    if kind not in GROUP_OF:
        return None
    high_enough = box[3] - box[1] >= MIN_HEIGHT_PX
    counts = high_enough and truncation in (0, 1) and occlusion in (0, 1, 2)
    east_m, north_m, up_m = centre.tolist()
    return ObjectLabel(track, GROUP_OF[kind], box, counts, (east_m, north_m, up_m))


def label_file(root: Path, drive: str) -> Path:
    """The file with the labels of a drive: tracklets of ``2011_09_26/0005``, ``label_02`` of
    ``tracking/0000``.

    Raises UserError, naming the labelled drives of both kinds, where there is none.
    """
    date, _, number = drive.partition("/")
    label_02, path = root / "tracking" / "training" / "label_02", None
    if drive.startswith(TRACKING):
        path = label_02 / f"{number}.txt"
    elif RAW_DRIVE.fullmatch(drive):
        path = root / date / f"{date}_drive_{number}_sync" / TRACKLETS
    if path is None or not path.is_file():
        choices = [
            name for name, folder in drive_folders(root).items() if (folder / TRACKLETS).is_file()
        ]
        choices += [f"{TRACKING}{file.stem}" for file in label_02.glob("*.txt")]
        missing = "" if path is None else f"{path.relative_to(root)}: no such file; "
        raise UserError(
            f"{root}: {missing}{unknown('labelled drive', drive, choices)} (tracklets of a raw "
            "drive DATE/NUMBER, or label_02 of a sequence tracking/NUMBER)"
        )
    return path


def _in_raw_drive(
    root: Path, name: str, trace: Trace
) -> Iterator[tuple[Picture, ObjectLabel | None]]:
    objects = tracklets(label_file(root, name))
    drive = open_drive(
        root, name, sorted(trace.frames), origin=trace.origin, allow_missing_scans=True
    )
    for camera, frames in trace.frames.items():
        frames_by_index = {frame.index: frame for frame in drive.frames[camera]}
        camera_SE3_velo = drive.camera_SE3_velo(camera)
        for frame in frames:
            if frame.index not in frames_by_index:
                raise UserError(
                    f"{root}: drive {name}: has no frame {frame.index} of camera {camera}"
                )
            size = (frame.width, frame.height)
            intrinsics = frames_by_index[frame.index].intrinsics_of(size)
            for track, item in enumerate(objects):
                i = frame.index - item.first
                if not 0 <= i < len(item.centres):
                    continue
                corners = transform(camera_SE3_velo, item.corners(i))
                box = _box_of(corners, intrinsics, size)
                if box is None:
                    continue
                centre = transform(drive.world_SE3_velo(frame.index), item.centres[i])
                yield (
                    (camera, frame.index),
                    _object_label(
                        track,
                        item.kind,
                        box,
                        truncation=item.truncation[i] if corners[:, 2].min() > 0 else BEHIND,
                        occlusion=item.occlusion[i],
                        centre=centre,
                    ),
                )


def _in_sequence(
    root: Path, name: str, trace: Trace
) -> Iterator[tuple[Picture, ObjectLabel | None]]:
    path = label_file(root, name)
    training, sequence = root / "tracking" / "training", name.removeprefix(TRACKING)
    drive = open_sequence(training, sequence, trace.origin)
    frames = trace.frames.get(CAMERA)
    if frames is None:
        cameras = ", ".join(trace.frames)
        raise UserError(f"{training}: labels are those of camera {CAMERA}, the trace has {cameras}")
    for frame in frames:
        if not _is_at(drive, frame.index, frame.pose[:3]):
            raise UserError(
                f"{training}: sequence {sequence} is not the drive of this trace "
                f"(frame {frame.index})"
            )
    indices = {frame.index for frame in frames}
    return (
        ((CAMERA, frame), label)
        for frame, label in tracking_labels(path, drive)
        if frame in indices
    )


def _is_at(drive: TrackingSequence, frame: int, place: Location) -> bool:
    """Whether the camera of a sequence is at a place when a frame is taken."""
    if frame >= len(drive.world_SE3_camera0):
        return False
    return math.dist(place, drive.world_SE3_camera2(frame)[:3, 3].tolist()) <= SAME_PLACE_M


def tracking_labels(path: Path, drive: TrackingSequence) -> list[tuple[int, ObjectLabel | None]]:
    """The frame and the label of every line of the ``label_02`` file of a sequence. Raises
    UserError.
    """
    labels = []
    for number, fields in numbered_lines(path):
        where = f"{path}: line {number}"
        with as_user_error(f"{where}: not a tracking label", IndexError, ValueError, OverflowError):
            frame, track = int(fields[0]), int(fields[1])
            truncation, occlusion = int(float(fields[3])), int(fields[4])
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, (*fields[6:13], *fields[13:16]))
        if not are_plausible([x1, y1, x2, y2, height_m, x, y, z]):
            raise UserError(f"{where}: not a tracking label: a number is not finite, or too large")
        if not 0 <= frame < len(drive.world_SE3_camera0):
            raise UserError(f"{where}: frame {frame} has no line in oxts")
        label = _object_label(
            track,
            fields[2],
            (x1, y1, x2, y2),
            truncation=truncation,
            occlusion=occlusion,
            centre=transform(drive.world_SE3_camera0[frame], (x, y - height_m / 2, z)),
        )
        labels.append((frame, label))
    return labels


@dataclass(frozen=True, slots=True)
class Tracklet:
    """One object of a ``tracklet_labels.xml``, from frame ``first`` on, in the laser's frame.

    ``size_m`` is height, width, length; ``centres`` (n, 3); ``turns_rad`` (n,) about the laser's z
    axis, 0 where the length lies along x. ``occlusion`` and ``truncation`` are KITTI's codes, given
    for camera 2.
    """

    kind: str
    first: int
    size_m: tuple[float, float, float]
    centres: Array
    turns_rad: Array
    occlusion: tuple[int, ...]
    truncation: tuple[int, ...]

    def corners(self, i: int) -> Array:
        """The eight corners (8, 3) of its box at the i-th of its frames, in the laser's frame."""
        height_m, width_m, length_m = self.size_m
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
        turn = rotation_from_rpy(0.0, 0.0, float(self.turns_rad[i]))
        corners: Array = signs * [length_m, width_m, height_m] @ turn.T + self.centres[i]
        return corners


def tracklets(path: Path) -> list[Tracklet]:
    """All objects of a ``tracklet_labels.xml``. Raises UserError where it is missing or something
    else.
    """
    broken = ElementTree.ParseError, ValueError, LookupError, OverflowError
    with as_user_error(f"{path}: not KITTI tracklets", *broken):
        tree = ElementTree.fromstring(read_bytes(path))
        return [_tracklet(item) for item in tree.findall("tracklets/item")]


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [
        [float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")
    ]
    table = np.array(poses).reshape(-1, len(names))
    height_m, width_m, length_m = (float(item.findtext(name, "")) for name in "hwl")
    if not are_plausible([height_m, width_m, length_m, *table.ravel()]):
        raise ValueError("a number is not finite, or too large")
    return Tracklet(
        kind=str(item.findtext("objectType")),
        first=int(item.findtext("first_frame", "")),
        size_m=(height_m, width_m, length_m),
        centres=table[:, :3] + np.array([0.0, 0.0, height_m / 2]),
        turns_rad=table[:, 3],
        occlusion=tuple(map(int, table[:, 4])),
        truncation=tuple(map(int, table[:, 5])),
    )


def _box_of(corners: Array, intrinsics: Array, size: tuple[int, int]) -> Box | None:
    """The part of the picture that a box in space covers; ``None`` where it covers nothing."""
    pixels = project(intrinsics, corners)
    if np.isnan(pixels).all():
        return None
    low = np.clip(np.nanmin(pixels, axis=0), 0, size)
    high = np.clip(np.nanmax(pixels, axis=0), 0, size)
    if (high - low < 1).any():
        return None
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _moving(pictures: Mapping[Picture, list[ObjectLabel]], trace: Trace) -> frozenset[int]:
    """The tracks that got away from where they were first labelled faster than ``MOVING_MPS``, over
    all their time.
    """
    stamps_ns = {
        (camera, frame.index): frame.stamp_ns
        for camera in trace.frames
        for frame in trace.frames[camera]
    }
    tracks: dict[int, dict[int, Location]] = {}
    for picture, labels in pictures.items():
        for label in labels:
            if label.centre is not None:
                tracks.setdefault(label.track, {})[stamps_ns[picture]] = label.centre
    return frozenset(track for track, places in tracks.items() if _speed_mps(places) > MOVING_MPS)


def _speed_mps(places: Mapping[int, Location]) -> float:
    """How far it got from its first place over the time between its first and its last."""
    first_ns, last_ns = min(places), max(places)
    away_m = max(math.dist(place[:2], places[first_ns][:2]) for place in places.values())
    return away_m / ((last_ns - first_ns) / NS_PER_S) if last_ns > first_ns else 0.0


def make_truth(
    root: str | Path, drive: str, trace: Trace, report: ImportReport | None = None
) -> TruthTable:
    """The truth table of a trace from the labels of its drive, ``2011_09_26/0005`` or
    ``tracking/0000``; ``report`` is told what was read.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    truth = read_labels(root, drive, trace)
    report = report or ImportReport(root)
    frames = {
        (camera, frame.index): frame for camera in trace.frames for frame in trace.frames[camera]
    }
    rows, distances_m = [], []
    for picture, labels in sorted(truth.pictures.items()):
        frame = frames[picture]
        report.read("pictures", 1)
        for label in sorted(labels):
            if label.centre is None:
                report.leave_out("labels of areas and of no class")
                continue
            distances_m.append(math.dist(label.centre[:2], frame.pose[:2]))
            east_m, north_m, up_m = (round(x, POSITION_DECIMALS) for x in label.centre)
            rows.append(
                TruthRow(
                    camera=frame.camera,
                    frame=frame.index,
                    stamp_ns=frame.stamp_ns,
                    object=label.track,
                    label=GROUPS[label.group][0],
                    moving=label.track in truth.moving,
                    visible=label.counts,
                    east_m=east_m,
                    north_m=north_m,
                    up_m=up_m,
                )
            )
    report.read("labels", len(rows))
    check_distances(report, distances_m)
    if not rows:
        raise UserError(f"{root}: no object of {drive} is in view of the trace {trace.name}")
    provenance = {
        "drive": drive,
        "labels": truth.source,
        "labels_sha256": sha256_of(label_file(Path(root), drive)),
    }
    return TruthTable(trace.digest, trace.origin, tuple(rows), {**provenance, "trace": trace.name})
