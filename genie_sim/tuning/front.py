"""Dominance, and which designs cannot be told apart."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.statistics import over_seeds, wilson
from genie_sim.tuning.design import Case, Part

MIN_FINISHED = 10  # points, before any is given up

Table = np.ndarray[Any, np.dtype[np.float64]]


def dominates(one: Table, other: Table) -> Any:
    """Whether ``one`` is at least as good in every objective and better in some; for tables, row by
    row. Less is better.
    """
    return (one <= other).all(axis=-1) & (one < other).any(axis=-1)


def means(rows: Any) -> Table:
    """The mean over the cases. They are summed in their order, so that processors agree."""
    table = np.asarray(rows, dtype=float)
    total = np.zeros(table.shape[1])
    for row in table:
        total = total + row
    return total / len(table)


def is_hopeless(early: Table, finished: Sequence[Table]) -> bool:
    """Whether one finished point is better beyond doubt in some objective, while ``early`` is so in
    none.

    Beyond doubt is a mean difference, over the first cases, of more than two standard errors. The
    standard deviation is that of the finished points: what is left of their objectives without the
    means of points and cases, the median over points.

    Parameters
    ----------
    early : array
        A point's first cases by objectives, less is better.
    finished : sequence of array
        All cases by objectives of the points it is compared with.
    """
    cases = len(early)
    if len(finished) < MIN_FINISHED or finished[0].shape[0] < 2:
        return False
    table = np.array(finished)  # points by cases by objectives
    residual = table - table.mean(axis=1, keepdims=True) - table.mean(axis=0, keepdims=True)
    residual = residual + table.mean(axis=(0, 1), keepdims=True)
    deviation = np.median(residual.std(axis=1, ddof=1), axis=0)
    doubt = 2 * deviation * math.sqrt(2 / cases)
    worse = early.mean(axis=0) - table[:, :cases].mean(axis=1)
    return bool(((worse >= -doubt).all(axis=1) & (worse > doubt).any(axis=1)).any())


class Interval(NamedTuple):
    """A mean with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def sign(self) -> int:
        """1 or -1 where the interval lies above or below zero, else 0."""
        return (self.low > 0) - (self.high < 0)


def interval(values: Table, is_share: bool = False) -> Interval:
    """Mean and 95 % t interval, to ten digits; of a share Wilson's, which stays within 0 and 1."""
    mean, half = over_seeds(values)
    low, high = wilson(mean, half) if is_share else (mean - half, mean + half)
    return Interval(*(float(f"{number:.10g}") for number in (mean, low, high)))


def replicates(rows: Mapping[Case, Sequence[float]], part: Part) -> Table:
    """The numbers that intervals are of, replicates by targets: the means of each drive, or with
    one drive those of each seed.
    """
    by_drive = len(part.drives) > 1
    names = part.drives if by_drive else part.seeds
    return np.array(
        [
            means(
                [
                    row
                    for case, row in rows.items()
                    if (case.drive if by_drive else case.seed) == name
                ]
            )
            for name in names
        ]
    )


class Relation(NamedTuple):
    """How a design compares with another: paired differences of each target, this minus that."""

    differences: tuple[Interval, ...]
    signs: tuple[int, ...]  # 1: the target is made small, -1: large, of the objectives

    @property
    def _worse(self) -> list[int]:
        pairs = zip(self.differences, self.signs, strict=False)
        return [difference.sign * sign for difference, sign in pairs]

    @property
    def is_equal(self) -> bool:
        """Whether no objective tells the two apart."""
        return not any(self._worse)

    @property
    def is_dominated(self) -> bool:
        """Whether the other is better beyond doubt in some objective, and by its mean at least as
        good in all.
        """
        pairs = zip(self.differences, self.signs, strict=False)
        return 1 in self._worse and all(difference.value * sign >= 0 for difference, sign in pairs)


def relation(one: Table, other: Table, signs: Sequence[int]) -> Relation:
    """Compares two designs by their replicates, which are paired."""
    difference = one - other
    columns = range(difference.shape[1])
    return Relation(tuple(interval(difference[:, place]) for place in columns), tuple(signs))


def groups(equal: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """The first design of each group that cannot be told apart, for every design.

    Parameters
    ----------
    equal : mapping
        For each design, the best first, those it cannot be told apart from. The relation is not
        transitive: a design joins the first group whose first design it equals.
    """
    leaders: dict[str, str] = {}
    for name, others in equal.items():
        heads = [leader for member, leader in leaders.items() if member == leader]
        leaders[name] = next((leader for leader in heads if leader in others), name)
    return leaders
