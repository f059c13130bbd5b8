"""SIM-LRU: an LRU cache in which a near key is as good as an equal one (Chierichetti et al., PODS 2009)."""

from genie_sim.core.caches.cache import Replay, SimilarityCache
from genie_sim.core.caches.radius import SimLRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import Similarity, at_least
from genie_sim.sim.station import Place


class SimilarityLRU(Similarity):
    """SIM-LRU: the answer to the nearest picture within a radius stands for a picture's own."""

    title = "SIM-LRU"

    def __init__(self, radius: float = 0.1, feature: str = "hsv", replay: Replay = "camera") -> None:
        self.radius, self.feature, self.replay = at_least("radius", radius, 0.0), feature, replay

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return SimLRU(capacity, self.radius, self.replay)

    def reach(self, cache: SimilarityCache) -> float:
        return self.radius
