"""FoggyCache: caches on cars and edges in which the nearest images vote (Guo et al., MobiCom
2018). Theirs are found by hashing, these exactly.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.settings import Bounds, Share
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import (
    AnswerObjects,
    Replay,
    SimilarityCache,
    SimilarityCaching,
    same,
)
from genie_sim.sim.method import HostContext


class VotingCache(SimilarityCache):
    """The nearest stored keys vote by their answers: homogenised k nearest neighbours.

    Equal answers form clusters of sizes n_i; their homogeneity is max n_i / sqrt(sum n_i^2). A hit
    is the nearest key of the largest cluster, if that has two members or more and the homogeneity
    is at least ``theta``.

    Parameters
    ----------
    capacity : Capacity or None
        A limit in entries or bytes; ``None``: no limit.
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
        *,
        replay: Replay = "world",
        theta: float = 0.8,
        neighbours: int = 10,
        radius: float = 0.3,
    ) -> None:
        super().__init__(LRU(), capacity, replay)
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


@dataclass(frozen=True, kw_only=True)
class FoggyCache(SimilarityCaching):
    """FoggyCache: the answers to the nearest images vote; where they agree, the nearest of them is
    replayed.
    """

    title = "FoggyCache"

    theta: Share = 0.8
    """The least homogeneity of a hit."""

    neighbours: Annotated[int, Bounds(minimum=2)] = 10
    """How many keys vote at most."""

    radius: Annotated[float, Bounds(minimum=0)] = 0.3
    """The distance up to which a key votes."""

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return VotingCache(
            capacity,
            replay=self.replay,
            theta=self.theta,
            neighbours=self.neighbours,
            radius=self.radius,
        )
