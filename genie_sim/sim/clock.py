"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time, which ``Timeline`` carries out.
"""

from typing import Any

import simpy
from simpy.core import EmptySchedule, Infinity
from simpy.events import NORMAL, EventPriority

from genie_sim.sim.timeline import Timeline


class Clock(Timeline, simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    def __init__(self, *, is_traced: bool = False) -> None:
        Timeline.__init__(self, is_traced=is_traced)
        simpy.Environment.__init__(self)

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
        next_ns = self.next_ns()
        return Infinity if next_ns is None else next_ns

    def step(self) -> None:
        """Carries out the next call."""
        if self._urgent:
            self._process(self._urgent.popleft())
        elif self.next_ns() is not None:
            super().step()
        else:
            raise EmptySchedule

    def run(self, until: Any = None) -> Any:
        """Lets time pass: to an instant [ns], to an event, or as long as calls are scheduled."""
        if until is None or isinstance(until, simpy.Event) or until <= self.now:
            return simpy.Environment.run(self, until)
        self.pass_time(until)
        return None

    def _process(self, event: simpy.Event) -> None:
        self._queue.append((self.now, NORMAL, 0, event))
        simpy.Environment.step(self)
