"""Cachier: caches on the edges of a cloud, each as large as pays (U. Drolia et al., ICDCS 2017)."""

from collections.abc import Hashable, Iterable
from functools import partial
from itertools import accumulate
from typing import Any

from genie_sim.core.caches.cache import Replay, SimilarityCache, cache_node, stores_nothing
from genie_sim.core.caches.nearest import Key, Nearest
from genie_sim.core.eviction import Eviction
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import Exact
from genie_sim.errors import UserError, unknown
from genie_sim.messages import Answer
from genie_sim.methods.genie import REMOTE
from genie_sim.methods.remote import Remote
from genie_sim.methods.similarity import Similarity, at_least
from genie_sim.sim.station import IMAGES, OBJECTS, Place, Station
from genie_sim.units import NS_PER_MS, NS_PER_S

GAIN = 1 / 8  # of the mean of the cloud's times, as TCP's of round-trip times (RFC 6298)
AGEING = 1 / 2  # assumed: what is left of every count after a period
RARE = 1 / 16  # assumed: with fewer requests than this, aged, a key is forgotten
LOST_NS = 2 * 10**9  # assumed: an answer that has not come by then does not come any more


def best_size(counts: Iterable[float], per_entry_ns: float, cloud_ns: float) -> int:
    """The k for which f(k) + (1 - P(k)) cloud is least; of equally good ones the smallest.

    f(k) = ``per_entry_ns`` k is the time of a look-up among k keys, P(k) the share of the requests (``counts``, by key)
    that ask for the k most popular ones, and ``cloud_ns`` the time until the cloud's answer is here.
    """
    ordered = sorted(counts, reverse=True)
    total = sum(ordered) or 1.0
    masses = accumulate(ordered, initial=0.0)
    expected = [k * per_entry_ns + (1 - mass / total) * cloud_ns for k, mass in enumerate(masses)]
    return expected.index(min(expected))


class Popularity(Eviction):
    """How often each known key was asked for, of late; of the stored ones the least popular goes first, of equally
    popular ones the one not asked for the longest (LFU with recency)."""

    def __init__(self) -> None:
        super().__init__()
        self.counts: dict[
            Hashable, float
        ] = {}  # of all known keys, in the order of their last requests

    def asked(self, key: Hashable) -> None:
        """One more request for a key."""
        self.counts[key] = self.counts.pop(key, 0.0) + 1

    def victim(self) -> Hashable:
        return min((key for key in self.counts if key in self._keys), key=self.counts.__getitem__)

    def age(self) -> list[Hashable]:
        """Every count shrinks; forgets and returns the keys that are neither stored nor popular any more."""
        self.counts = {key: count * AGEING for key, count in self.counts.items()}
        gone = [key for key, count in self.counts.items() if count < RARE and key not in self._keys]
        for key in gone:
            del self.counts[key]
        return gone


class Cachier(SimilarityCache):
    """Holds the answers to the k most popular pictures; those within ``radius`` of one another are the same one.

    Every ``period_ns`` the counts age and k is found anew (``best_size``). Until the first answer is here, and where
    everything known is best, only the capacity limits it.
    """

    def __init__(
        self,
        capacity: Capacity | None,
        radius: float,
        per_entry_ns: int,
        period_ns: int,
        replay: Replay = "camera",
    ) -> None:
        self.popularity = Popularity()
        super().__init__(self.popularity, capacity, replay)
        self.reach = radius
        self.size: int | None = None  # k; ``None``: no limit
        self.cloud_ns: float | None = None  # mean time from a miss to its answer
        self._per_entry_ns, self._period_ns = per_entry_ns, period_ns
        self._next_ns: int | None = None
        self._known = Nearest()  # the keys of all counts
        self._asked_ns: dict[Hashable, int] = {}  # misses without an answer, the oldest first

    def choose(self, key: Key, now_ns: int) -> Key | None:
        if self._next_ns is None or now_ns >= self._next_ns:
            self._solve()
            self._next_ns = now_ns + self._period_ns
        stored = self.near(key, 1, now_ns, self.reach)
        alike = stored or self._known.near(key, 1, self.reach)
        if not alike:
            self._known.add(key)
        self.popularity.asked(alike[0][1] if alike else key)
        if stored:
            return stored[0][1]
        while (
            self._asked_ns and now_ns - (oldest := next(iter(self._asked_ns.items())))[1] > LOST_NS
        ):
            del self._asked_ns[oldest[0]]
        self._asked_ns[key] = now_ns
        return None

    def learn(self, key: Key, answer: Answer, now_ns: int) -> None:
        """The cloud has answered. The picture takes the place of the one that it was counted for, if there is one."""
        taken_ns = now_ns - self._asked_ns.pop(key, now_ns - LOST_NS)
        self.cloud_ns = (
            taken_ns if self.cloud_ns is None else self.cloud_ns + GAIN * (taken_ns - self.cloud_ns)
        )
        counts = self.popularity.counts
        for _, other in self._known.near(key, 1, self.reach) if key not in counts else ():
            counts[key] = counts.pop(other)
            self._known.discard(other)
            if other in self._answers:
                self._remove(other)
        counts.setdefault(key, 1.0)
        self._known.add(key)

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        super().put(key, topic, answer, now_ns)
        self._shrink()

    def _solve(self) -> None:
        for key in self.popularity.age():
            self._known.discard(key)
        if self.cloud_ns is not None:
            counts = self.popularity.counts.values()
            best = best_size(counts, self._per_entry_ns, self.cloud_ns)
            self.size = None if best == len(counts) else best
            self._shrink()

    def _shrink(self) -> None:
        while self.size is not None and len(self) > self.size:
            self._remove(self.popularity.victim())


class EdgeOfCloud(Similarity):
    """Cachier: one edge stands for the cloud and alone detects; the others have caches as large as pays."""

    title = "Cachier"

    def __init__(
        self,
        cloud: str | None = None,
        per_entry_ns: int = 2 * NS_PER_MS,
        period_ns: int = 5 * NS_PER_S,
        radius: float = 0.1,
        feature: str = "hsv",
        replay: Replay = "camera",
    ) -> None:
        """``cloud``: the edge that stands for it; ``None``: the last one. ``per_entry_ns``: CPU time to compare a
        picture with one stored key."""
        self._cloud, self.feature, self.replay = cloud, feature, replay
        self._radius = at_least("radius", radius, 0.0)
        self._times = (
            int(at_least("per_entry", per_entry_ns, 0)),
            int(at_least("period", period_ns, 1)),
        )

    def on_car(self, place: Place) -> Station | None:
        return Remote().on_car(place)

    def on_edge(self, place: Place) -> Station:
        cloud = place.edges[-1] if self._cloud is None else self._cloud
        if cloud not in place.edges:
            raise UserError(f"cachier: cloud: {unknown('edge', cloud, place.edges)}")
        if place.name == cloud:
            return Station(
                detector=True, interceptor=partial(_cloud, place), hears=(IMAGES + REMOTE,)
            )
        if not place.sees:
            return Station()
        if cloud not in place.neighbours:
            raise UserError(
                f"cachier: cloud: {place.name} is no neighbour of {cloud}, and can forward nothing to it"
            )
        node = partial(self._node, place, on_edge=True, asks=True)
        return Station(
            interceptor=node,
            hears=(OBJECTS + REMOTE,),
            key=self.feature,
            per_entry_ns=self._times[0],
        )

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return Cachier(capacity, self._radius, *self._times, self.replay)


def _cloud(place: Place, subscribed: tuple[str, ...], published: tuple[str, ...]) -> GenieNode:
    """It stores nothing: whatever it is asked goes to its detector, whose answer goes back to whoever asked."""
    rules, same = place.genie, Exact()
    assert rules is not None
    parts: dict[str, Any] = {"key": same.key, "new_cache": stores_nothing, "pending": same.index}
    own: dict[str, Any] = {
        "share_requests": False,
        "same_key_pending": "forward",
        "neighbour_miss": "process",
    }
    return cache_node(rules, f"{place.name}/cloud", subscribed, published, **parts, **own)
