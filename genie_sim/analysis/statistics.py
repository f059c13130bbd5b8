"""Intervals of a run's numbers: from batch means inside one run, and over runs with several seeds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.recording.results import Metric
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

BLOCK_NS = NS_PER_S
CONFIDENCE = 0.95

_METRIC = ["metric", "method", "placement", "component", "unit"]  # the columns that tell which

Floats = np.ndarray[Any, np.dtype[np.float64]]


def across_seeds(runs: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Mean, 95 % t interval and count of each metric within the groups ``by``: columns value, low, high, runs.

    The unit of replication is the seed: with several runs of a group under one seed, their mean counts once. One seed
    gives no interval.
    """
    from scipy.special import stdtrit

    per_seed = runs.groupby([*by, *_METRIC, "seed"], sort=False, dropna=False)["value"].mean()
    grouped = per_seed.groupby([*by, *_METRIC], sort=False, dropna=False)
    spread = grouped.std().to_numpy()
    found = grouped.agg(value="mean", runs="count").reset_index()
    n = found["runs"].to_numpy()
    half = np.full(len(n), np.nan)
    several = n > 1
    half[several] = stdtrit(n[several] - 1, (1 + CONFIDENCE) / 2) * spread[several] / np.sqrt(n[several])
    found = found.assign(low=found["value"] - half, high=found["value"] + half)
    for name in ("value", "low", "high"):  # ten digits: processors add up in different orders
        found[name] = [float(f"{number:.10g}") for number in found[name]]
    return found[[*by, *_METRIC, "value", "low", "high", "runs"]]


class Blocks:
    """Rows grouped into one second each, every stratum (car or Genie) for itself."""

    def __init__(self, strata: pd.Series[Any], instants_ns: pd.Series[int]) -> None:
        stratum = np.unique(strata.to_numpy(dtype=str), return_inverse=True)[1]
        seconds = instants_ns.to_numpy() // BLOCK_NS
        per_stratum = int(seconds.max()) + 1
        blocks, self._of_row = np.unique(stratum * per_stratum + seconds, return_inverse=True)
        self._stratum = blocks // per_stratum
        self._sizes = np.bincount(self._stratum)

    def influence(self, above: Floats, below: Floats) -> Floats:
        """How far each block moves the ratio sum(above) / sum(below): the linearised ratio estimator's residuals."""
        sums, counts = self._sum(above), self._sum(below)
        ratio = sums.sum() / counts.sum()
        return np.asarray((sums - ratio * counts) / counts.sum())

    def half_width(self, influence: Floats) -> float | None:
        """Half the confidence interval; None if a stratum lasted for one block only."""
        from scipy.special import stdtrit

        if self._sizes.min() < 2:
            return None
        means = np.bincount(self._stratum, influence) / self._sizes
        squares = np.bincount(self._stratum, (influence - means[self._stratum]) ** 2)
        error = np.sqrt((self._sizes / (self._sizes - 1) * squares).sum())
        return float(stdtrit((self._sizes - 1).sum(), (1 + CONFIDENCE) / 2) * error)

    def _sum(self, values: Floats) -> Floats:
        sums: Floats = np.bincount(self._of_row, values, minlength=len(self._stratum)).astype(np.float64)
        return sums


def around(value: float, half: float | None) -> tuple[float | None, float | None]:
    """The ends of an interval of this half width."""
    return (None, None) if half is None else (value - half, value + half)


def share(blocks: Blocks, name: str, where: tuple[str, str, str], part: Floats, whole: Floats) -> Metric:
    """How many of ``whole`` are in ``part``, at a method, placement and component; the interval stays within [0, 1]."""
    n = int(whole.sum())
    if not n:
        return Metric(name, *where, None, "1")
    value = float(part.sum() / n)
    low, high = around(value, blocks.half_width(blocks.influence(part.astype(float), whole.astype(float))))
    low, high = (None if end is None else min(max(end, 0.0), 1.0) for end in (low, high))
    return Metric(name, *where, value, "1", low, high, n)
