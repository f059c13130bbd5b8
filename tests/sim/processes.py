"""Processes that tests start: a job on a processor, a message that a sender sends."""

from __future__ import annotations

from collections.abc import Callable

import simpy

from genie_sim.sim.clock import Clock, Steps
from genie_sim.sim.device import Processor
from genie_sim.sim.link_models import Sender


def job(
    processor: Processor, service_ns: int, done: Callable[[], None] = lambda: None
) -> simpy.Process:
    """Serves a job, then calls ``done``."""
    return then(processor.clock, processor.serve(service_ns), done)


def then(clock: Clock, steps: Steps, done: Callable[[], None]) -> simpy.Process:
    """A process that takes some steps, then calls ``done``; a crash that interrupts it ends it."""

    def process() -> Steps:
        try:
            yield from steps
        except simpy.Interrupt:
            return
        done()

    return clock.process(process())


def send(clock: Clock, sender: Sender, size_bytes: int, left: Callable[[], None]) -> None:
    """Sends a message now, and calls ``left`` when its last bit has left."""
    sender.sent(size_bytes).callbacks.append(lambda _: left())
