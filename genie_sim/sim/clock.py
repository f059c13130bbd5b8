"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time. The heap holds a whole number for each: its instant, and in
the lowest ``ORDER_BITS`` its place in SimPy's order of what happens at one instant. By that number the call is found.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush
from itertools import count
from typing import Any

import simpy
from simpy.core import EmptySchedule, Infinity
from simpy.events import NORMAL, EventPriority

ORDER_BITS = 48
PRIORITY_BITS = 44  # below them calls and events are numbered as they are scheduled
FIRST = NORMAL << PRIORITY_BITS  # of these numbers


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    now: int = 0  # SimPy allows for fractions; delays here are whole, so this stays whole

    def __init__(self) -> None:
        super().__init__()
        self._eid = count(FIRST)
        self._heap: list[int] = []
        self._calls: dict[int, tuple[Callable[..., None], tuple[Any, ...]]] = {}

    def after(self, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
        """Calls ``call(*arguments)`` in ``delay_ns`` of simulated time, an ``int`` (numpy's are too short)."""
        key = (self.now + delay_ns << ORDER_BITS) + next(self._eid)
        self._calls[key] = call, arguments
        heappush(self._heap, key)

    def schedule(self, event: simpy.Event, priority: EventPriority = NORMAL, delay: Any = 0) -> None:
        """SimPy's way to say when an event happens; ``delay`` is a whole number, too."""
        key = (self.now + int(delay) << ORDER_BITS) + next(self._eid) + (priority - NORMAL << PRIORITY_BITS)
        self._calls[key] = self._happens, (event,)
        heappush(self._heap, key)

    def peek(self) -> Any:
        """When something happens next."""
        return self._heap[0] >> ORDER_BITS if self._heap else Infinity

    def step(self) -> None:
        """What happens next."""
        if not self._heap:
            raise EmptySchedule
        key = heappop(self._heap)
        self.now = key >> ORDER_BITS
        call, arguments = self._calls.pop(key)
        call(*arguments)

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or as long as something happens."""
        if not isinstance(until, int) or until <= self.now:
            return super().run(until)
        heap, take, end = self._heap, self._calls.pop, until << ORDER_BITS
        while heap and heap[0] < end:
            key = heappop(heap)
            self.now = key >> ORDER_BITS
            call, arguments = take(key)
            call(*arguments)
        self.now = until
        return None

    def waits_only_for(self, call: Callable[..., None]) -> bool:
        """Whether nothing else is to happen any more."""
        return all(one == call for one, _ in self._calls.values())

    def clear(self) -> None:
        """Nothing happens any more."""
        self._heap.clear()
        self._calls.clear()

    def _happens(self, event: simpy.Event) -> None:
        self._queue.append((self.now, NORMAL, 0, event))
        super().step()
