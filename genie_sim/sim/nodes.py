"""The nodes of the simulated graph: detector and interceptor (a Genie), and how one is attached to
a node.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterable

import simpy

from genie_sim.base.contracts import class_name, whole
from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.messages import (
    Detections,
    Effect,
    Expired,
    Header,
    Image,
    Message,
    Observation,
    Publish,
)
from genie_sim.sim.clock import Steps
from genie_sim.sim.method import LOCAL, OBJECTS, Costs, Interceptor, MakeInterceptor
from genie_sim.sim.monitor import Span, SpanLabel
from genie_sim.sim.ros_graph import Graph, Node

TIMER_STEP_NS = 1_000_000  # a node that wants to be woken at once again waits so long
MAX_PATHS = 20_000  # of frames, that a node remembers
DEFAULT_COSTS = Costs()
Observer = Callable[[str, Observation, int], None]  # the node's name, its observation, and when


class DetectorNode(Node):
    """The Autoware Vision Detector: one image at a time on the host's accelerator, its answer under
    the same header.

    Its answer is what the recording's detector found in the frame; how long it takes depends on the
    device.
    """

    part = "inference"

    def work(self, topic: str, message: Message, sender: str) -> Steps:
        return self.host.infer(message.header, self.work_label)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        assert isinstance(message, Image)
        answer = Detections(message.header, message.content.detections, "detector", self.name)
        self.publish(self.publishes[0], answer)


class InterceptorNode(Node):
    """A pure node in the simulated graph: every message costs CPU time, every effect becomes a
    publication.

    Where ``costs`` charge answers, one of its own making costs CPU time, too, before it leaves on
    the original topic; an answer of the detector or another node has paid on arrival.

    Parameters
    ----------
    make : callable
        Makes the pure node, and a fresh one whenever a fault takes its state away.
    graph : Graph
        The graph that it registers with.
    observe : callable
        Called with the node's name, each observation, and the time [ns].
    costs : Costs
        What the pure node's messages cost.
    """

    def __init__(
        self,
        make: Callable[[], Interceptor],
        graph: Graph,
        observe: Observer,
        costs: Costs = DEFAULT_COSTS,
    ) -> None:
        pure = make()
        if not pure.name.startswith(f"{graph.name}/"):
            text = f"is {short_repr(pure.name)}, but must begin with its host, '{graph.name}/'"
            raise UserError(f"{class_name(pure)}: name {text}")
        threads = graph.host.device.cores
        super().__init__(
            pure.name, graph, pure.subscriptions(), pure.publications(), threads=threads
        )
        self.pure = pure
        self._make = make
        self._costs = costs
        self._charges_answers = costs.charge_answers
        self._observe = observe
        self._timer_ns: int | None = None  # when it is called next, if nothing comes before
        self._pending = SpanLabel("pending", pure.name)
        self._paths: OrderedDict[Header, Span] = OrderedDict()  # of the requested frames
        self._set_timer()

    @property
    def is_busy(self) -> bool:
        return self._timer_ns is not None or super().is_busy

    def work(self, topic: str, message: Message, sender: str) -> Iterable[simpy.Event]:
        costs = self._costs
        if costs.is_free:
            return ()
        if costs.key is not None and isinstance(message, Image):
            return self._look_up(costs.key, topic, message, sender)
        if costs.relay_time_ns is not None:
            return self.host.cpu.serve(costs.relay_time_ns, self.work_label)
        return self.host.serve_message(topic, message, sender, self.work_label)

    def _look_up(self, key: str, topic: str, message: Message, sender: str) -> Steps:
        """Computes the key of an image, searches the cache, then handles the message."""
        host, label = self.host, self.work_label
        yield from host.compute_key(key, label)
        if per_entry_ns := self._costs.per_entry_ns:
            yield from host.cpu.serve(per_entry_ns * self.pure.cache_entries(), label)
        yield from host.serve_message(topic, message, sender, label)

    def handle(self, topic: str, message: Message, sender: str) -> None:
        effects = self.pure.on_message(topic, message, self.clock.now, sender)
        path = self.clock.path
        if path is not None and isinstance(message, Image):
            self._paths[message.header] = path
            if len(self._paths) > MAX_PATHS:
                self._paths.popitem(last=False)
        self._carry_out("on_message()", effects)
        self._set_timer()

    def lose_memory(self, where: str) -> None:
        for observation in self.pure.on_memory_lost():
            if isinstance(observation, Expired):
                self.graph.dropped(Detections(observation.header, ()), where)
            else:
                self._observe(self.name, observation, self.clock.now)
        self.pure = self._make()
        self._set_timer()

    def _carry_out(self, hook: str, effects: list[Effect]) -> None:
        if not isinstance(effects, (list, tuple)):
            raise TypeError(f"{hook} is {short_repr(effects)}, but must be a list of effects")
        path = self.clock.path
        for effect in effects:
            if isinstance(effect, Publish):
                self._publish_effect(effect)
                self.clock.path = path  # that of another frame may have left
            elif isinstance(effect, Observation):
                self._observe(self.name, effect, self.clock.now)
            else:
                text = f"{hook} has {short_repr(effect)}, but must have effects, such as Publish"
                raise TypeError(text)

    def _publish_effect(self, effect: Publish) -> None:
        """Publishes a message, on the path of that which led to it, or on its own."""
        path = self.clock.path
        if path is not None:
            header = effect.message.header
            if header != path.header and header in self._paths:
                # another frame, which has waited here for this one
                self.clock.waited(self._paths[header], self._pending)
        if self._charges_answers and self._is_own_answer(effect):
            self.clock.process(self._publish_own_answer(effect, self.clock.path))
        else:
            self.graph.publish(self, effect.topic, effect.message, effect.to)

    def _is_own_answer(self, effect: Publish) -> bool:
        """Whether this is an answer of the node's own making on the original topic."""
        message = effect.message
        return (
            effect.topic == OBJECTS
            and isinstance(message, Detections)
            and message.served_by == self.name
        )

    def _publish_own_answer(self, effect: Publish, path: Span | None) -> Steps:
        """An answer of the node's own making costs CPU time before it leaves; no thread waits."""
        process = self.clock.active_process
        self._working[process] = (effect.message,)
        self.clock.path = path
        try:
            message = effect.message
            yield from self.host.serve_message(effect.topic, message, self.name, self.work_label)
        except simpy.Interrupt:  # a crash
            return
        del self._working[process]
        self.graph.publish(self, effect.topic, effect.message, effect.to)

    def _set_timer(self) -> None:
        """The pure node is told the time when its deadline has come. Any message that comes does
        so, too; this is for when none does.
        """
        deadline_ns = self.pure.next_deadline_ns()
        if deadline_ns is None:
            return
        now_ns = self.clock.now
        timer_ns = max(whole(self.pure, "next_deadline_ns()", deadline_ns), now_ns + TIMER_STEP_NS)
        if self._timer_ns is None or timer_ns < self._timer_ns:
            self._timer_ns = timer_ns
            self.clock.after(timer_ns - now_ns, self._on_timer, (timer_ns,), self._pending)

    def _on_timer(self, timer_ns: int) -> None:
        if timer_ns == self._timer_ns:  # else an earlier deadline has come in between
            self._timer_ns = None
            self._carry_out("on_deadline()", self.pure.on_deadline(self.clock.now))
            self._set_timer()


def attach(
    graph: Graph,
    node_name: str,
    make: MakeInterceptor,
    observe: Observer,
    *,
    costs: Costs = DEFAULT_COSTS,
    suffix: str = LOCAL,
) -> InterceptorNode:
    """Encapsulates a running node (Section III-B), which itself is not changed.

    Reads T_S and T_P from the master, renames the node's topics with ``suffix`` so that it talks to
    its interceptor alone, and starts that, which takes over the original names.

    Parameters
    ----------
    graph : Graph
        The graph of the node.
    node_name : str
        The node to encapsulate.
    make : callable
        Makes the interceptor from T_S and T_P.
    observe : callable
        See ``InterceptorNode``.
    costs : Costs
        See ``InterceptorNode``.
    suffix : str
        What is appended to the node's topics.
    """
    inputs, outputs = graph.topics_of(node_name)
    graph.remap(node_name, {topic: topic + suffix for topic in (*inputs, *outputs)})
    return InterceptorNode(lambda: make(inputs, outputs), graph, observe, costs=costs)
