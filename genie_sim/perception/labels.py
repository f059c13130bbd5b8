"""What really stood on the street: KITTI's own labels as tracks in the east-north-up world.

Two sources give the same ``Labels``: the tracklets of a raw drive, and the labels of a tracking sequence. KITTI labels
what its annotators saw in the laser scans; objects far away or never labelled are missing, so an object without a
label nearby is not always a ghost.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genie_sim.core.geometry import Array, Geodetic, inverse, rigid, rotation_from_rpy, transform
from genie_sim.errors import UserError
from genie_sim.messages import Location
from genie_sim.perception.geodesy import enu_SE3_enu

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
FRAME_NS = 100_000_000  # KITTI records at 10 Hz; tracking sequences carry no time stamps


@dataclass(frozen=True, slots=True)
class Track:
    """One labelled object: its kind, and its centre (n, 3) [m] at each of its time stamps [ns]."""

    kind: str
    stamps_ns: tuple[int, ...]
    centres: Array

    @property
    def moving(self) -> bool:
        """Whether it got away from where it was first seen faster than ``MOVING_MPS``, over the time it is labelled."""
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
    tracks: tuple[Track, ...]


def read_tracklets(root: str | Path, drive: str, origin: Geodetic | None = None) -> Labels:
    """The labels of a raw drive such as ``2011_09_26/0005``, on the clock of its colour cameras' trace.

    Raises UserError for a missing or unreadable ``tracklet_labels.xml`` and for what ``open_drive`` refuses.
    """
    from genie_sim.perception.kitti import open_drive

    opened = open_drive(root, drive, ("02", "03"), origin, allow_missing_scans=True)
    date, number = drive.split("/")
    path = Path(root) / date / f"{date}_drive_{number}_sync" / "tracklet_labels.xml"
    stamps_ns = {frame.index: frame.stamp_ns - opened.first_stamp_ns for frame in opened.frames["02"]}
    imu_SE3_velo = inverse(np.asarray(opened.calibration.T_velo_imu, dtype=np.float64))
    world_SE3_velo = {index: pose @ imu_SE3_velo for index, pose in opened.world_SE3_imu.items()}
    tracks = []
    for kind, first, bottoms, height_m in _tracklets(path):
        centres = bottoms + [0.0, 0.0, height_m / 2]
        known = [i for i in range(len(centres)) if first + i in stamps_ns and first + i in world_SE3_velo]
        if kind in KINDS and known:
            places = np.array([transform(world_SE3_velo[first + i], centres[i]) for i in known])
            tracks.append(Track(KINDS[kind], tuple(stamps_ns[first + i] for i in known), places))
    return Labels(opened.origin, tuple(tracks))


def read_tracking_labels(training: str | Path, sequence: str, origin: Geodetic | None = None) -> Labels:
    """The labels of a tracking sequence such as ``0000``; ``training`` holds ``label_02``, ``oxts`` and ``calib``.

    Raises UserError for files that are missing or hold something else.
    """
    training = Path(training)
    oxts = _numbers(training / "oxts" / f"{sequence}.txt", 30)
    velo_SE3_camera, velo_SE3_imu = _tracking_calibration(training / "calib" / f"{sequence}.txt")
    imu_SE3_camera = inverse(velo_SE3_imu) @ velo_SE3_camera
    first_fix = (float(oxts[0, 0]), float(oxts[0, 1]), float(oxts[0, 2]))
    origin = first_fix if origin is None else origin
    path = training / "label_02" / f"{sequence}.txt"
    seen: dict[int, tuple[str, list[int], list[Array]]] = {}
    for number, fields in enumerate(_lines(path), start=1):
        try:
            frame, track, kind = int(fields[0]), int(fields[1]), fields[2]
            height_m, (x, y, z) = float(fields[10]), map(float, fields[13:16])
        except (IndexError, ValueError) as error:
            raise UserError(f"{path}: line {number}: not a tracking label: {error}") from error
        if kind not in KINDS:
            continue
        if not 0 <= frame < len(oxts):
            raise UserError(f"{path}: line {number}: frame {frame} has no line in oxts")
        latitude, longitude, altitude, roll, pitch, yaw = oxts[frame, :6].tolist()
        here_SE3_imu = rigid(rotation_from_rpy(roll, pitch, yaw), (0.0, 0.0, 0.0))
        world_SE3_camera = enu_SE3_enu(origin, (latitude, longitude, altitude)) @ here_SE3_imu @ imu_SE3_camera
        _, stamps_ns, centres = seen.setdefault(track, (KINDS[kind], [], []))
        stamps_ns.append(frame * FRAME_NS)
        centres.append(transform(world_SE3_camera, (x, y - height_m / 2, z)))  # KITTI gives the middle of the bottom
    return Labels(origin, tuple(Track(kind, tuple(s), np.array(c)) for kind, s, c in seen.values()))


def _tracklets(path: Path) -> list[tuple[str, int, Array, float]]:
    """Type, first frame, bottom centres (n, 3) in the laser's frame, and height of each tracklet."""
    try:
        items = ElementTree.parse(path).getroot().findall("tracklets/item")
        return [
            (
                str(item.findtext("objectType")),
                int(item.findtext("first_frame", "")),
                np.array([[float(p.findtext(n, "")) for n in ("tx", "ty", "tz")] for p in item.findall("poses/item")]),
                float(item.findtext("h", "")),
            )
            for item in items
        ]
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise UserError(f"{path}: not KITTI tracklets: {error}") from error


def _tracking_calibration(path: Path) -> tuple[Array, Array]:
    """``velo_SE3_camera`` of the rectified camera 0 and ``velo_SE3_imu``; label_02 is in the former's frame."""
    rows = {fields[0].rstrip(":"): fields[1:] for fields in _lines(path)}
    found: dict[str, Array] = {}
    for name, spellings, count in (
        ("rect", ("R0_rect", "R_rect"), 9),
        ("velo_to_cam", ("Tr_velo_to_cam", "Tr_velo_cam"), 12),
        ("imu_to_velo", ("Tr_imu_to_velo", "Tr_imu_velo"), 12),
    ):
        values = next((rows[spelling] for spelling in spellings if spelling in rows), [])
        try:
            found[name] = np.array([float(value) for value in values]).reshape(3, count // 3)
        except ValueError as error:
            raise UserError(f"{path}: {spellings[0]} is missing or has not {count} numbers") from error
    camera_SE3_velo = rigid(found["rect"], (0, 0, 0)) @ rigid(found["velo_to_cam"][:, :3], found["velo_to_cam"][:, 3])
    return np.linalg.inv(camera_SE3_velo), rigid(found["imu_to_velo"][:, :3], found["imu_to_velo"][:, 3])


def _lines(path: Path) -> list[Sequence[str]]:
    try:
        return [line.split() for line in path.read_text().splitlines() if line.strip()]
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error


def _numbers(path: Path, columns: int) -> Array:
    try:
        table = np.array([[float(value) for value in fields] for fields in _lines(path)])
    except ValueError as error:
        raise UserError(f"{path}: not a table of numbers: {error}") from error
    if table.ndim != 2 or table.shape[1] < columns or not np.isfinite(table).all():
        raise UserError(f"{path}: expected lines of {columns} finite numbers")
    return table


def distance_m(a: Location, b: Location) -> float:
    """In the ground plane."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
