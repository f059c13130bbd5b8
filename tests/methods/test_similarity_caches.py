"""Caches of similar images: which stored key is a hit, and what runs where."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from genie_sim.core.messages import Header
from genie_sim.core.rules import GenieRules
from genie_sim.methods.sim_lru import NearestCache, RandomNearestCache, RndLRU, SimLRU
from genie_sim.sim.method import LOCAL, REMOTE, REMOTE_UPLINK, LocalAndRemote


class Fixed:
    """Draws that are what it is told."""

    def __init__(self, value: float) -> None:
        self.value = value

    def uniform(self, key: str) -> float:
        return self.value


@pytest.mark.parametrize(
    ("distance", "draw", "hit"),
    [
        (0.0, 0.999, True),
        (0.5, 0.499, True),
        (0.5, 0.5, False),
        (0.5, 0.7, False),
        (0.9, 0.09, True),
        (0.9, 0.11, False),
        (1.0, 0.0, False),
    ],
)
def test_the_nearer_the_likelier(monkeypatch: Any, distance: float, draw: float, hit: bool):
    """With probability 1 - distance / radius, here of a radius of 2."""
    draws: Any = Fixed(draw)
    cache = RandomNearestCache(None, 2.0, draws)
    near = [(2.0 * distance, "stored")]
    monkeypatch.setattr(cache, "near", lambda key, count, now_ns, reach: near[:count])
    asked: Any = SimpleNamespace(header=Header(1, "front", "car1"))
    assert cache.choose(asked, 5) == ("stored" if hit else None)


def test_a_key_at_no_distance_is_a_hit_even_where_the_radius_is_zero(monkeypatch: Any):
    draws: Any = Fixed(0.5)
    cache = RandomNearestCache(None, 0.0, draws)
    asked: Any = SimpleNamespace(header=Header(1, "front", "car1"))
    monkeypatch.setattr(cache, "near", lambda *_: [(0.0, "stored")])
    assert cache.choose(asked, 5) == "stored"
    monkeypatch.setattr(cache, "near", lambda *_: [])
    assert cache.choose(asked, 5) is None


def host(**other: Any) -> Any:
    rules = GenieRules()
    about = {"gets_images": True, "has_edge": True, "genie": rules, "rules": rules, "name": "car1"}
    return SimpleNamespace(**{**about, **other, "draws": lambda name: name})


def test_what_runs_on_a_car():
    method = SimLRU(feature="yolox_gap")
    config = method.on_car(host())
    assert config is not None and config.detector and config.interceptor is not None
    assert config.uplink == REMOTE_UPLINK and config.costs.key == "yolox_gap"
    alone = method.on_car(host(has_edge=False))
    assert alone is not None and alone.uplink is None and alone.interceptor is not None
    plain = method.on_car(host(genie=None))
    assert plain is not None and plain.detector and plain.interceptor is None
    assert method.on_car(host(gets_images=False)) is None


def test_what_runs_on_an_edge():
    config = SimLRU().on_edge(host())
    assert config.detector and config.interceptor is not None and not config.neighbour_topics
    empty = SimLRU().on_edge(host(gets_images=False))
    assert not empty.detector and empty.interceptor is None


def test_caches_have_the_radius_and_only_one_draws():
    nearest, random = (method(radius=0.3).cache(host(), None) for method in (SimLRU, RndLRU))
    assert type(nearest) is NearestCache and type(random) is RandomNearestCache
    assert nearest.reach == random.reach == 0.3


def test_a_router_hears_both_detectors_and_speaks_to_both():
    router = LocalAndRemote("car1/router", ("/image_raw",), ("/objects",))
    objects, images = "/objects", "/image_raw"
    assert router.subscriptions() == (images, objects + LOCAL, objects + REMOTE)
    assert router.publications() == (objects, images + LOCAL, images + REMOTE)
