"""The nodes of the simulated graph: detector and interceptor (a Genie); and how one is attached to a node."""

from collections import OrderedDict
from collections.abc import Callable

from genie_sim.messages import (
    Detections,
    Effect,
    Expired,
    Header,
    Image,
    Message,
    Observation,
    Publish,
)
from genie_sim.monitor import Step
from genie_sim.sim.device import Arguments, Done
from genie_sim.sim.ros_graph import Graph, Node
from genie_sim.sim.station import OBJECTS, Interceptor, MakeInterceptor, Station

TIMER_LATE_NS = 500_000_000
MOST_WAYS = 20_000  # that a node remembers
PLAIN = Station()
Observer = Callable[[str, Observation, int], None]  # the node's name, what it observed, and when


class Detector(Node):
    """The Autoware Vision Detector: one image at a time on the host's accelerator, its answer under the same header.

    What it finds is what the recording's detector found in the frame; how long it takes is the device's business.
    """

    part = "inference"

    def work(self, message: Message, done: Done, arguments: Arguments) -> None:
        self.host.infer(done, arguments)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        assert isinstance(message, Image)
        self.publish(
            self.publishes[0],
            Detections(message.header, message.content.detections, "detector", self.name),
        )


class InterceptorNode(Node):
    """A pure node in the simulated graph: every message costs CPU time, every effect becomes a publication.

    ``make`` makes the pure node, and a fresh one whenever a fault takes its state away. ``station`` says what it does
    with a picture that takes time besides. With two ``passes`` an answer of its own making costs CPU time, too, before
    it leaves on the original topic; what the detector or another node answers has paid when it came.
    """

    def __init__(
        self,
        make: Callable[[], Interceptor],
        graph: Graph,
        observe: Observer,
        station: Station = PLAIN,
        passes: int = 1,
    ):
        pure = make()
        topics = pure.subscriptions(), pure.publications()
        super().__init__(pure.name, graph, *topics, threads=graph.host.device.cores)
        self.pure = pure
        self._make = make
        self._key, self._free, self._per_entry_ns = station.key, station.free, station.per_entry_ns
        self._observe = observe
        self._timer_set = False
        self._two_passes = passes == 2 and not station.free
        self._ways: OrderedDict[Header, Step] = (
            OrderedDict()
        )  # of the frames that it was asked about

    def work(self, message: Message, done: Done, arguments: Arguments) -> None:
        if self._free:
            done(*arguments)
        elif self._key is not None and isinstance(message, Image):
            self.host.compute_key(self._key, self._look_up, (done, arguments))
        else:
            self.host.serve_message(done, arguments)

    def _look_up(self, done: Done, arguments: Arguments) -> None:
        if self._per_entry_ns:
            search_ns = self._per_entry_ns * self.pure.cache_entries()
            self.host.cpu.run(search_ns, self._decide, (done, arguments))
        else:
            self._decide(done, arguments)

    def _decide(self, done: Done, arguments: Arguments) -> None:
        """The node's own, not the host's: the clock counts the time until it as a step of this node."""
        self.host.serve_message(done, arguments)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        effects = self.pure.on_message(topic, message, self.env.now, sender)
        way = self.env.way
        if way is not None and isinstance(message, Image):
            self._ways[message.header] = way
            if len(self._ways) > MOST_WAYS:
                self._ways.popitem(last=False)
        self._carry_out(effects)
        if not self._timer_set:
            self._set_timer()

    def void(self, where: str) -> None:
        super().void(where)
        for record in self.pure.on_void():
            if not isinstance(record, Expired):
                self._observe(self.name, record, self.env.now)
            else:
                self.graph.dropped(Detections(record.header, ()), where)
        self.pure = self._make()

    def _carry_out(self, effects: list[Effect]) -> None:
        publish, way = self.graph.publish, self.env.way
        for effect in effects:
            if isinstance(effect, Publish):
                header = effect.message.header
                if (
                    way is not None and header != way.header and header in self._ways
                ):  # it had waited for this
                    self.env.waited(self._ways[header], "pending", self.name)
                if self._two_passes and self._made(effect):
                    self._in_service.append(effect.message)
                    self.host.serve_message(self._leave, (effect,))
                else:
                    publish(self, effect.topic, effect.message, effect.to)
                self.env.way = way
            else:
                self._observe(self.name, effect, self.env.now)

    def _made(self, effect: Publish) -> bool:
        """Whether this is an answer of the node's own making that leaves on the original topic."""
        message = effect.message
        return (
            effect.topic == OBJECTS
            and isinstance(message, Detections)
            and message.served_by == self.name
        )

    def _leave(self, effect: Publish) -> None:
        self._in_service.remove(effect.message)
        self.graph.publish(self, effect.topic, effect.message, effect.to)

    def _set_timer(self) -> None:
        """Any message that comes tells the node the time. The timer is for when none does, so it may be late."""
        deadline_ns = self.pure.next_deadline_ns()
        if deadline_ns is not None:
            self._timer_set = True
            self.env.after(max(int(deadline_ns) - self.env.now, 0) + TIMER_LATE_NS, self._on_timer)

    def _on_timer(self) -> None:
        self._timer_set = False
        self._carry_out(self.pure.on_deadline(self.env.now))
        self._set_timer()


def attach(
    graph: Graph,
    node_name: str,
    make: MakeInterceptor,
    observe: Observer,
    station: Station = PLAIN,
    passes: int = 1,
    suffix: str = "-local",
) -> InterceptorNode:
    """Encapsulates a running node (Section III-B): the node itself is not touched.

    Reads T_S and T_P from the master, renames the node's topics with ``suffix`` so that it talks to its interceptor
    alone, and starts that, which takes over the original names. ``make`` gets T_S and T_P.
    """
    subscribed, published = graph.topics_of(node_name)
    graph.remap(node_name, {topic: topic + suffix for topic in (*subscribed, *published)})
    return InterceptorNode(lambda: make(subscribed, published), graph, observe, station, passes)
