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

from genie_sim.core.genies import make_genie, rules_on_car, rules_on_edge
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import GenieRules
from genie_sim.sim.method import (
    IMAGES,
    OBJECTS,
    REMOTE,
    REMOTE_UPLINK,
    HostConfig,
    HostContext,
    Method,
)


class Genie(Method):
    """A Genie stands before every detector, cars upload what they miss, and edges share over the
    edge network.
    """

    title = "Genie (DG)"

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return HostConfig(interceptor=partial(_phantom_on_car, host), uplink=REMOTE_UPLINK)
        if host.genie is None:
            return HostConfig(detector=True)
        genie = partial(_genie, host, rules_on_car(host.genie, alone=not host.has_edge))
        uplink = REMOTE_UPLINK if host.has_edge else None
        return HostConfig(detector=True, interceptor=genie, uplink=uplink)

    def on_edge(self, host: HostContext) -> HostConfig:
        if not host.gets_images:  # it has no results of its own for its neighbours: it only listens
            phantom = partial(_phantom_on_edge, host)
            return HostConfig(interceptor=phantom, neighbour_topics=(OBJECTS + REMOTE,))
        return HostConfig(
            detector=True,
            interceptor=partial(_genie, host, rules_on_edge(host.rules)),
            neighbour_topics=(IMAGES + REMOTE, OBJECTS + REMOTE),
        )


def _phantom_on_car(
    host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> GenieNode:
    """The local phantom waits for the remote one, because its own map holds no more than what that
    has sent before. It has no node of its own to learn from.
    """
    rules = replace(rules_on_car(host.rules), miss_policy="blocking", car_learns="all")
    return _genie(host, rules, inputs, outputs)


def _phantom_on_edge(
    host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> GenieNode:
    """The remote phantom has no detector that could answer later: it answers at once from its
    map.
    """
    rules = replace(rules_on_edge(host.rules), miss_policy="immediate")
    return _genie(host, rules, inputs, outputs)


def _genie(
    host: HostContext, rules: GenieRules, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> GenieNode:
    name = f"{host.name}/genie"
    return make_genie(rules, name, inputs, outputs, names_changes=host.names_changes)
