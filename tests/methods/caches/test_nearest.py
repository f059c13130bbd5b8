"""The nearest keys against the plain definition, and what a cache replays of them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from genie_sim.base.features import UNIT
from genie_sim.base.seeds import Draws
from genie_sim.core.messages import CameraPose
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import Nearest
from genie_sim.methods.sim_lru import NearestCache, RandomNearestCache
from genie_sim.methods.similarity_cache import moved
from tests.methods.caches.vectors import HERE, TOPIC, answer, at, key


def test_near_keys_are_those_of_the_definition_through_growth_and_removal():
    rng = np.random.default_rng(7)
    store, held = Nearest(), []
    for step in range(600):
        if held and rng.random() < 0.4:
            store.discard(held.pop(int(rng.integers(len(held)))))
        else:
            held.append(key(*rng.integers(-9, 9, 3), stream="left" if step % 3 else "right"))
            store.add(held[-1])
        asked, count, radius = (
            key(*rng.integers(-9, 9, 3), stream="left"),
            int(rng.integers(1, 5)),
            8 / UNIT,
        )
        expected = sorted(
            (
                (float(np.linalg.norm(one.vector - asked.vector)) / UNIT, born, one)
                for born, one in enumerate(held)
                if one.stream == "left"
            ),
            key=lambda found: found[:2],
        )
        expected = [(distance, one) for distance, _, one in expected if distance <= radius][:count]
        found = store.near(asked, count, radius)
        assert [one for _, one in found] == [one for _, one in expected]
        assert [distance for distance, _ in found] == pytest.approx(
            [distance for distance, _ in expected]
        )
    assert len(store) == len(held)


def test_a_key_finds_itself_and_with_a_radius_its_neighbour():
    near, far = at(0.1), at(0.5)
    exact, tolerant = Nearest(), Nearest(lambda: 0.2)
    for store in (exact, tolerant):
        assert store.find(near) is None
        store.add(near)
        store.add(far)
        assert store.find(near) is near
    assert exact.find(at(0.1)) is None, "another picture is another key, however alike"
    assert tolerant.find(at(0.0)) is near
    assert tolerant.find(at(0.29)) is near
    assert tolerant.find(at(0.8)) is None
    tolerant.discard(near)
    assert tolerant.find(at(0.1)) is None


def test_sim_lru_serves_near_ones_and_does_not_store_them():
    cache = NearestCache(Capacity(entries=2), radius=0.1)
    first, second, third = at(0.0), at(1.0), at(2.0)
    cache.put(first, TOPIC, answer(1.0), 0)
    cache.put(second, TOPIC, answer(2.0), 1)
    assert cache.get(at(0.09), 2) == {TOPIC: answer(1.0)}
    assert cache.get(at(0.11), 2) is None
    assert len(cache) == 2
    cache.put(third, TOPIC, answer(3.0), 3)  # the first was used last: the second goes
    assert cache.get(at(1.0), 4) is None
    assert cache.get(at(0.0), 4) is not None


def test_rnd_lru_hits_in_proportion_to_nearness():
    cache = RandomNearestCache(None, 0.4, Draws(3))
    cache.put(at(0.0), TOPIC, answer(), 0)
    for distance, expected in ((0.0, 1.0), (0.1, 0.75), (0.3, 0.25), (0.41, 0.0)):
        hits = sum(cache.get(at(distance), 1) is not None for _ in range(2000))
        assert hits / 2000 == pytest.approx(expected, abs=0.04), distance


def test_an_answer_moves_with_its_camera():
    here = CameraPose(100.0, 50.0, 1.6, math.pi / 2)
    (one,) = moved(answer(10.0), HERE, here).objects
    assert one.location == pytest.approx((100.0, 60.0, 0.8))
    # 3 m to the right of where it was: the car is 3 m to its left
    aside = CameraPose(0.0, -3.0, 1.6, 0.0)
    (one,) = moved(answer(10.0), aside, here).objects
    assert one.location == pytest.approx((97.0, 60.0, 0.8))
    assert moved(answer(10.0), HERE, HERE) == answer(10.0)
    of_another_type = SimpleNamespace(objects=None)
    assert moved(of_another_type, HERE, here) is of_another_type
    cache = NearestCache(None, 0.1, replay="camera")
    cache.put(key(0), TOPIC, answer(10.0), 0)
    (seen,) = cache.get(key(1, pose=here), 1)[TOPIC].objects
    assert seen.location == pytest.approx((100.0, 60.0, 0.8))
