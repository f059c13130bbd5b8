"""Links: a queue, a transmitter that takes its time, a delay, and losses on the way."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any

from genie_sim.base.contracts import whole
from genie_sim.base.errors import UserError
from genie_sim.core.messages import Message
from genie_sim.sim.bends import NO_BORDER, Border
from genie_sim.sim.clock import Clock, NewestQueue, Occupancy, Steps
from genie_sim.sim.encoding import Coder, ImageCodec
from genie_sim.sim.interface import InterfaceUse
from genie_sim.sim.link_model import Transmitter
from genie_sim.sim.monitor import Part, Span, SpanLabel
from genie_sim.sim.ros_graph import Dropped, Graph, Subscriber, ignore_drop

Deliver = Callable[..., None]
Arguments = tuple[Any, ...]
OnMessage = Callable[[Message], None]


@dataclass(slots=True, eq=False)
class Transfer:
    """What is sent over a link. ``message`` and ``deliver`` are ``None`` where it is nothing to the
    nodes: background traffic.
    """

    flow: Hashable
    size_bytes: int
    message: Message | None = None
    host: str = ""  # that it goes to
    deliver: Deliver | None = None
    arguments: Arguments = ()
    carried: OnMessage | None = None
    path: Span | None = None


class Link:
    """One direction between two hosts, a process: a queue, then the transmitter of a link model.

    Messages wait in one queue; each flow keeps its ``queue_length`` newest waiting ones, as a ROS
    publisher does. Messages stay in order, as with TCP. A message is lost where the transmitter
    says so, or if a fault has cut the link at the moment its last bit leaves.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    name : str
        ``FROM->TO``.
    transmitter : Transmitter
        One direction of a link model.
    part : {"uplink", "downlink", "edges"}
        What the time on the link counts as.
    queue_length : int
        How many messages of each flow wait at most.
    dropped : callable
        Called with each message that is lost, and what lost it.
    """

    kind = "link"
    capacity = 1

    def __init__(
        self,
        clock: Clock,
        name: str,
        transmitter: Transmitter,
        *,
        part: Part = "edges",
        queue_length: int = 1,
        dropped: Dropped = ignore_drop,
    ) -> None:
        self.clock = clock
        self.name = name
        self.completed = 0
        self.drops = 0
        self.sent_bytes = 0
        self.cut_by: list[str] = []  # the faults that keep it cut now
        self._cut_off: list[tuple[str, str]] = []  # hosts that faults keep from it, and the faults
        self.interface: InterfaceUse | None = None  # of the car at one of its ends
        self._is_connected = True
        self.transmitter = transmitter
        self._transport = SpanLabel(part, name)
        self._queueing = SpanLabel("queueing", name)
        self._dropped = dropped
        self._waiting = NewestQueue[Transfer](clock, queue_length)
        self._sending: Transfer | None = None
        self._busy_since_ns = 0
        self._busy_ns = 0
        self._last_arrival_ns = 0
        clock.process(self._transmit())

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def occupancy(self) -> Occupancy:
        """How many have waited, over time."""
        return self._waiting.occupancy

    @property
    def busy_ns(self) -> int:
        """How long it has been sending until now."""
        present_ns = self.clock.now - self._busy_since_ns if self._sending is not None else 0
        return self._busy_ns + present_ns

    @property
    def is_busy(self) -> bool:
        """Whether a message waits or is being sent, other than background traffic."""
        transfers = (self._sending, *self._waiting.items)
        return any(transfer is not None and transfer.deliver for transfer in transfers)

    def send(
        self,
        flow: Hashable,
        message: Message,
        deliver: Deliver,
        arguments: Arguments = (),
        *,
        carried: OnMessage | None = None,
        host: str = "",
    ) -> None:
        """Queues a message. Raises ``UserError`` for one of no bytes.

        Parameters
        ----------
        flow : hashable
            Messages of one flow push each other out of the queue.
        message : Message
            What is sent.
        deliver : callable
            Called with ``arguments`` when the message arrives at the other end, if it does.
        arguments : tuple
            See ``deliver``.
        carried : callable or None
            Called with the message when its last bit has left, whether it arrives or is lost.
        host : str
            The host that it goes to, or a node there.
        """
        size_bytes = message.size_bytes
        if size_bytes <= 0:
            raise UserError(f"{self.name}: a message of {size_bytes} bytes; it must have some")
        self._queue(
            Transfer(
                flow,
                size_bytes,
                message,
                host=host,
                deliver=deliver,
                arguments=arguments,
                carried=carried,
                path=self.clock.path,
            )
        )

    def load(self, flow: Hashable, size_bytes: int) -> None:
        """Queues background traffic, which takes its time on the link and reaches no node. Raises
        ValueError for a size that is not positive.
        """
        if size_bytes <= 0:
            raise ValueError(f"{self.name}: background traffic of {size_bytes} bytes")
        self._queue(Transfer(("background", flow), size_bytes))

    def _queue(self, transfer: Transfer) -> None:
        oldest = self._waiting.put(transfer)
        if oldest is not None and oldest.message is not None:
            self.lose(oldest.message, self.name)

    def _transmit(self) -> Steps:
        """Sends one message after the other; each arrives after a delay, or is lost."""
        clock = self.clock
        while True:
            transfer = yield self._waiting.get()
            if self._sending is None:
                self._busy_since_ns = clock.now
                if self.interface is not None:
                    self.interface.begin(clock.now)
            self._sending = transfer
            clock.waited(transfer.path, self._queueing)
            self.transmitter.random.begin(transfer.message, transfer.host)
            yield from clock.wait(self.transmitter.transmit(transfer.size_bytes), self._transport)
            self.sent_bytes += transfer.size_bytes
            if transfer.message is not None:
                self._leave(transfer, transfer.message)
            if not self._waiting.items:
                self._sending = None
                self._busy_ns += clock.now - self._busy_since_ns
                if self.interface is not None:
                    self.interface.end(clock.now)

    def _leave(self, transfer: Transfer, message: Message) -> None:
        """The last bit of a message has left: it arrives after the delay, or is lost."""
        clock = self.clock
        now_ns, size_bytes = clock.now, message.size_bytes
        if transfer.carried is not None:
            transfer.carried(message)
        if (cause := self._cut(transfer.host)) is not None:
            self.lose(message, f"{self.name}:{cause}")
        elif (delay_ns := self.transmitter.delay_ns(size_bytes, now_ns)) is None:
            self.lose(message, self.name)
        else:
            self.completed += 1
            arrival_ns = now_ns + whole(self.transmitter, "delay_ns()", delay_ns)
            self._last_arrival_ns = max(arrival_ns, self._last_arrival_ns)
            assert transfer.deliver is not None
            clock.after(
                self._last_arrival_ns - now_ns,
                transfer.deliver,
                transfer.arguments,
                self._transport,
            )

    def cut(self, cause: str, host: str = "") -> None:
        """The link carries nothing from now on, or nothing to a ``host``; it drops messages as
        ``NAME:cause``.
        """
        if host:
            self._cut_off.append((host, cause))
        else:
            self.cut_by.append(cause)
            self.transmitter.set_available(False)

    def restore(self, cause: str, host: str = "") -> None:
        """Ends a ``cut``."""
        if host:
            self._cut_off.remove((host, cause))
        else:
            self.cut_by.remove(cause)
            self.transmitter.set_available(not self.cut_by and self._is_connected)

    def _cut(self, node: str) -> str | None:
        """The fault that takes what would go to a node, ``None`` if there is none."""
        if self.cut_by:
            return self.cut_by[-1]
        host = node.partition("/")[0] if self._cut_off else ""
        return next((cause for name, cause in self._cut_off if name == host), None)

    def set_connected(self, is_connected: bool) -> None:
        """A hand-over takes the link away, or makes it again."""
        self._is_connected = is_connected
        self.transmitter.set_available(not self.cut_by and is_connected)

    def lose(self, message: Message, where: str) -> None:
        """A message is lost, by what ``where`` names."""
        self.drops += 1
        self._dropped(message, where)


class Bridge(Subscriber):
    """Carries a topic of one graph over a link to a topic of another.

    After ``disconnect`` nothing gets across any more, neither what comes then nor what was on its
    way.

    Parameters
    ----------
    link : Link
        What carries the messages.
    target : Graph or Coder
        What takes them at the far end.
    topic : str
        The topic at the far end.
    address : str
        The node at the far end, for messages meant for one receiver.
    carried : callable or None
        Called with each message whose last bit has left.
    lost : callable or None
        Called with each message lost by ``disconnect``, at the instant at which it would have begun
        or ended its way.
    codec : ImageCodec or None
        How images are encoded; ``None``: not at all.
    border : Border
        What faults change of the messages at both ends.
    """

    def __init__(
        self,
        link: Link,
        target: Graph | Coder,
        *,
        topic: str,
        address: str,
        carried: OnMessage | None = None,
        lost: OnMessage | None = None,
        codec: ImageCodec | None = None,
        border: Border = NO_BORDER,
    ) -> None:
        self.address = address
        self.link = link
        self._codec = codec
        self._target = target
        self._topic = topic
        self._carried = carried
        self._lost = lost
        self._border = border
        self._is_connected = True
        self._connections = 1  # how often it was connected

    def disconnect(self) -> None:
        """The connection breaks."""
        self._is_connected = False
        self.link.set_connected(False)

    def reconnect(self) -> None:
        """The connection is there again; what was on its way before stays lost."""
        self._is_connected = True
        self._connections += 1
        self.link.set_connected(True)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        if not self._is_connected:
            self._lose(message)
            return
        if self._codec is not None:
            message = self._codec.encoded(message)
        outside = self._cross(message, self._border.leave(message))
        if outside is None:
            return
        flow = (self.address, self._topic, message.header.frame_id)
        arguments = (outside, sender, self._connections)
        self.link.send(
            flow, outside, self.arrive, arguments, carried=self._carried, host=self.address
        )

    def arrive(self, message: Message, sender: str, connections: int) -> None:
        """A message reaches the far end, which left over the connection of this number."""
        if not self._is_connected or connections != self._connections:
            self._lose(message)
            return
        inside = self._cross(message, self._border.enter(message))
        if inside is not None:
            self._target.inject(self._topic, inside, sender)

    def _cross(self, message: Message, outcome: Message | str) -> Message | None:
        """A message beyond a border, of which ``outcome`` tells; ``None`` if it was lost there."""
        if isinstance(outcome, str):
            self.link.lose(message, f"{self.link.name}:{outcome}")
            return None
        return outcome

    def _lose(self, message: Message) -> None:
        if self._lost is not None:
            self._lost(message)
