"""Edge servers, which of them are neighbours, and the ports through which they share."""

from collections.abc import Mapping, Sequence

import numpy as np

from genie_sim.core.messages import Message
from genie_sim.sim.encoding import Coder
from genie_sim.sim.link import Bridge
from genie_sim.sim.link_model import LinkEnds, LinkModel
from genie_sim.sim.method import OBJECTS, HostConfig
from genie_sim.sim.network import Network
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.settings import EDGES, Edge

ALL_SHARE = 6  # so many edges all share with each other
NEAREST = 4  # of more each shares with so many


class EdgeServer(Subscriber):
    """An edge server: its ROS graph, what the method runs there, and the bridges down to the cars
    that it has had. An answer goes down the bridge to the car whose image it is about, found by
    the header's origin, however many cars there are.
    """

    def __init__(self, graph: Graph, config: HostConfig) -> None:
        self.name = graph.name
        self.graph = graph
        self.config = config
        self.target: Graph | Coder = graph  # takes what comes over links
        self.address = f"{self.name}/cars"
        self.bridge_to: dict[str, Bridge] = {}  # by the car
        graph.add_bridge(OBJECTS, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        bridge = self.bridge_to.get(message.header.origin)
        if bridge is not None:
            bridge.deliver(topic, message, sender)


def neighbours(edges: Sequence[Edge], count: int | None = None) -> dict[str, list[str]]:
    """The neighbours of each edge, in the scenario's order. Where one of two edges names its
    neighbours, or both do, the two are neighbours if each that does names the other. Else they are
    if one is among the ``count`` nearest of the other: by their places, or by their order if any
    has none.

    Without a ``count`` up to ``ALL_SHARE`` edges all share with each other, and of more each with
    the ``NEAREST`` ones.
    """
    if count is None:
        count = len(edges) if len(edges) <= ALL_SHARE else NEAREST
    near = _near(edges, count)

    def are_neighbours(edge: Edge, neighbour: Edge) -> bool:
        choices = [
            second.name in first.neighbours
            for first, second in ((edge, neighbour), (neighbour, edge))
            if first.neighbours is not None
        ]
        return all(choices) if choices else neighbour.name in near[edge.name]

    return {
        edge.name: [
            neighbour.name
            for neighbour in edges
            if neighbour is not edge and are_neighbours(edge, neighbour)
        ]
        for edge in edges
    }


def _near(edges: Sequence[Edge], count: int) -> dict[str, set[str]]:
    """The ``count`` nearest of each edge, of equally near ones the first, and the edges whose
    nearest it is among.
    """
    near: dict[str, set[str]] = {edge.name: set() for edge in edges}
    places = [edge.at_m for edge in edges if edge.at_m is not None]
    if len(places) < len(edges):
        places = [(float(number), 0.0) for number in range(len(edges))]
    points = np.array(places)
    for number, edge in enumerate(edges):
        distances_m = np.hypot(*(points - points[number]).T)
        distances_m[number] = np.inf
        for neighbour in np.argsort(distances_m, kind="stable")[: min(count, len(edges) - 1)]:
            near[edge.name].add(edges[neighbour].name)
            near[edges[neighbour].name].add(edge.name)
    return near


def join_edges(
    network: Network,
    edges: Mapping[str, EdgeServer],
    neighbours_of: Mapping[str, Sequence[str]],
    model: LinkModel,
) -> None:
    """Connects neighbouring edges: what an edge publishes on the ``neighbour_topics`` of another
    reaches it through the edge's port to the network, a link of this ``model``.
    """
    if not any(edge.config.neighbour_topics for edge in edges.values()):
        return
    for name, neighbour_names in neighbours_of.items():
        ends = LinkEnds(f"{name}->{EDGES}", None, name, up=True)
        port = network.add_link(ends, model, part="edges")
        for neighbour in (edges[neighbour_name] for neighbour_name in neighbour_names):
            for topic in neighbour.config.neighbour_topics:
                bridge = Bridge(
                    port,
                    neighbour.target,
                    topic=topic,
                    address=neighbour.graph.entry,
                    codec=network.codec,
                    border=network.border(name, neighbour.graph.name),
                )
                edges[name].graph.add_bridge(topic, bridge)
