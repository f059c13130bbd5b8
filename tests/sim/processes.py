"""Processes that tests start: a job on a processor, a message on a link; and transmitters of links
that are in no network.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import simpy

from genie_sim.base.seeds import Draws
from genie_sim.sim.clock import Clock, Steps
from genie_sim.sim.host import Processor
from genie_sim.sim.link_model import LinkEnds, LinkModel, Transmitter

UP = LinkEnds("car1->edge1", "car1", "edge1", up=True)
DOWN = LinkEnds("edge1->car1", "car1", "edge1", up=False)


def transmitter(
    model: LinkModel,
    ends: LinkEnds = UP,
    *,
    clock: Clock | None = None,
    seed: int = 1,
) -> Any:
    """One direction of a link whose car stands at the origin."""
    network: Any = SimpleNamespace(
        clock=clock or Clock(),
        draws=lambda *names: Draws(seed, *names),
        place=lambda car: (0.0, 0.0),
    )
    return model.transmitter(network, ends)


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


def send(clock: Clock, transmitter: Transmitter, size_bytes: int, left: Callable[[], None]) -> None:
    """Sends a message now, and calls ``left`` when its last bit has left."""
    transmitter.transmit(size_bytes).callbacks.append(lambda _: left())
