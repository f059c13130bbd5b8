"""A central cache: what the paper sets itself apart from. One edge has the only cache; the others ask it."""

from dataclasses import replace
from functools import partial
from typing import Any

from genie_sim.core.caches.cache import stores_nothing
from genie_sim.core.genies import make_genie
from genie_sim.core.maps import Map
from genie_sim.core.node import GenieNode
from genie_sim.errors import UserError, unknown
from genie_sim.methods.genie import REMOTE
from genie_sim.sim.station import IMAGES, OBJECTS, Method, Place, Station, Uplink


class Central(Method):
    """One edge has the only cache, a Genie's; the other edges ask it for what their cars send up."""

    title = "central cache"

    def __init__(self, at: str | None = None) -> None:
        """``at``: the edge with the cache; ``None``: the first one."""
        self._at = at

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        return Station(detector=True, uplink=Uplink(IMAGES, OBJECTS) if place.joined else None)

    def on_edge(self, place: Place) -> Station:
        hub = place.edges[0] if self._at is None else self._at
        if hub not in place.edges:
            raise UserError(f"central: at: {unknown('edge', hub, place.edges)}")
        if place.name == hub:
            hears = IMAGES + REMOTE, OBJECTS + REMOTE
            return Station(detector=place.sees, interceptor=partial(_hub, place), hears=hears)
        if not place.sees:
            return Station()
        return Station(detector=True, interceptor=partial(_asker, place), hears=(OBJECTS + REMOTE,))


def _hub(place: Place, subscribed: tuple[str, ...], published: tuple[str, ...]) -> GenieNode:
    assert place.genie is not None
    rules = replace(place.genie, share_requests=False, share_answers="on_request")
    name = f"{place.name}/genie"
    return make_genie(rules, name, subscribed, published, on_edge=True, laws=place.laws)


def _asker(place: Place, subscribed: tuple[str, ...], published: tuple[str, ...]) -> GenieNode:
    """It stores nothing: what it is asked goes to its detector and to the hub, the first answer goes back."""
    assert place.genie is not None
    without: dict[str, Any] = {"new_cache": stores_nothing, "object_map": Map()}
    return make_genie(
        place.genie, f"{place.name}/asker", subscribed, published, on_edge=True, **without
    )
