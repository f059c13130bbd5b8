"""Simulated time: SimPy's environment in whole nanoseconds, and the queue that devices take from.

Cameras, links, processors and nodes are SimPy processes: generators that yield the event that they
wait for.
"""

from collections.abc import Callable, Generator
from contextlib import suppress
from heapq import heappop, heappush
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar, cast

import simpy
from simpy.events import NORMAL, URGENT

from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.plugins import own_place
from genie_sim.core.messages import Header
from genie_sim.core.monitor import Span, SpanLabel

Steps = Generator[simpy.Event, Any, None]  # what a process does


class Delay(simpy.Timeout):
    """SimPy's timeout, of a whole number of nanoseconds.

    Raises ValueError for a delay that is negative or no whole number.
    """

    def __init__(self, clock: "Clock", delay: float, value: Any = None) -> None:
        if type(delay) is not int:
            delay = _whole_ns(delay)
        if delay < 0:
            raise ValueError(f"a delay of {delay} ns is negative")
        # what SimPy's constructors do, in one call: most events are timeouts
        self.env = clock
        self.callbacks = []
        self._value = value
        self._delay = delay
        self._ok = True
        heappush(clock._queue, (clock._now + delay, NORMAL, next(clock._eid), self))


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in whole nanoseconds since its start.

    Where time ``is_traced``, every frame is followed, which changes nothing else: ``path`` is the
    last span of the path of the message that is handled now. A process keeps the path of its
    message while it waits, and continues it with ``waited``. A span begins where the one before it
    ends, so the spans of an answer add up to its response time.

    ``in_flight`` is how many calls are due that carry a message on.
    """

    def __init__(self, *, is_traced: bool = False) -> None:
        super().__init__()
        self.path: Span | None = None
        self.in_flight = 0
        self._is_traced = is_traced
        self._alive: dict[simpy.Event, None] = {}  # processes that have not ended

    now: int = property(attrgetter("_now"))  # type: ignore[assignment]
    """Time since the start of the run [ns]; SimPy's own takes a call."""

    if TYPE_CHECKING:

        @property
        def active_process(self) -> simpy.Process:
            """The process that runs now, asked from within it."""

    def process(self, generator: Steps) -> simpy.Process:
        """Starts a process."""
        process = simpy.Process(self, generator)
        self._alive[process] = None
        process.callbacks.append(self._alive.pop)
        return process

    def timeout(self, delay: float = 0, value: Any = None) -> simpy.Timeout:
        """Happens after a delay [ns]. Raises ValueError for one that is negative or no whole
        number.
        """
        return Delay(self, delay, value)

    def event(self) -> simpy.Event:
        """Happens when somebody says so."""
        return simpy.Event(self)

    def wake(self, event: simpy.Event, value: Any = None) -> None:
        """An event happens now, before all others of this instant that are due already."""
        event._ok, event._value = True, value
        heappush(self._queue, (self._now, URGENT, next(self._eid), event))

    def after(
        self,
        delay_ns: int,
        call: Callable[..., None],
        arguments: tuple[Any, ...] = (),
        label: SpanLabel | None = None,
    ) -> None:
        """Calls ``call(*arguments)`` later: for a delay that needs no process of its own, such as
        the flight of a message. Raises ValueError for a delay that is negative or no whole number.

        Parameters
        ----------
        delay_ns : int
            The time until then [ns].
        call : callable
            What is called.
        arguments : tuple
            What it is called with.
        label : SpanLabel or None
            What the delay counts as on the path of the message that is handled now; ``None``: the
            call has nothing to do with that message.
        """
        if label is None:
            Delay(self, delay_ns).callbacks.append(lambda _: call(*arguments))
            return
        path = self.path
        self.in_flight += 1

        def carry_on(_: simpy.Event) -> None:
            self.in_flight -= 1
            self.waited(path, label)
            call(*arguments)

        Delay(self, delay_ns).callbacks.append(carry_on)

    def begin(self, header: Header) -> None:
        """A new frame is handled from now on."""
        if self._is_traced:
            self.path = Span(None, self.now, before=None, header=header)

    def waited(self, path: Span | None, label: SpanLabel) -> None:
        """Continues the ``path`` of a message that has waited until now, as ``label`` says."""
        if path is not None and path.end_ns != self.now:
            path = Span(label, self.now, before=path, header=path.header)
        self.path = path

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or until nothing is due; see SimPy.

        Raises what a process raises that no other waits for, and ``UserError`` where one yields
        what is no event.
        """
        try:
            if until is None or isinstance(until, simpy.Event):
                return super().run(until)
            return self._pass_time(until)
        except RuntimeError:
            process = self._active_proc
            if process is None:
                raise
            raise UserError(
                f"{_place(process)}: a process yields the event that it waits for, such as "
                "clock.timeout(10**6); this is none"
            ) from None

    def _pass_time(self, until_ns: int) -> None:
        """What SimPy's ``run`` and ``step`` do, in one loop, and without a copy of what is
        raised.
        """
        if until_ns < self._now:
            raise ValueError(f"until {until_ns} ns: it is {self._now} ns already")
        queue = self._queue
        while queue and queue[0][0] < until_ns:
            self._now, _, _, event = heappop(queue)
            callbacks, event.callbacks = event.callbacks, None  # type: ignore[assignment]
            for callback in callbacks:
                callback(event)
            if not event._ok and not hasattr(event, "_defused"):
                raise event._value
        self._now = until_ns

    def clear(self) -> None:
        """Ends all processes after a run, and drops what is scheduled, so that nothing is left to
        Python's garbage collector.
        """
        process: Any
        for process in list(self._alive):
            with suppress(RuntimeError):  # one of the user's own may go on all the same
                process._generator.close()
            _forget(process.target)
        for _, _, _, event in self._queue:
            _forget(event)
        self._alive.clear()
        self._queue.clear()


def _place(process: simpy.Process) -> str:
    """Where a process is, in the code of the user's own if it is there."""
    place, generator = process.name, cast(Any, process._generator)
    while hasattr(generator, "gi_frame"):
        place = own_place(generator.gi_frame) or place
        generator = generator.gi_yieldfrom
    return place


def _forget(event: Any) -> None:
    """Nobody waits for an event any more, nor for what it is made of."""
    if event.callbacks:
        event.callbacks.clear()
    for part in getattr(event, "_events", ()):
        _forget(part)


def _whole_ns(delay: Any) -> int:
    try:
        delay_ns = int(delay)
    except (TypeError, ValueError, OverflowError):  # no number, not a number, infinite
        delay_ns = -1
    if delay_ns != delay:
        raise ValueError(f"a delay is a whole number of nanoseconds, not {short_repr(delay)}")
    return delay_ns


class Occupancy:
    """How many wait somewhere, counted at each change and not at samples.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._count = 0
        self._since_ns = 0  # for how long so many wait
        self._most = 0  # before that
        self._total_ns = 0

    @property
    def total_ns(self) -> int:
        """The time waited until now, summed over all that waited or still do."""
        return self._total_ns + self._count * (self._clock.now - self._since_ns)

    @property
    def most(self) -> int:
        """How many have waited at a time; who is taken at once has not waited."""
        return max(self._most, self._count if self._clock.now > self._since_ns else 0)

    def forget_most(self) -> None:
        """The most at a time is that from now on."""
        self._change(0)
        self._most = 0

    def enter(self) -> None:
        """One more waits."""
        self._change(1)

    def leave(self, count: int = 1) -> None:
        """So many do not wait any more."""
        self._change(-count)

    def _change(self, by: int) -> None:
        now_ns = self._clock.now
        if now_ns > self._since_ns:
            self._total_ns += self._count * (now_ns - self._since_ns)
            self._most = max(self._most, self._count)
            self._since_ns = now_ns
        self._count += by


class OfFlow(Protocol):
    """An item of a queue; those of one ``flow`` push each other out."""

    @property
    def flow(self) -> Any: ...


Item = TypeVar("Item", bound=OfFlow)


class NewestQueue(Generic[Item]):
    """A queue that keeps the newest items of each flow, as the queue of a ROS publisher or
    subscriber keeps those of its topic. Processes take the oldest.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    length : int
        How many items of each flow wait at most.
    """

    def __init__(self, clock: Clock, length: int) -> None:
        self.items: list[Item] = []  # that wait, in the order of their arrival
        self.occupancy = Occupancy(clock)
        self._clock = clock
        self._length = length
        self._takers: list[simpy.Event] = []

    def __len__(self) -> int:
        return len(self.items)

    def put(self, item: Item) -> Item | None:
        """An item arrives: a process that waits takes it, or it joins the queue. Returns the oldest
        of its flow, if that makes room for it.
        """
        if self._takers:
            self._clock.wake(self._takers.pop(0), item)
            return None
        oldest = self.in_the_way(item.flow) if self.items else None
        if oldest is not None:
            self.take(oldest)
        self.items.append(item)
        self.occupancy.enter()
        return oldest

    def get(self) -> simpy.Event:
        """Happens when there is an item: ``item = yield queue.get()`` takes the oldest."""
        event = self._clock.event()
        if self.items:
            self._clock.wake(event, self.items.pop(0))
            self.occupancy.leave()
        else:
            self._takers.append(event)
        return event

    def take(self, item: Item) -> None:
        """An item waits no more."""
        self.items.remove(item)
        self.occupancy.leave()

    def in_the_way(self, flow: Any) -> Item | None:
        """The item that a new one of a flow pushes out; ``None`` if there is room."""
        of_flow = [item for item in self.items if item.flow == flow]
        return of_flow[0] if len(of_flow) >= self._length else None

    def clear(self) -> None:
        """Empties the queue."""
        self.occupancy.leave(len(self.items))
        self.items.clear()
