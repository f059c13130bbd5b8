"""What a metric is: a class with its title, its unit, its meaning and its formula.

A formula is given a *view*: the rows of one method in one place, such as its frames, or what its
Genies on cars were asked. ``registry.MODULES`` lists the modules of metrics.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.result_table import Cell
from genie_sim.analysis.statistics import Blocks, Measured, ratio
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.plugins import is_own, own_fault
from genie_sim.record.columns import Columns
from genie_sim.record.results import MetricValue

DEADLINE_MS = 33.0  # Section V-B of the paper: 30 frames per second
RECENT_MS = 100.0  # a look is recent that is no older: the time between two frames of a camera
RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
WINDOW_REQUESTS = 50  # of which the paper's error bars of reuse are made
ZERO_DELAY = "zero_delay"  # as a component: of the detector's own answers without any delay
LOWER, HIGHER = "lower", "higher"
WINDOWS, POWERS = "a", "b"  # marks of intervals that are no 95 % intervals
MARKS = {
    WINDOWS: f"lowest and highest ratio of any {WINDOW_REQUESTS} requests in a row of any Genie",
    POWERS: "with every power at the lower and at the upper end of its range",
}


class Where(NamedTuple):
    """Where a number is of: a method, a placement and a component (see ``MetricValue``)."""

    method: str
    placement: str = "all"
    component: str = ""


class Metric:
    """A metric. Unless it has a ``meaning``, its docstring is that."""

    meaning: str
    """What it measures, in one sentence that people read."""

    title: str
    """Its name, the same wherever it is shown."""

    unit: str = "%"
    """As it is shown: ``%`` for shares, which are from 0 to 1 in files; empty without a unit."""

    better: str = ""
    """``lower`` or ``higher``; empty where neither is better."""

    section: str = ""
    """The table of ``summary.md`` that shows it; empty: none does."""

    reads: str = ""
    """The tables and columns that its formula reads: ``frames: stamp_ns, drop; held: right``."""

    mark: str = ""
    """What kind of interval it has, a key of ``MARKS``; empty for a 95 % interval."""

    view: type
    """What its formula is given."""

    def __init_subclass__(cls) -> None:
        if "meaning" not in vars(cls):
            cls.meaning = " ".join((cls.__doc__ or "").split())

    def of(self, view: Any) -> Measured | None:
        """Its number in a view; ``None`` where it has none there."""
        raise NotImplementedError

    @property
    def over_rows(self) -> "Ratio | None":
        """The same number as a ratio of sums over rows, where it is one: those of two methods have
        a paired difference inside one run.
        """
        return None

    def columns_read(self) -> dict[str, list[str]]:
        """What ``reads`` names, by table."""
        parts = (part.partition(":") for part in self.reads.split(";") if part)
        return {table.strip(): columns.replace(",", " ").split() for table, _, columns in parts}

    @property
    def label(self) -> str:
        """The title with the unit: ``first answer, mean [ms]``."""
        return self.labelled(self.title)

    def labelled(self, title: str) -> str:
        """Another title with its unit."""
        return f"{title} [{self.unit}]" if self.unit else title

    def titled(self, placement: str = "all", component: str = "") -> str:
        """The title of its number in one place: ``image reuse on cars``."""
        title = f"{self.title} {PLACEMENTS[placement]}" if placement in PLACEMENTS else self.title
        return f"{title}, {component}" if component else title

    @property
    def factor(self) -> int:
        """What a value in a file is multiplied with to be shown in the unit."""
        return 100 if self.unit == "%" else 1

    @property
    def unit_in_files(self) -> str:
        """Shares and plain numbers have the unit 1 there."""
        return "1" if self.unit in ("%", "") else self.unit

    def cell(
        self,
        value: float | None,
        low: float | None = None,
        high: float | None = None,
        sign: str = "",
    ) -> Cell:
        """A number as it is in files, in the unit that is shown; NaN is not defined."""
        value, low, high = (
            None if number is None or math.isnan(number) else self.factor * float(number)
            for number in (value, low, high)
        )
        return Cell(value, low, high, mark="" if low is None else self.mark, sign=sign)


class Rows:
    """Rows of a table of which some are chosen: those of one method, in one place.

    Parameters
    ----------
    table : Columns
        The whole table.
    chosen : array of bool
        Which rows.
    blocks : Blocks
        All rows by car and second.
    where : Where
        What the chosen rows are of.
    """

    def __init__(self, table: Columns, chosen: Any, blocks: Blocks, where: Where) -> None:
        self.table, self.chosen, self.blocks, self.where = table, chosen, blocks, where

    @property
    def rows(self) -> Columns:
        """The chosen rows."""
        return self.table.rows(self.chosen)


class Ratio(Metric):
    """A ratio of two sums over rows; of flags and counts a share, with Wilson's interval."""

    table: str
    """The table, which has the columns ``car`` and ``stamp_ns``."""

    only: Mapping[str, str] = MappingProxyType({})
    """The rows that count, by what is in a column."""

    @property
    def over_rows(self) -> "Ratio":
        return self

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        """What is above and below, a number for each of these rows."""
        raise NotImplementedError

    def counts(self, rows: Rows) -> Any:
        """Which rows of the whole table are chosen and count."""
        flags = rows.chosen
        for name, value in self.only.items():
            flags = flags & (rows.table[name] == value)
        return flags

    def of(self, view: Rows) -> Measured | None:
        counts = self.counts(view)
        if not counts.any():
            return None
        above, below = (np.where(counts, part, 0.0) for part in self.terms(view.table))
        is_share = self.unit == "%"
        return ratio(view.blocks, np.nan_to_num(above), np.nan_to_num(below), is_share)


Views = Iterable[tuple[Where, Any]]


def measured(metrics: Mapping[str, Metric], views: Views) -> Iterator[MetricValue]:
    """Every number of these metrics in these views, view by view."""
    by_view: dict[type, dict[str, Metric]] = {}
    for name, metric in metrics.items():
        by_view.setdefault(metric.view, {})[name] = metric
    for where, view in views:
        for name, metric in by_view.get(type(view), {}).items():
            number = _own_number(name, metric, view) if is_own(name) else metric.of(view)
            if number is not None:
                yield MetricValue(name, *where, unit=metric.unit_in_files, **number._asdict())


def _own_number(name: str, metric: Metric, view: Any) -> Measured | None:
    """The number of a metric of the user's own. Raises ``UserError`` for whatever goes wrong."""
    try:
        number = metric.of(view)
    except Exception as error:
        text = f"metric {name!r}: {type(error).__name__}: {short_repr(str(error))}"
        raise UserError(own_fault(error) or text) from error
    if number is not None and not isinstance(number, Measured):
        text = f"of() must return Measured or None, not {short_repr(number)}"
        raise UserError(f"metric {name!r}: {text}")
    return number


def average(values: Any) -> Measured:
    """The mean of some numbers, without an interval."""
    return Measured(float(np.mean(values)) if len(values) else None, n=len(values))


def quotient(above: float, below: float, n: int) -> Measured:
    """A ratio without an interval."""
    return Measured(above / below if below else None, n=n)
