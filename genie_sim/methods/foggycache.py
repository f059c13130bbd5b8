"""FoggyCache: caches on cars and edges in which the nearest images vote (Guo et al., MobiCom
2018).
"""

import math
from collections.abc import Hashable

import numpy as np

from genie_sim.core.caches.cache import AnswerObjects, Replay, SimilarityCache, same
from genie_sim.core.caches.features import DIMENSION, UNIT, Vector
from genie_sim.core.caches.nearest import FeatureKey, Nearest
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.similarity import SimilarityCaching, as_share, at_least
from genie_sim.sim.method import HostContext

TABLES, HASHES = 4, 8  # assumed
GRAIN = 64  # the normal directions are whole numbers of it, so that hashes are exact
ADAPTATION_LOOKUPS = 50  # look-ups between two adaptations of the width
WIDTH_FACTOR = 1.5  # by which an adaptation changes the width


class HashIndex(Nearest):
    """Keys that share a bucket with a given one: p-stable hashing h(v) = floor((a v + b) / w), a
    normal, b uniform.

    ``w`` adapts so that a look-up finds between ``min_candidates`` and ``max_candidates`` on
    average.
    """

    def __init__(
        self, rng: np.random.Generator, width: float, min_candidates: int, max_candidates: int
    ) -> None:
        super().__init__()
        directions = rng.standard_normal((TABLES * HASHES, DIMENSION))
        self._directions = np.rint(directions * GRAIN).astype(np.float32)
        self._offsets = rng.random(TABLES * HASHES)
        self._min_candidates = min_candidates
        self._max_candidates = max_candidates
        self._lookups = 0
        self._candidates = 0
        self._rehash(width)

    def add(self, key: Hashable) -> None:
        assert isinstance(key, FeatureKey)
        super().add(key)
        self._insert(key)

    def discard(self, key: Hashable) -> None:
        if key in self._slots:
            assert isinstance(key, FeatureKey)
            for table, bucket in zip(self._tables, self._buckets(key), strict=True):
                del table[bucket][key]
                if not table[bucket]:
                    del table[bucket]
        super().discard(key)

    def near(
        self, key: FeatureKey, count: int, radius: float = math.inf
    ) -> list[tuple[float, FeatureKey]]:
        candidates: dict[FeatureKey, None] = {}
        for table, bucket in zip(self._tables, self._buckets(key), strict=True):
            candidates.update(table.get(bucket, {}))
        candidates.pop(key, None)
        slots = np.array([self._slots[candidate] for candidate in candidates], np.intp)
        self._lookups += 1
        self._candidates += len(slots)
        if self._lookups == ADAPTATION_LOOKUPS:
            self._adapt()
        if not len(slots):
            return []
        dots = self._vectors[slots] @ key.vector
        squares: Vector = self._squares[slots] - 2 * dots + np.float32(key.square)
        return self._first(slots, squares, count, radius)

    def _adapt(self) -> None:
        mean = self._candidates / self._lookups
        self._lookups = 0
        self._candidates = 0
        if mean > self._max_candidates:
            self._rehash(self.width / WIDTH_FACTOR)
        elif mean < self._min_candidates < len(self):
            self._rehash(self.width * WIDTH_FACTOR)

    def _rehash(self, width: float) -> None:
        self.width = width
        self._whole_width = max(round(width * UNIT * GRAIN), 1)
        self._shift = np.floor(self._offsets * self._whole_width)
        self._last_buckets: tuple[FeatureKey | None, list[bytes]] = (None, [])
        self._tables: list[dict[bytes, dict[FeatureKey, None]]] = [{} for _ in range(TABLES)]
        for key in self._slots:
            assert isinstance(key, FeatureKey)
            self._insert(key)

    def _insert(self, key: FeatureKey) -> None:
        for table, bucket in zip(self._tables, self._buckets(key), strict=True):
            table.setdefault(bucket, {})[key] = None

    def _buckets(self, key: FeatureKey) -> list[bytes]:
        """The bucket of a key in each table; those of different cameras have none in common."""
        last_key, buckets = self._last_buckets
        if last_key is not key:  # a miss is looked up and then stored: the same key twice
            hashes = np.floor((self._directions @ key.vector + self._shift) / self._whole_width)
            packed = hashes.astype(np.int32).tobytes()
            camera = key.stream.encode()
            length = len(packed) // TABLES
            begins = range(0, len(packed), length)
            buckets = [camera + packed[begin : begin + length] for begin in begins]
            self._last_buckets = (key, buckets)
        return buckets


class VotingCache(SimilarityCache):
    """The nearest stored keys vote by their answers: homogenised k nearest neighbours.

    Equal answers form clusters of sizes n_i; their homogeneity is max n_i / sqrt(sum n_i^2). A hit
    is the nearest key of the largest cluster, if that has two members or more and the homogeneity
    is at least ``theta``.

    Parameters
    ----------
    capacity : Capacity or None
        A limit in entries or bytes; ``None``: no limit.
    rng : Generator
        Draws the directions of the hashes.
    replay : {"camera", "world"}
        Where the objects of a replayed answer are (see ``SimilarityCache``).
    theta : float
        The least homogeneity of a hit, 0 to 1.
    neighbours : int
        How many keys vote at most.
    radius : float
        The distance up to which a key votes.
    """

    def __init__(
        self,
        capacity: Capacity | None,
        rng: np.random.Generator,
        *,
        replay: Replay = "world",
        theta: float = 0.8,
        neighbours: int = 10,
        radius: float = 0.3,
    ) -> None:
        super().__init__(LRU(), capacity, replay)
        self.keys = self._index = HashIndex(rng, 4 * radius, neighbours, 2 * neighbours)
        self._theta = theta
        self._neighbours = neighbours
        self._radius = radius

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        clusters: list[tuple[AnswerObjects, list[FeatureKey]]] = []
        for _, neighbour in self.near(key, self._neighbours, now_ns, self._radius):
            objects = self.stored_objects(neighbour)
            for cluster_objects, members in clusters:
                if same(objects, cluster_objects):
                    members.append(neighbour)
                    break
            else:
                clusters.append((objects, [neighbour]))
        largest = max((members for _, members in clusters), key=len, default=[])
        if len(largest) < 2:
            return None
        homogeneity = len(largest) / math.sqrt(sum(len(members) ** 2 for _, members in clusters))
        return largest[0] if homogeneity >= self._theta else None


class FoggyCache(SimilarityCaching):
    """FoggyCache: the answers to the nearest images vote; where they agree, the nearest of them is
    replayed.
    """

    title = "FoggyCache"

    def __init__(
        self,
        theta: float = 0.8,
        neighbours: int = 10,
        radius: float = 0.3,
        feature: str = "hsv",
        replay: Replay = "camera",
    ) -> None:
        """Checks the settings.

        Parameters
        ----------
        theta : float
            The least homogeneity of a hit, 0 to 1.
        neighbours : int
            How many keys vote at most.
        radius : float
            The distance up to which a key votes.
        feature : str
            The images' vectors.
        replay : {"camera", "world"}
            Where the objects of a replayed answer are (see ``SimilarityCache``).
        """
        self.theta = as_share("theta", theta)
        self.neighbours = int(at_least("neighbours", neighbours, 2))
        self.radius = at_least("radius", radius, 0.0)
        self.feature = feature
        self.replay = replay

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return VotingCache(
            capacity,
            host.stream("foggycache"),
            replay=self.replay,
            theta=self.theta,
            neighbours=self.neighbours,
            radius=self.radius,
        )
