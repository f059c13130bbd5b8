"""A ROS graph: which node subscribes to and publishes which topic, with the master's names and
remappings.
"""

from collections import deque
from collections.abc import Callable, Iterable
from typing import Literal

from genie_sim.messages import Message
from genie_sim.monitor import Part, Span, SpanLabel
from genie_sim.sim.device import Arguments, Done, Host

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
        """A node announces itself and its topics to the master."""
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
        self._clear_routes()

    def subscribe(self, topic: str, subscriber: Subscriber) -> None:
        self._subscribers.setdefault(topic, []).append(subscriber)
        self._clear_routes()

    def bridge(self, topic: str, bridge: Subscriber) -> None:
        """What is published here on the topic goes to another graph too; what came from another
        graph does not.
        """
        self._bridges.setdefault(topic, []).append(bridge)
        self._clear_routes()

    def void(self, where: str, keep: Literal["memory"] | None = None) -> None:
        """A fault: what is queued and in service on the host is lost, dropped by ``where``, and its
        nodes start anew, unless they ``keep`` what is in memory.
        """
        for node in self.nodes:
            if keep == "memory":
                node.void_work(where)
            else:
                node.void(where)
        self.host.accelerator.void()
        self.host.cpu.void()

    def clear(self) -> None:
        """Removes all nodes, subscribers and bridges."""
        self._clear_routes()
        self._subscribers.clear()
        self._bridges.clear()
        self._nodes.clear()

    def publish(self, node: "Node", topic: str, message: Message, to: str | None = None) -> None:
        """Delivers to every other node that subscribes to the topic, or only to the one whose
        address is ``to``.
        """
        route = node.routes.get(topic)
        if route is None:
            route = node.routes[topic] = self._route(node, topic)
        current, receivers = route
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

    def _clear_routes(self) -> None:
        for node in self._nodes.values():
            node.routes.clear()

    def _route(self, node: "Node", topic: str) -> tuple[str, list[Subscriber]]:
        """The current name of a node's topic, and who gets what the node publishes on it."""
        current = self._remapped[node.name].get(topic, topic)
        receivers = (*self._subscribers.get(current, ()), *self._bridges.get(current, ()))
        return current, [receiver for receiver in receivers if receiver is not node]

    def _arrive(
        self, receivers: Iterable[Subscriber], topic: str, message: Message, sender: str
    ) -> None:
        for receiver in receivers:
            receiver.deliver(topic, message, sender)


class Node(Subscriber):
    """A ROS node: a queue for each topic that keeps the newest messages, and callback threads that
    serve them.

    Subclasses say how long a message takes (``work``, which waits for a device) and what follows
    (``handle``).

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
    busy_ns = 0
    sent_bytes = None
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
        self.drops = 0
        self.completed = 0
        self.queued = 0  # how many messages wait, over all topics
        # of what it publishes, kept by the graph
        self.routes: dict[str, tuple[str, list[Subscriber]]] = {}
        self.work_label = SpanLabel(self.part, name)
        self._queueing = SpanLabel("queueing", name)
        self._idle_threads = threads
        self._threads = threads
        self._queues: dict[str, deque[tuple[int, Message, str, Span | None]]] = {}
        self._in_service: list[Message] = []
        self._generation = 0  # counts how often everything here was voided
        self._arrivals = 0
        graph.register(self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """An idle thread takes the message, or it joins its topic's queue; the oldest makes room in
        a full one.
        """
        if self._idle_threads:
            self._idle_threads -= 1
            self._serve(topic, message, sender)
            return
        queue = self._queues.get(topic)
        if queue is None:
            queue = self._queues[topic] = deque()
        self.queued += 1
        if len(queue) >= self.graph.queue_length:
            _, oldest, _, _ = queue.popleft()
            self.queued -= 1
            self.drops += 1
            self.graph.dropped(oldest, f"{self.name}:{topic}")
        queue.append((self._arrivals, message, sender, self.clock.path))
        self._arrivals += 1

    def publish(self, topic: str, message: Message, to: str | None = None) -> None:
        self.graph.publish(self, topic, message, to)

    def void(self, where: str) -> None:
        """A fault: what is queued and in service here is lost, dropped by ``where``, and the node
        starts anew.
        """
        queued = [message for queue in self._queues.values() for _, message, *_ in queue]
        for message in (*self._in_service, *queued):
            self.drops += 1
            self.graph.dropped(message, where)
        self._queues.clear()
        self.queued = 0
        self._in_service.clear()
        self._idle_threads = self._threads
        self._generation += 1

    def void_work(self, where: str) -> None:
        """As ``void``, but what the node has in memory stays."""
        self.void(where)

    def work(self, message: Message, done: Done, arguments: Arguments) -> None:
        """Handling a message takes until ``done(*arguments)`` is called."""
        raise NotImplementedError

    def handle(self, topic: str, message: Message, sender: str) -> None:
        """What follows when the work is done."""
        raise NotImplementedError

    def _serve(self, topic: str, message: Message, sender: str) -> None:
        self._in_service.append(message)
        self.work(message, self._served, (topic, message, sender, self._generation))

    def _served(self, topic: str, message: Message, sender: str, generation: int) -> None:
        """The thread goes on with the message that arrived first, or is idle."""
        if generation != self._generation:
            return
        self._in_service.remove(message)
        self.completed += 1
        self.handle(topic, message, sender)
        if not self.queued:
            self._idle_threads += 1
            return
        self.queued -= 1
        topic = self._next_topic()
        _, message, sender, path = self._queues[topic].popleft()
        self.clock.waited(path, self._queueing)
        self._serve(topic, message, sender)

    def _next_topic(self) -> str:
        """The topic of the message that has waited for longest; there is one."""
        oldest, oldest_topic = self._arrivals, ""
        for topic, queue in self._queues.items():
            if queue:
                arrival, _, _, _ = queue[0]
                if arrival < oldest:
                    oldest, oldest_topic = arrival, topic
        return oldest_topic
