"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time. That is one SimPy event; a SimPy process that waits for it
would be three.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

import simpy

Process = Generator[simpy.Event, Any, None]


class _Call(simpy.Event):
    """An event with one callback, which nobody waits for: less to set up than a ``Timeout``."""

    _ok = True
    _value = None

    def __init__(self, callback: Callable[[simpy.Event], None]) -> None:
        self.callbacks = [callback]


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    now: int  # SimPy allows for fractions; delays here are whole, so this stays whole

    def waits_only_for(self, process: simpy.Process) -> bool:
        """Whether nothing else is to happen any more. (``run`` leaves an event in the queue that nobody waits for.)"""
        return all(event is process.target for _, _, _, event in self._queue if event.callbacks)

    def after(self, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
        """Calls ``call(*arguments)`` in ``delay_ns`` of simulated time."""
        self.schedule(_Call(lambda _: call(*arguments)), delay=delay_ns)
