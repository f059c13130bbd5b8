"""What a metric is: words, and an expression over rows.

A formula is given rows of one method in one place, such as its frames or what its Genies on cars
were asked (``Metric.kind`` says which), and returns a ``Sample``: what is above and below, row by
row. One place makes a number with its interval of that, and the difference of two methods is made
of the same rows. What has no interval is a plain ``Estimate``.
"""

import math
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.result_table import Cell
from genie_sim.analysis.statistics import (
    Blocks,
    Estimate,
    around_mean,
    percentile,
    ratio,
    rows_needed,
)
from genie_sim.analysis.style import PLACEMENTS
from genie_sim.record.columns import Columns, joined

DEADLINE_MS = 33.0  # Section V-B of the paper: 30 frames per second
RECENT_MS = 100.0  # a look is recent that is no older: the time between two frames of a camera
RIGHT_F1 = 0.8  # a cache hit below it is a wrong hit
LOWER, HIGHER = "lower", "higher"
HEADLINE, SHORT, MAIN, REST = range(4)  # tiers

MethodTables = Mapping[str, Columns]  # of one method, by name


def of_method(tables: MethodTables, method: str) -> dict[str, Columns]:
    """Those rows of each table that are of one method; no tables without any."""
    of_one = {name: table.where(method=method) for name, table in tables.items() if len(table)}
    return {name: table for name, table in of_one.items() if len(table)}


class Given(NamedTuple):
    """What a formula is given: rows of this kind, in a placement and of a component."""

    kind: str
    rows: Any
    placement: str = "all"
    component: str = ""


class Sample(NamedTuple):
    """A number that is made of rows.

    Parameters
    ----------
    rows : Columns
        The rows, with the columns ``car`` and ``stamp_ns``.
    above, below : array
        A number or a flag for each row. The number is the sum above over the sum below: a mean, or
        a share.
    percent : int
        If not 0, the number is this percentile of what is above in the rows with a flag below.
    """

    rows: Columns
    above: Any
    below: Any
    percent: int = 0

    def estimate(self, is_share: bool, intervals: bool = True) -> Estimate:
        """The number with its 95 % interval, over blocks of one second of each car."""
        if not len(self.rows) or not np.any(self.below):
            return Estimate(None)
        blocks = blocks_of(self.rows) if intervals else None
        if self.percent:
            values = np.where(self.below, self.above, np.nan)
            return percentile(blocks, values, self.percent)
        return ratio(blocks, *self.terms, is_share)

    @property
    def terms(self) -> tuple[Any, Any]:
        """What is above and below, as numbers; 0 where it is not known."""
        return _numbers(self.above), _numbers(self.below)


def _numbers(values: Any) -> Any:
    return np.nan_to_num(np.asarray(values, dtype=float))


_blocks: "weakref.WeakKeyDictionary[Columns, Blocks]" = weakref.WeakKeyDictionary()


def blocks_of(rows: Columns) -> Blocks:
    """These rows by car and second."""
    if rows not in _blocks:
        _blocks[rows] = Blocks(rows["car"], rows["stamp_ns"])
    return _blocks[rows]


def half_of_pair(
    samples: Sequence[Sample], slopes: Sequence[float] = (1, -1)
) -> tuple[float | None, int]:
    """Half the 95 % interval of what changes by these slopes with two ratios, by default their
    difference, and the number of blocks. The blocks of both are paired.
    """
    rows = [sample.rows for sample in samples]
    cars = joined([of_sample["car"] for of_sample in rows])
    blocks = Blocks(cars, np.concatenate([of_sample["stamp_ns"] for of_sample in rows]))
    moves: Any = 0.0
    for place, slope in enumerate(slopes):
        terms = zip(*(sample.terms for sample in samples), strict=True)
        above, below = (
            np.concatenate([part * (number == place) for number, part in enumerate(parts)])
            for parts in terms
        )
        moves = moves + slope * blocks.influence(above, below)
    return blocks.half_width(moves), len(moves)


def mean_of(rows: Columns, values: Any, percent: int = 0) -> Sample:
    """The mean, or a percentile, of the values that are not NaN."""
    return Sample(rows, np.nan_to_num(values), ~np.isnan(values), percent)


def share_of(rows: Columns, flags: Any) -> Sample:
    """The share of all these rows that have the flag."""
    return Sample(rows, flags, np.ones(len(rows)))


def quotient(above: float, below: float) -> Estimate:
    """A ratio without an interval."""
    return Estimate(above / below if below else None, n=int(below))


def average(values: Any) -> Estimate:
    """The mean of some numbers, without an interval."""
    return Estimate(float(np.mean(values)) if len(values) else None, n=len(values))


Formula = Callable[[Any], Sample | Estimate | None]


@dataclass(frozen=True)
class Metric:
    """A metric.

    Parameters
    ----------
    title : str
        Its name, the same wherever it is shown.
    unit : str
        As it is shown: ``%`` for shares, which are from 0 to 1 in files; empty without a unit.
    better : str
        ``lower`` or ``higher``; empty where neither is better.
    section : str
        The table of ``summary.md`` that shows it; empty: none does.
    meaning : str
        What it measures, in one sentence that people read.
    formula : callable
        Returns its number of some rows: a ``Sample``, or an ``Estimate`` without an interval;
        ``None`` where it has none there.
    kind : str
        What the formula is given, one of ``metrics.KINDS``: ``frames``, ``lookups`` and so on.
    tier : int
        Where it is shown: ``HEADLINE`` in sentences, ``SHORT`` on a terminal after a run and in
        figures for papers, ``MAIN`` in tables and comparisons, ``REST`` in ``summary.md`` and
        wherever it is asked for; each also where the later ones are.
    is_signed : bool
        Whether it may be below zero although it has a unit.
    needs : int
        Over how many rows each run's number must be for an interval over seeds.
    """

    title: str
    unit: str
    better: str = ""
    section: str = ""
    meaning: str = ""
    formula: Formula = lambda _: None
    kind: str = "frames"
    tier: int = REST
    is_signed: bool = False
    needs: int = 0

    def of(self, rows: Any, intervals: bool = True) -> Estimate | None:
        """Its number of some rows; ``None`` where it has none there."""
        result = self.formula(rows)
        if not isinstance(result, Sample):
            return result
        number = result.estimate(self.unit == "%", intervals)
        low, high = self.cut(number.value, number.low, number.high)
        return number._replace(low=low, high=high)

    def over_seeds(
        self, mean: float, spread: float, seeds: int, *, rows: float | None, is_cut: bool = True
    ) -> tuple[float | None, float | None]:
        """The ends of the interval of its mean over seeds (``statistics.around_mean``), within what
        is possible unless the mean is one of differences; none where a run's number is over fewer
        than ``needs`` rows. Those of the run with the fewest are ``rows``; None or NaN is
        not known.
        """
        if rows is not None and rows < self.needs:
            return None, None
        low, high = around_mean(mean, spread, seeds)
        return self.cut(mean, low, high) if is_cut else (low, high)

    def cut(
        self, value: float | None, low: float | None, high: float | None
    ) -> tuple[float | None, float | None]:
        """The ends of an interval, within what is possible: no time, share or count is below zero,
        no share above 1. What has no unit, or is beyond a bound itself, is not cut there.
        """
        if value is None or low is None or high is None or value < 0 or self.is_signed:
            return low, high
        low = max(low, 0.0) if self.unit else low
        return low, min(high, 1.0) if self.unit == "%" and value <= 1 else high

    @property
    def label(self) -> str:
        """The title with the unit: ``first answer, mean [ms]``."""
        return self.labelled(self.title)

    def labelled(self, title: str) -> str:
        """Another title with its unit."""
        return f"{title} [{self.unit}]" if self.unit else title

    def titled(self, placement: str = "all", component: str = "") -> str:
        """The title of its number in one place: ``image reuse on cars``, ``utilization, edge1``."""
        if component:
            return f"{self.title}, {component}"
        return f"{self.title} {PLACEMENTS[placement]}" if placement in PLACEMENTS else self.title

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
        return Cell(value, low, high, sign=sign)


# How the title ends, how the meaning begins, and the percentile.
STATISTICS = {
    "mean": ("mean", "Mean time", 0),
    "p50": ("median", "Median time", 50),
    "p95": ("p95", "95th percentile of the time", 95),
    "p99": ("p99", "99th percentile of the time", 99),
}


def times(
    title: str,
    span: str,
    times_ms: Callable[[Columns], Any],
    tiers: Mapping[str, int],
    **words: Any,
) -> Iterator[tuple[str, Metric]]:
    """The statistics of a time of rows, by how their names end; ``tiers`` says which there are, and
    ``span`` from when to when the time is.
    """
    for statistic, tier in tiers.items():
        ending, begin, percent = STATISTICS[statistic]

        def formula(rows: Columns, percent: int = percent) -> Sample:
            return mean_of(rows, times_ms(rows), percent)

        title_of_all, meaning = f"{title}, {ending}", f"{begin} {span}"
        yield (
            statistic,
            Metric(
                title_of_all,
                "ms",
                LOWER,
                meaning=meaning,
                formula=formula,
                tier=tier,
                needs=rows_needed(percent) if percent else 0,
                **words,
            ),
        )
