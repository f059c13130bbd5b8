"""How much of the differences between points each parameter explains by itself."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.seeds import stream
from genie_sim.tuning.design import SearchDesign
from genie_sim.tuning.front import Table, means
from genie_sim.tuning.searcher import ROWS, MethodSearch

if TYPE_CHECKING:
    import pandas as pd

BINS = 5  # of a range, of equally many points each
RESAMPLES = 200
MIN_POINTS = 10
QUANTILES = (2.5, 97.5)


def importance(design: SearchDesign, searches: Sequence[MethodSearch]) -> "pd.DataFrame":
    """One row per method, parameter and objective: the share of the objective's variance over the
    points that the parameter explains by itself, with a 95 % bootstrap interval over points.

    It is the correlation ratio eta squared, adjusted for the number of groups (Kelley's epsilon
    squared), so that a parameter without effect has 0 on average. It is taken over the points at
    which the parameter counts, ``points`` of them; ranges are cut into five groups of equally many
    points. Points crowd where the search went, so it is no property of the space as a whole.

    Source: T. L. Kelley, "An unbiased correlation ratio measure", 1935.
    """
    import pandas as pd

    rows = []
    for search in searches:
        trials = [trial for trial in search.trials() if ROWS in trial.user_attrs]
        for name, parameter in search.space.free(design.settings).items():
            own = [trial for trial in trials if name in trial.params]
            if len(own) < MIN_POINTS:
                continue
            values = np.array([float(trial.params[name]) for trial in own])
            labels = values if parameter.range is None else _binned(values)
            numbers = np.array([means(trial.user_attrs[ROWS]) for trial in own])
            for place, objective in enumerate(design.objectives.all):
                names = ("importance", search.method, name, place)
                rng = stream(design.seed, *names)
                share, low, high = with_interval(labels, numbers[:, place], rng)
                rows.append(
                    (search.method, name, objective.target.text, share, low, high, len(own))
                )
    columns = ["method", "parameter", "metric", "value", "low", "high", "points"]
    return pd.DataFrame(rows, columns=columns)


def with_interval(
    labels: Table, numbers: Table, rng: np.random.Generator
) -> tuple[float, float, float]:
    """The explained share, and the ends of its bootstrap interval, from 0 to 1."""
    shares = []
    for _ in range(RESAMPLES):
        places = rng.integers(len(numbers), size=len(numbers))
        shares.append(explained(labels[places], numbers[places]))
    low, high = np.percentile(shares, QUANTILES)
    ends = (explained(labels, numbers), float(low), float(high))
    value, low, high = (float(f"{min(max(number, 0.0), 1.0):.10g}") for number in ends)
    return value, low, high


def explained(labels: Table, numbers: Table) -> float:
    """Epsilon squared: the share of the variance between groups of equal labels."""
    total = float(((numbers - numbers.mean()) ** 2).sum())
    _, group = np.unique(labels, return_inverse=True)
    count, groups = len(numbers), int(group.max()) + 1
    if total <= 1e-24 * count * max(float(np.abs(numbers).max()) ** 2, 1e-300) or count <= groups:
        return 0.0
    group_means = np.bincount(group, numbers) / np.bincount(group)
    within = float(((numbers - group_means[group]) ** 2).sum())
    return 1.0 - within / (count - groups) * (count - 1) / total


def _binned(values: Table) -> Any:
    edges = np.quantile(values, np.arange(1, BINS) / BINS)
    return np.searchsorted(edges, values, side="left").astype(float)
