"""The share of a run that one process simulates, where several simulate one run.

One process simulates all edges and some of the cars, each of the others some of the cars alone. A
message between them takes at least the delay of a car's link, so no process needs to know what
another did in that time. Each simulates window after window, a part of that delay, gives what
crosses to the others, and waits only where they are as many windows behind as make the whole delay
(conservative synchronisation; R. M. Fujimoto, "Parallel discrete event simulation", CACM 33(10),
1990). Every event has the place among the others that it has in one process.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, TypeVar

from genie_sim.messages import Detections, Expired, Header, Message, Observation
from genie_sim.monitor import Monitor, Placement
from genie_sim.sim.clock import Clock
from genie_sim.sim.crossing import pack, unpack
from genie_sim.sim.interface import InterfaceUse
from genie_sim.sim.link import Bridge
from genie_sim.sim.link_models import LinkEnds
from genie_sim.sim.ros_graph import Subscriber
from genie_sim.sim.setup import Setup

Value = TypeVar("Value", bound=int)
EDGES = 0  # the number of the process that simulates the edges
WINDOWS = 4  # in the least delay of a message between processes


class Parcel(NamedTuple):
    """What one process has for another at the end of a window.

    Parameters
    ----------
    crossings : list
        Messages on links that end there: the link, when the message arrives and when that was
        decided [ns], the message as ``crossing.pack`` makes it, and what its bridge has to know.
    losses : list
        Frames of cars there that lost a message: when that happened and when it was scheduled [ns],
        the frame's header, what lost it, and the node at which it expired, if it did.
    carried : list
        What a link has carried to a car there: the header and the size [bytes] of each message.
    uses : list
        When [ns] a link to a car there begins (True) or ends to be in use, and the car.
    """

    crossings: list[tuple[str, int, int, tuple[Any, ...], str, int]]
    losses: list[tuple[int, int, tuple[Any, ...], str, str | None]]
    carried: list[tuple[tuple[Any, ...], int]]
    uses: list[tuple[int, str, bool]]


class Exchange(Protocol):
    """Connects the processes that simulate one run. The one with the edges is connected to all
    others, these to that one alone. What one gives comes in the order in which it was given.
    """

    def give(self, parcels: Mapping[int, Any]) -> None:
        """Sends each connected process its parcel, and does not wait until it takes it."""

    def take(self) -> Mapping[int, Any]:
        """Waits for the next parcel of each connected process."""


class OrderUnknown(Exception):
    """Two events came at one instant, and both had been scheduled at one instant, by two processes:
    only one process knows which is first.
    """


class Share:
    """What this process, the ``number``-th, simulates, and what it exchanges with the others.

    Parameters
    ----------
    number : int
        Which process this is; ``EDGES`` has the edges.
    owners : mapping of str to int
        The process of each car.
    delay_ns : int
        No message between processes takes less [ns].
    exchange : Exchange
        Connects the processes.
    """

    def __init__(
        self, number: int, owners: Mapping[str, int], delay_ns: int, exchange: Exchange
    ) -> None:
        self.has_edges = number == EDGES
        self.window_ns = delay_ns // WINDOWS
        self._number = number
        self._owners = owners
        self._exchange = exchange
        others = sorted(set(owners.values()) - {EDGES}) if self.has_edges else [EDGES]
        self._parcels = {other: Parcel([], [], [], []) for other in others}
        self._here = Parcel([], [], [], [])  # losses and uses of this window
        self._open: deque[Parcel] = deque()  # of windows of which others have not told
        self._bridges: dict[str, Bridge] = {}  # whose messages come from elsewhere, by the link
        self._uses: dict[str, NotedUse] = {}  # by the car
        self._carried_bytes: dict[str, int] = {}  # by links elsewhere, by the car
        self.clock: Clock
        self.monitor: Monitor

    def observe(self, clock: Clock, monitor: Monitor) -> "SharedMonitor":
        """The run begins; returns what observes the share in the place of ``monitor``."""
        self.clock, self.monitor = clock, monitor
        return SharedMonitor(self, monitor)

    def scheduled_ns(self) -> int:
        """When the present event was scheduled [ns]."""
        return self.clock.scheduled_ns

    def has(self, host: str) -> bool:
        """Whether this process simulates a host."""
        return self._owners.get(host, EDGES) == self._number

    def sends(self, ends: LinkEnds) -> bool:
        """Whether this process simulates the sender of a link."""
        return self.has(ends.edge if ends.car is None or not ends.up else ends.car)

    def receives(self, ends: LinkEnds) -> bool:
        """Whether this process simulates the receiver of a link."""
        return self.has(ends.edge if ends.car is None or ends.up else ends.car)

    def expect(self, link: str, bridge: Bridge) -> None:
        """From now on messages may come over a link from another process."""
        self._bridges[link] = bridge

    def interface(self, car: str, tail_time_ns: int) -> InterfaceUse:
        """The use of a car's interface, whose links may have their senders in two processes."""
        if self.has_edges and self.has(car):
            return InterfaceUse(tail_time_ns)
        use = NotedUse(car, self._note_use, tail_time_ns)
        if self.has(car):
            self._uses[car] = use
        return use

    def carried_bytes(self, car: str) -> int:
        """How much links with their senders elsewhere have carried to a car."""
        return self._carried_bytes.get(car, 0)

    def carry(self, ends: LinkEnds, arrives_ns: int, arguments: tuple[Any, ...]) -> None:
        """A message of a bridge is on its way to another process, where it ``arrives_ns``."""
        message, sender, times_up = arguments
        receiver = EDGES if ends.up or ends.car is None else self._owners[ends.car]
        self._parcels[receiver].crossings.append(
            (ends.name, arrives_ns, self.clock.now, pack(message), sender, times_up)
        )

    def lose(self, header: Header, where: str, node: str | None = None) -> None:
        """A message about a frame is lost, or expires at a ``node``. What came last counts, so the
        frame's car hears of it when the window is over.
        """
        loss = self.clock.now, self.clock.scheduled_ns, tuple(header), where, node
        self._parcel(header.origin).losses.append(loss)

    def take(self, column: str, message: Message) -> None:
        """A link of a car has carried a message; see ``monitor.Monitor.carried``."""
        parcel = self._parcel(message.header.origin)
        if parcel is self._here:
            self.monitor.carried(column, message)
        else:
            parcel.carried.append((tuple(message.header), message.size_bytes))

    def latest(self, instant_ns: int) -> int:
        """The latest of what all processes say."""
        return self._agreed(instant_ns, max)

    def all_say(self, is_so: bool) -> bool:
        """Whether all processes say so."""
        return self._agreed(is_so, min)

    def _agreed(self, value: Value, choose: Callable[[Iterable[Value]], Value]) -> Value:
        for _ in range(2):  # the process with the edges learns it, then it tells the others
            self._exchange.give(dict.fromkeys(self._parcels, value))
            value = choose([value, *self._exchange.take().values()])
        return value

    def end_window(self) -> None:
        """Gives others what this window has for them, and waits for what must be known before the
        next. Raises ``OrderUnknown``.
        """
        if self.clock.has_ties:
            raise OrderUnknown
        self._exchange.give(self._parcels)
        for parcel in self._parcels.values():
            for facts in parcel:
                facts.clear()
        self._open.append(self._here)
        self._here = Parcel([], [], [], [])
        while len(self._open) >= WINDOWS:
            self._close_window()

    def catch_up(self) -> None:
        """Waits until all windows are known that have ended here."""
        while self._open:
            self._close_window()

    def _close_window(self) -> None:
        """Takes what others have for this process from the oldest open window."""
        here = self._open.popleft()
        for parcel in self._exchange.take().values():
            self._deliver(parcel.crossings)
            here.losses.extend(parcel.losses)
            here.uses.extend(parcel.uses)
            for header, size_bytes in parcel.carried:
                answer = CarriedAnswer(Header(*header), size_bytes)
                self.monitor.carried("bytes_down", answer)
                car = answer.header.origin
                self._carried_bytes[car] = self.carried_bytes(car) + size_bytes
        self._settle(here)

    def _note_use(self, now_ns: int, car: str, is_begin: bool) -> None:
        self._parcel(car).uses.append((now_ns, car, is_begin))

    def _parcel(self, car: str) -> Parcel:
        """What this window has for the process of a car, which may be this one."""
        owner = self._owners.get(car, self._number)
        return self._here if owner == self._number else self._parcels[owner]

    def _deliver(
        self, crossings: Iterable[tuple[str, int, int, tuple[Any, ...], str, int]]
    ) -> None:
        """Schedules the arrivals of messages from elsewhere."""
        for link, arrives_ns, scheduled_ns, packed, sender, times_up in crossings:
            arguments = unpack(packed), sender, times_up
            self.clock.from_elsewhere(
                arrives_ns, scheduled_ns, self._bridges[link].arrive, arguments
            )

    def _settle(self, window: Parcel) -> None:
        """Tells what happened in a window, in the order in which it did."""
        for now_ns, _, header, where, node in sorted(window.losses, key=lambda loss: loss[:2]):
            if node is None:
                self.monitor.dropped(Detections(Header(*header), ()), where)
            else:
                self.monitor.observe("edge", node, Expired(Header(*header)), now_ns)
        for now_ns, car, is_begin in sorted(window.uses):
            self._uses[car].settle(now_ns, is_begin=is_begin)


def shared(setup: Setup, share: Share) -> Setup:
    """What a share needs of a set-up: its cars and their faults, with the edges all of them."""
    if share.has_edges:
        return setup
    cars = [car for car in setup.cars if share.has(car.name)]
    faults = [timed for timed in setup.faults if share.has(timed.fault.target)]
    return replace(setup, cars=cars, faults=faults)


class CarriedAnswer(NamedTuple):
    """All that counts of a message that a link elsewhere has carried."""

    header: Header
    size_bytes: int


class NotedUse(InterfaceUse):
    """The use of an interface that two processes note; it counts when both are known."""

    def __init__(self, car: str, note: Callable[[int, str, bool], None], tail_time_ns: int) -> None:
        super().__init__(tail_time_ns)
        self._car = car
        self._note = note

    def begin(self, now_ns: int) -> None:
        self._note(now_ns, self._car, True)

    def end(self, now_ns: int) -> None:
        self._note(now_ns, self._car, False)

    def settle(self, now_ns: int, *, is_begin: bool) -> None:
        """Counts what was noted."""
        if is_begin:
            super().begin(now_ns)
        else:
            super().end(now_ns)


class SharedMonitor:
    """Observes a share: what concerns the frames of cars elsewhere is told to their processes. See
    ``monitor.Monitor``.
    """

    def __init__(self, share: Share, monitor: Monitor) -> None:
        self.wants_changes = monitor.wants_changes
        self.wants_paths = monitor.wants_paths
        self.samples = monitor.samples
        self.published = monitor.published
        self.received = monitor.received
        self.answered = monitor.answered
        self.sample = monitor.sample
        self.used = monitor.used
        self.failed = monitor.failed
        self.attacked = monitor.attacked
        self.close = monitor.close
        self.carried = share.take
        self._share = share
        self._observe = monitor.observe

    def dropped(self, message: Message, where: str) -> None:
        self._share.lose(message.header, where)

    def observe(self, placement: Placement, node: str, record: Observation, now_ns: int) -> None:
        if isinstance(record, Expired):
            self._share.lose(record.header, "", node)
        else:
            self._observe(placement, node, record, now_ns)


class FarEdge:
    """An edge server that another process simulates, as a car's uplink sees it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.target = FarGraph(name)
        self.bridge_to: dict[str, Bridge] = {}


class FarGraph:
    """The graph of a host that another process simulates, as links see it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.entry = f"{name}/consumer"

    def bridge(self, topic: str, bridge: Subscriber) -> None:
        """What is published there is so in the other process."""

    def inject(self, topic: str, message: Message, sender: str) -> None:
        raise AssertionError("arrives in another process")


class FarSender:
    """The sender of a link whose messages are sent in another process."""

    def send(self, size_bytes: int, carried: Callable[[], None]) -> None:
        raise AssertionError("sent in another process")

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        raise AssertionError("sent in another process")

    def set_up(self, is_up: bool) -> None:
        """A hand-over takes the link away or makes it again; here it carries nothing."""
