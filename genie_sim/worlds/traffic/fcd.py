"""Reads floating-car data of SUMO: where every vehicle is at every time step.

The file is ``<fcd-export>`` with a ``<timestep time>`` for each step and in it a ``<vehicle id x y
angle type>`` or a ``<person>`` for each road user, plain or compressed by gzip. It is read as a
stream, and no further than the last step that is wanted.
"""

import contextlib
import gzip
import math
import zlib
from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple, cast
from xml.parsers import expat

import numpy as np
import pandas as pd

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.geometry import Array
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import check_is_file
from genie_sim.base.spans import Ints
from genie_sim.base.tables import is_gzip
from genie_sim.base.text import one_line
from genie_sim.base.units import MAX_M, MAX_TIME_S
from genie_sim.worlds.traffic.fcd_checks import compare_ways, tell, time_text

CHUNK_BYTES = 1 << 20
MAX_ROWS = 50_000_000  # of about 40 bytes: more would fill the memory of most machines
MAX_TURN_DEG = 3600.0
VALUES = ("x", "y", "angle", "speed")  # of a road user in a step
INVALID = -(2.0**30)  # what SUMO writes for a value that it does not know


class VehicleRows(NamedTuple):
    """What a file says of its vehicles between two times, in the order of the file. A *vehicle* of
    these columns is any road user, persons on foot, too; where they do not count it is said.

    ``times_s`` are the steps (n,) and ``step``, ``vehicle``, ``x_m``, ``y_m``, ``angle_deg`` have
    one value for each vehicle and step: the front bumper, of a person the middle, and the heading
    clockwise from north. ``ids``, ``types`` and ``is_person`` have one for each vehicle.
    ``begin_s`` is when the simulation begins, ``report`` tells what was read.
    """

    begin_s: float
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


@dataclass
class _Step:
    """A time step: the numbers of the road users that are there, and the ``VALUES`` of each, one
    after the other; how many of them are ``vehicles``, not persons. ``where`` begins errors.
    """

    where: str
    time_s: float
    numbers: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))
    vehicles: int = 0
    invalid: int = 0


class _Reader:
    """Takes what a file holds, one element after the other: ``_finished`` are the steps that
    nobody has had yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.numbers: dict[tuple[str, bool], int] = {}  # by id and whether a person
        self.types: list[str] = []
        self._finished: list[_Step] = []
        self.first_s = math.inf  # of the steps that came: none yet
        self._step: _Step | None = None
        self._there: set[int] = set()  # in this step
        self._parser = expat.ParserCreate()
        self._parser.StartDoctypeDeclHandler = self._doctype
        self._parser.StartElementHandler = self._root

    def steps(self, file: IO[bytes]) -> Iterator[_Step]:
        """The steps of a file. An error is only raised behind the steps before it: who needs none
        that is behind it never meets it.
        """
        chunk, problem = b" ", None
        while chunk and not problem:
            chunk = file.read(CHUNK_BYTES)
            problem = self._problem(chunk)
            yield from self._finished
            self._finished.clear()
        if problem:
            raise problem

    def _problem(self, chunk: bytes) -> UserError | None:
        """Takes the next bytes of the file, at its end none; tells what is wrong with them."""
        try:
            self._parser.Parse(chunk, not chunk)
        except expat.ExpatError as error:
            text = f"{self.path}: not XML: {one_line(str(error))}"
            return UserError(f"{text}; SUMO's --fcd-output NAME.xml is")
        except UserError as error:
            return error
        return None

    @property
    def where(self) -> str:
        """The line that is being read, as errors begin."""
        return f"{self.path}: line {self._parser.CurrentLineNumber}"

    def _doctype(self, *_: object) -> None:
        """One could define entities without end; SUMO writes none."""
        raise self.error("has a document type; floating-car data of SUMO have none")

    def _root(self, name: str, attributes: dict[str, str]) -> None:
        if name != "fcd-export":
            raise self.error(f"<{name[:40]}> is no floating-car data of SUMO, <fcd-export> is")
        self._parser.StartElementHandler = self._element
        self._parser.EndElementHandler = self._end

    def _element(self, name: str, attributes: dict[str, str]) -> None:
        if name == "vehicle":
            self._add(attributes, is_person=False)
        elif name == "timestep":
            self._begin(self._number(attributes, "timestep", "time", MAX_TIME_S))
        elif name == "person" and not attributes.get("vehicle"):  # not one who rides
            self._add({"angle": "0", **attributes}, is_person=True)

    def error(self, text: str) -> UserError:
        return UserError(f"{self.where}: {text}")

    def _begin(self, time_s: float) -> None:
        """A time step begins."""
        if self._step is not None:
            raise self.error("timestep: is within another")
        self._step = _Step(self.where, time_s)
        self.first_s = min(self.first_s, time_s)
        self._there.clear()

    def _end(self, name: str) -> None:
        """An element is over, such as the time step."""
        if name == "timestep" and self._step is not None:
            self._finished.append(self._step)
            self._step = None

    def _add(self, attributes: Mapping[str, str], is_person: bool) -> None:
        """A road user of this step, by its attributes."""
        if self._step is None:
            return
        what, name = "person" if is_person else "vehicle", attributes.get("id")
        if name is None:
            raise self.error(f"{what}: attribute 'id' is missing")
        x_m = y_m = angle_deg = math.nan
        with contextlib.suppress(KeyError, ValueError):
            x_m, y_m = float(attributes["x"]), float(attributes["y"])
            angle_deg = float(attributes["angle"])
        if not (abs(x_m) <= MAX_M and abs(y_m) <= MAX_M and abs(angle_deg) <= MAX_TURN_DEG):
            if INVALID in (x_m, y_m, angle_deg):
                self._step.invalid += 1
                return
            for key, most in (("x", MAX_M), ("y", MAX_M), ("angle", MAX_TURN_DEG)):
                self._number(attributes, f"{what} {short_repr(name)}", key, most)
        number = self.numbers.setdefault((name, is_person), len(self.types))
        if number == len(self.types):
            self.types.append("" if is_person else attributes.get("type", ""))
        elif number in self._there:
            raise self.error(f"{what}: id {short_repr(name)} is twice in one time step")
        self._there.add(number)
        self._step.numbers.append(number)
        self._step.vehicles += not is_person
        self._step.values.extend((x_m, y_m, angle_deg, _speed(attributes.get("speed", "nan"))))

    def _number(self, attributes: Mapping[str, str], what: str, name: str, most: float) -> float:
        """An attribute that is a number up to ``most``. Raises UserError."""
        if attributes.get(name) is None:
            raise self.error(f"{what}: attribute {name!r} is missing")
        text = attributes[name]
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not abs(number) <= most:
            limit = f" up to {most:,.0f}" if math.isfinite(number) else ""
            raise self.error(f"{what}: {name}: must be a number{limit}, not {short_repr(text)}")
        return number


def _speed(text: str) -> float:
    """The attribute ``speed`` [m/s]; not a number where there is none that is one."""
    try:
        speed_mps = float(text)
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
    check_is_file(path)
    reader = _Reader(path)
    with (
        as_user_error(f"{path}: cannot be read", OSError, EOFError, zlib.error),
        gzip.open(path) if is_gzip(path) else path.open("rb") as file,
    ):
        in_file = reader.steps(cast(IO[bytes], file))
        steps = _wanted(reader, in_file, begin_s, duration_s)
    report = ImportReport(path, accept, "perception.accept: true")
    if begin_s is None:
        begin_s = steps[0].time_s
        begins = list(dict.fromkeys(map(time_text, (begin_s, reader.first_s))))
        report.choose("begin", begins[0], begins, "perception.begin")
    counts = [len(step.numbers) for step in steps]
    numbers = np.concatenate([step.numbers for step in steps]).astype(np.int64)
    values = np.concatenate([step.values for step in steps]).reshape(-1, len(VALUES))
    step_of = np.repeat(np.arange(len(steps)), counts)
    if len(steps) > 1 and steps[-1].time_s >= begin_s + duration_s:
        # The last step tells where vehicles go that were there before; others come too late.
        before = len(numbers) - counts[-1]
        is_wanted = np.isin(numbers, numbers[:before])
        numbers, values, step_of = numbers[is_wanted], values[is_wanted], step_of[is_wanted]
    vehicle, known = pd.factorize(numbers)  # in the order in which they come
    names = list(reader.numbers)
    rows = VehicleRows(
        begin_s=begin_s,
        times_s=np.array([step.time_s for step in steps]),
        ids=[names[number][0] for number in known],
        types=[reader.types[number] for number in known],
        is_person=[names[number][1] for number in known],
        step=step_of,
        vehicle=vehicle,
        x_m=values[:, 0].copy(),
        y_m=values[:, 1].copy(),
        angle_deg=values[:, 2].copy(),
        report=report,
    )
    report.check_dropped(
        "rows",
        len(rows.step),
        len(rows.step) + sum(step.invalid for step in steps),
        f"a place of {INVALID:.0f}, SUMO's mark of none",
    )
    tell(rows, duration_s)
    compare_ways(rows, speeds_mps=values[:, 3])
    return rows


def _wanted(
    reader: _Reader, steps: Iterable[_Step], begin_s: float | None, duration_s: float
) -> list[_Step]:
    """One step at or before the beginning, those after it, and one at or after the end, which tells
    where the vehicles go that were there before. Raises UserError if there is no vehicle.
    """
    wanted: list[_Step] = []
    earlier_s, vehicles, rows = -math.inf, 0, 0
    for step in steps:
        if step.time_s <= earlier_s:
            raise UserError(
                f"{step.where}: timestep: time {step.time_s:.15g} does not follow {earlier_s:.15g}"
            )
        earlier_s = step.time_s
        if begin_s is None or (wanted and step.time_s <= begin_s):
            wanted, vehicles, rows = [], 0, 0
        is_over = False
        if begin_s is not None:
            end_s = begin_s + duration_s
            is_over = step.time_s >= end_s
            if is_over and step.vehicles and not vehicles:
                span = f"from {time_text(begin_s)} to {time_text(end_s)}"
                raise UserError(
                    f"{reader.path}: has no vehicles {span}; the first one comes at "
                    f"{time_text(step.time_s)}: set 'begin' or 'duration'"
                )
        wanted.append(step)
        if is_over and vehicles:
            break
        vehicles += step.vehicles
        rows += len(step.numbers)
        if begin_s is None and vehicles:
            begin_s = step.time_s
        if rows > MAX_ROWS:
            raise UserError(
                f"{step.where}: more than {MAX_ROWS:,} vehicles and steps; shorten 'duration'"
            )
    if not wanted:
        raise UserError(f"{reader.path}: has no time steps")
    last_s = wanted[-1].time_s
    if begin_s is not None and begin_s > last_s:
        raise UserError(
            f"{reader.path}: begin: {time_text(begin_s)} is after the last time step, "
            f"{time_text(last_s)}"
        )
    if not vehicles:
        from_s = reader.first_s if begin_s is None else begin_s
        raise UserError(f"{reader.path}: has no vehicles from {time_text(from_s)} on")
    return wanted
