"""Simulated time: SimPy's environment in whole nanoseconds, and the queue that devices take from.

Cameras, links, processors and nodes are SimPy processes: generators that yield the event that they
wait for.
"""

from collections.abc import Callable, Generator
from contextlib import suppress
from heapq import heappush
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import simpy
from simpy.events import NORMAL, URGENT, EventPriority

from genie_sim.errors import UserError, short_repr
from genie_sim.messages import Header
from genie_sim.monitor import Span, SpanLabel
from genie_sim.plugins import own_place

Steps = Generator[simpy.Event, Any, None]  # what a process does


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
        self._alive: dict[simpy.Process, None] = {}  # processes that have not ended
        self._failure: BaseException | None = None  # of the last one that failed

    if TYPE_CHECKING:

        @property
        def now(self) -> int:
            """Time since the start of the run [ns]."""

        @property
        def active_process(self) -> simpy.Process:
            """The process that runs now, asked from within it."""

    def schedule(
        self, event: simpy.Event, priority: EventPriority = NORMAL, delay: Any = 0
    ) -> None:
        """See SimPy. Raises ValueError for a delay that is no whole number of nanoseconds."""
        if type(delay) is not int:
            delay = _whole_ns(delay)
        heappush(self._queue, (self._now + delay, priority, next(self._eid), event))

    def process(self, generator: Steps) -> simpy.Process:
        """Starts a process."""
        process = simpy.Process(self, generator)
        self._alive[process] = None
        process.callbacks.append(self._ended)
        return process

    def timeout(self, delay: float = 0, value: Any = None) -> simpy.Timeout:
        """Happens after a delay [ns]. Raises ValueError for one that is negative or no whole
        number.
        """
        return simpy.Timeout(self, delay, value)

    def event(self) -> simpy.Event:
        """Happens when somebody says so."""
        return simpy.Event(self)

    def wake(self, event: simpy.Event, value: Any = None) -> None:
        """An event happens now, before all others of this instant that are due already."""
        event._ok, event._value = True, value
        self.schedule(event, URGENT)

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
            self.timeout(delay_ns).callbacks.append(lambda _: call(*arguments))
            return
        path = self.path
        self.in_flight += 1

        def carry_on(_: simpy.Event) -> None:
            self.in_flight -= 1
            self.waited(path, label)
            call(*arguments)

        self.timeout(delay_ns).callbacks.append(carry_on)

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
        """See SimPy. Raises what a process raises that no other waits for, and ``UserError`` where
        one yields what is no event.
        """
        try:
            return super().run(until)
        except BaseException as error:
            process, failure = self._active_proc, self._failure
            if isinstance(error, RuntimeError) and process is not None:
                generator: Any = process._generator
                place = own_place(generator.gi_frame) or process.name
                raise UserError(
                    f"{place}: a process yields the event that it waits for, such as "
                    "clock.timeout(10**6); this is none"
                ) from None
            if failure is not None and (error.__cause__ is failure or isinstance(error, TypeError)):
                raise failure from None  # SimPy raises a copy, if it can make one
            raise

    def clear(self) -> None:
        """Ends all processes after a run, and drops what is scheduled, so that nothing is left to
        Python's garbage collector.
        """
        for process in list(self._alive):
            with suppress(RuntimeError):  # one of the user's own may go on all the same
                process._generator.close()
            _forget(process.target)
        for _, _, _, event in self._queue:
            _forget(event)
        self._alive.clear()
        self._queue.clear()

    def _ended(self, process: simpy.Event) -> None:
        assert isinstance(process, simpy.Process)
        del self._alive[process]
        if not process._ok:
            self._failure = process._value


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


class OfFlow(Protocol):
    """An item of a queue; those of one ``flow`` push each other out."""

    @property
    def flow(self) -> Any: ...


Item = TypeVar("Item", bound=OfFlow)


class Newest(Generic[Item]):
    """A queue that keeps the newest items of each flow, as the queue of a ROS publisher or
    subscriber keeps those of its topic. Processes take the oldest.

    Parameters
    ----------
    clock : Clock
        The run's clock.
    length : int
        How many items of each flow wait at most.
    pushed_out : callable
        Called with each item that makes room for a newer one.
    """

    def __init__(self, clock: Clock, length: int, pushed_out: Callable[[Item], None]) -> None:
        self.items: list[Item] = []  # that wait, in the order of their arrival
        self._clock = clock
        self._length = length
        self._pushed_out = pushed_out
        self._takers: list[simpy.Event] = []

    def __len__(self) -> int:
        return len(self.items)

    def put(self, item: Item) -> None:
        """An item arrives: a process that waits takes it; else it joins the queue, where the oldest
        of its flow makes room if that is full.
        """
        if self._takers:
            self._clock.wake(self._takers.pop(0), item)
            return
        oldest = self.in_the_way(item.flow) if self.items else None
        if oldest is not None:
            self.items.remove(oldest)
            self._pushed_out(oldest)
        self.items.append(item)

    def get(self) -> simpy.Event:
        """Happens when there is an item: ``item = yield queue.get()`` takes the oldest."""
        event = self._clock.event()
        if self.items:
            self._clock.wake(event, self.items.pop(0))
        else:
            self._takers.append(event)
        return event

    def in_the_way(self, flow: Any) -> Item | None:
        """The item that a new one of a flow pushes out; ``None`` if there is room."""
        of_flow = [item for item in self.items if item.flow == flow]
        return of_flow[0] if len(of_flow) >= self._length else None

    def clear(self) -> list[Item]:
        """Empties the queue; returns what was in it."""
        items = self.items.copy()
        self.items.clear()
        return items
