"""Listens to a car's graph: when its frames are received, and where the answers to them come
from.
"""

from genie_sim.base.errors import short_repr
from genie_sim.core.messages import Detections, Message
from genie_sim.sim.connection import CarConnection
from genie_sim.sim.method import IMAGES, OBJECTS
from genie_sim.sim.monitor import Monitor
from genie_sim.sim.ros_graph import Graph, Subscriber


class CarListener(Subscriber):
    """Node Z, the consumer, which takes the answers to its car's frames from whichever node sends
    them. It reports each to the monitor, and each frame when it reaches the first node's queue;
    what a consumer makes of them is in ``tracks.consumer``.

    If not ``is_answered``, frames are dropped at once because no node handles them.
    """

    def __init__(
        self,
        graph: Graph,
        monitor: Monitor,
        *,
        connection: CarConnection | None,
        is_answered: bool,
    ) -> None:
        self.address = f"{graph.name}/consumer"
        self._car = graph.name
        self._clock = graph.clock
        self._monitor = monitor
        self._connection = connection
        self._is_answered = is_answered
        graph.subscribe(IMAGES, self)
        graph.subscribe(OBJECTS, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        clock, monitor = self._clock, self._monitor
        if topic == OBJECTS:
            if not isinstance(message, Detections):
                text = f"publishes {short_repr(message)}, but must publish Detections"
                raise TypeError(f"{sender}: {topic}: {text}")
            monitor.answered(message, self._source(message), clock.now, clock.path)
        elif self._is_answered:
            monitor.received(message.header, clock.now)
        else:
            monitor.dropped(message, f"{self._car}:no_edge")

    def _source(self, answer: Detections) -> str:
        """Where an answer comes from, seen from the car at this moment."""
        if answer.source == "map":
            return "map"
        host = answer.served_by.split("/")[0]
        if host == self._car:
            role = "own"
        elif self._connection is not None and host == self._connection.edge:
            role = "edge"
        else:
            role = "peer"
        if answer.source == "detector":
            return "own_detector" if role == "own" else "edge_detector"
        return f"{role}_cache"
