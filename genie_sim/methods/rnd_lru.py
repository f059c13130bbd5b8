"""RND-LRU: SIM-LRU in which farther keys are hits more rarely (Chierichetti et al., PODS 2009)."""

from genie_sim.core.caches.cache import SimilarityCache
from genie_sim.core.caches.radius import RndLRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.sim_lru import SimilarityLRU
from genie_sim.sim.station import Place


class RandomLRU(SimilarityLRU):
    """RND-LRU: the nearer the nearest picture, the more likely its answer stands for a picture's own."""

    title = "RND-LRU"

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return RndLRU(capacity, self.radius, place.stream("rnd_lru"), self.replay)
