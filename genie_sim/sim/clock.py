"""Simulated time: SimPy's environment in whole nanoseconds, and the queue that devices take from.

Cameras, links, processors and nodes are SimPy processes: generators that yield the event that they
wait for.
"""

from collections.abc import Callable, Generator
from heapq import heappush
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import simpy
from simpy.events import NORMAL

from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.messages import Header
from genie_sim.sim.monitor import Span, SpanLabel

Steps = Generator[simpy.Event, Any, None]  # what a process does


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in whole nanoseconds since its start.

    If it ``keeps_paths``, every frame is followed, which changes nothing else: ``path`` is the
    last span of the path of the message that is handled now. A span begins where the one before it
    ends, so the spans of an answer add up to its response time.

    Whenever a process yields, others run and leave paths of their own here. So one that has a
    message in hand waits with ``wait``, which gives the message its path back; a message that waits
    in a queue takes its path along, and goes on with ``waited``::

        self._queue.put(Waiting(message, clock.path))   # where the message arrives

        message, path = yield self._queue.get()         # in the process that takes it
        clock.waited(path, self._queueing)
        yield from clock.wait(clock.timeout(service_ns), self._service)

    Where that is left out nothing fails, but the time counts on the path of another frame.

    ``in_flight`` is how many calls are due that carry a message on.
    """

    def __init__(self, *, keeps_paths: bool = False) -> None:
        super().__init__()
        self.path: Span | None = None
        self.in_flight = 0
        self._keeps_paths = keeps_paths

    # SimPy's own of these four take a call or two more, a tenth of a simulation.
    now: int = property(attrgetter("_now"))  # type: ignore[assignment]
    """Time since the start of the run [ns]."""

    def schedule(self, event: simpy.Event, priority: Any = NORMAL, delay: float = 0) -> None:
        """An event happens after a delay [ns]. Raises ValueError for one that is no whole
        number.
        """
        delay_ns = delay if type(delay) is int else _whole_ns(delay)
        heappush(self._queue, (self._now + delay_ns, priority, next(self._eid), event))

    def timeout(self, delay: float = 0, value: Any = None) -> simpy.Timeout:
        """Happens after a delay [ns]. Raises ValueError for one that is negative or no whole
        number.
        """
        return simpy.Timeout(self, delay, value)

    def event(self) -> simpy.Event:
        """Happens when somebody says so."""
        return simpy.Event(self)

    if TYPE_CHECKING:

        @property
        def active_process(self) -> simpy.Process:
            """The process that runs now, asked from within it."""

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
        if self._keeps_paths:
            self.path = Span(None, self.now, before=None, header=header)

    def wait(self, event: simpy.Event, label: SpanLabel) -> Steps:
        """Waits for an event with the message that is handled now, whose path goes on, as ``label``
        says: ``yield from clock.wait(event, label)``.
        """
        path = self.path
        yield event
        self.waited(path, label)

    def waited(self, path: Span | None, label: SpanLabel) -> None:
        """Continues the ``path`` of a message that has waited until now, as ``label`` says."""
        if path is not None and path.end_ns != self.now:
            path = Span(label, self.now, before=path, header=path.header)
        self.path = path

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or until nothing is due; see SimPy.

        Raises what a process raises that no other waits for, itself and not SimPy's copy, and
        ``UserError`` where one yields what is no event.
        """
        try:
            return super().run(until)
        except RuntimeError as error:
            if self.active_process is None:
                raise
            raise UserError(
                f"{' '.join(str(error).split())}: a process yields the event that it waits for, "
                "such as clock.timeout(10**6)"
            ) from None
        except Exception as error:
            original = error.__cause__
            if type(original) is not type(error) or original.args != error.args:
                raise
            raise original from original.__cause__


def _whole_ns(delay: Any) -> int:
    try:
        delay_ns = int(delay)
    except (TypeError, ValueError, OverflowError):  # no number, not a number, infinite
        delay_ns = -1
    if delay_ns != delay:
        raise ValueError(f"a delay is a whole number of nanoseconds, not {short_repr(delay)}")
    return delay_ns


class Occupancy:
    """How many wait somewhere. It changes with each that comes or goes, and is not sampled.

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

    def restart_most(self) -> None:
        """From now on ``most`` is the most since now."""
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
    subscriber keeps those of its topic, which SimPy's stores cannot. Processes take the oldest.

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
            self._takers.pop(0).succeed(item)
            return None
        oldest = self.oldest_of_full(item.flow) if self.items else None
        if oldest is not None:
            self.take(oldest)
        self.items.append(item)
        self.occupancy.enter()
        return oldest

    def get(self) -> simpy.Event:
        """Happens when there is an item: ``item = yield queue.get()`` takes the oldest."""
        event = self._clock.event()
        if self.items:
            event.succeed(self.items.pop(0))
            self.occupancy.leave()
        else:
            self._takers.append(event)
        return event

    def take(self, item: Item) -> None:
        """An item waits no more."""
        self.items.remove(item)
        self.occupancy.leave()

    def oldest_of_full(self, flow: Any) -> Item | None:
        """The oldest item of a flow, which a new one pushes out; ``None`` if there is room."""
        of_flow = [item for item in self.items if item.flow == flow]
        return of_flow[0] if len(of_flow) >= self._length else None

    def clear(self) -> None:
        """Empties the queue."""
        self.occupancy.leave(len(self.items))
        self.items.clear()
