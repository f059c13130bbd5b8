"""Listens to a car's graph: when its frames are received, and where the answers to them come from."""

from typing import TYPE_CHECKING

from genie_sim.messages import Detections, Message
from genie_sim.sim.station import IMAGES, OBJECTS

if TYPE_CHECKING:
    from genie_sim.sim.ros_graph import Graph
    from genie_sim.sim.uplinks import CarUplink
    from genie_sim.sim.world import World


class CarListener:
    """Node Z, the consumer, which takes the answers to its car's frames from whichever node sends them. It tells the
    monitor of each, and of each frame when it reaches the first node's queue. With ``no_server`` no node takes the
    frames: they are lost at once."""

    def __init__(
        self, world: "World", car: str, graph: "Graph", uplink: "CarUplink | None", no_server: bool
    ) -> None:
        self.address = f"{car}/consumer"
        self._world = world
        self._car = car
        self._uplink = uplink
        self._no_server = no_server
        graph.subscribe(IMAGES, self)
        graph.subscribe(OBJECTS, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        world = self._world
        if isinstance(message, Detections):
            world.monitor.answered(message, self._source(message), world.env.now, world.env.way)
        elif self._no_server:
            world.monitor.dropped(message, f"{self._car}:no_edge")
        else:
            world.monitor.received(message.header, world.env.now)

    def _source(self, answer: Detections) -> str:
        """Where an answer comes from, seen from the car at this moment."""
        if answer.source == "map":
            return "map"
        place = answer.served_by.split("/")[0]
        at_edge = self._uplink is not None and place == self._uplink.edge
        node = "own" if place == self._car else "edge" if at_edge else "peer"
        if answer.source == "detector":
            return "own_detector" if node == "own" else "edge_detector"
        return f"{node}_cache"
