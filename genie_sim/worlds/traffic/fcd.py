"""Reads floating-car data of SUMO: where every vehicle is at every time step.

The file is ``<fcd-export>`` with a ``<timestep time>`` for each step and in it a ``<vehicle id x y
angle type>`` or a ``<person>`` for each road user, plain or compressed by gzip; or SUMO's table of
the same, CSV or Parquet. It is read as a stream, and no further than the last step that is wanted.
"""

import gzip
import math
import zlib
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple, cast
from xml.parsers import expat

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.geometry import Array
from genie_sim.base.import_report import FAST_SHARE, LONG_GAP_S, ImportReport
from genie_sim.base.paths import check_is_file
from genie_sim.base.tables import FileColumn, FileTable, is_gzip
from genie_sim.base.text import one_line
from genie_sim.base.units import MAX_M, MAX_TIME_S

CHUNK_BYTES = 1 << 20
MAX_ROWS = 50_000_000  # of about 40 bytes: more would fill the memory of most machines
UNKNOWN_TYPE = ""  # of a vehicle without the attribute
MAX_TURN_DEG = 3600.0
INVALID = -(2.0**30)  # what SUMO writes for a value that it does not know
SPEEDS = 20_000  # rows whose speed is compared with their way
SAME_SPEED, NO_SPEED = 2.0, 10.0  # how many times as far a vehicle may have gone
JUMP_MPS = 70.0  # a teleport

TEXTS, NUMBERS = ("id", "type"), ("x", "y", "angle", "speed")  # columns of a table

Ints = np.ndarray[Any, np.dtype[np.int64]]


class VehicleRows(NamedTuple):
    """What a file says of its vehicles between two times, in the order of the file.

    ``times_s`` are the steps (n,) and ``step``, ``vehicle``, ``x_m``, ``y_m``, ``angle_deg`` have
    one value for each vehicle and step: the front bumper, and the heading clockwise from north.
    ``ids`` and ``types`` are those of the vehicles, and of persons on foot, whose place is their
    middle. ``report`` tells what was read.
    """

    times_s: Array
    ids: list[str]
    types: list[str]
    is_person: list[bool]
    step: Ints
    vehicle: Ints
    x_m: Array
    y_m: Array
    angle_deg: Array
    report: ImportReport


class _Enough(Exception):
    """All that is wanted has been read."""


@dataclass
class _Content:
    """What has been read so far. ``where`` begins errors: the file and the line being read."""

    path: Path
    begin_s: float | None
    duration_s: float
    where: Callable[[], str]
    report: ImportReport
    times_s: list[float] = field(default_factory=list)
    numbers: dict[tuple[str, bool], int] = field(default_factory=dict)  # by id and whether a person
    types: list[str] = field(default_factory=list)
    step: "array[int]" = field(default_factory=lambda: array("q"))
    vehicle: "array[int]" = field(default_factory=lambda: array("q"))
    x_m: "array[float]" = field(default_factory=lambda: array("d"))
    y_m: "array[float]" = field(default_factory=lambda: array("d"))
    angle_deg: "array[float]" = field(default_factory=lambda: array("d"))
    speeds_mps: "array[float]" = field(default_factory=lambda: array("d"))  # of the first rows
    first_s: float | None = None  # of the file
    earlier_s: float = -math.inf  # the step before, wanted or not
    seen: set[int] = field(default_factory=set)  # vehicles of this step
    begins_late: bool = False  # after the first step
    is_over: bool = False  # the time that is wanted: this step only tells where vehicles go
    invalid: int = 0
    others: int = 0

    def error(self, text: str) -> UserError:
        """The error of the line that is being read."""
        return UserError(f"{self.where()}: {text}")

    def timestep(self, time_s: float) -> None:
        """A time step begins."""
        if time_s <= self.earlier_s:
            raise self.error(f"timestep: time {time_s:.15g} does not follow {self.earlier_s:.15g}")
        self.earlier_s = time_s
        if self.first_s is None:
            self.first_s = time_s
        begin_s = self.begin_s
        if begin_s is None:
            self._clear()  # a step without vehicles
        # One step before the beginning and one at or after the end, for places in between.
        elif self.times_s and time_s >= begin_s + self.duration_s:
            if self.is_over and self.types:
                raise _Enough
            self.is_over = True
        elif time_s <= begin_s and self.times_s:
            self._clear()
        self.seen.clear()
        self.times_s.append(time_s)

    def _clear(self) -> None:
        """Forgets the steps so far."""
        for column in (self.times_s, self.types, self.numbers):
            column.clear()
        for values in (
            self.step,
            self.vehicle,
            self.x_m,
            self.y_m,
            self.angle_deg,
            self.speeds_mps,
        ):
            del values[:]
        self.invalid = self.others = 0

    def road_user(
        self, attributes: dict[str, Any], is_person: bool = False, type_: str = UNKNOWN_TYPE
    ) -> None:
        """A vehicle or a person of this time step, by the attributes ``id``, ``x``, ``y``,
        ``angle`` and ``speed``.
        """
        try:
            name = attributes["id"]
            x_m, y_m = float(attributes["x"]), float(attributes["y"])
            angle_deg = float(attributes["angle"])
        except (KeyError, ValueError, TypeError):
            raise self._wrong(attributes, is_person) from None
        if not (abs(x_m) <= MAX_M and abs(y_m) <= MAX_M and abs(angle_deg) <= MAX_TURN_DEG):
            if INVALID in (x_m, y_m, angle_deg):
                self.invalid += 1
                return
            raise self._wrong(attributes, is_person)
        if self.is_over and not self.types:
            raise UserError(
                f"{self.path}: has no vehicles from {self.begin_s:g} s to "
                f"{(self.begin_s or 0.0) + self.duration_s:g} s; the first one comes at "
                f"{self.earlier_s:g} s: set 'begin' or 'duration'"
            )
        if self.is_over and (name, is_person) not in self.numbers:
            return
        if self.begin_s is None:
            self.begin_s = self.times_s[-1]
            self.begins_late = self.begin_s != self.first_s
        number = self.numbers.setdefault((name, is_person), len(self.numbers))
        if number == len(self.types):
            self.types.append(type_)
        if number in self.seen:
            what = "person" if is_person else "vehicle"
            raise self.error(f"{what}: id {short_repr(name)} is twice in one time step")
        self.seen.add(number)
        self.step.append(len(self.times_s) - 1)
        self.vehicle.append(number)
        self.x_m.append(x_m)
        self.y_m.append(y_m)
        self.angle_deg.append(angle_deg)
        if len(self.speeds_mps) < SPEEDS:
            self.speeds_mps.append(_speed(attributes.get("speed")))
        elif len(self.step) > MAX_ROWS:
            raise self.error(f"more than {MAX_ROWS:,} vehicles and steps; shorten 'duration'")

    def _wrong(self, attributes: dict[str, Any], is_person: bool) -> UserError:
        """What is wrong with a vehicle or a person."""
        what = "person" if is_person else "vehicle"
        if "id" not in attributes:
            return self.error(f"{what}: attribute 'id' is missing")
        what = f"{what} {short_repr(attributes['id'])}"
        try:
            for name, most in (("x", MAX_M), ("y", MAX_M), ("angle", MAX_TURN_DEG)):
                self.number(attributes, what, name, most)
        except UserError as error:
            return error
        raise AssertionError("no attribute is wrong")

    def number(
        self, attributes: dict[str, Any], what: str, name: str, most: float = MAX_M
    ) -> float:
        """An attribute that is a number up to ``most``. Raises UserError."""
        if attributes.get(name) is None:
            raise self.error(f"{what}: attribute {name!r} is missing")
        text = attributes[name]
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not abs(number) <= most:
            limit = f" up to {most:g}" if math.isfinite(number) else ""
            raise self.error(f"{what}: {name}: must be a number{limit}, not {short_repr(text)}")
        return number


class _Xml:
    """Hands what an XML file holds to its content; its methods are called by the parser."""

    def __init__(self, path: Path, begin_s: float | None, duration_s: float, report: ImportReport):
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._element
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._is_root = True

        def where() -> str:
            return f"{path}: line {self._parser.CurrentLineNumber}"

        self.content = _Content(
            path, begin_s=begin_s, duration_s=duration_s, where=where, report=report
        )

    def read(self, file: IO[bytes]) -> None:
        """The whole file, or until there is enough."""
        try:
            while chunk := file.read(CHUNK_BYTES):
                self._parser.Parse(chunk)
            self._parser.Parse(b"", True)
        except _Enough:
            pass
        except expat.ExpatError as error:
            text = one_line(str(error))
            raise UserError(f"{self.content.path}: not XML: {text}") from error

    def _doctype(self, *_: object) -> None:
        """A document type could define entities without end; SUMO writes none."""
        raise self.content.error("has a document type; floating-car data of SUMO have none")

    def _element(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        content = self.content
        if name == "vehicle":
            if content.times_s:
                content.road_user(attributes, type_=attributes.get("type", UNKNOWN_TYPE))
        elif name == "timestep":
            content.timestep(content.number(attributes, "timestep", "time", MAX_TIME_S))
        elif name == "person":
            if not attributes.get("vehicle") and content.times_s:  # of one who rides in a vehicle
                content.road_user({"angle": "0", **attributes}, is_person=True)
        elif name == "container":
            content.others += 1
        elif self._is_root and name != "fcd-export":
            raise content.error(f"<{name[:40]}> is no floating-car data of SUMO, <fcd-export> is")
        self._is_root = False


def _read_table(
    table: FileTable, begin_s: float | None, duration_s: float, report: ImportReport
) -> _Content:
    """The content of SUMO's CSV or Parquet."""
    prefixes = ("vehicle_", "person_") if "timestep_time" in table.titles else ("",)
    time = "timestep_time" if prefixes[0] else "time"
    columns = [FileColumn(time, lowest=-MAX_TIME_S, highest=MAX_TIME_S)]
    for prefix in prefixes:
        columns += [FileColumn(f"{prefix}{name}", "text", optional=True) for name in TEXTS]
        columns += [FileColumn(f"{prefix}{name}", optional=True) for name in NUMBERS]
    needed = [f"{prefixes[0]}{name}" for name in ("id", "x", "y", "angle")]
    missing = ", ".join(name for name in needed if name not in table.titles)
    if missing:
        raise UserError(f"{table.path}: is no floating-car data of SUMO: has no columns {missing}")
    where = str(table.path)
    content = _Content(
        table.path,
        begin_s=begin_s,
        duration_s=duration_s,
        where=lambda: where,
        report=report,
    )
    names = (*TEXTS, *NUMBERS)
    try:
        for row in table.rows(columns):
            where, (time_s, *values) = row
            if time_s != content.earlier_s:
                content.timestep(time_s)
            for first in range(0, len(values), len(names)):
                attributes = dict(zip(names, values[first:], strict=False))
                is_person = first > 0
                if attributes["id"] is not None:
                    if is_person and attributes["angle"] is None:
                        attributes["angle"] = 0.0
                    content.road_user(attributes, is_person, attributes["type"] or UNKNOWN_TYPE)
    except _Enough:
        pass
    return content


def _speed(value: Any) -> float:
    """The attribute ``speed`` [m/s]; not a number where there is none that is one."""
    try:
        speed_mps = math.nan if value is None else float(value)
    except ValueError:
        return math.nan
    return speed_mps if abs(speed_mps) <= MAX_M else math.nan


def read_fcd(
    path: Path, begin_s: float | None, duration_s: float, accept: bool = False
) -> VehicleRows:
    """The rows of a file from the last step at or before ``begin_s`` (``None``: from the first one
    with a vehicle) to the first at or after the end. ``accept``: also what cannot be.

    Raises UserError, naming file, line and attribute, for a file that is not such data, and for
    times that it does not have.
    """
    report = ImportReport(path, accept, "perception.accept: true")
    check_is_file(path)
    with as_user_error(f"{path}: cannot be read", OSError, EOFError, zlib.error):
        if path.name.removesuffix(".gz").endswith((".csv", ".parquet")):
            content = _read_table(FileTable(path), begin_s, duration_s, report)
        else:
            reader = _Xml(path, begin_s, duration_s, report)
            with gzip.open(path) if is_gzip(path) else path.open("rb") as file:
                reader.read(cast(IO[bytes], file))
            content = reader.content
    return _rows(content)


def _rows(content: _Content) -> VehicleRows:
    """What was read, as columns. Raises UserError if that is nothing, or cannot be."""
    path, times_s, begin_s = content.path, content.times_s, content.begin_s
    if content.first_s is None:
        raise UserError(f"{path}: has no time steps")
    if begin_s is not None and begin_s > times_s[-1]:
        raise UserError(
            f"{path}: begin: {begin_s:g} s is after the last time step, {times_s[-1]:g} s"
        )
    if not content.types:
        from_s = content.first_s if begin_s is None else begin_s
        raise UserError(f"{path}: has no vehicles from {from_s:g} s on")
    rows = VehicleRows(
        times_s=np.array(times_s),
        ids=[name for name, _ in content.numbers],
        types=content.types,
        is_person=[is_person for _, is_person in content.numbers],
        step=np.array(content.step),
        vehicle=np.array(content.vehicle),
        x_m=np.array(content.x_m),
        y_m=np.array(content.y_m),
        angle_deg=np.array(content.angle_deg),
        report=content.report,
    )
    _tell(rows, content)
    return rows


def _tell(rows: VehicleRows, content: _Content) -> None:
    """What was read, for the report. Raises UserError where places cannot be in metres."""
    report, persons = rows.report, sum(rows.is_person)
    report.read("vehicles", len(rows.ids) - persons)
    if persons:
        report.read("persons", persons)
    report.dropped(
        "rows",
        len(rows.step),
        len(rows.step) + content.invalid,
        f"a place of {INVALID:.0f}, SUMO's mark of none",
    )
    report.leave_out("containers", content.others)
    if content.begins_late:
        begins = [f"{time_s:g} s" for time_s in (content.begin_s, content.first_s)]
        report.choose("begin", begins[0], begins, "perception.begin")
    report.span("times", (rows.times_s[0], rows.times_s[-1]), "s")
    known_s = float(rows.times_s[-1]) - (content.begin_s or 0.0)
    if known_s + LONG_GAP_S < content.duration_s:
        report.warn(
            f"ends {known_s:.4g} s after the beginning, before 'duration' of "
            f"{content.duration_s:.4g} s is over"
        )
    for name, values in (("x", rows.x_m), ("y", rows.y_m)):
        report.span(name, (values.min(), values.max()), "m")
    report.times("steps", rows.times_s.tolist(), "in between vehicles drive straight")
    order = np.lexsort((rows.step[:SPEEDS], rows.vehicle[:SPEEDS]))
    vehicle, t_s = rows.vehicle[order], rows.times_s[rows.step[order]]
    same_vehicle, apart = np.diff(vehicle) == 0, np.diff(rows.step[order])
    if same_vehicle.any() and np.median(apart[same_vehicle]) > 1:
        report.refuse(
            f"a vehicle is there at every {np.median(apart[same_vehicle]):g}th step only, and "
            "nowhere in between: write all vehicles at all steps (--device.fcd.period)"
        )
    pairs = same_vehicle & (apart == 1)
    if not pairs.any():
        return
    passed_s = np.diff(t_s)[pairs]
    steps_m = np.column_stack([np.diff(rows.x_m[order]), np.diff(rows.y_m[order])])[pairs]
    drives = ~np.array(rows.is_person)[vehicle[1:][pairs]]
    angle_deg = rows.angle_deg[order][1:][pairs][drives]
    report.heading(
        "vehicles: angle",
        np.radians(90.0 - angle_deg),
        as_radians=math.pi / 2 - angle_deg,
        steps_m=steps_m[drives],
        passed_s=passed_s[drives],
        counts="count clockwise from north, in degrees",
    )
    way_m = np.hypot(*steps_m.T)
    told_m = passed_s * np.array(content.speeds_mps)[order][1:][pairs]
    speeds_mps = way_m / passed_s
    if (speeds_mps > JUMP_MPS).mean() <= FAST_SHARE:  # teleports, which are told elsewhere
        speeds_mps = speeds_mps[speeds_mps <= JUMP_MPS]
    comparable = np.isfinite(told_m) & (way_m <= JUMP_MPS * passed_s)
    if told_m[comparable].sum() > 1.0:
        times = float(way_m[comparable].sum() / told_m[comparable].sum())
        text = f"vehicles go {times:.3g} times as far as their speeds say: is x, y in metres?"
        if not 1 / NO_SPEED < times < NO_SPEED:
            report.refuse(f"{text} (not of --fcd-output.geo, in degrees)")
        elif not 1 / SAME_SPEED < times < SAME_SPEED:
            report.warn(text)
    report.speeds("vehicles", speeds_mps, float(t_s.max() - t_s.min()))
