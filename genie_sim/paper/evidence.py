"""What replicated runs say: means with 95 % intervals over seeds, and whether they match, exceed or order as claimed.

The unit of replication is drive x seed. Arms that are compared ran on the same drive and seed, so differences and
ratios are taken seed by seed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from genie_sim.analysis.statistics import over_seeds
from genie_sim.paper.definitions import fact
from genie_sim.paper.facts import Facts

Values = np.ndarray[Any, np.dtype[np.float64]]  # one per seed
BASE = "base"  # the variant that is meant where none is named


@dataclass(frozen=True, slots=True)
class Claim:
    """One line of ``claims.yaml``, which says what the thresholds are."""

    id: str
    where: str
    kind: str
    claim: str
    test: str
    expect: float
    tolerance: float = 0.0
    near: float | None = None
    also: float = 0.0


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
    def one_seed(self) -> bool:
        """Whether the interval is a point because nothing was replicated; arithmetic needs no seeds."""
        return self.n == 1 and self.low is not None

    @property
    def known(self) -> bool:
        """Whether the runs had what the test needs."""
        return self.value is not None and not math.isnan(self.value)


class Evidence:
    """Facts of runs by (variant, scenario), one for each seed, in the same order everywhere. ``definitions``: of each
    metric, which one is meant by it, where it is not the default's."""

    def __init__(
        self,
        runs: Mapping[tuple[str, str], Sequence[Facts]],
        definitions: Mapping[str, str] | None = None,
    ) -> None:
        self._runs = runs
        self._definitions = definitions or {}
        self._values: dict[tuple[str, str, str], Values] = {}
        self._means: dict[tuple[str, ...], Values] = {}
        self._places: Values | None = None  # of the seeds that are meant; None: each once

    def of(self, scenario: str, name: str, variant: str = BASE) -> Values:
        """A fact's values over seeds. Raises ``KeyError`` where such a run was not made."""
        return self._drawn(self._every(scenario, name, variant))

    def _every(self, scenario: str, name: str, variant: str) -> Values:
        """A fact's values, each seed once."""
        key = variant, scenario, name
        if key not in self._values:
            runs, meant = self._runs[variant, scenario], self.meant(name)
            self._values[key] = np.array([run.get(meant, math.nan) for run in runs], dtype=float)
        return self._values[key]

    def _drawn(self, values: Values) -> Values:
        return values if self._places is None else values[self._places[self._places < len(values)]]

    def meant(self, name: str) -> str:
        """The fact that the reading means by a name."""
        return fact(name, self._definitions)

    def names(self, scenario: str) -> list[str]:
        """The facts that any run of a scenario has, sorted."""
        return sorted({name for facts in self._runs[BASE, scenario] for name in facts})

    def mean_of(
        self, scenarios: Sequence[str], names: Sequence[str], variant: str = BASE
    ) -> Values:
        """Mean over scenarios and facts, seed by seed; what is not defined is left out."""
        key = variant, *scenarios, *names
        if key not in self._means:
            table = np.array(
                [self._every(scenario, name, variant) for scenario in scenarios for name in names]
            )
            known = ~np.isnan(table)
            counts = known.sum(axis=0)
            sums = np.where(known, table, 0.0).sum(axis=0)
            self._means[key] = np.where(counts > 0, sums / np.maximum(counts, 1), math.nan)
        return self._drawn(self._means[key])

    def resampled(self, places: Sequence[int]) -> "Evidence":
        """The evidence that other seeds could have given: the seeds at these places, some more than once."""
        other = Evidence(self._runs, self._definitions)
        other._values, other._means, other._places = self._values, self._means, np.asarray(places)
        return other

    @property
    def seeds(self) -> int:
        return max(
            (len(facts) for (variant, _), facts in self._runs.items() if variant == BASE), default=0
        )


def rounded(value: float) -> float:
    """Six digits, as they are written down."""
    return float(f"{value:.6g}")


def interval(values: Values) -> tuple[float, float, float]:
    """Mean and 95 % t interval over seeds; with one seed it is a point, which says nothing of other seeds."""
    mean, half = over_seeds(values)
    return mean, mean - half, mean + half


def matches(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """Equivalence: the whole interval lies within the tolerance of what is expected."""
    low, high = claim.expect - claim.tolerance, claim.expect + claim.tolerance
    return _within(claim, values, low, high, unit, note)


def below(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """The whole interval lies at most at what is expected."""
    return _within(claim, values, -math.inf, claim.expect, unit, note)


def above(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """The whole interval lies at least at what is expected."""
    return _within(claim, values, claim.expect, math.inf, unit, note)


def _within(
    claim: Claim, values: Values, least: float, most: float, unit: str, note: str
) -> Finding:
    """The direction is shown where the whole interval lies on the claimed side of ``near``."""
    mean, low, high = interval(values)
    holds, near = least <= low and high <= most, claim.near
    direction = near is not None and (low > near if claim.expect > near else high < near)
    return Finding(mean, low, high, len(values), unit, holds, direction, note)


def all_positive(parts: Mapping[str, Values], unit: str = "1", note: str = "") -> Finding:
    """Several effects that are all claimed to be positive: each one's interval must exclude zero.

    The value is their average; the note names those that are not shown, and says of which the opposite is. The
    direction is shown where none of them is opposite, and the average's interval excludes zero or most are shown.
    """
    ends = {name: interval(values) for name, values in parts.items()}
    missed = {name: one for name, one in ends.items() if not one[1] > 0}
    against = [name for name, (_, _, high) in missed.items() if high < 0]
    said = [
        f"{name} {mean:+.3g}{' (opposite)' if name in against else ''}"
        for name, (mean, _, _) in missed.items()
    ]
    shown = f"{len(parts) - len(missed)} of {len(parts)} shown" + (
        f"; not: {', '.join(said)}" if said else ""
    )
    average = np.mean(list(parts.values()), axis=0)
    mean, low, high = interval(average)
    direction = not against and (low > 0 or 2 * len(missed) < len(parts))
    return Finding(
        mean,
        low,
        high,
        len(average),
        unit,
        not missed,
        direction,
        f"{note}; {shown}" if note else shown,
    )
