"""What methods with similarity caches share: where the caches stand, and what they are told."""

import math
from functools import partial
from typing import Any

from genie_sim.core.caches.cache import Replay, SimilarityCache, cache_node
from genie_sim.core.caches.nearest import Nearest, key_of
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity
from genie_sim.methods.genie import REMOTE, UPLINK
from genie_sim.sim.station import Interceptor, Method, Place, Station

LOCAL = "-local"


def share(name: str, value: float) -> float:
    """``value`` if it is from 0 to 1. Raises ``ValueError``."""
    if not 0 <= value <= 1:
        raise ValueError(f"{name}: must be from 0 to 1, but is {value:g}")
    return value


def at_least(name: str, value: float, least: float) -> float:
    """``value`` if it is a finite number, at least ``least``. Raises ``ValueError``."""
    if not least <= value < math.inf:
        raise ValueError(f"{name}: must be at least {least:g}, but is {value:g}")
    return value


class Similarity(Method):
    """A cache before every detector, on cars and edges alike; cars upload what they miss, edges share nothing.

    ``feature`` names the pictures' vectors. The car computes it and sends it along with the picture. A subclass makes
    the caches: ``cache``.
    """

    title = "similarity cache"
    feature = "hsv"
    replay: Replay = "camera"

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        raise NotImplementedError

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None  # a car without cameras has no pictures to compare
        if place.genie is None:
            return Station(detector=True)
        node = partial(self._node, place, on_edge=False, asks=place.joined)
        return Station(
            detector=True,
            interceptor=node,
            uplink=UPLINK if place.joined else None,
            key=self.feature,
        )

    def on_edge(self, place: Place) -> Station:
        if not place.sees:
            return Station()
        return Station(
            detector=True, interceptor=partial(self._node, place, on_edge=True, asks=False)
        )

    def _node(
        self,
        place: Place,
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
        *,
        on_edge: bool,
        asks: bool,
    ) -> GenieNode:
        """``asks``: what it misses goes to ``-remote``, too."""
        rules = place.genie
        assert rules is not None
        cache = self.cache(
            place, rules.capacity if on_edge or rules.car_capacity is None else rules.car_capacity
        )
        return cache_node(
            rules,
            f"{place.name}/cache",
            subscribed,
            published,
            key=key_of(self.feature),
            new_cache=lambda: cache,
            pending=lambda: Nearest(lambda: cache.reach),
            share_requests=asks,
        )


class TwoWays(Interceptor):
    """A car's pictures come here, and go to its own detector or up; answers come from both. ``known``: its state."""

    def __init__(
        self, name: str, known: Any, subscribed: tuple[str, ...], published: tuple[str, ...]
    ) -> None:
        self.name, self._known = name, known
        (self._images,), (self._objects,) = subscribed, published

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL, self._objects + REMOTE

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL, self._images + REMOTE
