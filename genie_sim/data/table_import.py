"""Traces out of tables of poses and detections that somebody recorded or computed, and truth tables
out of a table of what was really there.

All cars of the tables share one clock, which begins at the first pose of any of them, and one
east-north plane.
"""

import bisect
import hashlib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import chain, combinations, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, TypeVar, Union

import numpy as np

from genie_sim.base.classes import CANONICAL, NO_CLASS, ROAD_LABELS
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.geometry import Geodetic
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
from genie_sim.data.intake import CLOSEST_NS, SAME_TIME_S, ImportedCar, traces
from genie_sim.data.reader_frames import new_detection, scan_frame
from genie_sim.data.trace import RANGE_M
from genie_sim.data.truth_tracks import (
    ObjectRow,
    TruthTrack,
    check_covered,
    in_view,
    without_gaps,
)
from genie_sim.data.world_table import SOMEWHERE

if TYPE_CHECKING:
    import pandas

Table: TypeAlias = Union[str, Path, "pandas.DataFrame"]
SENSOR = "sensor"  # what the one sensor of every car is called
ONLY_CAR = "car1"  # of tables without a column car
MAX_UP_M = 1e5  # above the plane
CAR = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*", re.ASCII)


class PoseRow(NamedTuple):
    """A car's pose, which is one frame; columns as in ``COLUMNS``."""

    car: str | None
    time_s: float
    east_m: float
    north_m: float
    heading_deg: float
    up_m: float | None


class DetectionRow(NamedTuple):
    """A detection in the frame of its time; columns as in ``COLUMNS``."""

    car: str | None
    time_s: float
    label: str
    east_m: float
    north_m: float
    score: float
    up_m: float | None


COLUMNS = {
    column.name: column
    for column in (
        TIME,
        EAST,
        NORTH,
        FileColumn("up_m", lowest=-MAX_UP_M, highest=MAX_UP_M, optional=True),
        FileColumn("heading_deg", lowest=-3600, highest=3600),
        FileColumn("car", "text", optional=True),
        FileColumn("object", "text"),
        FileColumn("label", "text"),
        FileColumn("score", lowest=0.0, highest=1.0),
        FileColumn("moving", "flag", optional=True),
        FileColumn("visible", "flag", optional=True),
    )
}
Row = TypeVar("Row", PoseRow, DetectionRow, ObjectRow)


def _place(row: PoseRow | DetectionRow) -> Location:
    return row.east_m, row.north_m, row.up_m or 0.0


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

    def rows(self, kind: type[Row], report: ImportReport) -> Iterator[tuple[str, Row]]:
        """Where each row stands, and the row; ``report`` is told of other columns. Raises
        UserError.
        """
        columns = [COLUMNS[name] for name in kind._fields]
        for title in self.reader.unused(columns):
            report.leave_out(f"column {title!r} of {self.path.name}")
        for where, values in self.reader.rows(columns):
            yield where, kind._make(values)


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
    poses : a file or a DataFrame with the columns of ``PoseRow``; each row is one frame of a car
    detections : with the columns of ``DetectionRow``; each belongs to the frame of its time
    truth : with the columns of ``ObjectRow``: objects at times; rows without a car count for all
    sensor : of every car
    origin : of the plane: latitude [deg], longitude [deg], altitude [m]
    provenance : where the tables come from; ``None``: their names and digests
    classes : the classes of labels that have other names; ``NO_CLASS``: such objects are left out
    report : is told what was read
    """
    content = {"poses": poses, "detections": detections, "truth": truth}
    tables = {name: _Table.of(name, of) for name, of in content.items() if of is not None}
    report = report or ImportReport(tables["poses"].path)
    by_car = _read_poses(tables["poses"], report)
    detected = _read_detections(tables["detections"], by_car, classes=classes, report=report)
    digests = {table.path.name: table.digest for table in tables.values()}
    for table, other in combinations(tables.values(), 2):
        if other.path.name == table.path.name:
            raise UserError(f"{other.path}: has the name of {table.path}; rename it")
    # of what the cars saw: whoever adds or mends a truth keeps the traces
    seen = tables["poses"].digest + tables["detections"].digest
    key = hashlib.sha256(seen.encode()).hexdigest()
    first_s = min(rows[0].time_s for rows in by_car.values())
    first_ns = round(first_s * NS_PER_S)
    frames = {
        car: [
            scan_frame(
                camera=SENSOR,
                # in whole microseconds, as far as a time since 1970 tells
                stamp_ns=first_ns
                + round((row.time_s - first_s) * NS_PER_S / NS_PER_US) * NS_PER_US,
                size_bytes=sensor.size_bytes,
                key=f"{key}/{car}/{index}",
                pose=_pose(row),
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
        of_all = [*chain(*tracks.values())]  # a car may see nothing of it
        for car, rows in by_car.items():
            times_s = np.array([row.time_s for row in rows])
            check_covered(car, times_s, of_all, report=report, path=tables["truth"].path)
            of_car = tracks.get(None, tracks.get(car, []))
            there[car] = in_view(frames[car], times_s, of_car, sensor.range_m)
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


def _time_s(row: tuple[str, PoseRow | ObjectRow]) -> float:
    return row[1].time_s


def _apart(what: str, rows: Sequence[tuple[str, Row]]) -> list[Row]:
    """Rows that are in order of time. Raises UserError for one in the millisecond of another."""
    for (_, before), (where, after) in pairwise(rows):
        apart_us = round((after.time_s - before.time_s) * NS_PER_S / NS_PER_US)
        if apart_us * NS_PER_US < CLOSEST_NS:
            raise UserError(
                f"{where}: time_s: {after.time_s:.15g} must be at least a millisecond after "
                f"{before.time_s:.15g}, a time of {what}, too"
            )
    return [row for _, row in rows]


def _pose(row: PoseRow) -> CameraPose:
    return CameraPose(*_place(row), math.remainder(math.radians(row.heading_deg), math.tau))


def _read_poses(table: _Table, report: ImportReport) -> dict[str, list[PoseRow]]:
    """The poses of each car, in order of time."""
    rows_of: dict[str, list[tuple[str, PoseRow]]] = {}
    for where, row in table.rows(PoseRow, report):
        rows_of.setdefault(_car(where, row.car), []).append((where, row))
    if not rows_of:
        raise UserError(f"{table.path}: has no poses")
    return {
        car: _apart(car, report.in_order(car, rows, key=_time_s)) for car, rows in rows_of.items()
    }


def _read_detections(
    table: _Table,
    by_car: Mapping[str, Sequence[PoseRow]],
    *,
    classes: Mapping[str, str],
    report: ImportReport,
) -> dict[str, list[list[Detection]]]:
    """The detections of each frame of each car, best score first."""
    detected: dict[str, list[list[Detection]]] = {
        car: [[] for _ in rows] for car, rows in by_car.items()
    }
    times_s = {car: [row.time_s for row in rows] for car, rows in by_car.items()}
    for where, row in table.rows(DetectionRow, report):
        car = _car(where, row.car, by_car)
        of_car = times_s[car]
        after = bisect.bisect_left(of_car, row.time_s)
        near = range(max(after - 1, 0), min(after + 1, len(of_car)))
        apart_s, index = min((abs(of_car[index] - row.time_s), index) for index in near)
        if apart_s > SAME_TIME_S:
            raise UserError(
                f"{where}: time_s: {car} has no pose at {row.time_s:.15g}; the nearest is at "
                f"{of_car[index]:.15g}"
            )
        label = classes.get(row.label, row.label)
        if label not in ROAD_LABELS:
            report.leave_label(label)
            continue
        place = np.array(_place(row))
        detection = new_detection(label, row.score, None, place, placed_by="table")
        detected[car][index].append(detection)
    for frames in detected.values():
        for of_frame in frames:
            of_frame.sort(key=lambda detection: -detection.score)
    return detected


def _read_truth(
    table: _Table,
    by_car: Mapping[str, Sequence[PoseRow]],
    classes: Mapping[str, str],
    report: ImportReport,
) -> dict[str | None, list[TruthTrack]]:
    """The objects by the car for which they count, in the order in which they come first; ``None``:
    for all cars.
    """
    rows_of: dict[tuple[str | None, str], list[tuple[str, ObjectRow]]] = {}
    for where, row in table.rows(ObjectRow, report):
        label = classes.get(row.label, row.label)
        if label == NO_CLASS:
            report.leave_out("rows of the truth of no class")
            continue
        if label not in CANONICAL:
            problem = unknown("class", label, CANONICAL)
            raise UserError(f"{where}: label: {problem}; --map LABEL=CLASS, or ={NO_CLASS}")
        car = None if row.car is None else _car(where, row.car, by_car)
        first, _ = next(iter(rows_of), (car, ""))
        if (first is None) != (car is None):
            raise UserError(f"{where}: car: must be given in every row or in none")
        rows = rows_of.setdefault((car, row.object), [])
        row = row._replace(label=CANONICAL[label])
        if rows and rows[0][1].label != row.label:
            raise UserError(
                f"{where}: label: object {short_repr(row.object)} was a {rows[0][1].label}, not a "
                f"{row.label}"
            )
        rows.append((where, row))
    if not rows_of:
        raise UserError(f"{table.path}: has no objects")
    numbers: dict[str, int] = {}
    objects: dict[str | None, list[TruthTrack]] = {}
    for (car, name), rows in rows_of.items():
        number = numbers.setdefault(name, len(numbers) + 1)
        ordered = _apart(f"object {short_repr(name)}", sorted(rows, key=_time_s))
        tracks = (TruthTrack(number, stretch) for stretch in without_gaps(ordered))
        objects.setdefault(car, []).extend(tracks)
    report.read("objects of the truth", len(numbers))
    return objects
