"""A central cache, from which the paper distinguishes itself: one edge has the only cache, and the
other edges ask it.
"""

from dataclasses import dataclass, replace
from functools import partial

from genie_sim.base.errors import UserError, unknown
from genie_sim.core.genies import make_genie, rules_on_edge
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import SIMILARITY
from genie_sim.methods.similarity_cache import check_neighbour, stores_nothing
from genie_sim.sim.method import (
    DIRECT_UPLINK,
    IMAGES,
    OBJECTS,
    REMOTE,
    HostConfig,
    HostContext,
    Method,
)


@dataclass(frozen=True)
class Central(Method):
    """One edge has the only cache, a Genie's; the other edges ask it for what their cars send
    up.
    """

    title = "central cache"

    at: str | None = None
    """The edge with the cache; `null`: the first one."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        return HostConfig(detector=True, uplink=DIRECT_UPLINK if host.has_edge else None)

    def on_edge(self, host: HostContext) -> HostConfig:
        hub = host.edges[0] if self.at is None else self.at
        if hub not in host.edges:
            raise UserError(f"central: at: {unknown('edge', hub, host.edges)}")
        if host.name == hub:
            return HostConfig(
                detector=host.gets_images,
                interceptor=partial(_hub, host),
                neighbour_topics=(IMAGES + REMOTE, OBJECTS + REMOTE),
            )
        if not host.gets_images:
            return HostConfig()
        check_neighbour(host, hub, "central: at")
        return HostConfig(
            detector=True,
            interceptor=partial(_requester, host),
            neighbour_topics=(OBJECTS + REMOTE,),
        )


def _hub(host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> GenieNode:
    """The Genie with the only cache. It answers the other edges, and sends them nothing unasked."""
    rules = replace(rules_on_edge(host.rules), share_requests=False, share_answers="on_request")
    return make_genie(rules, f"{host.name}/genie", inputs, outputs)


def _requester(host: HostContext, inputs: tuple[str, ...], outputs: tuple[str, ...]) -> GenieNode:
    """A node that stores nothing: a request goes to its detector and to the hub, and the first
    answer goes back.
    """
    rules = rules_on_edge(host.rules)
    similarity = SIMILARITY.make(rules.similarity)
    return GenieNode(
        f"{host.name}/asker",
        inputs,
        outputs,
        rules,
        key=similarity.key,
        new_keys=similarity.index,
        new_cache=stores_nothing,
        object_map=None,
    )
