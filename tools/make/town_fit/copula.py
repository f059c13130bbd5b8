"""How correlated the looks at one object are, and the copula that makes them so."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from genie_sim.base.geometry import Array

Whole = npt.NDArray[np.int_]
LAGS_M = (0.0, 0.25, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
OBJECT_SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
LOOK_SHARES = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3)
SMOOTH_M = (3.0, 6.0, 12.0, 24.0)
REPLICATIONS = 20


def normal_scores(values: npt.ArrayLike, bins: npt.ArrayLike) -> Array:
    """Each value's rank within its bin as a standard normal number; equal values (misses) share the
    middle rank.
    """
    from scipy.special import ndtri

    values_, bins_ = np.asarray(values, dtype=float), np.asarray(bins)
    below = np.empty(len(values_))
    for k in np.unique(bins_):
        here = bins_ == k
        ranked = np.sort(values_[here])
        first, last = (np.searchsorted(ranked, values_[here], side) for side in ("left", "right"))
        below[here] = (first + last) / (2 * len(ranked))
    z = ndtri(below)
    z -= z.mean()
    scaled: Array = z / max(float(z.std()), 1e-9)
    return scaled


class Pairs:
    """All pairs of looks at one object, by the distance of their views; each object counts alike,
    however often it was seen.
    """

    def __init__(self, tracks: Whole, views_m: Array) -> None:
        firsts, seconds, weights = [], [], []
        for track in np.unique(tracks):
            here = np.flatnonzero(tracks == track)
            a, b = np.triu_indices(len(here), 1)
            firsts.append(here[a])
            seconds.append(here[b])
            weights.append(np.full(len(a), 1.0 / len(here)))
        self._a, self._b, self._weights = map(np.concatenate, (firsts, seconds, weights))
        self._lag = np.digitize(np.abs(views_m[self._a] - views_m[self._b]), LAGS_M) - 1
        self._count = np.bincount(self._lag, self._weights, len(LAGS_M))

    def correlations(self, z: Array) -> Array:
        """Mean product of the normal scores of two looks at one object, for each of ``LAGS_M``; nan
        without pairs.
        """
        total = np.bincount(self._lag, self._weights * z[self._a] * z[self._b], len(LAGS_M))
        means: Array = np.divide(
            total, self._count, out=np.full(len(LAGS_M), np.nan), where=self._count > 0
        )
        return means


def fit_shares(
    tracks: Whole,
    views_m: Array,
    bins: Whole,
    values: Array,
    *,
    seed: int,
    replications: int = REPLICATIONS,
) -> dict[str, float]:
    """The shares of the copula whose looks, made at the same places, are as correlated as the real
    ones.

    Every combination of ``OBJECT_SHARES``, ``LOOK_SHARES`` and ``SMOOTH_M`` is simulated; the one
    nearest to the real correlations, in squares over ``LAGS_M``, is taken.

    Parameters
    ----------
    tracks : which object each look is at, (n,)
    views_m : the coordinate of its view [m], (n,)
    bins : the bin in which its value is ranked, (n,)
    values : a score (0: missed) or an error, (n,)
    seed : of the simulations
    replications : of each combination
    """
    pairs = Pairs(tracks, views_m)
    real = pairs.correlations(normal_scores(values, bins))
    missing = {k: float(np.mean(values[bins == k] == 0.0)) for k in set(bins.tolist())}
    objects = np.searchsorted(np.unique(tracks), tracks)
    random = np.random.default_rng(seed)
    draws = random.standard_normal((replications, 3, len(tracks)))
    best: tuple[float, dict[str, float]] = (math.inf, {})
    cut = np.array(
        [NormalDist().inv_cdf(min(max(missing[k], 1e-9), 1 - 1e-9)) for k in bins.tolist()]
    )
    for smooth_m in SMOOTH_M:
        gradual = _gradual(tracks, views_m, smooth_m, draws[:, 1])
        for of_object in OBJECT_SHARES:
            for of_look in LOOK_SHARES:
                of_view = 1 - of_object - of_look
                made = []
                for k in range(replications):
                    lasting = draws[k, 0][objects]
                    z = (
                        of_object**0.5 * lasting
                        + of_view**0.5 * gradual[k]
                        + of_look**0.5 * draws[k, 2]
                    )
                    z = np.where(z < cut, -9.0, z)
                    made.append(pairs.correlations(normal_scores(z, bins)))
                gap = float(np.nansum((np.mean(made, axis=0) - real) ** 2))
                if gap < best[0]:
                    shares = {"object": of_object, "view": round(of_view, 4), "smooth_m": smooth_m}
                    best = gap, shares
    return best[1]


def _gradual(tracks: Whole, views_m: Array, smooth_m: float, draws: Array) -> Array:
    """Standard normal numbers (replications, looks), correlated by exp(-distance of views /
    smooth_m) per object.
    """
    made = np.empty_like(draws)
    for track in np.unique(tracks):
        here = np.flatnonzero(tracks == track)
        gaps = np.abs(views_m[here, None] - views_m[None, here])
        factor = np.linalg.cholesky(np.exp(-gaps / smooth_m) + 1e-9 * np.eye(len(here)))
        made[:, here] = draws[:, here] @ factor.T
    return made
