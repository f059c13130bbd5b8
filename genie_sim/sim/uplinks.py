"""A car's connections to edges and back."""

from collections.abc import Mapping
from functools import partial

from genie_sim.core.messages import Message
from genie_sim.sim.link import Bridge
from genie_sim.sim.link_models import LinkEnds, LinkModel, Medium
from genie_sim.sim.method import DETECTOR, IMAGES, Uplink
from genie_sim.sim.network import Network
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.topology import EdgeServer


class CarUplink:
    """Connects a car and its edge to one virtual network: frames go up, the answers to them come
    down.

    The car may ``leave`` its edge and ``join`` another. What it sends in between is lost, and so is
    what waits for the old link or is on it, and what the old edge answers while the car is away.
    Each edge has its own link to the car, which is there again when the car comes back.

    Parameters
    ----------
    network : Network
        Where the links are made.
    graph : Graph
        The car's graph.
    topics : Uplink
        What goes up and what comes down.
    model : LinkModel or Medium
        The car's link.
    edges : mapping
        All edge servers, by name.
    tail_time_ns : int
        How long the car's network interface stays awake after a transfer.
    """

    def __init__(
        self,
        network: Network,
        graph: Graph,
        topics: Uplink,
        *,
        model: LinkModel | Medium,
        edges: Mapping[str, EdgeServer],
        tail_time_ns: int = 0,
    ) -> None:
        self.interface = network.interface(graph.name, tail_time_ns)
        self.edge = ""  # that it is connected to, or was last
        self._network = network
        self._graph = graph
        self._topics = topics
        self._model = model
        self._edges = edges
        self._lost_by = ""  # what made the car leave
        self._bridges: dict[str, tuple[Bridge, Bridge]] = {}  # up and down, by the edge

    def send(self, topic: str, message: Message, sender: str) -> None:
        """A message goes up."""
        upwards, _ = self._bridges[self.edge]
        upwards.deliver(topic, message, sender)

    def leave(self, lost_by: str) -> None:
        """The connection to the edge breaks; ``lost_by`` names what drops the messages."""
        self._lost_by = lost_by
        for bridge in self._bridges[self.edge]:
            bridge.take_down()

    def join(self, edge: str) -> None:
        """There is a connection to this edge from now on."""
        if edge in self._bridges:
            for bridge in self._bridges[edge]:
                bridge.put_up()
        else:
            self._bridges[edge] = self._connect(self._edges[edge])
        self.edge = edge

    def bytes_carried(self) -> tuple[int, int]:
        """How much went up and came down, over the links to all edges."""
        links = [(up.link, down.link) for up, down in self._bridges.values()]
        return sum(up.sent_bytes for up, _ in links), sum(down.sent_bytes for _, down in links)

    def _connect(self, edge: EdgeServer) -> tuple[Bridge, Bridge]:
        """What carries the car's frames up to an edge, and the answers to them down."""
        network, car = self._network, self._graph.name
        upwards_ends = LinkEnds(f"{car}->{edge.name}", car, edge.name, up=True)
        downwards_ends = LinkEnds(f"{edge.name}->{car}", car, edge.name, up=False)
        up = network.add_link(upwards_ends, self._model, part="uplink")
        down = network.add_link(downwards_ends, self._model, part="downlink")
        up.interface = down.interface = self.interface
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

    def _lost(self, message: Message) -> None:
        self._network.monitor.dropped(message, self._lost_by)


class CarUplinks(Subscriber):
    """All uplinks of a car. What is published on a topic goes up each uplink that takes it. Where
    images are encoded, each is so once for all of them.
    """

    def __init__(self, network: Network, graph: Graph) -> None:
        self.address = f"{graph.name}/uplink"
        self.car = graph.name
        self.uplinks: list[CarUplink] = []
        self._graph = graph
        self._by_topic: dict[str, list[CarUplink]] = {}
        self._encoder = network.add_coder(graph, "encoder", self._send)  # None: images stay raw

    def add(self, topic: str, uplink: CarUplink) -> None:
        """An uplink takes what is published on a topic."""
        if topic not in self._by_topic:
            self._graph.bridge(topic, self)
        self._by_topic.setdefault(topic, []).append(uplink)
        self.uplinks.append(uplink)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """The car has published something: it goes up, encoded before if it is an image."""
        if self._encoder is None:
            self._send(topic, message, sender)
        else:
            self._encoder.inject(topic, message, sender)

    def _send(self, topic: str, message: Message, sender: str) -> None:
        for uplink in self._by_topic[topic]:
            uplink.send(topic, message, sender)
