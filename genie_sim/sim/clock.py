"""Simulated time: SimPy's environment, its clock in integer nanoseconds.

Most of what happens here is one call at a later time. That is one SimPy event; a SimPy process that waits for it would
be three.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import simpy


def after(env: simpy.Environment, delay_ns: int, call: Callable[..., None], *arguments: Any) -> None:
    """Calls ``call(*arguments)`` in ``delay_ns`` of simulated time."""
    env.timeout(delay_ns).callbacks.append(lambda _: call(*arguments))
