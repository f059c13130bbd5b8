"""The process of a fault: it begins and ends at its times, and both are noted."""

from collections.abc import Generator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import simpy

from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.monitor import FaultSpan
from genie_sim.sim.clock import Steps
from genie_sim.sim.fault import AffectedNetwork, DrawnFault, FaultProcess, TimedFault


class RecordedFault:
    """A fault that notes when it begins and ends.

    Parameters
    ----------
    timed : TimedFault
        The fault.
    spans : list of FaultSpan
        Gets every time from a beginning to an end.
    """

    def __init__(self, timed: TimedFault, spans: list[FaultSpan]) -> None:
        self._timed = timed
        self._spans = spans
        self._present = -1  # the place of the span that has begun
        self._process: simpy.Process | None = None

    def begin(self, network: AffectedNetwork) -> None:
        fault = self._timed.fault
        hosts = fault.drawn_targets(network) if isinstance(fault, DrawnFault) else fault.target
        text = hosts if isinstance(hosts, str) else ", ".join(hosts)
        self._present = len(self._spans)
        self._spans.append(FaultSpan(self._timed.kind, text, network.clock.now, None))
        try:
            if isinstance(fault, FaultProcess):
                steps = fault.run(network)
                if not isinstance(steps, Generator):
                    raise UserError(
                        f"run() returns {short_repr(steps)}, but must be a generator, a function "
                        "that yields"
                    )
                self._process = network.clock.process(_until_interrupted(steps))
            else:
                fault.begin(network)
        except UserError as error:  # such as an unknown host
            raise UserError(f"fault {self._timed.kind!r}: {error}") from None

    def end(self, network: AffectedNetwork) -> None:
        span = self._spans[self._present]
        self._spans[self._present] = span._replace(end_ns=network.clock.now)
        if self._process is None:
            self._timed.fault.end(network)
        elif self._process.is_alive:
            self._process.interrupt("end")


def _until_interrupted(steps: Steps) -> Steps:
    with suppress(simpy.Interrupt):
        yield from steps


def recorded(timed: TimedFault, spans: list[FaultSpan]) -> TimedFault:
    """The same fault, which notes when it begins and ends."""
    fault: Any = RecordedFault(timed, spans)
    return replace(timed, fault=fault)


def run(timed: TimedFault, network: AffectedNetwork, last_frame_ns: int) -> Steps:
    """The process of a fault: it begins and ends, once or again and again. A recurring one does not
    begin again after the last frame.
    """
    clock, fault, between_ns = network.clock, timed.fault, timed.mean_time_between_ns
    if between_ns is None:
        yield clock.timeout(timed.begin_ns)
        fault.begin(network)
        if timed.end_ns is not None:
            yield clock.timeout(timed.end_ns - timed.begin_ns)
            fault.end(network)
        return
    rng = network.stream(timed.name)

    def drawn(mean_ns: int) -> simpy.Timeout:
        return clock.timeout(max(1, round(rng.exponential(mean_ns))))

    yield clock.timeout(timed.begin_ns)
    yield drawn(between_ns)
    while clock.now <= last_frame_ns:
        fault.begin(network)
        yield drawn(timed.mean_duration_ns)
        fault.end(network)
        if clock.now <= last_frame_ns:
            yield drawn(between_ns)
