"""FoggyCache: caches on cars and edges in which the nearest pictures vote (Guo et al., MobiCom 2018)."""

from genie_sim.core.caches.cache import Replay, SimilarityCache
from genie_sim.core.caches.foggycache import FoggyCache
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import Similarity, at_least, share
from genie_sim.sim.station import Place


class Foggy(Similarity):
    """FoggyCache: the answers to the nearest pictures vote; where they agree, the nearest of them is replayed."""

    title = "FoggyCache"

    def __init__(
        self,
        theta: float = 0.8,
        neighbours: int = 10,
        radius: float = 0.3,
        feature: str = "hsv",
        replay: Replay = "camera",
    ) -> None:
        self.theta, self.neighbours = share("theta", theta), int(at_least("neighbours", neighbours, 2))
        self.radius, self.feature, self.replay = at_least("radius", radius, 0.0), feature, replay

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        rng = place.stream("foggycache")
        return FoggyCache(capacity, rng, self.replay, self.theta, self.neighbours, self.radius)
