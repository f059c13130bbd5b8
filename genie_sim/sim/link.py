"""Links: a sender with a queue, a channel that takes its time, and what gets lost on the way."""

from collections import Counter, deque
from collections.abc import Callable, Hashable

from genie_sim.messages import Message
from genie_sim.monitor import Step
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Arguments
from genie_sim.sim.encoding import Codec, Coder
from genie_sim.sim.link_models import Channel
from genie_sim.sim.ros_graph import Dropped, Graph

Deliver = Callable[..., None]
Carried = Callable[[Message], None]


class Link:
    """One direction of a connection: a queue for the wire, then the channel of a link model.

    Messages wait in one queue; each flow keeps its ``queue_length`` newest waiting ones, as a ROS publisher does. The
    order of messages stays as it is, as with TCP. A message is lost where the channel says so, or when a fault has
    taken the link down at the moment its last bit leaves.
    """

    kind = "link"
    capacity = 1
    part = "edges"  # what the time on it counts as: ``uplink``, ``downlink``, or that of the network between edges

    def __init__(
        self,
        env: Clock,
        name: str,
        channel: Channel,
        queue_length: int = 1,
        dropped: Dropped | None = None,
    ) -> None:
        self.env = env
        self.name = name
        self.completed = 0
        self.drops = 0
        self.sent_bytes = 0
        self.down_by: list[str] = []  # the faults that it is down by now
        self._channel = channel
        self._queue_length = queue_length
        self._dropped = dropped
        self._waiting: deque[
            tuple[Hashable, Message, Step | None, Carried | None, Deliver, Arguments]
        ] = deque()
        self._flows: Counter[Hashable] = Counter()
        self._busy = False
        self._busy_since_ns = 0
        self._busy_ns = 0
        self._last_arrival_ns = 0

    @property
    def queued(self) -> int:
        return len(self._waiting)

    @property
    def busy_ns(self) -> int:
        """How long the wire has been in use until now."""
        return self._busy_ns + (self.env.now - self._busy_since_ns if self._busy else 0)

    def send(
        self,
        flow: Hashable,
        message: Message,
        deliver: Deliver,
        arguments: Arguments = (),
        carried: Carried | None = None,
    ) -> None:
        """Queues a message; ``deliver(*arguments)`` is called when it arrives at the other end, if it does.

        ``carried`` is told when it has been on the wire, whether it arrives or is lost.
        """
        if not self._busy:
            self._busy = True
            self._busy_since_ns = self.env.now
            self._transmit(message, carried, deliver, arguments)
            return
        if self._flows[flow] >= self._queue_length:
            self._drop_oldest(flow)
        self._waiting.append((flow, message, self.env.way, carried, deliver, arguments))
        self._flows[flow] += 1

    def _transmit(
        self, message: Message, carried: Carried | None, deliver: Deliver, arguments: Arguments
    ) -> None:
        """A message goes on the wire."""
        size_bytes = message.size_bytes
        occupied_ns = self._channel.occupied_ns(size_bytes, self.env.now)
        self.env.after(
            int(occupied_ns), self._transmitted, size_bytes, message, carried, deliver, arguments
        )

    def _transmitted(
        self,
        size_bytes: int,
        message: Message,
        carried: Carried | None,
        deliver: Deliver,
        arguments: Arguments,
    ) -> None:
        """Its last bit is on the wire: it arrives after the delay, or is lost."""
        now_ns = self.env.now
        self.sent_bytes += size_bytes
        if carried is not None:
            carried(message)
        if self.down_by:
            self._lose(message, f"{self.name}:{self.down_by[-1]}")
        elif (delay_ns := self._channel.delay_ns(size_bytes, now_ns)) is None:
            self._lose(message, self.name)
        else:
            self.completed += 1
            self._last_arrival_ns = max(now_ns + int(delay_ns), self._last_arrival_ns)
            self.env.after(self._last_arrival_ns - now_ns, deliver, *arguments)
        if self._waiting:
            flow, message, way, carried, deliver, arguments = self._waiting.popleft()
            self._flows[flow] -= 1
            self.env.waited(way, "queueing", self.name)
            self._transmit(message, carried, deliver, arguments)
        else:
            self._busy = False
            self._busy_ns += now_ns - self._busy_since_ns

    def _drop_oldest(self, flow: Hashable) -> None:
        oldest = next(i for i, entry in enumerate(self._waiting) if entry[0] == flow)
        _, message, *_ = self._waiting[oldest]
        del self._waiting[oldest]
        self._flows[flow] -= 1
        self._lose(message, self.name)

    def _lose(self, message: Message, where: str) -> None:
        self.drops += 1
        if self._dropped is not None:
            self._dropped(message, where)


class Bridge:
    """Carries a topic of one graph over a link to a topic of another.

    ``reaches`` is the address of the node at the far end, for messages meant for one receiver. ``carried`` is told of
    each message that was on the wire. After ``take_down`` nothing gets across any more, neither what comes then nor
    what was on its way; ``lost`` is told of each such message at the moment it would have begun or ended its way.
    With a ``codec`` pictures go as it encodes them.
    """

    def __init__(
        self,
        link: Link,
        target: Graph | Coder,
        topic: str,
        reaches: str,
        carried: Carried | None = None,
        lost: Carried | None = None,
        codec: Codec | None = None,
    ) -> None:
        self.address = reaches
        self._codec = codec
        self.link = link
        self._target = target
        self._topic = topic
        self._carried = carried
        self._lost = lost
        self._is_up = True
        self._times_up = 1

    def take_down(self) -> None:
        """The connection breaks."""
        self._is_up = False

    def put_up(self) -> None:
        """The connection is there again; what was on its way before stays lost."""
        self._is_up = True
        self._times_up += 1

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        if not self._is_up:
            self._lose(message)
            return
        if self._codec is not None:
            message = self._codec.on_wire(message)
        flow = (self.address, self._topic, message.header.frame_id)
        self.link.send(
            flow, message, self._arrive, (message, sender, self._times_up), self._carried
        )

    def _arrive(self, message: Message, sender: str, times_up: int) -> None:
        if self._is_up and times_up == self._times_up:
            self._target.inject(self._topic, message, sender)
        else:
            self._lose(message)

    def _lose(self, message: Message) -> None:
        if self._lost is not None:
            self._lost(message)
