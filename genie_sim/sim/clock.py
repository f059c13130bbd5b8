"""Simulated time: SimPy's environment, with a clock in whole nanoseconds.

Most of what happens in a run is one call at a later time. That is one SimPy event; a SimPy process that waits for it
would be three.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any

import simpy

Process = Generator[simpy.Event, Any, None]


class Clock(simpy.Environment):
    """The time of a run: ``now`` is in nanoseconds since its start."""

    now: int  # SimPy allows for fractions; delays here are whole, so this stays whole

    def after(self, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
        """Calls ``call(*arguments)`` in ``delay_ns`` of simulated time."""
        self.timeout(delay_ns).callbacks.append(lambda _: call(*arguments))
