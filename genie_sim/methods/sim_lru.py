"""SIM-LRU and RND-LRU: what is near enough is the same (F. Chierichetti, R. Kumar, S. Vassilvitskii, PODS 2009)."""

import numpy as np

from genie_sim.core.caches.cache import Replay, SimilarityCache
from genie_sim.core.caches.nearest import Key
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import Similarity, at_least
from genie_sim.sim.station import Place


class SimLRU(SimilarityCache):
    """A hit is the nearest stored key up to ``radius`` away; it moves to the front, the request is not stored."""

    def __init__(self, capacity: Capacity | None, radius: float, replay: Replay = "world") -> None:
        super().__init__(LRU(), capacity, replay)
        self.reach = radius


class RndLRU(SimLRU):
    """What is ``d`` away is a hit with probability max(0, 1 - d / radius)."""

    def __init__(
        self,
        capacity: Capacity | None,
        radius: float,
        rng: np.random.Generator,
        replay: Replay = "world",
    ) -> None:
        super().__init__(capacity, radius, replay)
        self._rng = rng

    def choose(self, key: Key, now_ns: int) -> Key | None:
        nearest = self.near(key, 1, now_ns, self.reach)
        if not nearest:
            return None
        distance, held = nearest[0]
        return (
            held
            if self._rng.random() * self.reach < self.reach - distance or not distance
            else None
        )


class SimilarityLRU(Similarity):
    """SIM-LRU: the answer to the nearest picture within a radius stands for a picture's own."""

    title = "SIM-LRU"

    def __init__(
        self, radius: float = 0.1, feature: str = "hsv", replay: Replay = "camera"
    ) -> None:
        self.radius, self.feature, self.replay = at_least("radius", radius, 0.0), feature, replay

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return SimLRU(capacity, self.radius, self.replay)


class RandomLRU(SimilarityLRU):
    """RND-LRU: the nearer the nearest picture, the more likely its answer stands for a picture's own."""

    title = "RND-LRU"

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return RndLRU(capacity, self.radius, place.stream("rnd_lru"), self.replay)
