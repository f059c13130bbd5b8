"""Edge servers, which of them are neighbours, and the ports through which they share."""

from collections.abc import Mapping, Sequence

from genie_sim.messages import Message
from genie_sim.sim.encoding import Coder
from genie_sim.sim.link import Bridge
from genie_sim.sim.link_models import LinkEnds, LinkModel, Medium
from genie_sim.sim.method import OBJECTS, HostConfig
from genie_sim.sim.network import Network
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.settings import Edge

EDGES = "edges"  # the network between edges, in the names of links


class EdgeServer(Subscriber):
    """An edge server: its ROS graph, what the method runs there, and the bridges down to the cars
    that it has served. An answer goes down the bridge to the car whose image it is about, found by
    the header's origin, however many cars there are.
    """

    def __init__(self, graph: Graph, config: HostConfig) -> None:
        self.name = graph.name
        self.graph = graph
        self.config = config
        self.target: Graph | Coder = graph  # takes what comes over links
        self.address = f"{self.name}/cars"
        self.bridge_to: dict[str, Bridge] = {}  # by the car
        graph.bridge(OBJECTS, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        bridge = self.bridge_to.get(message.header.origin)
        if bridge is not None:
            bridge.deliver(topic, message, sender)


def neighbours(edges: Sequence[Edge]) -> dict[str, list[str]]:
    """The neighbours of each edge, in the scenario's order. Two edges are neighbours unless one
    names its own and leaves the other out.
    """
    return {
        edge.name: [other.name for other in edges if other is not edge and _accept(edge, other)]
        for edge in edges
    }


def _accept(edge: Edge, other: Edge) -> bool:
    return all(
        first.neighbours is None or second.name in first.neighbours
        for first, second in ((edge, other), (other, edge))
    )


def join_edges(
    network: Network,
    edges: Mapping[str, EdgeServer],
    neighbours_of: Mapping[str, Sequence[str]],
    model: LinkModel | Medium,
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
                edges[name].graph.bridge(topic, bridge)
