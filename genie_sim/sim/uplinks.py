"""A car's way to its edge and back."""

from functools import partial
from typing import TYPE_CHECKING

from genie_sim.messages import Message
from genie_sim.sim.link import Bridge
from genie_sim.sim.station import DETECTOR, IMAGES, Uplink

if TYPE_CHECKING:
    from genie_sim.sim.ros_graph import Graph
    from genie_sim.sim.setup import CarSetup
    from genie_sim.sim.topology import Edge
    from genie_sim.sim.world import World


class CarUplink:
    """The car and its edge are one virtual network: frames go up, the answers to them come down.

    The car may ``leave`` its edge and ``join`` another. What it sends in between is lost, and so is what waits for the
    old link or is on it, and what the old edge answers while the car is away. Each edge has its own link to the car,
    which is there again when the car comes back.
    """

    def __init__(self, world: "World", car: "CarSetup", graph: "Graph", topics: Uplink) -> None:
        assert car.edge is not None
        self.address = f"{car.name}/uplink"
        self.edge = car.edge
        self._world = world
        self._car = car
        self._graph = graph
        self._topics = topics
        self._lost_by = ""  # what made the car leave
        self._bridges: dict[str, tuple[Bridge, Bridge]] = {}  # up and down, by the edge
        self._encoder = world.coder(car.name, "encoder", 0, self._send)
        self.join(car.edge)
        graph.bridge(topics.up, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        if self._encoder is None:
            self._send(topic, message, sender)
        else:
            self._encoder.inject(topic, message, sender)

    def _send(self, topic: str, message: Message, sender: str) -> None:
        self._bridges[self.edge][0].deliver(topic, message, sender)

    def leave(self, lost_by: str) -> None:
        """The connection to the edge breaks; ``lost_by`` names what drops the messages."""
        self._lost_by = lost_by
        for bridge in self._bridges[self.edge]:
            bridge.take_down()

    def join(self, name: str) -> None:
        """There is a connection to this edge."""
        if name in self._bridges:
            for bridge in self._bridges[name]:
                bridge.put_up()
        else:
            self._bridges[name] = self._bridges_to(self._world.edges[name])
        self.edge = name

    def clear(self) -> None:
        """No connection is left."""
        self._bridges.clear()

    def _bridges_to(self, edge: "Edge") -> tuple[Bridge, Bridge]:
        """What carries the car's frames up to an edge, and the answers to them down."""
        car, monitor = self._car, self._world.monitor
        assert car.link is not None, "a car with an edge has a link"
        up = self._world.link(f"{car.name}->{edge.name}", car.link, up=True)
        down = self._world.link(f"{edge.name}->{car.name}", car.link, up=False)
        up.part, down.part = "uplink", "downlink"
        sent, received = (
            partial(monitor.carried, "bytes_up"),
            partial(monitor.carried, "bytes_down"),
        )
        upwards = Bridge(
            up,
            edge.target,
            IMAGES,
            f"{edge.name}/{DETECTOR}",
            sent,
            self._lost,
            self._world.setup.codec,
        )
        downwards = Bridge(
            down, self._graph, self._topics.down, self._world.front(car.name), received, self._lost
        )
        edge.bridge_to[car.name] = downwards
        return upwards, downwards

    def _lost(self, message: Message) -> None:
        self._world.monitor.dropped(message, self._lost_by)
