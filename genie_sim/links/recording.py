"""Recorded links: rates and round trips over time, in a Parquet file."""

import functools
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base import files, parquet
from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import remembered, sha256_of
from genie_sim.base.units import NS_PER_S

if TYPE_CHECKING:
    import pyarrow as pa

WHOLE_COLUMNS = ("up_bps", "down_bps", "rtt_ns")
TOLD = {  # in the report of an import
    "up_bps": ("Mbit/s", 1e-6),
    "down_bps": ("Mbit/s", 1e-6),
    "rtt_ns": ("ms", 1e-6),
}
# The largest rate and the longest round trip of a link are in between,
POSSIBLE = {"Mbit/s": (0.001, 100_000.0), "ms": (0.05, 600_000.0)}
# and those of what drives, by radio, the median round trip, in between these.
USUAL = {"Mbit/s": (0.2, 2_500.0), "ms": (1.0, 2_000.0)}
COLUMNS = ("t_ns", *WHOLE_COLUMNS)  # all that there may be
LONG_PERIOD_S = 60.0  # from one measurement of a link to the next
MAX_WHOLE = 2**63 - 1


@dataclass(frozen=True)
class StepFunction:
    """A quantity that keeps its value from one row to the next.

    ``t_ns`` begins at 0. The last value lasts as long as the one before; after that the recording
    begins again if ``loops``, or else the last value stays.
    """

    t_ns: Sequence[int]
    values: Sequence[int]
    loops: bool

    @functools.cached_property
    def period_ns(self) -> int:
        """How long the recording lasts."""
        if len(self.t_ns) == 1:
            return NS_PER_S
        return 2 * self.t_ns[-1] - self.t_ns[-2]

    @functools.cached_property
    def _sums(self) -> list[int]:
        """The integral of the values until each row, and until the end."""
        lengths = (end - begin for begin, end in pairwise([*self.t_ns, self.period_ns]))
        parts = (value * length for value, length in zip(self.values, lengths, strict=True))
        return list(accumulate(parts, initial=0))

    def at(self, t_ns: int) -> int:
        """The value at a time."""
        t_ns = t_ns % self.period_ns if self.loops else t_ns
        return self.values[bisect_right(self.t_ns, t_ns) - 1]

    def time_ns(self, begin_ns: int, amount: int) -> int:
        """How long it takes from ``begin_ns`` until the integral of the values is ``amount``."""
        if amount == 0:
            return 0
        laps, begin_ns = divmod(begin_ns, self.period_ns) if self.loops else (0, begin_ns)
        row = bisect_right(self.t_ns, begin_ns) - 1
        target = self._sums[row] + self.values[row] * (begin_ns - self.t_ns[row]) + amount
        if not self.loops and target > self._sums[-2]:
            row = len(self.t_ns) - 1
            return self.t_ns[row] - begin_ns - (self._sums[row] - target) // self.values[row]
        laps, target = divmod(target - 1, self._sums[-1])
        target += 1
        row = bisect_left(self._sums, target) - 1
        end_ns = self.t_ns[row] - (self._sums[row] - target) // self.values[row]
        return laps * self.period_ns + end_ns - begin_ns


@dataclass(frozen=True)
class LinkRecording:
    """A recorded link: its columns by name, of equal length. ``t_ns`` begins at 0."""

    path: Path
    columns: Mapping[str, Sequence[int]]
    digest: str
    about: Mapping[str, Any] = field(compare=False)

    def steps(self, column: str, loops: bool) -> StepFunction:
        """A column over time. Raises ``UserError`` if there is none."""
        self.check(column)
        values = self.columns[column]
        if column != "rtt_ns" and not loops and values[-1] == 0:
            text = "ends with a rate of 0, so that nothing would ever get through; use 'loop: true'"
            raise UserError(f"{self.path}: column {column}: {text}")
        return StepFunction(self.columns["t_ns"], values, loops)

    def check(self, *columns: str) -> None:
        """Raises ``UserError`` unless there are these columns."""
        for column in columns:
            if column not in self.columns:
                names = ", ".join(self.columns)
                raise UserError(f"{self.path}: column {column}: missing; it has {names}")


def find(name: str) -> Path:
    """The file of a recording, by name or path. Raises ``UserError``."""
    return files.find(files.LINK_RECORDING, name)


def read(name: str) -> LinkRecording:
    """A recording by name or path. Raises ``UserError``."""
    return _read(find(name))


@remembered
def _read(path: Path) -> LinkRecording:
    def checked(file_schema: "pa.Schema", _: Mapping[str, Any]) -> Sequence[str]:
        for column in file_schema:
            if column.name not in COLUMNS:
                choices = ", ".join(COLUMNS)
                raise UserError(f"{path}: column {column.name}: unknown; known: {choices}")
            if str(column.type) != "int64":
                raise UserError(f"{path}: column {column.name}: must be of type int64")
        return list(file_schema.names)

    table, about = parquet.read(path, "recorded link", checked)
    columns = table.to_pydict()
    check(str(path), columns)
    digest = sha256_of(path)
    begin_ns = columns["t_ns"][0]
    columns["t_ns"] = [t_ns - begin_ns for t_ns in columns["t_ns"]]
    return LinkRecording(path, columns, digest, about)


def check(where: str, columns: Mapping[str, Sequence[int]]) -> None:
    """Raises ``UserError`` unless the columns are those of a recorded link."""
    if "t_ns" not in columns:
        raise UserError(f"{where}: column t_ns: missing")
    if not any(name in columns for name in WHOLE_COLUMNS):
        raise UserError(f"{where}: needs a column of {', '.join(WHOLE_COLUMNS)}")
    if not columns["t_ns"]:
        raise UserError(f"{where}: has no rows")
    for name, values in columns.items():
        for row, value in enumerate(values):
            if value is None or (name in WHOLE_COLUMNS and value < 0):
                text = "is unknown" if value is None else f"is {value}"
                raise UserError(f"{where}: column {name}: row {row} {text}; must be 0 or more")
            if abs(value) > MAX_WHOLE:
                text = f"is {value:.3g}; must be below {MAX_WHOLE:.2g}"
                raise UserError(f"{where}: column {name}: row {row} {text}")
        if name.endswith("_bps") and not any(values):
            raise UserError(
                f"{where}: column {name}: no rate is above 0: nothing would get through"
            )
    for row, (before, t_ns) in enumerate(pairwise(columns["t_ns"]), 1):
        if t_ns <= before:
            text = f"row {row} ({t_ns} ns) is not after the row before ({before} ns)"
            raise UserError(f"{where}: column t_ns: {text}")


def tell(report: ImportReport, columns: Mapping[str, Sequence[int]]) -> None:
    """The ranges and the gaps of a recorded link, for the report of its import."""
    times_s = [(t_ns - columns["t_ns"][0]) / NS_PER_S for t_ns in columns["t_ns"]]
    report.read("rows", len(times_s))
    if len(times_s) == 1:
        report.warn("one row alone: its values hold all the time")
    for name, (unit, factor) in TOLD.items():
        if name in columns:
            values = [value * factor for value in columns[name]]
            what = name.partition("_")[0]
            report.span(what, (min(values), max(values)), unit)
            low, high = POSSIBLE[unit]
            if not low <= max(values) <= high:
                report.refuse(
                    f"{what}: at most {max(values):.4g} {unit}, which no link has (from {low:g} to "
                    f"{high:g} {unit}): is it in another unit?"
                )
            middle = max(values) if unit == "Mbit/s" else sorted(values)[len(values) // 2]
            which = "at most" if unit == "Mbit/s" else "a median of"
            report.warn_unusual(f"{what}: {which}", middle, unit, USUAL[unit], "of a radio link")
            report.warn_sentinels(what, values, unit)
    report.check_times("times", times_s, "values hold until the next one", LONG_PERIOD_S)


def write(path: Path, columns: Mapping[str, Sequence[int]], about: Mapping[str, Any]) -> None:
    """Writes a recording. Raises ``UserError``."""
    import pyarrow as pa

    check(str(path), columns)
    schema = pa.schema([pa.field(name, pa.int64(), nullable=False) for name in columns])
    rows: Iterable[tuple[Any, ...]] = zip(*columns.values(), strict=True)
    parquet.write(path, schema, (dict(zip(columns, row, strict=True)) for row in rows), about)
