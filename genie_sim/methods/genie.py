"""Genie (DG, Section III): a Genie before every detector; cars upload what they miss, edges share.

A car without cameras relies on what others have seen (Section V-F, vision-assisted driving): the
coordinator server finds that nothing detects objects there and assigns phantom Genies. The local
one takes requests that hold a position instead of an image, answers what is in its cache, and asks
the remote phantom on the edge for the rest. That one answers with the confident objects in view of
its map, which the other cars' edges fill, and with what their caches hold for the same place. Both
follow Algorithm 1 as every Genie does; they only have no node behind them.
"""

from dataclasses import replace
from functools import partial
from typing import Any

from genie_sim.core.genies import make_genie
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import MissPolicy
from genie_sim.sim.method import (
    IMAGES,
    OBJECTS,
    REMOTE,
    REMOTE_UPLINK,
    HostConfig,
    HostContext,
    Method,
)

# The remote phantom has no detector that could answer later: it answers at once from its map. The
# local one waits for it, because its own map holds no more than what the remote one has sent
# before.
PHANTOM_ON_CAR: MissPolicy = "blocking"
PHANTOM_ON_EDGE: MissPolicy = "immediate"


class Genie(Method):
    """A Genie stands before every detector, cars upload what they miss, and edges share over the
    edge network.
    """

    title = "Genie (DG)"

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            phantom = partial(_genie, host, miss_policy=PHANTOM_ON_CAR)
            return HostConfig(interceptor=phantom, uplink=REMOTE_UPLINK)
        if host.genie is None:
            return HostConfig(detector=True)
        genie = partial(_genie, host, alone=not host.has_edge)
        uplink = REMOTE_UPLINK if host.has_edge else None
        return HostConfig(detector=True, interceptor=genie, uplink=uplink)

    def on_edge(self, host: HostContext) -> HostConfig:
        if not host.gets_images:  # it has no results of its own for its neighbours: it only listens
            phantom = partial(_genie, host, on_edge=True, miss_policy=PHANTOM_ON_EDGE)
            return HostConfig(interceptor=phantom, neighbour_topics=(OBJECTS + REMOTE,))
        return HostConfig(
            detector=True,
            interceptor=partial(_genie, host, on_edge=True),
            neighbour_topics=(IMAGES + REMOTE, OBJECTS + REMOTE),
        )


def _genie(
    host: HostContext,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    on_edge: bool = False,
    **arguments: Any,
) -> GenieNode:
    """The Genie of a host; ``arguments`` are further arguments of ``make_genie``."""
    assert host.genie is not None
    rules = host.genie
    if not host.gets_images:  # there is no own node to learn from
        rules = replace(rules, car_learns="all")
    return make_genie(
        rules,
        f"{host.name}/genie",
        subscribed,
        published,
        on_edge=on_edge,
        names_changes=host.names_changes,
        **arguments,
    )
