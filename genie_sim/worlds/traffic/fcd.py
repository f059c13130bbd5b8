"""Reads floating-car data of SUMO: where every vehicle is at every time step.

The file is ``<fcd-export>`` with a ``<timestep time>`` for each step and in it a ``<vehicle id x y
angle type>`` for each vehicle, plain or compressed by gzip. It is read as a stream, and no further
than the last step that is wanted.
"""

import gzip
import math
import zlib
from array import array
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple, cast
from xml.parsers import expat

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.text import one_line
from genie_sim.core.geometry import Array
from genie_sim.data.world_table import MAX_M

CHUNK_BYTES = 1 << 20
MAX_ROWS = 50_000_000  # of about 40 bytes: more would fill the memory of most machines
GZIP = b"\x1f\x8b"
UNKNOWN_TYPE = ""  # of a vehicle without the attribute

Ints = np.ndarray[Any, np.dtype[np.int64]]


class VehicleRows(NamedTuple):
    """What a file says of its vehicles between two times, in the order of the file.

    ``times_s`` are the steps (n,) and ``step``, ``vehicle``, ``x_m``, ``y_m``, ``angle_deg`` have
    one value for each vehicle and step: the front bumper, and the heading clockwise from north.
    ``ids`` and ``types`` are those of the vehicles; ``persons`` counts other road users.
    """

    times_s: Array
    ids: list[str]
    types: list[str]
    step: Ints
    vehicle: Ints
    x_m: Array
    y_m: Array
    angle_deg: Array
    persons: int


class _Enough(Exception):
    """All that is wanted has been read."""


@dataclass
class _Content:
    """What has been read so far; its methods are called by the parser."""

    path: Path
    begin_s: float | None
    duration_s: float
    parser: "expat.XMLParserType"
    times_s: list[float] = field(default_factory=list)
    numbers: dict[str, int] = field(default_factory=dict)  # of vehicles, by id
    types: list[str] = field(default_factory=list)
    step: "array[int]" = field(default_factory=lambda: array("q"))
    vehicle: "array[int]" = field(default_factory=lambda: array("q"))
    x_m: "array[float]" = field(default_factory=lambda: array("d"))
    y_m: "array[float]" = field(default_factory=lambda: array("d"))
    angle_deg: "array[float]" = field(default_factory=lambda: array("d"))
    persons: int = 0
    earlier_s: float = -math.inf  # the step before, wanted or not
    seen: set[int] = field(default_factory=set)  # vehicles of this step
    is_root: bool = True
    wanted: bool = False

    def error(self, text: str) -> UserError:
        """The error of the line where the parser is."""
        return UserError(f"{self.path}: line {self.parser.CurrentLineNumber}: {text}")

    def doctype(self, *_: object) -> None:
        """A document type could define entities without end; SUMO writes none."""
        raise self.error("has a document type; floating-car data of SUMO have none")

    def element(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        if name == "vehicle":
            if self.wanted:
                self._vehicle(attributes)
        elif name == "timestep":
            self._timestep(attributes)
        elif name in ("person", "container"):
            self.persons += self.wanted
        elif self.is_root and name != "fcd-export":
            raise self.error(f"<{name[:40]}> is no floating-car data of SUMO, <fcd-export> is")
        self.is_root = False

    def _timestep(self, attributes: dict[str, str]) -> None:
        time_s = self._number(attributes, "timestep", "time")
        if time_s <= self.earlier_s:
            raise self.error(f"timestep: time {time_s:g} does not follow {self.earlier_s:g}")
        self.earlier_s = time_s
        if self.begin_s is None:
            self.begin_s = time_s
        # One step before the beginning and one after the end, for places in between.
        if self.times_s and self.times_s[-1] >= self.begin_s + self.duration_s:
            raise _Enough
        if time_s <= self.begin_s and self.times_s:
            self._clear()
        self.wanted = True
        self.seen.clear()
        self.times_s.append(time_s)

    def _clear(self) -> None:
        """Forgets a step that another one before the beginning follows."""
        for column in (self.times_s, self.types, self.numbers):
            column.clear()
        for values in (self.step, self.vehicle, self.x_m, self.y_m, self.angle_deg):
            del values[:]
        self.persons = 0

    def _vehicle(self, attributes: dict[str, str]) -> None:
        try:
            name = attributes["id"]
            x_m, y_m = float(attributes["x"]), float(attributes["y"])
            angle_deg = float(attributes["angle"])
        except (KeyError, ValueError):
            raise self._wrong(attributes) from None
        if not (abs(x_m) <= MAX_M and abs(y_m) <= MAX_M and abs(angle_deg) <= MAX_M):
            raise self._wrong(attributes)
        number = self.numbers.setdefault(name, len(self.numbers))
        if number == len(self.types):
            self.types.append(attributes.get("type", UNKNOWN_TYPE))
        if number in self.seen:
            raise self.error(f"vehicle: id {short_repr(name)} is twice in one time step")
        self.seen.add(number)
        self.step.append(len(self.times_s) - 1)
        self.vehicle.append(number)
        self.x_m.append(x_m)
        self.y_m.append(y_m)
        self.angle_deg.append(angle_deg)
        if len(self.step) > MAX_ROWS:
            raise self.error(f"more than {MAX_ROWS:,} vehicles and steps; shorten 'duration'")

    def _wrong(self, attributes: dict[str, str]) -> UserError:
        """What is wrong with a vehicle."""
        if "id" not in attributes:
            return self.error("vehicle: attribute 'id' is missing")
        what = f"vehicle {short_repr(attributes['id'])}"
        try:
            for name in ("x", "y", "angle"):
                self._number(attributes, what, name)
        except UserError as error:
            return error
        raise AssertionError("no attribute is wrong")

    def _number(self, attributes: dict[str, str], what: str, name: str) -> float:
        if name not in attributes:
            raise self.error(f"{what}: attribute {name!r} is missing")
        text = attributes[name]
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not abs(number) <= MAX_M:
            raise self.error(f"{what}: {name}: must be a number, not {short_repr(text)}")
        return number


def read_fcd(path: Path, begin_s: float | None, duration_s: float) -> VehicleRows:
    """The rows of a file from the last step at or before ``begin_s`` (``None``: from the first one)
    to the first at or after the end.

    Raises UserError, naming file, line and attribute, for a file that is not such data, and for
    times that it does not have.
    """
    parser = expat.ParserCreate()
    content = _Content(path, begin_s, duration_s, parser)
    parser.StartElementHandler = content.element
    parser.StartDoctypeDeclHandler = content.doctype
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    broken = as_user_error(f"{path}: cannot be read", OSError, EOFError, zlib.error)
    with ExitStack() as stack:
        stack.enter_context(broken)
        file = _opened(path, stack)
        try:
            while chunk := file.read(CHUNK_BYTES):
                parser.Parse(chunk)
            parser.Parse(b"", True)
        except _Enough:
            pass
        except expat.ExpatError as error:
            raise UserError(f"{path}: not XML: {one_line(str(error))}") from error
    return _rows(content)


def _opened(path: Path, stack: ExitStack) -> IO[bytes]:
    file: IO[bytes] = stack.enter_context(path.open("rb"))
    is_compressed = file.read(len(GZIP)) == GZIP
    file.seek(0)
    if is_compressed:
        return cast(IO[bytes], stack.enter_context(gzip.open(file)))
    return file


def _rows(content: _Content) -> VehicleRows:
    """What was read, as columns. Raises UserError if that is nothing."""
    path, times_s = content.path, content.times_s
    if content.begin_s is None:
        raise UserError(f"{path}: has no time steps")
    if content.begin_s > times_s[-1]:
        raise UserError(
            f"{path}: begin: {content.begin_s:g} s is after the last time step, {times_s[-1]:g} s"
        )
    if not content.types:
        raise UserError(f"{path}: has no vehicles from {content.begin_s:g} s on")
    return VehicleRows(
        times_s=np.array(times_s),
        ids=list(content.numbers),
        types=content.types,
        step=np.array(content.step),
        vehicle=np.array(content.vehicle),
        x_m=np.array(content.x_m),
        y_m=np.array(content.y_m),
        angle_deg=np.array(content.angle_deg),
        persons=content.persons,
    )
