"""Similarity caches against what their sources say of them."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.core.rules import Capacity
from genie_sim.methods.sim_lru import NearestCache
from tests.methods.caches.vectors import TOPIC, answer, at, key


def requests(items: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rates after Zipf's law in a random order, and independent requests."""
    rng = np.random.default_rng(seed)
    rates = rng.permutation(1.0 / np.arange(1, items + 1) ** 0.8)
    return rates / rates.sum(), rng.choice(items, count, p=rates / rates.sum())


def hit_ratio(places: np.ndarray, asked: np.ndarray, capacity: int, radius: float) -> float:
    cache, hits, nothing = NearestCache(Capacity(entries=capacity), radius), 0, answer()
    for now, item in enumerate(asked):
        one = key(places[item])
        if cache.get(one, now) is not None:
            hits += now >= len(asked) // 5  # then the cache is warm
        else:
            cache.put(one, TOPIC, nothing, now)
    return hits / (len(asked) - len(asked) // 5)


def ttl_approximation(places: np.ndarray, rates: np.ndarray, capacity: int, reach: float) -> float:
    """The hit ratio of SIM-LRU for items on a line, in rising order, under independent requests.

    As Che's approximation of LRU, in the manner of Y. Ben Mazziane, S. Alouf, G. Neglia, D. S.
    Menasche (arXiv 2209.03174): an item's stay ends when nobody has refreshed it for one
    characteristic time. What is within reach of an item excludes it from the cache; all else is
    taken to be independent.
    """
    apart = np.abs(places[:, None] - places[None, :])
    inside = (apart <= reach) & ~np.eye(len(places), dtype=bool)
    left, right = np.tril(inside), np.triu(inside)
    # Who takes the requests for j from i, although i holds: nearer to j, and not excluded by i.
    takes = [
        [
            (j, np.flatnonzero((apart[j] <= reach) & (apart[j] < apart[j, i]) & (apart[i] > reach)))
            for j in np.flatnonzero(inside[i])
        ]
        for i in range(len(places))
    ]

    def nobody_else(held: np.ndarray) -> np.ndarray:
        """Nothing within reach is held, given that the item itself is not."""
        free = 1.0 - held
        return np.maximum(1.0 - left @ held / free, 0.0) * np.maximum(
            1.0 - right @ held / free, 0.0
        )

    def refreshed(held: np.ndarray) -> np.ndarray:
        found = rates.copy()
        for i, others in enumerate(takes):
            for j, nearer in others:
                taken = sum(
                    held[k] / max(1.0 - held[inside[k] & inside[i]].sum(), 0.05) for k in nearer
                )
                found[i] += rates[j] * max(1.0 - taken, 0.0)
        return found

    held = np.full(len(rates), capacity / len(rates) / 2)
    for _ in range(150):
        again, comes = refreshed(held), rates * nobody_else(held)
        low, high = 0.0, 1e6
        for _ in range(50):
            time = (low + high) / 2
            stays = np.expm1(np.minimum(again * time, 60.0)) / again
            now = stays / (stays + 1.0 / np.maximum(comes, 1e-12))
            low, high = (time, high) if now.sum() < capacity else (low, time)
        held = 0.8 * held + 0.2 * now
    return float(rates @ (1.0 - (1.0 - held) * nobody_else(held)))


@pytest.mark.slow
@pytest.mark.parametrize(("capacity", "reach"), [(15, 4), (30, 4), (15, 12)])
def test_hits_of_sim_lru_are_those_of_its_ttl_approximation(capacity: int, reach: int):
    places = np.sort(np.random.default_rng(5).choice(1000, 120, replace=False)).astype(float)
    rates, asked = requests(120, 25_000, seed=11)
    found = hit_ratio(places, asked, capacity, (reach + 0.4) / 254)
    assert found == pytest.approx(ttl_approximation(places, rates, capacity, reach), rel=0.05)
    assert found > 1.1 * hit_ratio(places, asked, capacity, 0.0), "similarity brings much here"


@pytest.mark.parametrize("capacity", [1, 7, 40])
def test_at_radius_nought_it_is_lru_to_the_hit(capacity: int):
    libcachesim = pytest.importorskip(
        "libcachesim", reason="needs libcachesim: pip install 'genie-sim[test]'"
    )
    _, asked = requests(80, 3_000, seed=capacity)
    reference = libcachesim.LRU(cache_size=capacity, hashpower=12)
    expected = [reference.get(libcachesim.Request(obj_id=int(item), obj_size=1)) for item in asked]
    cache = NearestCache(Capacity(entries=capacity), radius=0.0)
    found = []
    for now, item in enumerate(asked):
        found.append(cache.get(key(item), now) is not None)
        if not found[-1]:
            cache.put(key(item), TOPIC, answer(), now)
    assert found == expected


def test_objects_of_a_stored_answer_are_those_of_the_latest_one():
    """What is compared is the answer that would be replayed, not one that it has replaced."""
    cache, stored = NearestCache(Capacity(entries=3), radius=0.1), at(0.0)
    cache.put(stored, TOPIC, answer(1.0), 0)
    before = cache.stored_objects(stored)
    assert cache.stored_objects(stored) is before, "worked out once"
    cache.put(stored, TOPIC, answer(50.0), 1)
    assert cache.stored_objects(stored).placed != before.placed
