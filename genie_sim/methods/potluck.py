"""Potluck: every device learns how alike two pictures must be to have one answer (Guo and Hu, ASPLOS 2018)."""

from genie_sim.core.caches.cache import Replay, SimilarityCache
from genie_sim.core.caches.potluck import Potluck
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import Similarity, at_least, share
from genie_sim.sim.station import Place
from genie_sim.units import NS_PER_S


class AdaptiveThreshold(Similarity):
    """Potluck: the nearest picture within a threshold that each cache learns; some hits are dropped for that."""

    title = "Potluck"

    def __init__(
        self,
        feature: str = "hsv",
        replay: Replay = "camera",
        dropout: float = 0.1,
        warm: int = 100,
        tighten: float = 4.0,
        keep: float = 0.8,
        ttl_ns: int = 10 * NS_PER_S,
    ) -> None:
        self.feature, self.replay = feature, replay
        self._learning = share("dropout", dropout), int(at_least("warm", warm, 1)), at_least("tighten", tighten, 1.0)
        self._keep, self._ttl_ns = share("keep", keep), int(at_least("ttl", ttl_ns, 1))

    def cache(self, place: Place, capacity: Capacity | None) -> Potluck:
        rng = place.stream("potluck")
        return Potluck(capacity, rng, self.replay, *self._learning, self._keep, self._ttl_ns)

    def reach(self, cache: SimilarityCache) -> float:
        assert isinstance(cache, Potluck)
        return cache.threshold
