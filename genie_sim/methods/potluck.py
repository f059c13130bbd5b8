"""Potluck: every device learns how alike two pictures must be to have one answer (Guo and Hu, ASPLOS 2018)."""

from collections.abc import Hashable

import numpy as np

from genie_sim.core.caches.cache import Replay, SimilarityCache, same
from genie_sim.core.caches.nearest import Key
from genie_sim.core.eviction import TTL
from genie_sim.core.rules import Capacity
from genie_sim.messages import Answer
from genie_sim.methods.similarity import Similarity, at_least, share
from genie_sim.sim.station import Place
from genie_sim.units import NS_PER_S


class Importance(TTL):
    """The answer that saves least goes first: uses per byte, since all took equally long; then the oldest."""

    def __init__(self, ttl_ns: int) -> None:
        super().__init__(ttl_ns)
        self._uses: dict[Hashable, int] = {}
        self.sizes: dict[Hashable, int] = {}

    def stored(self, key: Hashable, now_ns: int) -> None:
        super().stored(key, now_ns)
        self.used(key, now_ns)

    def used(self, key: Hashable, now_ns: int) -> None:
        self._uses[key] = self._uses.get(key, 0) + 1

    def removed(self, key: Hashable) -> None:
        super().removed(key)
        self._uses.pop(key, None)
        self.sizes.pop(key, None)

    def victim(self) -> Hashable:
        return min(self._keys, key=lambda key: self._uses[key] / self.sizes[key])


class Potluck(SimilarityCache):
    """A hit is the nearest stored key up to ``reach`` away, the threshold, but for a share of ``dropout``: misses.

    After a miss, as soon as ``warm`` requests are stored: two different answers within the threshold divide it by
    ``tighten``; two equal ones beyond it draw it nearer to their distance, keeping a share of ``keep``.
    """

    def __init__(
        self,
        capacity: Capacity | None,
        rng: np.random.Generator,
        replay: Replay = "world",
        dropout: float = 0.1,
        warm: int = 100,
        tighten: float = 4.0,
        keep: float = 0.8,
        ttl_ns: int = 10**10,
    ) -> None:
        self._importance = Importance(ttl_ns)
        super().__init__(self._importance, capacity, replay)
        self.reach = 0.0
        self._rng = rng
        self._dropout, self._warm, self._tighten, self._keep = dropout, warm, tighten, keep

    def choose(self, key: Key, now_ns: int) -> Key | None:
        return None if self._rng.random() < self._dropout else super().choose(key, now_ns)

    def learn(self, key: Key, answer: Answer, now_ns: int) -> None:
        nearest = self.near(key, 1, now_ns) if len(self) >= self._warm else []
        for distance, other in nearest:
            agree = same(self.seen([answer], key.pose), self.held(other))
            if distance <= self.reach and not agree:
                self.reach /= self._tighten
            elif distance > self.reach and agree:
                self.reach = (1 - self._keep) * distance + self._keep * self.reach

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        self._importance.sizes[key] = answer.size_bytes
        super().put(key, topic, answer, now_ns)
        if key not in self._answers:  # it was larger than the whole cache
            self._importance.sizes.pop(key, None)


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
        self._learning = (
            share("dropout", dropout),
            int(at_least("warm", warm, 1)),
            at_least("tighten", tighten, 1.0),
        )
        self._keep, self._ttl_ns = share("keep", keep), int(at_least("ttl", ttl_ns, 1))

    def cache(self, place: Place, capacity: Capacity | None) -> Potluck:
        rng = place.stream("potluck")
        return Potluck(capacity, rng, self.replay, *self._learning, self._keep, self._ttl_ns)
