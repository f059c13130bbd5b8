"""FoggyCache: caches on cars and edges in which the nearest pictures vote (Guo et al., MobiCom 2018)."""

import math
from collections.abc import Hashable

import numpy as np

from genie_sim.core.caches.cache import Objects, Replay, SimilarityCache, same
from genie_sim.core.caches.features import DIMENSION, UNIT, Vector
from genie_sim.core.caches.nearest import Key, Nearest
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import Similarity, at_least, share
from genie_sim.sim.station import Place

TABLES, HASHES = 4, 8  # assumed
GRAIN = 64  # the normal directions are whole numbers of it, so that hashes are exact
EVERY = 50  # look-ups between two adaptations


class Hashed(Nearest):
    """Keys that share a bucket with a given one: p-stable hashing h(v) = floor((a v + b) / w), a normal, b uniform.

    ``w`` adapts so that a look-up finds ``few`` to ``many`` candidates on average.
    """

    def __init__(self, rng: np.random.Generator, width: float, few: int, many: int) -> None:
        super().__init__()
        self._directions = np.rint(
            rng.standard_normal((TABLES * HASHES, DIMENSION)) * GRAIN
        ).astype(np.float32)
        self._offsets = rng.random(TABLES * HASHES)
        self._few, self._many = few, many
        self._lookups = self._found = 0
        self._rehash(width)

    def add(self, key: Hashable) -> None:
        assert isinstance(key, Key)
        super().add(key)
        self._put(key)

    def discard(self, key: Hashable) -> None:
        if key in self._slots:
            assert isinstance(key, Key)
            for table, bucket in zip(self._tables, self._buckets(key), strict=True):
                del table[bucket][key]
                if not table[bucket]:
                    del table[bucket]
        super().discard(key)

    def near(self, key: Key, count: int, radius: float = math.inf) -> list[tuple[float, Key]]:
        buckets = zip(self._tables, self._buckets(key), strict=True)
        found = dict.fromkeys(one for table, bucket in buckets for one in table.get(bucket, ()))
        slots = np.array([self._slots[one] for one in found if one is not key], np.intp)
        self._lookups += 1
        self._found += len(slots)
        if self._lookups == EVERY:
            self._adapt()
        squares: Vector = (
            self._squares[slots] - 2 * (self._vectors[slots] @ key.vector) + np.float32(key.square)
        )
        return self._first(slots, squares, count, radius) if len(slots) else []

    def _adapt(self) -> None:
        mean, self._lookups, self._found = self._found / self._lookups, 0, 0
        if mean > self._many:
            self._rehash(self.width / 1.5)
        elif mean < self._few < len(self):
            self._rehash(self.width * 1.5)

    def _rehash(self, width: float) -> None:
        self.width = width
        self._whole = max(round(width * UNIT * GRAIN), 1)
        self._shift = np.floor(self._offsets * self._whole)
        self._last: tuple[Key | None, list[bytes]] = None, []
        self._tables: list[dict[bytes, dict[Key, None]]] = [{} for _ in range(TABLES)]
        for key in self._slots:
            assert isinstance(key, Key)
            self._put(key)

    def _put(self, key: Key) -> None:
        for table, bucket in zip(self._tables, self._buckets(key), strict=True):
            table.setdefault(bucket, {})[key] = None

    def _buckets(self, key: Key) -> list[bytes]:
        """Of each table, the bucket of a key; those of different cameras have none in common."""
        if self._last[0] is not key:  # a miss asks, then stores
            packed = (
                np.floor((self._directions @ key.vector + self._shift) / self._whole)
                .astype(np.int32)
                .tobytes()
            )
            camera, step = key.stream.encode(), len(packed) // TABLES
            self._last = (
                key,
                [camera + packed[begin : begin + step] for begin in range(0, len(packed), step)],
            )
        return self._last[1]


class FoggyCache(SimilarityCache):
    """The ``neighbours`` nearest keys up to ``radius`` away vote by their answers: homogenised k nearest neighbours.

    Equal answers make clusters of sizes n_i; their homogeneity is max n_i / sqrt(sum n_i^2). A hit is the nearest key
    of the largest cluster, if that has two members or more and the homogeneity is at least ``theta``.
    """

    def __init__(
        self,
        capacity: Capacity | None,
        rng: np.random.Generator,
        replay: Replay = "world",
        theta: float = 0.8,
        neighbours: int = 10,
        radius: float = 0.3,
    ) -> None:
        super().__init__(LRU(), capacity, replay)
        self.keys = self._index = Hashed(rng, 4 * radius, neighbours, 2 * neighbours)
        self._theta, self._neighbours, self._radius = theta, neighbours, radius

    def choose(self, key: Key, now_ns: int) -> Key | None:
        clusters: list[tuple[Objects, list[Key]]] = []
        for _, one in self.near(key, self._neighbours, now_ns, self._radius):
            objects = self.held(one)
            for first, members in clusters:
                if same(objects, first):
                    members.append(one)
                    break
            else:
                clusters.append((objects, [one]))
        largest = max((members for _, members in clusters), key=len, default=[])
        if len(largest) < 2:
            return None
        homogeneity = len(largest) / math.sqrt(sum(len(members) ** 2 for _, members in clusters))
        return largest[0] if homogeneity >= self._theta else None


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
        self.theta, self.neighbours = (
            share("theta", theta),
            int(at_least("neighbours", neighbours, 2)),
        )
        self.radius, self.feature, self.replay = at_least("radius", radius, 0.0), feature, replay

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        rng = place.stream("foggycache")
        return FoggyCache(capacity, rng, self.replay, self.theta, self.neighbours, self.radius)
