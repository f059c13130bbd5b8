"""FoggyCache: its vote trades reuse for accuracy."""

from __future__ import annotations

import numpy as np

from genie_sim.methods.foggycache import FoggyCache, VotingCache
from tests.methods.caches.vectors import TOPIC, answer, at


def reuse_and_accuracy(theta: float, seed: int) -> tuple[float, float]:
    """Over requests on a line, whose answer changes every 0.2, and where one stored answer of eight
    is another one.
    """
    rng = np.random.default_rng(seed)
    cache = VotingCache(FoggyCache(replay="world", theta=theta, radius=0.15), None)
    hits = right = 0
    for now, place in enumerate(rng.uniform(0.0, 2.0, 700)):
        true = 100.0 * (place // 0.2)
        found = cache.get(at(place), now)
        if found is None:
            cache.put(
                at(place),
                TOPIC,
                answer(true if rng.random() > 0.125 else rng.uniform(5e3, 9e3)),
                now,
            )
        else:
            hits += 1
            right += found[TOPIC].objects[0].location[0] == true
    return hits / 700, right / hits


def test_with_theta_accuracy_rises_and_reuse_falls():
    thetas = (0.5, 0.8, 0.95)
    found = np.mean(
        [[reuse_and_accuracy(theta, seed) for theta in thetas] for seed in range(3)], axis=0
    )
    reuse, accuracy = found[:, 0], found[:, 1]
    assert reuse[0] > reuse[1] + 0.02 > reuse[2] + 0.04
    assert accuracy[0] < accuracy[1] <= accuracy[2]
    assert accuracy[2] > 0.95


def test_a_vote_needs_two_and_the_largest_cluster_wins():
    cache = VotingCache(FoggyCache(replay="world", theta=0.7, radius=0.5), None)
    cache.put(at(0.0), TOPIC, answer(1.0), 0)
    assert cache.get(at(0.0), 1) is None, "one alone is no vote"
    cache.put(at(0.01), TOPIC, answer(1.5), 1)
    assert cache.get(at(0.0), 2) == {TOPIC: answer(1.0)}
    cache.put(at(0.02), TOPIC, answer(50.0), 3)
    assert cache.get(at(0.02), 4) is not None, "2 / sqrt(5) is 0.89"
    cache.put(at(0.03), TOPIC, answer(50.0), 5)
    assert cache.get(at(0.02), 6) == {TOPIC: answer(50.0)}, (
        "2 / sqrt(8) is 0.707, and the nearest of the first cluster"
    )
    cache.put(at(0.04), TOPIC, answer(90.0), 7)
    assert cache.get(at(0.02), 8) is None, "2 / sqrt(9) is less"
