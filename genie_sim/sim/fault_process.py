"""The process of a fault: it begins and ends at its times, and both are noted."""

from collections.abc import Generator

import simpy

from genie_sim.base.contracts import require
from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.sim.clock import Steps
from genie_sim.sim.fault import Strike, TimedFault
from genie_sim.sim.monitor import FaultSpan
from genie_sim.sim.network import Network


def run(entry: TimedFault, network: Network, last_frame_ns: int, spans: list[FaultSpan]) -> Steps:
    """The process of a fault: it begins and ends, once or again and again. A recurring one does not
    begin again after the last frame. ``spans`` gets every time from a beginning to an end.
    """
    clock, target = network.clock, entry.fault.target
    owner, between_ns = f"fault {entry.kind!r}", entry.mean_time_between_ns
    rng = network.stream(entry.name)

    def drawn(mean_ns: int) -> simpy.Timeout:
        return clock.timeout(max(1, round(rng.exponential(mean_ns))))

    yield clock.timeout(entry.begin_ns)
    if between_ns is not None:
        yield drawn(between_ns)
    while between_ns is None or clock.now <= last_frame_ns:
        text = target if isinstance(target, str) else ", ".join(target)
        number = len(spans)
        spans.append(FaultSpan(entry.kind, text, clock.now, None))
        steps = entry.fault.strike(network)
        generator = "a generator, a function that yields"
        require(isinstance(steps, Generator), f"{owner}: strike()", steps, generator)
        with as_user_error(owner, UserError):  # such as an unknown host
            event = next(steps, None)
        process = clock.process(_working(owner, steps, event))
        if between_ns is not None:
            yield drawn(entry.mean_duration_ns)
        elif entry.end_ns is not None:
            yield clock.timeout(entry.end_ns - entry.begin_ns)
        else:
            return
        spans[number] = spans[number]._replace(end_ns=clock.now)
        if process.is_alive:
            process.interrupt("end")
        elif next(steps, steps) is not steps:
            raise UserError(f"{owner}: strike() yields again after the fault's end")
        if between_ns is None:
            return
        if clock.now <= last_frame_ns:
            yield drawn(between_ns)


def _working(owner: str, steps: Strike, event: simpy.Event | None) -> Steps:
    """Waits for what a fault waits for, until that is its end alone."""
    try:
        while event is not None:
            if not isinstance(event, simpy.Event):
                raise UserError(
                    f"{owner}: strike() yields {short_repr(event)}, but must yield an event of the "
                    "clock, or nothing to wait for its end"
                )
            try:
                value = yield event
            except Exception as error:
                event = steps.throw(error)
            else:
                event = steps.send(value)
    except (StopIteration, simpy.Interrupt):
        return
