"""A car's connection to an edge and back."""

from collections.abc import Mapping
from functools import partial

from genie_sim.base.errors import UserError, unknown
from genie_sim.core.messages import Message
from genie_sim.sim.interface import InterfaceUse
from genie_sim.sim.link import Bridge
from genie_sim.sim.link_model import LinkEnds, LinkModel
from genie_sim.sim.method import DETECTOR, IMAGES, UplinkTopics
from genie_sim.sim.network import Network
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.topology import EdgeServer


class CarConnection(Subscriber):
    """Connects a car and its edge: frames go up, encoded before where images are, and the answers
    to them come down.

    The car may ``leave`` its edge and ``join`` another. What it sends in between is lost, and so is
    what waits for the old link or is on it, and what the old edge answers while the car is away.
    Each edge has its own link to the car, which is there again when the car comes back.

    Parameters
    ----------
    network : Network
        Where the links are made.
    graph : Graph
        The car's graph.
    topics : UplinkTopics
        On which topics frames go up and answers come down.
    model : LinkModel
        The car's link.
    edges : mapping
        All edge servers, by name.
    """

    def __init__(
        self,
        network: Network,
        graph: Graph,
        topics: UplinkTopics,
        *,
        model: LinkModel,
        edges: Mapping[str, EdgeServer],
    ) -> None:
        self.address = f"{graph.name}/uplink"
        self.edge = ""  # that it is connected to, or was last
        self._network = network
        self._graph = graph
        self._topics = topics
        self._model = model
        self._edges = edges
        self._lost_by = ""  # what made the car leave
        self._bridges: dict[str, tuple[Bridge, Bridge]] = {}  # up and down, by the edge
        self._further: list[Bridge] = []
        self._encoder = network.add_coder(graph, "encoder", self._send)  # None: images stay raw
        self._interface = network.add_interface(graph.name)
        graph.add_bridge(topics.up, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """The car has published something: it goes up, encoded before if it is an image."""
        if self._encoder is None:
            self._send(topic, message, sender)
        else:
            self._encoder.inject(topic, message, sender)

    def leave(self, lost_by: str) -> None:
        """The connection to the edge breaks; ``lost_by`` names what drops the messages."""
        self._lost_by = lost_by
        for bridge in self._bridges[self.edge]:
            bridge.disconnect()

    def join(self, edge: str) -> None:
        """There is a connection to this edge from now on."""
        if edge in self._bridges:
            for bridge in self._bridges[edge]:
                bridge.reconnect()
        else:
            self._bridges[edge] = self.make_bridges(edge, self._model, self._interface)
        self.edge = edge

    def also_send_over(self, bridge: Bridge) -> None:
        """What goes up goes over another bridge from now on, too."""
        self._further.append(bridge)

    def make_bridges(
        self, edge_name: str, model: LinkModel, interface: InterfaceUse
    ) -> tuple[Bridge, Bridge]:
        """New links between the car and an edge: what carries frames up, which nothing is sent over
        yet, and the answers to them down. Raises ``UserError`` for an unknown edge, or where there
        are links already.
        """
        if edge_name not in self._edges:
            raise UserError(unknown("edge", edge_name, self._edges))
        network, car, edge = self._network, self._graph.name, self._edges[edge_name]
        upwards_ends = LinkEnds(f"{car}->{edge.name}", car, edge.name, up=True)
        downwards_ends = LinkEnds(f"{edge.name}->{car}", car, edge.name, up=False)
        up = network.add_link(upwards_ends, model, part="uplink")
        down = network.add_link(downwards_ends, model, part="downlink")
        interface.carry(up, down)
        upwards = Bridge(
            up,
            edge.target,
            topic=IMAGES,
            address=f"{edge.name}/{DETECTOR}",
            carried=partial(network.monitor.carried, "bytes_up"),
            lost=self._lost,
            codec=network.codec,
            border=network.border(car, edge.name),
        )
        downwards = Bridge(
            down,
            self._graph,
            topic=self._topics.down,
            address=self._graph.entry,
            carried=partial(network.monitor.carried, "bytes_down"),
            lost=self._lost,
            border=network.border(edge.name, car),
        )
        edge.bridge_to[car] = downwards
        return upwards, downwards

    def _send(self, topic: str, message: Message, sender: str) -> None:
        upwards, _ = self._bridges[self.edge]
        upwards.deliver(topic, message, sender)
        for bridge in self._further:
            bridge.deliver(topic, message, sender)

    def _lost(self, message: Message) -> None:
        self._network.monitor.dropped(message, self._lost_by)
