"""Statistical tests: independent replications, and equivalence instead of "no difference found"."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from genie_sim.base.seeds import stream

CONFIDENCE = 0.99


def replicate(
    experiment: Callable[[np.random.Generator], float], *, replications: int, seed: int
) -> tuple[float, ...]:
    """One result of each replication; every one has random numbers of its own."""
    return tuple(experiment(stream(seed, "replication", number)) for number in range(replications))


def equivalent(results: Sequence[float], *, expected: float, margin: float) -> bool:
    """Whether the whole 99 % confidence interval of the mean lies within ``margin`` (relative) of
    ``expected``.

    So few or noisy replications make the test fail, not pass. Prints what it compares.
    """
    from scipy.stats import t

    mean = float(np.mean(results))
    half = (
        float(t.ppf((1 + CONFIDENCE) / 2, len(results) - 1))
        * float(np.std(results, ddof=1))
        / math.sqrt(len(results))
    )
    low, high = expected * (1 - margin), expected * (1 + margin)
    print(
        f"\n{mean:.5g} +- {half:.2g} ({len(results)} replications, {CONFIDENCE:.0%}); "
        f"theory {expected:.5g}, accepted from {low:.5g} to {high:.5g}"
    )
    return low <= mean - half and mean + half <= high
