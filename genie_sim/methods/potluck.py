"""Potluck: every device learns how similar two images must be to share an answer (Guo and Hu,
ASPLOS 2018).
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.marks import Bounds, Count, Share
from genie_sim.base.seeds import Draws
from genie_sim.base.units import NS_PER_S
from genie_sim.core.eviction import TTL
from genie_sim.core.message_cache import Answers
from genie_sim.core.messages import Answer
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import (
    SimilarityCache,
    SimilarityCaching,
    are_same,
)
from genie_sim.sim.draw_keys import frame_key
from genie_sim.sim.method import HostContext


class ImportanceEviction(TTL):
    """The answer that saves least goes first: uses per byte, since all took equally long; then the
    oldest.
    """

    def __init__(self, ttl_ns: int) -> None:
        super().__init__(ttl_ns)
        self.answers: Mapping[Hashable, Answers] = {}  # of the cache
        self._uses: dict[Hashable, int] = {}

    def stored(self, key: Hashable, now_ns: int) -> None:
        super().stored(key, now_ns)
        self.used(key, now_ns)

    def used(self, key: Hashable, now_ns: int) -> None:
        self._uses[key] = self._uses.get(key, 0) + 1

    def removed(self, key: Hashable) -> None:
        super().removed(key)
        self._uses.pop(key, None)

    def victim(self) -> Hashable:
        return min(self._keys, key=self._importance)

    def _importance(self, key: Hashable) -> float:
        size_bytes = sum(answer.size_bytes for answer in self.answers[key].values())
        return self._uses[key] / size_bytes


class AdaptiveThresholdCache(SimilarityCache):
    """A hit is the nearest stored key up to ``reach`` away, the threshold, but for the share of
    ``dropout``, which ``draws`` picks.

    After a miss, as soon as ``warm`` requests are stored: two different answers within the
    threshold divide it by ``tighten``; two equal ones beyond it draw it nearer to their distance.
    """

    def __init__(self, settings: "Potluck", capacity: Capacity | None, draws: Draws) -> None:
        importance = ImportanceEviction(settings.ttl_ns)
        super().__init__(importance, capacity, settings.replay)
        importance.answers = self.answers
        self.reach = 0.0
        self._settings = settings
        self._draws = draws

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        if self._draws.uniform(frame_key(key.header)) < self._settings.dropout:
            return None
        return super().choose(key, now_ns)

    def learn(self, key: FeatureKey, answer: Answer, now_ns: int) -> None:
        settings = self._settings
        if len(self) < settings.warm:
            return
        for distance, neighbour in self.near(key, 1, now_ns):
            agree = are_same(self.objects_of([answer], key.pose), self.stored_objects(neighbour))
            if distance <= self.reach and not agree:
                self.reach /= settings.tighten
            elif distance > self.reach and agree:
                self.reach = (1 - settings.keep) * distance + settings.keep * self.reach


@dataclass(frozen=True, kw_only=True)
class Potluck(SimilarityCaching):
    """Potluck: the nearest image within a threshold that each cache learns; some hits are dropped
    for that.
    """

    title = "Potluck"

    dropout: Share = 0.1
    """The share of hits that count as misses."""

    warm: Count = 100
    """The number of stored requests from which on the threshold is learned."""

    tighten: Annotated[float, Bounds(minimum=1)] = 4.0
    """What a wrong hit divides the threshold by."""

    keep: Share = 0.8
    """The share of the old threshold in the new one when it grows."""

    ttl_ns: Annotated[int, Bounds(above=0)] = 10 * NS_PER_S
    """How long an answer is kept."""

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return AdaptiveThresholdCache(self, capacity, host.draws("potluck"))
