"""KITTI's own labels as tracks of objects in the east-north-up world.

Two sources give the same ``Labels``: the tracklets of a raw drive, and the labels of a tracking sequence. KITTI labels
what its annotators saw in the laser scans; objects far away or never labelled are missing, so an object without a
label nearby is not always a ghost.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.core.geometry import Array, Geodetic, rotation_from_rpy, transform
from genie_sim.errors import UserError
from genie_sim.messages import Box, Location
from genie_sim.perception.files import lines, read_bytes, within
from genie_sim.perception.tracking import FRAME_NS, open_sequence

KINDS = {  # KITTI's types by what a detector can tell apart; others (Misc, Tram, DontCare) are no objects here
    "Car": "vehicle",
    "Van": "vehicle",
    "Truck": "vehicle",
    "Pedestrian": "person",
    "Person": "person",
    "Person_sitting": "person",
    "Person (sitting)": "person",
    "Cyclist": "cyclist",
}
# On drive 0005 the labelled centres of parked cars wander by up to 0.3 m a second, from the labels' and OXTS's own
# errors; a slow walk is 1 m/s.
MOVING_MPS = 0.5


@dataclass(frozen=True, slots=True)
class LabelledTrack:
    """One labelled object: its kind, and its centre (n, 3) [m] at each of its time stamps [ns]."""

    kind: str
    stamps_ns: tuple[int, ...]
    centres: Array

    @property
    def moving(self) -> bool:
        """Whether it left the place of its first label faster than ``MOVING_MPS``, over the time it is labelled."""
        seconds = (self.stamps_ns[-1] - self.stamps_ns[0]) / 1e9
        return seconds > 0 and float(np.hypot(*(self.centres - self.centres[0])[:, :2].T).max()) / seconds > MOVING_MPS

    def at(self, stamp_ns: int) -> Location | None:
        """Where it was, between two labels in a straight line; ``None`` before its first and after its last label."""
        if not self.stamps_ns[0] <= stamp_ns <= self.stamps_ns[-1]:
            return None
        east, north, up = (float(np.interp(stamp_ns, self.stamps_ns, column)) for column in self.centres.T)
        return east, north, up


@dataclass(frozen=True, slots=True)
class Labels:
    """All labelled objects of one drive around one geodetic origin; time counts from the drive's first frame."""

    origin: Geodetic
    tracks: tuple[LabelledTrack, ...]


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


def read_tracklets(root: str | Path, drive: str, origin: Geodetic | None = None) -> Labels:
    """The labels of a raw drive such as ``2011_09_26/0005``, on the clock of its colour cameras' trace.

    Raises UserError for a missing or unreadable ``tracklet_labels.xml`` and for what ``open_drive`` refuses.
    """
    from genie_sim.perception.kitti import open_drive

    opened = open_drive(root, drive, ("02", "03"), origin, allow_missing_scans=True)
    stamps_ns = {frame.index: frame.stamp_ns - opened.first_stamp_ns for frame in opened.frames["02"]}
    tracks = []
    for item in tracklets(opened.tracklets):
        frames = range(item.first, item.first + len(item.centres))
        known = [frame for frame in frames if frame in stamps_ns]
        if item.kind in KINDS and known:
            places = [transform(opened.world_SE3_velo(frame), item.centres[frame - item.first]) for frame in known]
            tracks.append(LabelledTrack(KINDS[item.kind], tuple(stamps_ns[frame] for frame in known), np.array(places)))
    return Labels(opened.origin, tuple(tracks))


def read_tracking_labels(training: str | Path, sequence: str, origin: Geodetic | None = None) -> Labels:
    """The labels of a tracking sequence such as ``0000``; ``training`` holds ``label_02``, ``oxts`` and ``calib``.

    Raises UserError for files that are missing or hold something else.
    """
    drive = open_sequence(training, sequence, origin)
    path = Path(training) / "label_02" / f"{sequence}.txt"
    seen: dict[int, tuple[str, list[int], list[Array]]] = {}
    for label in tracking_labels(path, len(drive.world_SE3_camera0)):
        if label.kind in KINDS:
            _, stamps_ns, centres = seen.setdefault(label.track, (KINDS[label.kind], [], []))
            stamps_ns.append(label.frame * FRAME_NS)
            centres.append(transform(drive.world_SE3_camera0[label.frame], label.centre))
    return Labels(drive.origin, tuple(LabelledTrack(kind, tuple(s), np.array(c)) for kind, s, c in seen.values()))


def tracking_labels(path: Path, frames: int) -> list[TrackingLabel]:
    """Every line of a ``label_02`` file of a sequence of so many frames. Raises UserError."""
    labels = []
    for number, fields in lines(path):
        try:
            frame, track, kind, truncation, occlusion = int(fields[0]), int(fields[1]), fields[2], *fields[3:5]
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, (*fields[6:13], *fields[13:16]))
            bounded = within([x1, y1, x2, y2, height_m, x, y, z])
            label = TrackingLabel(
                frame, track, kind, int(float(truncation)), int(occlusion), (x1, y1, x2, y2), (x, y - height_m / 2, z)
            )
        except (IndexError, ValueError, OverflowError) as error:
            raise UserError(f"{path}: line {number}: not a tracking label: {error}") from error
        if not bounded:
            raise UserError(f"{path}: line {number}: not a tracking label: a number is not finite, or too large")
        if not 0 <= frame < frames:
            raise UserError(f"{path}: line {number}: frame {frame} has no line in oxts")
        labels.append(label)
    return labels


def tracklets(path: Path) -> list[Tracklet]:
    """All objects of a ``tracklet_labels.xml``. Raises UserError where it is missing or something else."""
    try:
        return [_tracklet(item) for item in ElementTree.fromstring(read_bytes(path)).findall("tracklets/item")]
    except (ElementTree.ParseError, ValueError, LookupError, OverflowError) as error:
        raise UserError(f"{path}: not KITTI tracklets: {error}") from error


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [[float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")]
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


def distance_m(a: Location, b: Location) -> float:
    """How far apart two places are in the ground plane [m]."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
