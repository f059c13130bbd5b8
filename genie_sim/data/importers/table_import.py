"""Traces out of tables of poses and detections that somebody recorded or computed, and truth tables
out of a table of what was really there.

All cars of the tables share one clock, which begins at the first pose of any of them, and one
east-north plane.
"""

import bisect
import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, Union

import numpy as np

from genie_sim.base.classes import CANONICAL, MOVING_MPS, NO_CLASS, ROAD_LABELS
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.geometry import Array, Geodetic
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import sha256_of
from genie_sim.base.tables import (
    EAST,
    NORTH,
    TIME,
    DataFrameTable,
    FileColumn,
    FileTable,
    ForeignTable,
)
from genie_sim.base.units import NS_PER_S, NS_PER_US
from genie_sim.core.messages import CameraPose, Detection, Location
from genie_sim.core.view import ViewSector
from genie_sim.data.importers.trace_import import (
    BEYOND_M,
    CLOSEST_NS,
    ImportedCar,
    new_detection,
    rounded_pose,
    scan_frame,
    traces,
)
from genie_sim.data.trace import POSITION_DECIMALS, RANGE_M, TraceFrame
from genie_sim.data.truth import TruthObject
from genie_sim.data.world_table import SOMEWHERE

if TYPE_CHECKING:
    import pandas

Table: TypeAlias = Union[str, Path, "pandas.DataFrame"]
SENSOR = "sensor"  # what the one sensor of every car is called
ONLY_CAR = "car1"  # of tables without a column car
SAME_TIME_S = CLOSEST_NS / NS_PER_S / 2  # what differs by less is one instant
TRUTH_GAP_S = 1.0  # between two rows of an object that far apart at most it is there
MAX_UP_M = 1e5  # above the plane
MOVING_OVER_S = 1.0  # the time over which a speed is computed
Flags = np.ndarray[Any, np.dtype[np.bool_]]
CAR = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*", re.ASCII)

_PLACE = (EAST, NORTH)
_UP = FileColumn("up_m", lowest=-MAX_UP_M, highest=MAX_UP_M, optional=True)
_CAR = FileColumn("car", "text", optional=True)
_LABEL = FileColumn("label", "text")
POSES = (_CAR, TIME, *_PLACE, FileColumn("heading_deg", lowest=-3600, highest=3600), _UP)
DETECTIONS = (_CAR, TIME, _LABEL, *_PLACE, FileColumn("score", lowest=0.0, highest=1.0), _UP)
TRUTH = (
    _CAR,
    TIME,
    FileColumn("object", "text"),
    _LABEL,
    *_PLACE,
    FileColumn("moving", "flag", optional=True),
    FileColumn("visible", "flag", optional=True),
    _UP,
)
COLUMNS = {"poses": POSES, "detections": DETECTIONS, "truth": TRUTH}


@dataclass(frozen=True)
class Sensor:
    """What tables do not tell of the sensor of every car.

    ``fov_rad`` is the angle that it sees around the heading, ``size_bytes`` what one frame takes to
    send, ``range_m`` how far away objects are judged.
    """

    fov_rad: float = 2 * math.pi
    size_bytes: int = 960_000
    range_m: float = RANGE_M


class _Table(NamedTuple):
    """One of the tables: its file, or its name, the digest of its content, and what reads it."""

    path: Path
    digest: str
    reader: ForeignTable

    @classmethod
    def of(cls, name: str, table: Table) -> "_Table":
        """A file or a DataFrame; ``name`` is what the latter is called. Raises UserError."""
        if isinstance(table, str | Path):
            path = Path(table)
            reader = FileTable(path)
            return cls(path, sha256_of(path), reader)
        content = table.to_csv(index=False).encode()
        return cls(Path(name), hashlib.sha256(content).hexdigest(), DataFrameTable(table, name))


class _Pose(NamedTuple):
    time_s: float
    pose: CameraPose


class _Sightings(NamedTuple):
    """One object at the times of a car's frames, as columns: whether it is there, where [m] (n, 3),
    and which row of the table is nearest in time.
    """

    there: Flags
    place: Array
    row: np.ndarray[Any, np.dtype[np.int64]]


class _ObjectRows:
    """The rows of one object, in order of time: where it is, and what the table says of it."""

    def __init__(self, number: int, label: str) -> None:
        self.number, self.label = number, label
        self.times_s: list[float] = []
        self.places: list[Location] = []
        self.moving: list[bool | None] = []
        self.visible: list[bool | None] = []

    def at(self, times_s: Array) -> _Sightings:
        """The object at some times (n,), between two rows on a straight line."""
        own_s, places = np.array(self.times_s), np.array(self.places)
        last = len(own_s) - 1
        later = np.minimum(np.searchsorted(own_s, times_s - SAME_TIME_S), last)
        earlier = np.maximum(later - 1, 0)
        exact = np.abs(own_s[later] - times_s) <= SAME_TIME_S
        gap_s = own_s[later] - own_s[earlier]
        between = (own_s[earlier] < times_s) & (times_s < own_s[later])
        share = np.where(exact, 1.0, (times_s - own_s[earlier]) / np.where(gap_s > 0, gap_s, 1.0))
        place = places[earlier] + share[:, None] * (places[later] - places[earlier])
        return _Sightings(
            there=exact | (between & (gap_s <= TRUTH_GAP_S)),
            place=np.where(exact[:, None], places[later], place),
            row=np.where(share < 0.5, earlier, later),
        )

    def is_moving(self, times_s: Array) -> Flags:
        """Whether it moves at some times (n,), by its places over the second around each."""
        first_s = np.maximum(times_s - MOVING_OVER_S / 2, self.times_s[0])
        last_s = np.minimum(times_s + MOVING_OVER_S / 2, self.times_s[-1])
        begin, end = self.at(first_s), self.at(last_s)
        way_m = np.hypot(*(end.place - begin.place)[:, :2].T)
        duration_s = last_s - first_s
        is_known = begin.there & end.there & (duration_s > SAME_TIME_S)
        is_moving: Flags = is_known & (way_m > MOVING_MPS * duration_s)
        return is_moving


def cars_of_tables(
    poses: Table,
    detections: Table,
    truth: Table | None = None,
    sensor: Sensor = Sensor(),
    *,
    origin: Geodetic = SOMEWHERE,
    provenance: Mapping[str, Any] | None = None,
    classes: Mapping[str, str] = {},
    report: ImportReport | None = None,
) -> dict[str, ImportedCar]:
    """The cars of three tables, by their names.

    Raises UserError, naming table, row and column, and for what cannot be.

    Parameters
    ----------
    poses : a file or a DataFrame with the columns ``POSES``; each row is one frame of a car
    detections : with the columns ``DETECTIONS``; each belongs to the frame of its time
    truth : with the columns ``TRUTH``: objects at times; rows without a car count for all
    sensor : of every car
    origin : of the plane: latitude [deg], longitude [deg], altitude [m]
    provenance : where the tables come from; ``None``: their names and digests
    classes : the classes of labels that have other names; ``NO_CLASS``: such objects are left out
    report : is told what was read
    """
    content = {"poses": poses, "detections": detections, "truth": truth}
    tables = {name: _Table.of(name, of) for name, of in content.items() if of is not None}
    report = report or ImportReport(tables["poses"].path)
    for name, table in tables.items():
        for title in table.reader.unused(COLUMNS[name]):
            report.leave_out(f"column {title!r} of {table.path.name}")
    by_car = _read_poses(tables["poses"], report)
    detected = _read_detections(tables["detections"], by_car, classes=classes, report=report)
    digests = {table.path.name: table.digest for table in tables.values()}
    if len(digests) < len(tables):
        *_, last = tables.values()
        raise UserError(f"{last.path}: has the name of another of the tables; rename it")
    key = hashlib.sha256("".join(digests.values()).encode()).hexdigest()
    first_s = min(rows[0].time_s for rows in by_car.values())
    first_ns = round(first_s * NS_PER_S)
    frames = {
        car: [
            scan_frame(
                camera=SENSOR,
                stamp_ns=first_ns + _since_ns(row.time_s, first_s),
                size_bytes=sensor.size_bytes,
                key=f"{key}/{car}/{index}",
                pose=row.pose,
                horizontal_fov_rad=sensor.fov_rad,
                detections=of_frame,
            )
            for index, (row, of_frame) in enumerate(zip(rows, detected[car], strict=True))
        ]
        for car, rows in by_car.items()
    }
    there = {}
    if "truth" in tables:
        tracks = _read_truth(tables["truth"], by_car, classes, report)
        for car, rows in by_car.items():
            times_s = np.array([row.time_s for row in rows])
            of_car = tracks.get(None, tracks.get(car, []))
            _check_covered(tables["truth"].path, car, times_s, of_car)
            there[car] = _in_view(frames[car], times_s, of_car, sensor.range_m)
    return traces(
        frames,
        origin=origin,
        provenance={
            **({"source": "tables"} if provenance is None else provenance),
            "files": digests,
            "parameters": asdict(sensor),
        },
        report=report,
        truth=there,
        first_ns=first_ns,
        sequence=f"{tables['poses'].path.stem}-{key[:12]}" if len(by_car) > 1 else None,
        range_m=sensor.range_m,
        detected_in=tables["detections"].path,
        truth_in=tables["truth"].path if "truth" in tables else None,
    )


def _car(where: str, name: str | None, cars: Mapping[str, Any] | None = None) -> str:
    """The car of a row; its name may be that of a file, and is in ``cars`` if they are known."""
    car = ONLY_CAR if name is None else name
    if not CAR.fullmatch(car) or car == "edges":
        raise UserError(
            f"{where}: car: {short_repr(car)} must be letters, digits, '_' and '-', the first a "
            "letter or digit, and not 'edges'"
        )
    if cars is not None and car not in cars:
        raise UserError(f"{where}: car: {unknown('car', car, cars)}")
    return car


def _check_apart(where: str, time_s: float, before_s: float, what: str) -> None:
    """Raises UserError for a row in the millisecond of the one before."""
    if time_s - before_s <= 2 * SAME_TIME_S:
        raise UserError(
            f"{where}: time_s: {time_s:.15g} must be at least a millisecond after "
            f"{before_s:.15g}, the time of {what} before"
        )


def _read_poses(table: _Table, report: ImportReport) -> dict[str, list[_Pose]]:
    """The poses of each car, in order of time."""
    rows_of: dict[str, list[tuple[str, _Pose]]] = {}
    for where, (name, time_s, east_m, north_m, heading_deg, up_m) in table.reader.rows(POSES):
        heading_rad = math.remainder(math.radians(heading_deg), math.tau)
        pose = CameraPose(east_m, north_m, up_m or 0.0, heading_rad)
        rows_of.setdefault(_car(where, name), []).append((where, _Pose(time_s, pose)))
    if not rows_of:
        raise UserError(f"{table.path}: has no poses")
    by_car = {}
    for car, rows in rows_of.items():
        rows = report.in_order(car, rows, key=lambda row: row[1].time_s)
        for (_, before), (where, after) in pairwise(rows):
            _check_apart(where, after.time_s, before.time_s, f"{car}'s pose")
        by_car[car] = [pose for _, pose in rows]
    return by_car


def _read_detections(
    table: _Table,
    by_car: Mapping[str, Sequence[_Pose]],
    *,
    classes: Mapping[str, str],
    report: ImportReport,
) -> dict[str, list[list[Detection]]]:
    """The detections of each frame of each car, best score first."""
    detected: dict[str, list[list[Detection]]] = {
        car: [[] for _ in rows] for car, rows in by_car.items()
    }
    times_s = {car: [row.time_s for row in rows] for car, rows in by_car.items()}
    for where, (name, time_s, label, east_m, north_m, score, up_m) in table.reader.rows(DETECTIONS):
        car = _car(where, name, by_car)
        index = _nearest(times_s[car], time_s)
        nearest_s = times_s[car][index]
        if abs(nearest_s - time_s) > SAME_TIME_S:
            raise UserError(
                f"{where}: time_s: {car} has no pose at {time_s:.15g}; the nearest is at "
                f"{nearest_s:.15g}"
            )
        label = classes.get(label, label)
        if label not in ROAD_LABELS:
            report.leave_label(label)
            continue
        place = np.array([east_m, north_m, up_m or 0.0])
        detected[car][index].append(new_detection(label, score, None, place, placed_by="table"))
    for frames in detected.values():
        for of_frame in frames:
            of_frame.sort(key=lambda detection: -detection.score)
    return detected


def _nearest(times_s: Sequence[float], time_s: float) -> int:
    after = bisect.bisect_left(times_s, time_s)
    if after == 0 or (
        after < len(times_s) and times_s[after] - time_s < time_s - times_s[after - 1]
    ):
        return after
    return after - 1


def _since_ns(time_s: float, first_s: float) -> int:
    """The time from the first pose on [ns], in whole microseconds, as far as a time since 1970
    tells.
    """
    return round((time_s - first_s) * NS_PER_S / NS_PER_US) * NS_PER_US


def _read_truth(
    table: _Table,
    by_car: Mapping[str, Sequence[_Pose]],
    classes: Mapping[str, str],
    report: ImportReport,
) -> dict[str | None, list[_ObjectRows]]:
    """The objects by the car for which they count, in the order in which they come first; ``None``:
    for all cars.
    """
    numbers: dict[str, int] = {}
    tracks: dict[str | None, dict[str, _ObjectRows]] = {}
    for where, (name, time_s, item, label, *place, moving, visible, up_m) in table.reader.rows(
        TRUTH
    ):
        label = classes.get(label, label)
        if label == NO_CLASS:
            report.leave_label(label)
            continue
        if label not in CANONICAL:
            problem = unknown("class", label, CANONICAL)
            raise UserError(f"{where}: label: {problem}; --map LABEL=CLASS, or ={NO_CLASS}")
        car = None if name is None else _car(where, name, by_car)
        if tracks and (None in tracks) != (car is None):
            raise UserError(f"{where}: car: must be given in every row or in none")
        number = numbers.setdefault(item, len(numbers) + 1)
        track = tracks.setdefault(car, {}).setdefault(item, _ObjectRows(number, CANONICAL[label]))
        if track.label != CANONICAL[label]:
            raise UserError(
                f"{where}: label: object {short_repr(item)} was a {track.label}, not a "
                f"{CANONICAL[label]}"
            )
        if track.times_s:
            _check_apart(where, time_s, track.times_s[-1], f"object {short_repr(item)}")
        track.times_s.append(time_s)
        track.places.append((*place, up_m or 0.0))
        track.moving.append(moving)
        track.visible.append(visible)
    if not tracks:
        raise UserError(f"{table.path}: has no objects")
    report.read("objects of the truth", len(numbers))
    return {car: list(of_car.values()) for car, of_car in tracks.items()}


def _in_view(
    frames: Sequence[TraceFrame], times_s: Array, tracks: Sequence[_ObjectRows], range_m: float
) -> list[list[TruthObject]]:
    """What is there at each frame of a car, taken at ``times_s`` (n,), up to a little beyond
    ``range_m``.
    """
    poses = [rounded_pose(frame).pose for frame in frames]
    sectors = [
        ViewSector(pose, frame.horizontal_fov_rad, range_m)
        for pose, frame in zip(poses, frames, strict=True)
    ]
    origins = np.array([pose[:2] for pose in poses])
    there: list[list[TruthObject]] = [[] for _ in frames]
    for track in tracks:
        sightings, moving = track.at(times_s), track.is_moving(times_s)
        away_m = np.hypot(*(sightings.place[:, :2] - origins).T)
        near = sightings.there & (away_m <= range_m + BEYOND_M)
        for index in np.flatnonzero(near).tolist():
            place = sightings.place[index].round(POSITION_DECIMALS).tolist()
            row = sightings.row[index]
            in_view = sectors[index].distance_m(*place[:2]) is not None
            says_moving, says_visible = track.moving[row], track.visible[row]
            there[index].append(
                TruthObject(
                    track.number,
                    track.label,
                    bool(moving[index]) if says_moving is None else says_moving,
                    in_view and says_visible is not False,
                    *place,
                )
            )
    return there


def _check_covered(path: Path, car: str, times_s: Array, tracks: Sequence[_ObjectRows]) -> None:
    own_s = np.array(sorted(time_s for track in tracks for time_s in track.times_s))
    own_s = np.concatenate([[-np.inf], own_s, [np.inf]])
    after = np.searchsorted(own_s, times_s)
    apart_s = np.minimum(own_s[after] - times_s, times_s - own_s[after - 1])
    uncovered = np.flatnonzero(apart_s > TRUTH_GAP_S)
    if len(uncovered):
        raise UserError(
            f"{path}: time_s: no row within {TRUTH_GAP_S:g} s of {car}'s pose at "
            f"{times_s[uncovered[0]]:.15g}"
        )
