"""FoggyCache: caches on cars and edges in which the nearest images vote (Guo et al., MobiCom
2018). Theirs are found by hashing, these exactly.
"""

import math
from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.marks import Bounds, Share
from genie_sim.core.eviction import LRU
from genie_sim.core.rules import Capacity
from genie_sim.methods.nearest import FeatureKey
from genie_sim.methods.similarity_cache import (
    AnswerObjects,
    SimilarityCache,
    SimilarityCaching,
    are_same,
)
from genie_sim.sim.method import HostContext


class VotingCache(SimilarityCache):
    """The nearest stored keys vote by their answers: homogenised k nearest neighbours.

    Equal answers form clusters of sizes n_i; their homogeneity is max n_i / sqrt(sum n_i^2). A hit
    is the nearest key of the largest cluster, if that has two members or more and the homogeneity
    is at least ``theta``.
    """

    def __init__(self, settings: "FoggyCache", capacity: Capacity | None) -> None:
        super().__init__(LRU(), capacity, settings.replay)
        self._settings = settings

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        settings = self._settings
        clusters: list[tuple[AnswerObjects, list[FeatureKey]]] = []
        for _, neighbour in self.near(key, settings.neighbours, now_ns, settings.radius):
            objects = self.stored_objects(neighbour)
            for cluster_objects, members in clusters:
                if are_same(objects, cluster_objects):
                    members.append(neighbour)
                    break
            else:
                clusters.append((objects, [neighbour]))
        largest = max((members for _, members in clusters), key=len, default=[])
        if len(largest) < 2:
            return None
        homogeneity = len(largest) / math.sqrt(sum(len(members) ** 2 for _, members in clusters))
        return largest[0] if homogeneity >= settings.theta else None


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
        return VotingCache(self, capacity)
