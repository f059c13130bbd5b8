"""C_T: a number, or a percentile of what is stored."""

from __future__ import annotations

import random

import pytest

from genie_sim.core.rules import Percentile
from genie_sim.core.thresholds import threshold_of


def nearest_rank(percent: int, values: list[float]) -> float:
    """The smallest value that is not below so many percent of all."""
    return next(
        value
        for value in sorted(values)
        if 100 * sum(other <= value for other in values) >= percent * len(values)
    )


@pytest.mark.parametrize("percent", [1, 50, 60, 100])
def test_a_percentile_is_that_of_what_is_stored_now(percent: int):
    rng, stored = random.Random(percent), []
    threshold = threshold_of(Percentile(percent))
    assert threshold.value == 1.0, "nothing may leave an empty map"
    for _ in range(200):
        what = rng.random()
        if what < 0.5 or not stored:
            stored.append(round(rng.random(), 1))  # some are equal
            threshold.added(stored[-1])
        elif what < 0.75:
            place, after = rng.randrange(len(stored)), round(rng.random(), 1)
            threshold.changed(stored[place], after)
            stored[place] = after
        else:
            threshold.removed(stored.pop(rng.randrange(len(stored))))
        assert threshold.value == (nearest_rank(percent, stored) if stored else 1.0)


def test_a_number_stays_as_it_is():
    threshold = threshold_of(0.7)
    threshold.added(0.1)
    threshold.changed(0.1, 0.2)
    threshold.removed(0.2)
    assert threshold.value == 0.7
