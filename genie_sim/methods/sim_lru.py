"""SIM-LRU and RND-LRU: the answer to a similar image is replayed (S. Pandey et al., WWW 2009)."""

from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.marks import Bounds
from genie_sim.base.seeds import Draws
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import Replay, SimilarityCache, SimilarityCaching
from genie_sim.sim.draw_keys import frame_key
from genie_sim.sim.method import HostContext


class NearestCache(SimilarityCache):
    """A hit is the nearest stored key up to ``radius`` away; it moves to the front, the request is
    not stored.
    """

    def __init__(self, capacity: Capacity | None, radius: float, replay: Replay = "world") -> None:
        super().__init__(LRU(), capacity, replay)
        self.reach = radius


class RandomNearestCache(NearestCache):
    """A stored key at the distance ``d`` is a hit with probability max(0, 1 - d / radius)."""

    def __init__(
        self,
        capacity: Capacity | None,
        radius: float,
        draws: Draws,
        replay: Replay = "world",
    ) -> None:
        super().__init__(capacity, radius, replay)
        self._draws = draws

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        nearest = self.near(key, 1, now_ns, self.reach)
        if not nearest:
            return None
        distance, neighbour = nearest[0]
        number = self._draws.uniform(frame_key(key.header))
        is_hit = number * self.reach < self.reach - distance
        return neighbour if is_hit or distance == 0 else None


@dataclass(frozen=True, kw_only=True)
class SimLRU(SimilarityCaching):
    """SIM-LRU: the answer to the nearest image within a radius is replayed for an image."""

    title = "SIM-LRU"

    radius: Annotated[float, Bounds(minimum=0)] = 0.1
    """The distance up to which an image's answer is replayed."""

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return NearestCache(capacity, self.radius, self.replay)


class RndLRU(SimLRU):
    """RND-LRU: the nearer the nearest image, the more likely its answer is replayed."""

    title = "RND-LRU"

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return RandomNearestCache(capacity, self.radius, host.draws("rnd_lru"), self.replay)
