"""Intervals of numbers: from batch means inside one run, and over runs with several seeds."""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Floats, Text

BLOCK_NS = NS_PER_S
CONFIDENCE = 0.95
NORMAL_QUANTILE = 1.959963984540054  # of (1 + CONFIDENCE) / 2

MIN_SEEDS = 3  # of an interval


def mean_and_spread(values: Sequence[float] | Floats) -> tuple[float, float]:
    """Mean and standard deviation: 0 of one value. As by ``np.mean`` and ``np.std``, faster."""
    sample, n = np.asarray(values, dtype=float), len(values)
    mean = float(np.add.reduce(sample)) / n
    away = sample - mean
    return mean, math.sqrt(float(np.add.reduce(away * away)) / max(n - 1, 1))


def half_of_mean(spread: Any, n: int) -> Any:
    """Half of the 95 % t interval of the mean of ``n`` values with this standard deviation, or of
    each of an array.
    """
    return t_quantile(n - 1) * spread / math.sqrt(n)


def has_interval(seeds: Any) -> Any:
    """Whether so many seeds tell anything of others: a count, or an array of counts."""
    return seeds >= MIN_SEEDS


def around_mean(mean: float, spread: float, seeds: int) -> tuple[float | None, float | None]:
    """The 95 % t interval of the mean over seeds with this standard deviation; none of fewer than
    ``MIN_SEEDS``, or where all are equal: both tell little of other seeds.
    """
    is_known = has_interval(seeds) and spread > 0
    return around(mean, half_of_mean(spread, seeds) if is_known else None)


def mean_bands(seeds: Floats, shares: bool = False) -> tuple[Floats, Floats, Floats]:
    """Of curves, a row a seed: at each place their mean and the ends of its 95 % t interval, of
    ``shares`` within 0 and 1; no interval of fewer than ``MIN_SEEDS``.
    """
    n = len(seeds)
    mean = seeds.mean(axis=0)
    if not has_interval(n):
        return mean, mean, mean
    half = half_of_mean(seeds.std(axis=0, ddof=1), n)
    least, most = (0.0, 1.0) if shares else (-np.inf, np.inf)
    return mean, np.maximum(mean - half, least), np.minimum(mean + half, most)


class Blocks:
    """Rows grouped into blocks of one second each, every stratum (car or Genie) by itself. A
    stratum that lasted for one block is collapsed with the next, as in surveys with one unit a
    stratum: the interval is a little too wide, instead of none.

    Source: W. G. Cochran, "Sampling Techniques", 1977, section 5A.12.
    """

    def __init__(self, strata: Text, instants_ns: np.ndarray[Any, np.dtype[np.int64]]) -> None:
        stratum = np.unique(strata.codes, return_inverse=True)[1]
        seconds = instants_ns // BLOCK_NS
        per_stratum = int(seconds.max()) + 1
        blocks, self._of_row = np.unique(stratum * per_stratum + seconds, return_inverse=True)
        self._stratum = _collapsed(blocks // per_stratum)
        self._sizes = np.bincount(self._stratum)

    def influence(self, above: Floats, below: Floats) -> Floats:
        """How far each block moves the ratio sum(above) / sum(below): the linearised ratio
        estimator's residuals.
        """
        sums, counts = self._sum(above), self._sum(below)
        ratio = sums.sum() / counts.sum()
        return np.asarray((sums - ratio * counts) / counts.sum())

    def half_width(self, influence: Floats) -> float | None:
        """Half the confidence interval; None if there is one block only."""
        if self._sizes.min() < 2:
            return None
        means = np.bincount(self._stratum, influence) / self._sizes
        squares = np.bincount(self._stratum, (influence - means[self._stratum]) ** 2)
        error = np.sqrt((self._sizes / (self._sizes - 1) * squares).sum())
        return t_quantile(int((self._sizes - 1).sum())) * float(error)

    def _sum(self, values: Floats) -> Floats:
        sums: Floats = np.bincount(self._of_row, values, minlength=len(self._stratum)).astype(
            np.float64
        )
        return sums


def _collapsed(strata: Any) -> Any:
    """Strata, numbered from 0 in ascending order, without any that has one block; the last one
    goes with those before it.
    """
    sizes = np.bincount(strata)
    collapsed, size, number = np.empty_like(sizes), 0, 0
    for stratum, blocks in enumerate(sizes):
        if size > 1:
            number, size = number + 1, 0
        collapsed[stratum], size = number, size + blocks
    if size == 1 and number:
        collapsed[-1] -= 1
    return collapsed[strata]


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


class Estimate(NamedTuple):
    """A number, the ends of its 95 % interval, over how many rows it is (None: not known), and the
    lowest and the highest value that something has where it is one of several.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    n: int | None = None
    range_low: float | None = None
    range_high: float | None = None


def ratio(blocks: Blocks | None, above: Floats, below: Floats, is_share: bool = True) -> Estimate:
    """The ratio of two sums over rows with its interval, Wilson's for a share within 0 and 1.

    Parameters
    ----------
    blocks : Blocks or None
        The rows grouped into seconds; ``None``: no interval is wanted.
    above, below : array of float
        A number for each row; for a share, flags or counts.
    is_share : bool
        Any other ratio is a mean, and gets the usual interval.
    """
    whole = float(below.sum())
    if not whole:
        return Estimate(None)
    value, n = float(above.sum() / whole), round(whole)
    half = None if blocks is None else blocks.half_width(blocks.influence(above, below))
    if half is None or not is_share or not 0 <= value <= 1:
        return Estimate(value, *around(value, half), n)
    return Estimate(value, *wilson(value, half, n), n)


def rows_needed(percent: int) -> int:
    """Over how many rows a percentile has an interval: so many that one is beyond it. Of p99 a
    hundred.
    """
    return math.ceil(100 / (100 - percent))


def percentile(blocks: Blocks | None, values: Floats, percent: int) -> Estimate:
    """A percentile of the values that are not NaN; without blocks, without an interval.

    Its interval is Woodruff's: the interval of the share of values below it, read back through the
    distribution; it ends at the run's smallest and largest value.
    """
    known = ~np.isnan(values)
    n = int(known.sum())
    if not n:
        return Estimate(None)
    value = float(np.percentile(values[known], percent))
    below = known & (values <= value)
    half = None
    if blocks is not None and n >= rows_needed(percent):
        half = blocks.half_width(blocks.influence(below.astype(float), known.astype(float)))
    if half is None:
        return Estimate(value, n=n)
    rank = percent / 100
    low, high = np.quantile(values[known], [max(rank - half, 0.0), min(rank + half, 1.0)]).tolist()
    return Estimate(value, low, high, n)


def thinned(n: int, most: int = 1000) -> np.ndarray[Any, np.dtype[np.int64]]:
    """At most ``most`` places of n, evenly spread, both ends among them: enough to draw a curve
    through.
    """
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64)) if n else np.arange(0)
