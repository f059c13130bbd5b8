"""Which edges are neighbours, and the ports through which they share."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from genie_sim.messages import Message
from genie_sim.sim.link import Bridge
from genie_sim.sim.station import OBJECTS, Station

if TYPE_CHECKING:
    from genie_sim.sim.encoding import Coder
    from genie_sim.sim.ros_graph import Graph
    from genie_sim.sim.setup import EdgeSetup
    from genie_sim.sim.world import World

EDGES = "edges"  # the network between edges, in the names of links


class Edge:
    """An edge server: its ROS graph, what stands there, and the way down to the cars that it has served: an answer goes
    down the bridge to the car whose picture it is about. A look-up by the header's origin, however many cars there are.
    """

    def __init__(self, graph: "Graph", station: Station) -> None:
        self.name = graph.name
        self.graph = graph
        self.station = station
        self.target: Graph | Coder = graph  # what takes what comes over links
        self.address = f"{self.name}/cars"
        self.bridge_to: dict[str, Bridge] = {}  # by the car
        graph.bridge(OBJECTS, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        bridge = self.bridge_to.get(message.header.origin)
        if bridge is not None:
            bridge.deliver(topic, message, sender)


def neighbours(edges: "Sequence[EdgeSetup]") -> Iterator[tuple[str, list[str]]]:
    """Each edge with its neighbours. Two edges are neighbours unless one names its own and leaves the other out."""
    named = {edge.name: edge.neighbours for edge in edges}
    order = {edge.name: place for place, edge in enumerate(edges)}
    for name, chosen in named.items():
        candidates: Sequence[str] = (
            list(named) if chosen is None else sorted(chosen, key=order.__getitem__)
        )
        others = [other for other in candidates if other != name]
        yield (
            name,
            [other for other in others if (theirs := named[other]) is None or name in theirs],
        )


def join_edges(world: "World", edges: Mapping[str, Edge]) -> None:
    """What an edge publishes on the topics that its neighbours hear reaches them through its port to the network."""
    if not any(edge.station.hears for edge in edges.values()):
        return
    codec = world.setup.codec
    for name, others in neighbours(world.setup.edges):
        port = world.link(f"{name}->{EDGES}", world.setup.edge_network, up=True)
        for other in (edges[one] for one in others):
            for topic in other.station.hears:
                edges[name].graph.bridge(
                    topic, Bridge(port, other.target, topic, world.front(other.name), codec=codec)
                )
