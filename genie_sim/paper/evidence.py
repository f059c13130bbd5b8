"""What replicated runs say: means with 95 % intervals over seeds, and whether they match, exceed or order as claimed.

The unit of replication is drive x seed. Arms that are compared ran on the same drive and seed, so differences and
ratios are taken seed by seed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from genie_sim.paper.definitions import fact
from genie_sim.paper.facts import Facts

Values = np.ndarray[Any, np.dtype[np.float64]]  # one per seed
CONFIDENCE = 0.95
BASE = "base"  # the variant that is meant where none is named


@dataclass(frozen=True, slots=True)
class Finding:
    """One claim looked at. ``holds``: as claimed, in size. ``direction``: at least the way it was claimed.

    ``value`` is the number that the claim's test names, ``low`` and ``high`` its 95 % interval over ``n`` seeds.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int
    unit: str
    holds: bool
    direction: bool
    note: str = ""

    @property
    def known(self) -> bool:
        """Whether the runs had what the test needs."""
        return self.value is not None and not math.isnan(self.value)


class Evidence:
    """Facts of runs by (variant, scenario), one for each seed, in the same order everywhere. ``definitions``: of each
    metric, which one is meant by it, where it is not the default's."""

    def __init__(
        self, runs: Mapping[tuple[str, str], Sequence[Facts]], definitions: Mapping[str, str] | None = None
    ) -> None:
        self._runs = runs
        self._definitions = definitions or {}

    def of(self, scenario: str, name: str, variant: str = BASE) -> Values:
        """A fact's values over seeds. Raises ``KeyError`` where such a run was not made."""
        runs = self._runs[variant, scenario]
        meant = fact(name, self._definitions)
        return np.array([run.get(meant, math.nan) for run in runs], dtype=float)

    def names(self, scenario: str) -> list[str]:
        """The facts that any run of a scenario has, sorted."""
        return sorted({name for facts in self._runs[BASE, scenario] for name in facts})

    def mean_of(self, scenarios: Sequence[str], names: Sequence[str], variant: str = BASE) -> Values:
        """Mean over scenarios and facts, seed by seed; what is not defined is left out."""
        table = np.array([self.of(scenario, name, variant) for scenario in scenarios for name in names])
        known = ~np.isnan(table)
        counts = known.sum(axis=0)
        sums = np.where(known, table, 0.0).sum(axis=0)
        return np.where(counts > 0, sums / np.maximum(counts, 1), math.nan)

    def resampled(self, places: Sequence[int]) -> Evidence:
        """The evidence that other seeds could have given: the seeds at these places, some more than once."""
        runs = {key: [facts[place] for place in places if place < len(facts)] for key, facts in self._runs.items()}
        return Evidence(runs, self._definitions)

    @property
    def seeds(self) -> int:
        return max((len(facts) for (variant, _), facts in self._runs.items() if variant == BASE), default=0)


def interval(values: Values) -> tuple[float, float, float]:
    """Mean and 95 % t interval over seeds; without spread or with one seed it is a point."""
    from scipy.special import stdtrit

    mean, n = float(np.mean(values)), len(values)
    spread = float(np.std(values, ddof=1)) if n > 1 else 0.0
    half = float(stdtrit(n - 1, (1 + CONFIDENCE) / 2)) * spread / math.sqrt(n) if spread > 0 else 0.0
    return mean, mean - half, mean + half


def matches(values: Values, expect: float, tolerance: float, unit: str = "1", note: str = "") -> Finding:
    """Equivalence: the whole interval lies within the tolerance. The direction is that of ``expect`` from zero."""
    mean, low, high = interval(values)
    holds = expect - tolerance <= low and high <= expect + tolerance
    return Finding(mean, low, high, len(values), unit, holds, mean > 0 if expect > 0 else mean < 0, note)


def below(values: Values, bound: float, unit: str = "1", note: str = "", near: float | None = None) -> Finding:
    """The whole interval lies below a bound; up to ``near`` it is at least the direction that was claimed."""
    mean, low, high = interval(values)
    return Finding(mean, low, high, len(values), unit, high <= bound, near is not None and mean <= near, note)


def above(values: Values, bound: float, unit: str = "1", note: str = "", near: float | None = None) -> Finding:
    """The whole interval lies above a bound; down to ``near`` it is at least the direction that was claimed."""
    mean, low, high = interval(values)
    return Finding(mean, low, high, len(values), unit, low >= bound, near is not None and mean >= near, note)


def all_positive(steps: Mapping[str, Values], unit: str = "1") -> Finding:
    """Several effects that are all claimed to be positive: each one's interval must exclude zero.

    The value is their average; the note names those that fail. The direction is right if the average is positive.
    """
    average = np.mean([np.asarray(values) for values in steps.values()], axis=0)
    mean, low, high = interval(average)
    failed = [f"{name} {interval(values)[0]:+.3g}" for name, values in steps.items() if not interval(values)[1] > 0]
    note = f"{len(steps) - len(failed)} of {len(steps)} shown" + (f"; not: {', '.join(failed)}" if failed else "")
    return Finding(mean, low, high, len(average), unit, not failed, mean > 0, note)
