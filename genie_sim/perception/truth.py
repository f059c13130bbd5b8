"""KITTI's labels as boxes in the pictures of a trace: what a detector should have found there, and where it stands.

Which labels count is KITTI's own codes: an object counts when its box is at least ``MIN_HEIGHT_PX`` high, lies mostly
in the picture (truncation 0 or 1) and how hidden it is was judged (occlusion 0 to 2). The others are ignored, found or
not, and so are trams, ``Misc`` and the areas that KITTI calls ``DontCare``; tracklets have no such areas.

KITTI labels what its annotators saw in the laser scans; objects far away or never labelled are missing, so an object
without a label nearby is not always a ghost.
"""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.core.geometry import Array, project, rotation_from_rpy, transform
from genie_sim.errors import UserError, as_user_error
from genie_sim.messages import Box, Location
from genie_sim.paths import read_bytes
from genie_sim.perception.files import lines, within
from genie_sim.perception.kitti import open_drive
from genie_sim.perception.trace import MIN_HEIGHT_PX, Trace
from genie_sim.perception.tracking import CAMERA, open_sequence
from genie_sim.units import NS_PER_S

GROUPS = {  # KITTI's types by what a detector can tell apart; others (Misc, Tram, DontCare) are no objects here
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
# On drive 0005 the labelled centres of parked cars wander by up to 0.3 m a second, from the labels' and OXTS's own
# errors; a slow walk is 1 m/s.
MOVING_MPS = 0.5

Picture = tuple[str, int]  # camera and frame number


class Labelled(NamedTuple):
    """One label in one picture. ``centre`` is in the trace's world, ``None`` for an area that is no object."""

    track: int
    group: str
    box: Box
    counts: bool
    centre: Location | None


@dataclass(frozen=True, slots=True)
class PictureLabels:
    """The labels of all pictures of a trace, by picture, and the numbers of the tracks that move."""

    source: str
    pictures: Mapping[Picture, list[Labelled]]
    moving: frozenset[int]


def read_truth(root: str | Path, labels: str, trace: Trace) -> PictureLabels:
    """The labels of ``2011_09_26/0005`` (tracklets) or ``tracking/0000`` for the pictures of a trace of that drive.

    Raises UserError for labels that are missing or broken, and where they are not of this drive.
    """
    root = Path(root)
    if labels.startswith("tracking/"):
        return _of_tracking(root / "tracking" / "training", labels.split("/")[1], trace)
    return _of_tracklets(root, labels, trace)


def _of_tracklets(root: Path, drive: str, trace: Trace) -> PictureLabels:
    opened = open_drive(root, drive, sorted(trace.frames), trace.origin, allow_missing_scans=True)
    items = tracklets(opened.tracklets)
    pictures: dict[Picture, list[Labelled]] = {}
    for camera, frames in trace.frames.items():
        known = {frame.index: frame for frame in opened.frames[camera]}
        camera_SE3_velo = opened.camera_SE3_velo(camera)
        for frame in frames:
            if frame.index not in known:
                raise UserError(
                    f"{root}: drive {drive}: has no frame {frame.index} of camera {camera}"
                )
            here = pictures.setdefault((camera, frame.index), [])
            for track, item in enumerate(items):
                i = frame.index - item.first
                if item.kind not in GROUPS | IGNORED or not 0 <= i < len(item.centres):
                    continue
                corners = transform(camera_SE3_velo, item.corners(i))
                box = _box_of(corners, known[frame.index].intrinsics, (frame.width, frame.height))
                if box is None:
                    continue
                judged = (
                    item.truncation[i] in (0, 1)
                    and item.occlusion[i] in (0, 1, 2)
                    and corners[:, 2].min() > 0
                )
                centre = _location(transform(opened.world_SE3_velo(frame.index), item.centres[i]))
                here.append(_labelled(track, item.kind, box, judged, centre))
    return PictureLabels(f"tracklets of {drive}", pictures, _moving(pictures, trace))


def _of_tracking(training: Path, sequence: str, trace: Trace) -> PictureLabels:
    drive = open_sequence(training, sequence, trace.origin)
    frames = trace.frames.get(CAMERA)
    if frames is None:
        raise UserError(
            f"{training}: labels are those of camera {CAMERA}, the trace has {', '.join(trace.frames)}"
        )
    for frame in frames:
        there = (
            drive.world_SE3_camera2(frame.index)[:3, 3]
            if frame.index < len(drive.world_SE3_camera0)
            else None
        )
        if there is None or math.dist(frame.pose[:3], there.tolist()) > 1.0:
            raise UserError(
                f"{training}: sequence {sequence} is not the drive of this trace (frame {frame.index})"
            )
    pictures: dict[Picture, list[Labelled]] = {(CAMERA, frame.index): [] for frame in frames}
    path = training / "label_02" / f"{sequence}.txt"
    for label in tracking_labels(path, len(drive.world_SE3_camera0)):
        if (CAMERA, label.frame) not in pictures or label.kind not in GROUPS | IGNORED:
            continue
        judged = label.truncation in (0, 1) and label.occlusion in (0, 1, 2)
        centre = _location(transform(drive.world_SE3_camera0[label.frame], label.centre))
        here = pictures[CAMERA, label.frame]
        here.append(_labelled(label.track, label.kind, label.box, judged, centre))
    return PictureLabels(f"label_02 of tracking/{sequence}", pictures, _moving(pictures, trace))


def _labelled(track: int, kind: str, box: Box, judged: bool, centre: Location) -> Labelled:
    if kind in IGNORED:
        return Labelled(track, IGNORED[kind], box, False, None)
    high = box[3] - box[1] >= MIN_HEIGHT_PX
    return Labelled(track, GROUPS[kind], box, judged and high, centre)


def _moving(pictures: Mapping[Picture, list[Labelled]], trace: Trace) -> frozenset[int]:
    """The tracks that got away from where they were first labelled faster than ``MOVING_MPS``, over all their time."""
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


def _location(place: Array) -> Location:
    east, north, up = place.tolist()
    return east, north, up


@dataclass(frozen=True, slots=True)
class Tracklet:
    """One object of a ``tracklet_labels.xml``, from frame ``first`` on, in the laser's frame.

    ``size_m`` is height, width, length; ``centres`` (n, 3); ``turns_rad`` (n,) about the laser's z axis, 0 where the
    length lies along x. ``occlusion`` and ``truncation`` are KITTI's codes, given for camera 2.
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


class TrackingLabel(NamedTuple):
    """One line of a ``label_02`` file: a box in the picture of camera 2, a centre in the rectified camera 0's frame.

    ``truncation`` and ``occlusion`` are KITTI's codes; -1 in an area of kind ``DontCare``.
    """

    frame: int
    track: int
    kind: str
    truncation: int
    occlusion: int
    box: Box
    centre: Location


def tracking_labels(path: Path, frames: int) -> list[TrackingLabel]:
    """Every line of a ``label_02`` file of a sequence of so many frames. Raises UserError."""
    labels = []
    for number, fields in lines(path):
        with as_user_error(
            f"{path}: line {number}: not a tracking label", IndexError, ValueError, OverflowError
        ):
            frame, track, kind, truncation, occlusion = (
                int(fields[0]),
                int(fields[1]),
                fields[2],
                *fields[3:5],
            )
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, (*fields[6:13], *fields[13:16]))
            bounded = within([x1, y1, x2, y2, height_m, x, y, z])
            label = TrackingLabel(
                frame,
                track,
                kind,
                int(float(truncation)),
                int(occlusion),
                (x1, y1, x2, y2),
                (x, y - height_m / 2, z),
            )
        if not bounded:
            raise UserError(
                f"{path}: line {number}: not a tracking label: a number is not finite, or too large"
            )
        if not 0 <= frame < frames:
            raise UserError(f"{path}: line {number}: frame {frame} has no line in oxts")
        labels.append(label)
    return labels


def tracklets(path: Path) -> list[Tracklet]:
    """All objects of a ``tracklet_labels.xml``. Raises UserError where it is missing or something else."""
    with as_user_error(
        f"{path}: not KITTI tracklets",
        ElementTree.ParseError,
        ValueError,
        LookupError,
        OverflowError,
    ):
        return [
            _tracklet(item)
            for item in ElementTree.fromstring(read_bytes(path)).findall("tracklets/item")
        ]


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [
        [float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")
    ]
    table = np.array(poses).reshape(-1, len(names))
    height_m, width_m, length_m = (float(item.findtext(name, "")) for name in "hwl")
    if not within([height_m, width_m, length_m, *table.ravel()]):
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
