"""Cachier: caches on the edges of a cloud, each as large as pays (U. Drolia et al., ICDCS 2017)."""

from functools import partial
from typing import Any

from genie_sim.core.caches.cache import Replay, SimilarityCache, cache_node, stores_nothing
from genie_sim.core.caches.cachier import Cachier
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import Exact
from genie_sim.errors import UserError, unknown
from genie_sim.methods.remote import Remote
from genie_sim.methods.similarity import REMOTE, Similarity, at_least
from genie_sim.sim.station import IMAGES, OBJECTS, Place, Station
from genie_sim.units import NS_PER_MS, NS_PER_S


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
        self._times = int(at_least("per_entry", per_entry_ns, 0)), int(at_least("period", period_ns, 1))

    def on_car(self, place: Place) -> Station | None:
        return Remote().on_car(place)

    def on_edge(self, place: Place) -> Station:
        cloud = place.edges[-1] if self._cloud is None else self._cloud
        if cloud not in place.edges:
            raise UserError(f"cachier: cloud: {unknown('edge', cloud, place.edges)}")
        if place.name == cloud:
            return Station(detector=True, interceptor=partial(_cloud, place), hears=(IMAGES + REMOTE,))
        if not place.sees:
            return Station()
        if cloud not in place.neighbours:
            raise UserError(f"cachier: cloud: {place.name} is no neighbour of {cloud}, and can forward nothing to it")
        node = partial(self._node, place, on_edge=True, asks=True)
        return Station(interceptor=node, hears=(OBJECTS + REMOTE,), key=self.feature, per_entry_ns=self._times[0])

    def cache(self, place: Place, capacity: Capacity | None) -> SimilarityCache:
        return Cachier(capacity, self._radius, *self._times, self.replay)

    def reach(self, cache: SimilarityCache) -> float:
        return self._radius


def _cloud(place: Place, subscribed: tuple[str, ...], published: tuple[str, ...]) -> GenieNode:
    """It stores nothing: whatever it is asked goes to its detector, whose answer goes back to whoever asked."""
    rules, same = place.genie, Exact()
    assert rules is not None
    parts: dict[str, Any] = {"key": same.key, "new_cache": stores_nothing, "pending": same.index}
    own: dict[str, Any] = {"share_requests": False, "same_key_pending": "forward", "neighbour_miss": "process"}
    return cache_node(rules, f"{place.name}/cloud", subscribed, published, **parts, **own)
