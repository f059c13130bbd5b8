"""What replicated runs say: means with 95 % intervals over seeds, effects that must be positive.

The unit of replication is drive x seed. Arms that are compared ran on the same drive and seed, so
differences and ratios are taken seed by seed.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.analysis.statistics import around_mean, mean_and_spread
from genie_sim.paper.numbers import Number

if TYPE_CHECKING:
    import pandas as pd

Values = np.ndarray[Any, np.dtype[np.float64]]  # one per seed
BASE = "base"  # the variant that is meant where none is named
# An effect below this share of the value that it changes does not count, in any ordering. Declared
# before it was applied; docs/paper.md says how.
NEGLIGIBLE = 0.01


class Evidence:
    """The numbers of runs, scenario x variant x seed x number, as arrays over the seeds.

    Parameters
    ----------
    numbers : pandas.DataFrame
        The columns of ``numbers.SCHEMA``.
    """

    def __init__(self, numbers: "pd.DataFrame") -> None:
        keys = ["variant", "scenario", *Number._fields]
        texts = numbers.astype(dict.fromkeys(keys, str))
        wide = texts.pivot(index=keys, columns="seed", values="value")
        self.seeds = tuple(int(seed) for seed in wide.columns)
        self._values: dict[tuple[str, ...], Values] = dict(
            zip(wide.index, wide.to_numpy(), strict=True)
        )
        self._runs = {place[:2] for place in self._values}

    def of(self, scenario: str, number: Number, variant: str = BASE) -> Values:
        """A number's values over seeds, NaN where it is not defined. Raises ``KeyError`` where such
        a run was not made.
        """
        if (variant, scenario) not in self._runs:
            raise KeyError(variant, scenario)
        return self._values.get((variant, scenario, *number), np.full(len(self.seeds), np.nan))

    def mean_of(
        self, scenarios: Sequence[str], numbers: Sequence[Number], variant: str = BASE
    ) -> Values:
        """Mean over scenarios and numbers, seed by seed; what is not defined is left out."""
        table = np.array(
            [self.of(scenario, number, variant) for scenario in scenarios for number in numbers]
        )
        defined = ~np.isnan(table)
        counts = defined.sum(axis=0)
        sums = np.where(defined, table, 0.0).sum(axis=0)
        return np.where(counts > 0, sums / np.maximum(counts, 1), math.nan)


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
Effects = Mapping[str, Effect]


def more(larger: Values, smaller: Values) -> Effect:
    """That one number is larger than another."""
    return Effect(larger - smaller, smaller)


def interval(values: Values) -> tuple[float, float, float]:
    """Mean and 95 % t interval over seeds; of fewer than three it is a point, which says nothing
    of other seeds.
    """
    mean, spread = mean_and_spread(values)
    low, high = around_mean(mean, spread, len(values))
    return (mean, mean, mean) if low is None or high is None else (mean, low, high)
