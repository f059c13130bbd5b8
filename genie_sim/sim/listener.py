"""Listens to a car's graph: when its frames are received, and where the answers to them come from."""

from typing import TYPE_CHECKING

from genie_sim.messages import Detections, Message
from genie_sim.sim.nodes import Consumer
from genie_sim.sim.station import IMAGES, OBJECTS

if TYPE_CHECKING:
    from genie_sim.sim.ros_graph import Graph
    from genie_sim.sim.uplinks import CarUplink
    from genie_sim.sim.world import World


class CarListener:
    """Tells the monitor of each frame when it reaches the first node's queue, and of each answer when the consumer has
    it. With ``no_server`` no node takes the frames: they are lost at once."""

    def __init__(self, world: "World", car: str, graph: "Graph", uplink: "CarUplink | None", no_server: bool) -> None:
        self.address = f"{graph.name}/watch"
        self._world = world
        self._car = car
        self._uplink = uplink
        self._no_server = no_server
        graph.subscribe(IMAGES, self)
        Consumer(f"{car}/consumer", graph, OBJECTS, self._answered)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        if self._no_server:
            self._world.monitor.dropped(message, f"{self._car}:no_edge")
        else:
            self._world.monitor.received(message.header, self._world.env.now)

    def _answered(self, answer: Detections, now_ns: int) -> None:
        self._world.monitor.answered(answer, self._source(answer), now_ns, self._world.env.way)

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
