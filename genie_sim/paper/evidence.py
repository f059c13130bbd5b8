"""What replicated runs say: means with 95 % intervals over seeds, and whether they match, exceed or
order as claimed.

The unit of replication is drive x seed. Arms that are compared ran on the same drive and seed, so
differences and ratios are taken seed by seed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.statistics import over_seeds
from genie_sim.paper.definitions import USUAL, Definitions, meant
from genie_sim.paper.facts import Fact, Facts

Values = np.ndarray[Any, np.dtype[np.float64]]  # one per seed
BASE = "base"  # the variant that is meant where none is named
# An effect below this share of the value that it changes does not count, in any ordering of any
# reading. Declared before it was applied; docs/paper.md says how.
NEGLIGIBLE = 0.01


@dataclass(frozen=True, slots=True)
class Claim:
    """One line of ``claims.yaml``, which says what the thresholds are."""

    id: str
    where: str
    kind: str
    claim: str
    test: str
    paper: str
    expect: float
    tolerance: float = 0.0
    near: float | None = None
    also: float = 0.0


class Effect(NamedTuple):
    """Something that is claimed to be positive, over seeds, and the ``value`` that it changes."""

    effect: Values
    value: Values

    @property
    def state(self) -> str:
        """One of ``STATES``, from the effect's 95 % interval and 1 % of the value."""
        margin = NEGLIGIBLE * np.abs(self.value)
        _, low, high = interval(self.effect - margin)
        if low > 0:
            return HELD
        _, low_below, high_below = interval(self.effect + margin)
        if high_below < 0:
            return CONTRARY
        return NEGLIGIBLE_EFFECT if high <= 0 <= low_below else OPEN

    @property
    def scale(self) -> float:
        """The larger of the two numbers that are compared: what makes effects of several units
        comparable; 1 where both are zero.
        """
        ends = np.abs([np.mean(self.value), np.mean(self.value + self.effect)])
        return float(np.nanmax(ends)) or 1.0 if not np.isnan(ends).all() else 1.0


HELD, NEGLIGIBLE_EFFECT, OPEN, CONTRARY = STATES = ("holds", "negligible", "open", "contrary")


def more(larger: Values, smaller: Values) -> Effect:
    """That one number is larger than another."""
    return Effect(larger - smaller, smaller)


class Leg(NamedTuple):
    """A part of a claim that is told apart: how many of its effects hold, of how many."""

    name: str
    held: int
    effects: int

    @property
    def holds(self) -> bool:
        return self.held == self.effects


@dataclass(frozen=True, slots=True)
class Finding:
    """One claim looked at. ``holds``: as claimed, in size. ``direction``: at least the way it was
    claimed. ``legs``: the parts of a claim that has several.

    ``value`` is the number that the claim's test names, ``low`` and ``high`` its 95 % interval over
    ``n`` seeds.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int
    unit: str
    holds: bool
    direction: bool
    note: str = ""
    legs: tuple[Leg, ...] = ()

    @property
    def one_seed(self) -> bool:
        """Whether the interval is a point because nothing was replicated; arithmetic needs no
        seeds.
        """
        return self.n == 1 and self.low is not None

    @property
    def known(self) -> bool:
        """Whether the runs had what the test needs."""
        return self.value is not None and not math.isnan(self.value)


class Evidence:
    """Facts of runs by (variant, scenario), one for each seed, in the same order everywhere. A
    metric is asked for by the paper's name; ``definitions`` say what is meant by it.
    """

    def __init__(
        self,
        runs: Mapping[tuple[str, str], Sequence[Facts]],
        definitions: Definitions = USUAL,
    ) -> None:
        self.definitions = definitions
        self._runs = runs
        self._values: dict[tuple[str, str, Fact], Values] = {}
        self._means: dict[tuple[object, ...], Values] = {}
        # Bootstrap indices; None for the original sample.
        self._places: Values | None = None

    def of(self, scenario: str, fact: Fact, variant: str = BASE) -> Values:
        """A fact's values over seeds. Raises ``KeyError`` where such a run was not made."""
        return self._drawn(self._every(scenario, fact, variant))

    def _every(self, scenario: str, fact: Fact, variant: str) -> Values:
        """A fact's values, each seed once."""
        fact = fact._replace(metric=meant(fact.metric, self.definitions))
        key = variant, scenario, fact
        if key not in self._values:
            runs = self._runs[variant, scenario]
            self._values[key] = np.array([run.get(fact, math.nan) for run in runs], dtype=float)
        return self._values[key]

    def _drawn(self, values: Values) -> Values:
        return values if self._places is None else values[self._places[self._places < len(values)]]

    def facts(self, scenario: str) -> list[Fact]:
        """The facts that any run of a scenario has, sorted, by the names that they have there."""
        return sorted({fact for facts in self._runs[BASE, scenario] for fact in facts})

    def mean_of(
        self, scenarios: Sequence[str], facts: Sequence[Fact], variant: str = BASE
    ) -> Values:
        """Mean over scenarios and facts, seed by seed; what is not defined is left out."""
        key = variant, *scenarios, *facts
        if key not in self._means:
            table = np.array(
                [self._every(scenario, fact, variant) for scenario in scenarios for fact in facts]
            )
            defined = ~np.isnan(table)
            counts = defined.sum(axis=0)
            sums = np.where(defined, table, 0.0).sum(axis=0)
            self._means[key] = np.where(counts > 0, sums / np.maximum(counts, 1), math.nan)
        return self._drawn(self._means[key])

    def with_definitions(self, definitions: Definitions) -> "Evidence":
        """The same runs, with other meanings of the metrics."""
        return Evidence(self._runs, definitions)

    def resampled(self, places: Sequence[int]) -> "Evidence":
        """The evidence that other seeds could have given: the seeds at these places, some more than
        once.
        """
        other = Evidence(self._runs, self.definitions)
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
    """Mean and 95 % t interval over seeds; with one seed it is a point, which says nothing of other
    seeds.
    """
    mean, half = over_seeds(values)
    return mean, mean - half, mean + half


def matches(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """Equivalence: the whole interval lies within the tolerance of what is expected."""
    low, high = claim.expect - claim.tolerance, claim.expect + claim.tolerance
    return _within(claim, values, (low, high), unit=unit, note=note)


def below(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """The whole interval lies at most at what is expected."""
    return _within(claim, values, (-math.inf, claim.expect), unit=unit, note=note)


def above(claim: Claim, values: Values, unit: str = "1", note: str = "") -> Finding:
    """The whole interval lies at least at what is expected."""
    return _within(claim, values, (claim.expect, math.inf), unit=unit, note=note)


def _within(
    claim: Claim, values: Values, bounds: tuple[float, float], *, unit: str, note: str
) -> Finding:
    """The claim holds where the whole interval lies within the bounds; the direction is shown where
    it lies on the claimed side of ``near``.
    """
    mean, low, high = interval(values)
    smallest, largest = bounds
    holds, near = smallest <= low and high <= largest, claim.near
    direction = near is not None and (low > near if claim.expect > near else high < near)
    return Finding(
        mean, low, high, n=len(values), unit=unit, holds=holds, direction=direction, note=note
    )


def all_positive(
    legs: Mapping[str, Mapping[str, Effect]], unit: str = "1", note: str = ""
) -> Finding:
    """Several effects that are all claimed to be positive: each must hold (``Effect.state``).

    The value is the effect that decides, the one whose interval begins lowest, measured by the
    numbers that it compares. The note names it and those that do not hold. The direction is shown
    where none of them is contrary, and either most of them hold or their average does. ``legs``:
    the effects by the part of the claim that they belong to.
    """
    effects = {name: effect for of_leg in legs.values() for name, effect in of_leg.items()}
    states = {name: effect.state for name, effect in effects.items()}
    held = sum(state == HELD for state in states.values())
    summary = f"{held} of {len(effects)} shown"
    if held < len(effects):
        missing = (
            f"{name} {np.mean(effects[name].effect):+.3g} ({state})"
            for name, state in states.items()
            if state != HELD
        )
        summary += f"; not: {', '.join(missing)}"
    relative = {name: effect.effect / effect.scale for name, effect in effects.items()}
    _, low, _ = interval(np.mean(list(relative.values()), axis=0))
    most = low > NEGLIGIBLE or 2 * held > len(effects)
    decisive = min(relative, key=lambda name: interval(relative[name])[1])
    if len(effects) > 1:
        summary += f"; decided by {decisive}"
    return Finding(
        *interval(effects[decisive].effect),
        n=len(effects[decisive].effect),
        unit=unit,
        holds=held == len(effects),
        direction=most and CONTRARY not in states.values(),
        note=f"{note}; {summary}" if note else summary,
        legs=tuple(
            Leg(name, sum(states[effect] == HELD for effect in of_leg), len(of_leg))
            for name, of_leg in legs.items()
        )
        if len(legs) > 1
        else (),
    )


def in_every_run(
    claim: Claim, values: Values, *, at_most: bool = False, unit: str = "1", note: str = ""
) -> Finding:
    """An invariant: what is expected is a bound that no run may miss. The value is that of the
    worst run, the interval the range of all runs.
    """
    low, high = float(np.min(values)), float(np.max(values))
    holds = high <= claim.expect if at_most else low >= claim.expect
    return Finding(
        high if at_most else low,
        low,
        high,
        n=len(values),
        unit=unit,
        holds=holds,
        direction=False,
        note=f"{note}; the worst run decides" if note else "the worst run decides",
    )
