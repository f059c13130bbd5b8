"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time. The heap holds the instants at which something happens, whole
numbers, and each has a list of calls, in the order in which they were scheduled.
"""

from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Any

import simpy
from simpy.core import EmptySchedule, Infinity
from simpy.events import NORMAL, EventPriority

from genie_sim.messages import Header
from genie_sim.monitor import Step


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    now: int = 0  # SimPy allows for fractions; delays here are whole, so this stays whole
    way: Step | None = (
        None  # what led to the call that is carried out now, where somebody wants to know
    )

    def __init__(self) -> None:
        super().__init__()
        self._instants: list[int] = []
        self._calls: dict[int, list[tuple[Callable[..., None], tuple[Any, ...]]]] = {}
        self._urgent: deque[simpy.Event] = (
            deque()
        )  # what comes before all other calls of this instant

    def after(self, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
        """Calls ``call(*arguments)`` in ``delay_ns`` of simulated time."""
        at_ns = self.now + delay_ns
        calls = self._calls.get(at_ns)
        if calls is None:
            self._calls[at_ns] = [(call, arguments)]
            heappush(self._instants, at_ns)
        else:
            calls.append((call, arguments))

    def begin(self, header: Header) -> None:
        """What is done from now on is about a new frame; only ``StepClock`` follows it."""

    def waited(self, way: Step | None, part: str, place: str) -> None:
        """What is done from now on goes on with ``way``, which has waited at this place until now."""

    def schedule(
        self, event: simpy.Event, priority: EventPriority = NORMAL, delay: Any = 0
    ) -> None:
        """SimPy's way to say when an event happens; ``delay`` is a whole number, too."""
        if priority == NORMAL:
            self.after(int(delay), self._happens, event)
        else:  # a process begins or is interrupted
            self._urgent.append(event)

    def peek(self) -> Any:
        """When something happens next."""
        return self.now if self._urgent else self._instants[0] if self._instants else Infinity

    def step(self) -> None:
        """What happens next."""
        if self._urgent:
            self._happens(self._urgent.popleft())
            return
        if not self._instants:
            raise EmptySchedule
        self.now = self._instants[0]
        call, arguments = self._calls[self.now].pop(0)
        if not self._calls[self.now]:
            del self._calls[heappop(self._instants)]
        call(*arguments)

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or as long as something happens."""
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
        """Whether nothing else is to happen any more."""
        return all(one == call for calls in self._calls.values() for one, _ in calls)

    def clear(self) -> None:
        """Nothing happens any more."""
        self._instants.clear()
        self._calls.clear()

    def _happens(self, event: simpy.Event) -> None:
        self._queue.append((self.now, NORMAL, 0, event))
        super().step()
