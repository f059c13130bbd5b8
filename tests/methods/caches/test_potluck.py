"""Potluck's threshold finds the boundary of a made-up stream, and what it evicts."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.base.seeds import Draws
from genie_sim.core.rules import Capacity
from genie_sim.methods.potluck import AdaptiveThresholdCache, Potluck
from tests.methods.caches.vectors import TOPIC, answer, at

BOUNDARY = 0.2


def learned(boundary: float, seed: int, **settings: float) -> list[float]:
    """The threshold after each miss: requests on a line whose answer changes at every multiple of
    the boundary, so two that are farther apart never agree.
    """
    rng = np.random.default_rng(seed)
    cache, found = (
        AdaptiveThresholdCache(
            Potluck(replay="world", warm=20, ttl_ns=10**15, **settings), None, Draws(seed + 100)
        ),
        [],
    )
    for now, place in enumerate(rng.uniform(0.0, 6.0, 1500)):
        one = at(place)
        if cache.get(one, now) is None:
            cache.put(one, TOPIC, answer(100.0 * (place // boundary)), now)
            found.append(cache.reach)
    return found


@pytest.mark.parametrize("boundary", [0.1, 0.2, 0.4])
def test_the_threshold_settles_below_the_boundary_and_in_proportion_to_it(boundary: float):
    late = [np.mean(learned(boundary, seed)[-60:]) for seed in range(4)]
    assert 0.0 < np.mean(late) < boundary
    assert max(learned(boundary, 1)) < boundary, "no two answers that far apart agree"


def test_a_wider_boundary_gives_a_wider_threshold():
    narrow, wide = (
        np.mean([np.mean(learned(b, seed)[-60:]) for seed in range(4)]) for b in (0.05, 0.4)
    )
    assert wide > 2 * narrow


def test_wrong_hits_tighten_the_threshold_and_missed_hits_loosen_it():
    cache = AdaptiveThresholdCache(
        Potluck(replay="world", dropout=0.0, warm=1, tighten=4.0, keep=0.8), None, Draws(1)
    )
    cache.put(at(0.0), TOPIC, answer(1.0), 0)
    cache.put(at(0.5), TOPIC, answer(1.0), 1)
    assert cache.reach == pytest.approx(0.1, abs=1e-3)
    assert cache.get(at(0.45), 2) is not None
    assert cache.get(at(0.35), 2) is None
    cache.put(at(0.45), TOPIC, answer(50.0), 3)
    assert cache.reach == pytest.approx(0.025, abs=1e-3)
    assert cache.get(at(0.45), 10**10 + 3) is None, "its time is over"


def test_dropped_hits_are_misses():
    cache = AdaptiveThresholdCache(Potluck(replay="world", dropout=0.25), None, Draws(1))
    cache.put(at(0.0), TOPIC, answer(1.0), 0)
    misses = sum(cache.get(at(0.0), 1) is None for _ in range(2000))
    assert misses / 2000 == pytest.approx(0.25, abs=0.03)


def test_what_saves_least_per_byte_goes_first():
    cache = AdaptiveThresholdCache(
        Potluck(replay="world", dropout=0.0), Capacity(entries=2), Draws(1)
    )
    cache.put(at(0.0), TOPIC, answer(1.0), 0)
    cache.put(at(1.0), TOPIC, answer(1.0, 9.0, 20.0), 1)
    cache.get(at(1.0), 2)
    # two uses of the large one are less per byte than one of the small one
    cache.put(at(2.0), TOPIC, answer(), 3)
    assert [cache.get(at(x), 4) is not None for x in (0.0, 1.0, 2.0)] == [True, False, True]
    cache.put(at(2.0), TOPIC, answer(), 3 * 10**10)  # its first answer is over
    for place in (3.0, 4.0):
        cache.put(at(place), TOPIC, answer(), 3 * 10**10)
    assert len(cache) == 2


def test_any_number_of_answers_may_be_over_at_once():
    cache = AdaptiveThresholdCache(
        Potluck(replay="world", dropout=0.0, warm=2000, ttl_ns=10), None, Draws(1)
    )
    for number in range(1200):
        cache.put(at(number / 100), TOPIC, answer(1.0), 0)
    assert cache.near(at(-1.0), 1, 20) == [] and len(cache) == 0
