"""Cachier: caches on the edges of a cloud, each as large as pays (U. Drolia et al., ICDCS 2017)."""

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import accumulate
from typing import Annotated

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.marks import Bounds
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.eviction import Eviction
from genie_sim.core.messages import Answer
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import Exact
from genie_sim.methods.nearest import FeatureKey, Nearest
from genie_sim.methods.remote import Remote
from genie_sim.methods.similarity_cache import (
    SimilarityCache,
    SimilarityCaching,
    cache_rules,
    check_neighbour,
    stores_nothing,
)
from genie_sim.sim.method import IMAGES, OBJECTS, REMOTE, Costs, HostConfig, HostContext

GAIN = 1 / 8  # of the mean of the cloud's times, as TCP's of round-trip times (RFC 6298)
AGEING = 1 / 2  # assumed: the share of every count that is left after a period
RARE = 1 / 16  # assumed: with fewer requests than this, aged, a key is forgotten
LOST_NS = 2 * NS_PER_S  # assumed: an answer that takes longer does not arrive any more


def best_size(counts: Iterable[float], per_entry_ns: float, cloud_ns: float) -> int:
    """The k for which f(k) + (1 - P(k)) cloud is least; of equally good ones the smallest.

    f(k) = ``per_entry_ns`` k is the time of a look-up among k keys, P(k) the share of the requests
    (``counts``, by key) for the k most popular ones, and ``cloud_ns`` the time until the cloud's
    answer arrives.
    """
    descending = sorted(counts, reverse=True)
    total = math.fsum(descending) or 1.0
    masses = accumulate(descending, initial=0.0)
    costs_ns = [k * per_entry_ns + (1 - mass / total) * cloud_ns for k, mass in enumerate(masses)]
    return costs_ns.index(min(costs_ns))


class PopularityEviction(Eviction):
    """Counts the requests for each key, with ageing. Of the stored keys the least popular goes
    first, of equally popular ones the least recently requested (LFU with recency).
    """

    def __init__(self) -> None:
        super().__init__()
        self.counts: dict[Hashable, float] = {}  # in the order of the last requests

    def requested(self, key: Hashable) -> None:
        """One more request for a key."""
        self.counts[key] = self.counts.pop(key, 0.0) + 1

    def victim(self) -> Hashable:
        return min((key for key in self.counts if key in self._keys), key=self.counts.__getitem__)

    def age(self) -> list[Hashable]:
        """Shrinks every count; forgets and returns the keys that are neither stored nor popular any
        more.
        """
        self.counts = {key: count * AGEING for key, count in self.counts.items()}
        gone = [key for key, count in self.counts.items() if count < RARE and key not in self._keys]
        for key in gone:
            del self.counts[key]
        return gone


class PopularityCache(SimilarityCache):
    """Holds the answers to the k most popular images; those within ``radius`` of one another count
    as the same one.

    Every ``period_ns`` the counts age and k is computed anew (``best_size``). Until the first
    answer arrives, and where all known keys together are best, only the capacity limits the cache.
    """

    def __init__(self, settings: "Cachier", capacity: Capacity | None) -> None:
        self.popularity = PopularityEviction()
        super().__init__(self.popularity, capacity, settings.replay)
        self.reach = settings.radius
        self.size: int | None = None  # k; ``None``: no limit
        self.cloud_ns: float | None = None  # mean time from a miss to its answer
        self._per_entry_ns = settings.per_entry_ns
        self._period_ns = settings.period_ns
        self._next_ns: int | None = None  # when k is computed again
        self._requested = Nearest()  # the keys of all counts
        self._missed_ns: dict[Hashable, int] = {}  # misses without an answer, the oldest first

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        if self._next_ns is None or now_ns >= self._next_ns:
            self._resize()
            self._next_ns = now_ns + self._period_ns
        hits = self.near(key, 1, now_ns, self.reach)
        similar = hits or self._requested.near(key, 1, self.reach)
        if not similar:
            self._requested.add(key)
        self.popularity.requested(similar[0][1] if similar else key)
        if hits:
            return hits[0][1]
        self._expire_misses(now_ns)
        self._missed_ns[key] = now_ns
        return None

    def learn(self, key: FeatureKey, answer: Answer, now_ns: int) -> None:
        """Measures the cloud's time. The image takes the place of the one that it was counted for,
        if there is one.
        """
        duration_ns = now_ns - self._missed_ns.pop(key, now_ns - LOST_NS)
        if self.cloud_ns is None:
            self.cloud_ns = duration_ns
        else:
            self.cloud_ns += GAIN * (duration_ns - self.cloud_ns)
        counts = self.popularity.counts
        if key not in counts:
            for _, twin in self._requested.near(key, 1, self.reach):
                counts[key] = counts.pop(twin)
                self._requested.discard(twin)
                if twin in self.answers:
                    self.remove(twin)
        counts.setdefault(key, 1.0)
        self._requested.add(key)

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        super().put(key, topic, answer, now_ns)
        self._shrink()

    def _expire_misses(self, now_ns: int) -> None:
        for key, missed_ns in list(self._missed_ns.items()):
            if now_ns - missed_ns <= LOST_NS:
                break
            del self._missed_ns[key]

    def _resize(self) -> None:
        for key in self.popularity.age():
            self._requested.discard(key)
        if self.cloud_ns is not None:
            counts = self.popularity.counts.values()
            best = best_size(counts, self._per_entry_ns, self.cloud_ns)
            self.size = None if best == len(counts) else best
            self._shrink()

    def _shrink(self) -> None:
        while self.size is not None and len(self) > self.size:
            self.remove(self.popularity.victim())


@dataclass(frozen=True, kw_only=True)
class Cachier(SimilarityCaching):
    """Cachier: one edge stands for the cloud and alone detects; the others have caches as large as
    pays.
    """

    title = "Cachier"

    cloud: str | None = None
    """The edge that stands for the cloud; `null`: the last one."""

    per_entry_ns: int = 2 * NS_PER_MS
    """CPU time to compare an image with one stored key."""

    period_ns: Annotated[int, Bounds(above=0)] = 5 * NS_PER_S
    """The time between two computations of a cache's size."""

    radius: Annotated[float, Bounds(minimum=0)] = 0.1
    """The distance up to which two images count as the same."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        return Remote().on_car(host)

    def on_edge(self, host: HostContext) -> HostConfig:
        cloud = host.edges[-1] if self.cloud is None else self.cloud
        if cloud not in host.edges:
            raise UserError(f"cachier: cloud: {unknown('edge', cloud, host.edges)}")
        if host.name == cloud:
            return HostConfig(
                detector=True,
                interceptor=partial(_cloud, host),
                neighbour_topics=(IMAGES + REMOTE,),
            )
        if not host.gets_images:
            return HostConfig()
        check_neighbour(host, cloud, "cachier: cloud")
        return HostConfig(
            interceptor=partial(self._node, host, host.rules.capacity, forwards_misses=True),
            neighbour_topics=(OBJECTS + REMOTE,),
            costs=Costs(key=self.feature, per_entry_ns=self.per_entry_ns),
        )

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return PopularityCache(self, capacity)


def _cloud(host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> GenieNode:
    """The cloud's node. It stores nothing: each request goes to its detector, whose answer goes
    back to the requester.
    """
    rules = cache_rules(host.rules, share_requests=False)
    return GenieNode(
        f"{host.name}/cloud",
        inputs,
        outputs,
        replace(rules, same_key_pending="forward", neighbour_miss="process"),
        key=Exact().key,
        new_keys=Exact().index,
        new_cache=stores_nothing,
        object_map=None,
    )
