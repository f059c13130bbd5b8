"""Intervals of numbers: from batch means inside one run, and over runs with several seeds."""

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.base.text import significant
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Floats, Text

if TYPE_CHECKING:
    import pandas as pd

BLOCK_NS = NS_PER_S
CONFIDENCE = 0.95
NORMAL_QUANTILE = 1.959963984540054  # of (1 + CONFIDENCE) / 2

NO_SHARES = ("confidence_boost", "improvement")  # metrics of unit 1 that may be below 0
_METRIC = ["metric", "method", "placement", "component", "unit"]  # the columns that tell which


def across_seeds(
    runs: "pd.DataFrame", by: Sequence[str], differences: bool = False
) -> "pd.DataFrame":
    """Mean, 95 % t interval and count of each metric within the groups ``by``: columns value, low,
    high, runs.

    The unit of replication is the seed: with several runs of a group under one seed, their mean
    counts once. One seed gives no interval. That of a share (not of ``differences``) is Wilson's,
    so it stays within 0 and 1.
    """
    per_seed = runs.groupby([*by, *_METRIC, "seed"], sort=False, dropna=False)["value"].mean()
    grouped = per_seed.groupby([*by, *_METRIC], sort=False, dropna=False)
    spread = grouped.std().to_numpy()
    rows = grouped.agg(value="mean", runs="count").reset_index()
    n = rows["runs"].to_numpy()
    half = np.full(len(n), np.nan)
    several = n > 1
    half[several] = [
        half_of_mean(*sample) for sample in zip(spread[several], n[several], strict=True)
    ]
    rows = rows.assign(low=rows["value"] - half, high=rows["value"] + half)
    shares = (
        (rows["unit"] == "1")
        & ~rows["metric"].str.startswith(NO_SHARES)
        & ~np.isnan(half)
        & (not differences)
    )
    ends = [
        wilson(value, reach)
        for value, reach in zip(rows["value"][shares], half[shares], strict=True)
    ]
    rows.loc[shares, ["low", "high"]] = np.reshape(ends, (-1, 2))
    for name in ("value", "low", "high"):  # ten digits: processors add up in different orders
        rows[name] = [significant(number, digits=10) for number in rows[name]]
    return rows[[*by, *_METRIC, "value", "low", "high", "runs"]]


def over_seeds(values: Sequence[float] | Floats) -> tuple[float, float]:
    """Mean, and half of its 95 % t interval: 0 for one value. As by ``np.mean`` and ``np.std``,
    faster.
    """
    sample, n = np.asarray(values, dtype=float), len(values)
    mean = float(np.add.reduce(sample)) / n
    if n == 1:
        return mean, 0.0
    away = sample - mean
    return mean, half_of_mean(math.sqrt(float(np.add.reduce(away * away)) / (n - 1)), n)


def half_of_mean(spread: float, n: int) -> float:
    """Half of the 95 % t interval of the mean of ``n`` values with this standard deviation."""
    return float(t_quantile(int(n) - 1) * spread / math.sqrt(n))


class Error(NamedTuple):
    """A standard error and its degrees of freedom."""

    value: float
    freedom: float

    @property
    def half(self) -> float:
        """Half of the 95 % t interval."""
        return t_quantile(max(int(self.freedom), 1)) * self.value


def error_of_mean(values: Sequence[float]) -> Error:
    """That of the mean of two values or more."""
    return Error(float(np.std(values, ddof=1)) / math.sqrt(len(values)), len(values) - 1.0)


def of_difference(one: Error, other: Error) -> Error:
    """That of a difference of two sides that nothing pairs.

    Source: B. L. Welch, "The generalization of Student's problem when several different population
    variances are involved", 1947.
    """
    variance = one.value**2 + other.value**2
    if not variance:
        return Error(0.0, one.freedom + other.freedom)
    parts = math.fsum(side.value**4 / side.freedom for side in (one, other))
    return Error(math.sqrt(variance), variance**2 / parts)


def mean_bands(seeds: Floats, shares: bool = False) -> tuple[Floats, Floats, Floats]:
    """Of curves, a row a seed: at each place their mean and the ends of its 95 % t interval, of
    ``shares`` Wilson's.
    """
    n = len(seeds)
    mean = seeds.mean(axis=0)
    if n == 1:
        return mean, mean, mean
    half = t_quantile(n - 1) * seeds.std(axis=0, ddof=1) / math.sqrt(n)
    if not shares:
        return mean, mean - half, mean + half
    low, high = np.transpose([wilson(*place) for place in zip(mean, half, strict=True)])
    return mean, low, high


class Blocks:
    """Rows grouped into blocks of one second each, every stratum (car or Genie) by itself."""

    def __init__(self, strata: Text, instants_ns: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        stratum = np.unique(strata.codes, return_inverse=True)[1]
        seconds = instants_ns // BLOCK_NS
        per_stratum = int(seconds.max()) + 1
        blocks, self._of_row = np.unique(stratum * per_stratum + seconds, return_inverse=True)
        self._stratum = blocks // per_stratum
        self._sizes = np.bincount(self._stratum)

    def influence(self, above: Floats, below: Floats) -> Floats:
        """How far each block moves the ratio sum(above) / sum(below): the linearised ratio
        estimator's residuals.
        """
        sums, counts = self._sum(above), self._sum(below)
        ratio = sums.sum() / counts.sum()
        return np.asarray((sums - ratio * counts) / counts.sum())

    def half_width(self, influence: Floats) -> float | None:
        """Half the confidence interval; None if a stratum lasted for one block only."""
        error = self.error(influence)
        return None if error is None else error.half

    def error(self, influence: Floats) -> "Error | None":
        """The standard error; None if a stratum lasted for one block only."""
        if self._sizes.min() < 2:
            return None
        means = np.bincount(self._stratum, influence) / self._sizes
        squares = np.bincount(self._stratum, (influence - means[self._stratum]) ** 2)
        error = np.sqrt((self._sizes / (self._sizes - 1) * squares).sum())
        return Error(float(error), float((self._sizes - 1).sum()))

    def _sum(self, values: Floats) -> Floats:
        sums: Floats = np.bincount(self._of_row, values, minlength=len(self._stratum)).astype(
            np.float64
        )
        return sums


@functools.lru_cache(maxsize=4096)
def t_quantile(freedom: int) -> float:
    """The 97.5 % quantile of Student's t distribution; scipy has it too, and takes as long to
    import as a run does.

    Source: M. Abramowitz, I. Stegun, "Handbook of Mathematical Functions", 1964: from 300 degrees
    of freedom on the series 26.7.5, below that Newton's method on 26.7.3 and 26.7.4.
    """
    x = NORMAL_QUANTILE
    series = (
        (x**3 + x) / 4,
        (5 * x**5 + 16 * x**3 + 3 * x) / 96,
        (3 * x**7 + 19 * x**5 + 17 * x**3 - 15 * x) / 384,
        (79 * x**9 + 776 * x**7 + 1482 * x**5 - 1920 * x**3 - 945 * x) / 92160,
    )
    t: float = x + math.fsum(part / freedom ** (place + 1) for place, part in enumerate(series))
    if freedom >= 300:
        return t
    peak = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(
        freedom * math.pi
    )
    for _ in range(20):
        before = t
        t -= (_t_within(t, freedom) - CONFIDENCE) / (
            2 * peak * (1 + t * t / freedom) ** (-(freedom + 1) / 2)
        )
        if abs(t - before) < 1e-14 * t:
            break
    return t


def _t_within(t: float, freedom: int) -> float:
    """How probable it is that Student's t lies between -t and t."""
    angle = math.atan(t / math.sqrt(freedom))
    sine, squared = math.sin(angle), math.cos(angle) ** 2
    odd = freedom % 2
    term = total = math.cos(angle) if odd else 1.0
    for k in range(2 + odd, freedom, 2):
        term *= squared * (k - 1) / k
        total += term
    if not odd:
        return sine * total
    return 2 / math.pi * (angle + (sine * total if freedom > 1 else 0.0))


def around(value: float, half: float | None) -> tuple[float | None, float | None]:
    """The ends of an interval of this half width."""
    return (None, None) if half is None else (value - half, value + half)


def wilson(value: float, half: float, n: int = 0) -> tuple[float, float]:
    """Wilson's interval of a share whose usual one reaches ``half`` to either side, which says for
    how many independent rows it stands; of a share of 0 or 1, that of ``n`` rows (0: nothing but
    the value). It stays within 0 and 1.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference",
    1927; with an effective number of rows: E. L. Korn, B. I. Graubard, "Confidence intervals for
    proportions with small expected number of positive counts estimated from survey data", 1998.
    """
    spread = value * (1 - value)
    # quantile squared / rows
    k = half**2 / spread if spread > 0 else NORMAL_QUANTILE**2 / n if n else 0.0
    middle, reach = value + k / 2, math.sqrt(k * spread + k * k / 4)
    return max((middle - reach) / (1 + k), 0.0), min((middle + reach) / (1 + k), 1.0)


class Measured(NamedTuple):
    """A number, the ends of its 95 % interval, over how many rows it is, and the lowest and the
    highest value that something has where it is one of several.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    n: int = 0
    range_low: float | None = None
    range_high: float | None = None


def ratio(blocks: Blocks | None, above: Floats, below: Floats, is_share: bool = True) -> Measured:
    """The ratio of two sums over rows with its interval, Wilson's for a share.

    Parameters
    ----------
    blocks : Blocks or None
        The rows grouped into seconds; ``None``: no interval is wanted.
    above, below : array of float
        A number for each row; for a share, flags or counts.
    is_share : bool
        Any other ratio is a mean, and gets the usual interval.
    """
    n = int(below.sum())
    if not n:
        return Measured(None)
    value = float(above.sum() / n)
    half = None if blocks is None else blocks.half_width(blocks.influence(above, below))
    low, high = wilson(value, half, n) if is_share and half is not None else around(value, half)
    return Measured(value, low, high, n)


def percentile(blocks: Blocks | None, values: Floats, percent: int) -> Measured:
    """A percentile of the values that are not NaN; without blocks, without an interval.

    Its interval is Woodruff's: the interval of the share of values below it, read back through the
    distribution; it ends at the run's smallest and largest value.
    """
    known = ~np.isnan(values)
    n = int(known.sum())
    if not n:
        return Measured(None)
    value = float(np.percentile(values[known], percent))
    below = known & (values <= value)
    half = None
    if blocks is not None:
        half = blocks.half_width(blocks.influence(below.astype(float), known.astype(float)))
    if half is None:
        return Measured(value, n=n)
    rank = percent / 100
    low, high = np.quantile(values[known], [max(rank - half, 0.0), min(rank + half, 1.0)]).tolist()
    return Measured(value, low, high, n)


def thinned(n: int, most: int = 1000) -> np.ndarray[Any, np.dtype[np.int64]]:
    """At most ``most`` places of n, evenly spread, both ends among them: enough to draw a curve
    through.
    """
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64)) if n else np.arange(0)
