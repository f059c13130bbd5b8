"""A ROS graph: which node subscribes to and publishes which topic, with the master's names and
remappings.
"""

from collections.abc import Callable, Hashable, Iterable
from itertools import chain
from typing import NamedTuple

import simpy

from genie_sim.base.errors import UserError, unknown
from genie_sim.core.messages import Message
from genie_sim.sim.clock import NewestQueue, Occupancy, Steps
from genie_sim.sim.host import Host
from genie_sim.sim.monitor import Part, Resource, Span, SpanLabel

Dropped = Callable[[Message, str], None]  # a message that is lost, and the name of what lost it


class Subscriber:
    """Anything that messages are delivered to; ``address`` is what a reply is sent to."""

    address: str

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """A message of a topic comes from the node called ``sender``."""
        raise NotImplementedError


def ignore_drop(message: Message, where: str) -> None:
    """Where nobody wants to know of lost messages."""


class Graph:
    """The topics known to the ROS master of a host, and the nodes that use them.

    Every queue of a node keeps its ``queue_length`` newest messages; ``dropped`` is called with
    each that is lost. Nodes name their topics; the graph maps the names of a remapped node, as
    ``topic:=other`` does in ROS. A message reaches the subscribers of its topic after the host's
    hop time. ``entry`` is the address of the node that takes what comes over links.
    """

    def __init__(self, host: Host, queue_length: int = 1, dropped: Dropped = ignore_drop) -> None:
        self.host = host
        self.clock = host.clock
        self.name = host.name
        self.entry = f"{host.name}/consumer"
        self.queue_length = queue_length
        self.dropped = dropped
        self._hop = SpanLabel("hop", host.name)
        self._subscribers: dict[str, list[Subscriber]] = {}
        self._bridges: dict[str, list[Subscriber]] = {}
        self._nodes: dict[str, Node] = {}
        self._remapped: dict[str, dict[str, str]] = {}

    def register(self, node: "Node") -> None:
        """A node announces itself and its topics to the master. Raises ``UserError`` for a second
        one of its name.
        """
        if node.name in self._nodes:
            raise UserError(f"two nodes are called {node.name!r}; a camera is a node, too")
        self._nodes[node.name] = node
        self._remapped[node.name] = {}
        for topic in node.subscribes:
            self.subscribe(topic, node)

    def node(self, name: str) -> "Node":
        return self._nodes[name]

    def topics_of(self, name: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """T_S and T_P of a node, under their current names, as the master's system state has
        them.
        """
        node, names = self._nodes[name], self._remapped[name]
        return (
            tuple(names.get(topic, topic) for topic in node.subscribes),
            tuple(names.get(topic, topic) for topic in node.publishes),
        )

    @property
    def nodes(self) -> "tuple[Node, ...]":
        """Every node, in the order in which they registered."""
        return tuple(self._nodes.values())

    def remap(self, name: str, topics: dict[str, str]) -> None:
        """From now on the node ``name`` uses other topics; its own code keeps the old names."""
        node, names = self._nodes[name], self._remapped[name]
        for old, new in topics.items():
            if old in node.subscribes:
                self._subscribers[names.get(old, old)].remove(node)
                self.subscribe(new, node)
            names[old] = new
        self._forget_receivers()

    def subscribe(self, topic: str, subscriber: Subscriber) -> None:
        self._subscribers.setdefault(topic, []).append(subscriber)
        self._forget_receivers()

    def add_bridge(self, topic: str, bridge: Subscriber) -> None:
        """What is published here on the topic goes to another graph too; what came from another
        graph does not.
        """
        self._bridges.setdefault(topic, []).append(bridge)
        self._forget_receivers()

    def void(self, where: str, *, keeps_memory: bool = False) -> None:
        """A fault: what is queued and in service on the host is lost, dropped by ``where``, and its
        nodes start anew, unless the host ``keeps_memory``.
        """
        for node in self.nodes:
            node.void(where)
            if not keeps_memory:
                node.lose_memory(where)

    @property
    def is_busy(self) -> bool:
        """Whether a node has a message."""
        return any(node.is_busy for node in self._nodes.values())

    def publish(self, node: "Node", topic: str, message: Message, to: str | None = None) -> None:
        """Delivers to every other node that subscribes to the topic, or only to the one whose
        address is ``to``.
        """
        named_receivers = node.receivers.get(topic)
        if named_receivers is None:
            named_receivers = node.receivers[topic] = self._receivers_of(node, topic)
        current, receivers = named_receivers
        if to is not None:
            receivers = [receiver for receiver in receivers if receiver.address == to]
        if receivers:
            hop_ns = self.host.hop_ns(message.size_bytes)
            self.clock.after(
                hop_ns, self._arrive, (receivers, current, message, node.name), self._hop
            )

    def inject(self, topic: str, message: Message, sender: str) -> None:
        """A message comes in from another graph: the link has already taken its time."""
        self._arrive(self._subscribers.get(topic, ()), topic, message, sender)

    def _forget_receivers(self) -> None:
        for node in self._nodes.values():
            node.receivers.clear()

    def _receivers_of(self, node: "Node", topic: str) -> tuple[str, list[Subscriber]]:
        """The current name of a node's topic, and who gets what the node publishes on it. Raises
        ``UserError`` for a topic that the node has not named.
        """
        if topic not in node.publishes:
            text = unknown("topic", topic, node.publishes)
            raise UserError(f"{node.name}: publishes on an {text}")
        current = self._remapped[node.name].get(topic, topic)
        receivers = (*self._subscribers.get(current, ()), *self._bridges.get(current, ()))
        return current, [receiver for receiver in receivers if receiver is not node]

    def _arrive(
        self, receivers: Iterable[Subscriber], topic: str, message: Message, sender: str
    ) -> None:
        for receiver in receivers:
            receiver.deliver(topic, message, sender)


class Waiting(NamedTuple):
    """A message that waits for a thread of a node."""

    flow: Hashable  # the newest of each are kept
    topic: str
    message: Message
    sender: str
    arrived_ns: int
    path: Span | None


def camera_flow(topic: str, message: Message) -> Hashable:
    """The flow of a camera's images."""
    header = message.header
    return topic, header.origin, header.frame_id


class Node(Subscriber, Resource):
    """A ROS node: a queue that keeps the newest messages of each flow, by itself of each topic, and
    callback threads that serve it. Each thread is a process.

    Subclasses say what handling a message takes (``work``) and what follows (``handle``), and may
    say which messages push each other out of the queue (``flow``).

    Parameters
    ----------
    name : str
        Such as ``car1/genie``; also its address.
    graph : Graph
        The graph that it registers with.
    subscribes, publishes : iterable of str
        Its topics.
    threads : int
        How many messages it handles at the same time.
    """

    kind = "queue"
    capacity = None  # nothing is served here: the host's processors do that
    part: Part = "genie"  # what its work counts as, on the path of a frame

    def __init__(
        self,
        name: str,
        graph: Graph,
        subscribes: Iterable[str],
        publishes: Iterable[str],
        *,
        threads: int = 1,
    ) -> None:
        self.name = name
        self.host = graph.host
        self.graph = graph
        self.clock = graph.clock
        self.subscribes = tuple(subscribes)
        self.publishes = tuple(publishes)
        self.address = name
        self.completed = 0
        # of what it publishes, kept by the graph
        self.receivers: dict[str, tuple[str, list[Subscriber]]] = {}
        self.work_label = SpanLabel(self.part, name)
        self._queueing = SpanLabel("queueing", name)
        self._waiting = NewestQueue[Waiting](self.clock, graph.queue_length)
        # what each process of the node is busy with
        self._working: dict[simpy.Process, tuple[Message, ...]] = {}
        for _ in range(threads):
            self.clock.process(self._thread())
        graph.register(self)

    @property
    def queued(self) -> int:
        """How many messages wait, over all topics."""
        return len(self._waiting)

    @property
    def occupancy(self) -> Occupancy:
        """How many have waited, over time."""
        return self._waiting.occupancy

    @property
    def is_busy(self) -> bool:
        """Whether a message waits or is handled here."""
        return bool(self._waiting.items or self._working)

    @property
    def messages(self) -> list[Message]:
        """What is handled here now, then what waits."""
        waiting = (waiting.message for waiting in self._waiting.items)
        return [*chain.from_iterable(self._working.values()), *waiting]

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """A message arrives, and waits for a thread."""
        clock, flow = self.clock, self.flow(topic, message)
        oldest = self._waiting.put(Waiting(flow, topic, message, sender, clock.now, clock.path))
        if oldest is not None:
            self._lose(oldest.message, f"{self.name}:{topic}")

    def publish(self, topic: str, message: Message, to: str | None = None) -> None:
        self.graph.publish(self, topic, message, to)

    def void(self, where: str) -> None:
        """A fault: what is queued and in service here is lost, dropped by ``where``."""
        for message in self.messages:
            self._lose(message, where)
        self._waiting.clear()
        for thread in self._working:
            thread.interrupt(where)
        self._working.clear()

    def lose_memory(self, where: str) -> None:
        """A fault, called ``where``, takes what the node has in memory; by itself that is
        nothing.
        """

    def flow(self, topic: str, message: Message) -> Hashable:
        """Which of the messages that wait a new one may push out."""
        return topic

    def work(self, topic: str, message: Message, sender: str) -> Iterable[simpy.Event]:
        """What handling a message takes: the part of a process that waits for the devices."""
        raise NotImplementedError

    def handle(self, topic: str, message: Message, sender: str) -> None:
        """What follows when the work is done."""
        raise NotImplementedError

    def _thread(self) -> Steps:
        """A callback thread takes the message that has waited for longest, works on it, and handles
        it.
        """
        clock = self.clock
        thread = clock.active_process
        while True:
            _, topic, message, sender, _, path = yield self._waiting.get()
            self._working[thread] = (message,)
            clock.waited(path, self._queueing)
            try:
                yield from self.work(topic, message, sender)
            except simpy.Interrupt:  # a crash
                continue
            del self._working[thread]
            self.completed += 1
            self.handle(topic, message, sender)

    def _lose(self, message: Message, where: str) -> None:
        self.drops += 1
        self.graph.dropped(message, where)
