"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time. A heap holds the instants at which calls
are due, and each instant has a list of calls, in the order in which they were scheduled.
"""

from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Any

import simpy
from simpy.core import EmptySchedule, Infinity
from simpy.events import NORMAL, EventPriority

from genie_sim.messages import Header
from genie_sim.monitor import Span, SpanLabel


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    now: int = 0  # SimPy allows fractions; delays here are whole, so this stays whole
    # The last span of the path that led to the current call; only ``TracingClock`` sets it.
    path: Span | None = None

    def __init__(self) -> None:
        super().__init__()
        self._instants: list[int] = []
        self._calls: dict[int, list[tuple[Callable[..., None], tuple[Any, ...]]]] = {}
        # SimPy's events that come before all other calls of this instant
        self._urgent: deque[simpy.Event] = deque()

    def after(
        self,
        delay_ns: int,
        call: Callable[..., None],
        arguments: tuple[Any, ...] = (),
        label: SpanLabel | None = None,
    ) -> None:
        """Schedules ``call(*arguments)``.

        Parameters
        ----------
        delay_ns : int
            The time until then [ns].
        call : callable
            What is called.
        arguments : tuple
            What it is called with.
        label : SpanLabel or None
            What the delay counts as on the path of the frame that is handled now; ``None``: the
            call has nothing to do with that frame.
        """
        at_ns = self.now + delay_ns
        calls = self._calls.get(at_ns)
        if calls is None:
            self._calls[at_ns] = [(call, arguments)]
            heappush(self._instants, at_ns)
        else:
            calls.append((call, arguments))

    def begin(self, header: Header) -> None:
        """A new frame is handled from now on; only ``TracingClock`` follows it."""

    def waited(self, path: Span | None, label: SpanLabel) -> None:
        """Continues the ``path`` of a message that has waited until now, as ``label`` says; only
        ``TracingClock`` does.
        """

    def schedule(
        self, event: simpy.Event, priority: EventPriority = NORMAL, delay: Any = 0
    ) -> None:
        """SimPy's way to schedule an event; ``delay`` is a whole number, too."""
        if priority == NORMAL:
            self.after(int(delay), self._process, (event,))
        else:  # a process begins or is interrupted
            self._urgent.append(event)

    def peek(self) -> Any:
        """The instant of the next call."""
        if self._urgent:
            return self.now
        return self._instants[0] if self._instants else Infinity

    def step(self) -> None:
        """Carries out the next call."""
        if self._urgent:
            self._process(self._urgent.popleft())
            return
        if not self._instants:
            raise EmptySchedule
        self.now = self._instants[0]
        call, arguments = self._calls[self.now].pop(0)
        if not self._calls[self.now]:
            del self._calls[heappop(self._instants)]
        call(*arguments)

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or as long as calls are scheduled."""
        if until is None or isinstance(until, simpy.Event) or until <= self.now:
            return super().run(until)
        instants, take, urgent = self._instants, self._calls.pop, self._urgent
        while urgent:
            self.step()
        while instants and instants[0] < until:
            self.now = at_ns = heappop(instants)
            for call, arguments in take(at_ns):
                call(*arguments)
                while urgent:
                    self.step()
        self.now = int(until)
        return None

    def waits_only_for(self, call: Callable[..., None]) -> bool:
        """Whether no other call is scheduled."""
        for calls in self._calls.values():
            for scheduled, _ in calls:
                if scheduled != call:
                    return False
        return True

    def clear(self) -> None:
        """Drops all scheduled calls."""
        self._instants.clear()
        self._calls.clear()

    def _process(self, event: simpy.Event) -> None:
        self._queue.append((self.now, NORMAL, 0, event))
        super().step()
