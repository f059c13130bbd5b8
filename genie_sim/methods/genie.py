"""Genie (DG, Section III): a Genie before every detector; cars upload what they miss, edges share.

A car without cameras lives on what others have seen (Section V-F, vision-assisted driving): the coordinator server
finds that nothing detects objects there and assigns phantom Genies. The local one takes requests that hold a position
instead of a picture, answers what is in its cache, and asks the remote phantom on the edge for the rest. That one
answers with the confident objects in view of its map, which the other cars' edges fill, and with what their caches hold
for the same spot. Both follow Algorithm 1 as every Genie does; they only have nothing encapsulated.
"""

from dataclasses import replace
from functools import partial
from typing import Any

from genie_sim.core.genies import make_genie
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import MissPolicy
from genie_sim.sim.station import IMAGES, OBJECTS, Method, Place, Station, Uplink

REMOTE = "-remote"
UPLINK = Uplink(IMAGES + REMOTE, OBJECTS + REMOTE)

# The remote phantom has no detector that could answer later: it gives what its map holds at once. The local one waits
# for it, because its own map holds no more than what the remote one has sent before.
PHANTOM_ON_CAR: MissPolicy = "blocking"
PHANTOM_ON_EDGE: MissPolicy = "immediate"


class Genie(Method):
    """A Genie stands before every detector, cars upload what they miss, and edges share over the edge network."""

    title = "Genie (DG)"

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return Station(
                interceptor=partial(_genie, place, miss_policy=PHANTOM_ON_CAR), uplink=UPLINK
            )
        if place.genie is None:
            return Station(detector=True)
        genie = partial(_genie, place, alone=not place.joined)
        return Station(detector=True, interceptor=genie, uplink=UPLINK if place.joined else None)

    def on_edge(self, place: Place) -> Station:
        if not place.sees:  # it has nothing of its own to answer neighbours with, and only listens
            phantom = partial(_genie, place, on_edge=True, miss_policy=PHANTOM_ON_EDGE)
            return Station(interceptor=phantom, hears=(OBJECTS + REMOTE,))
        genie = partial(_genie, place, on_edge=True)
        return Station(detector=True, interceptor=genie, hears=(IMAGES + REMOTE, OBJECTS + REMOTE))


def _genie(place: Place, *topics: tuple[str, ...], on_edge: bool = False, **how: Any) -> GenieNode:
    assert place.genie is not None
    rules = (
        place.genie if place.sees else replace(place.genie, car_learns="all")
    )  # there is no own node to learn from
    told = {"laws": place.laws, "tells_changes": place.records_changes, **how}
    return make_genie(rules, f"{place.name}/genie", *topics, on_edge=on_edge, **told)
