"""Servers that break down, against renewal theory and by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from genie_sim.faults.slow import Slow
from genie_sim.faults.stall import Stall
from genie_sim.seeds import stream
from genie_sim.sim import fault
from genie_sim.sim.clock import Clock
from genie_sim.sim.device import Processor
from genie_sim.sim.fault import TimedFault

S, MS = 1_000_000_000, 1_000_000
SEED, CYCLES = 3, 1000


def network(clock: Clock, processor: Processor) -> SimpleNamespace:
    return SimpleNamespace(
        clock=clock,
        stream=lambda *names: stream(SEED, *names),
        processors=lambda host: (processor,),
    )


def test_availability_of_a_queue_with_breakdowns():
    """M/M/1 whose server breaks down: it is up for a share MTBF / (MTBF + MTTR) of the time, within
    3 standard errors over 1,000 cycles, and a queue that is never empty is served at that share of
    its rate.
    """
    up_s, down_s = 8.0, 2.0
    clock = Clock()
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    rng, served_ns = stream(SEED, "services"), []

    def serve() -> None:
        service_ns = max(1, round(rng.exponential(0.1 * S)))
        served_ns.append(service_ns)
        processor.run(service_ns, serve)

    serve()
    end_ns = round(CYCLES * (up_s + down_s) * S)
    timed = TimedFault(
        fault=Stall("edge1"),
        name="fault 0",
        mean_time_between_ns=round(up_s * S),
        mean_duration_ns=round(down_s * S),
    )
    fault.start(timed, network(clock, processor), end_ns)  # type: ignore[arg-type]
    clock.run(until=end_ns)
    share = sum(served_ns[:-1]) / end_ns
    expected = up_s / (up_s + down_s)
    error = expected * (1 - expected) * math.sqrt(2 / CYCLES)
    print(f"\navailability {share:.4f}, theory {expected} +- {error:.4f}")
    assert share == pytest.approx(expected, abs=3 * error)


def test_a_stall_by_hand():
    """Two servers: what is in service takes as much longer as the stall lasts, what comes waits."""
    clock, ended = Clock(), {}
    cpu = Processor(clock, "car1.cpu", "cpu", capacity=2)

    def run(name: str, service_ms: int) -> None:
        cpu.run(service_ms * MS, lambda: ended.update({name: clock.now // MS}))

    run("within", 30)  # would end during the stall
    run("across", 100)  # would end after it
    clock.after(20 * MS, cpu.stall)
    clock.after(40 * MS, run, ("later", 10))
    clock.after(70 * MS, cpu.go_on)
    clock.run()
    assert ended == {"within": 80, "later": 90, "across": 150}
    assert cpu.completed == 3 and cpu.queued == 0


def test_two_stalls_that_overlap_and_one_job_over_two_stalls():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    processor.run(50 * MS, lambda: ended.append(clock.now // MS))
    for at_ms, call in ((10, processor.stall), (20, processor.stall), (30, processor.go_on)):
        clock.after(at_ms * MS, call)
    for at_ms, call in ((60, processor.go_on), (80, processor.stall), (90, processor.go_on)):
        clock.after(at_ms * MS, call)
    clock.run()
    assert ended == [50 + (60 - 10) + (90 - 80)]


def test_a_stalled_processor_that_is_voided_forgets_what_it_held():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    processor.run(10 * MS, lambda: ended.append("old"))
    clock.after(5 * MS, processor.stall)
    clock.after(20 * MS, processor.void)
    clock.after(30 * MS, processor.go_on)
    clock.after(31 * MS, processor.run, (10 * MS, lambda: ended.append(clock.now // MS)))
    clock.run()
    assert ended == [41]


def test_jobs_of_a_slow_host_take_longer():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    slow, hot = Slow("edge1", factor=5.0), Slow("edge1", factor=1.5)
    world = network(clock, processor)
    processor.run(10 * MS, lambda: ended.append(clock.now // MS))  # before: as usual
    slow.begin(world)  # type: ignore[arg-type]
    processor.run(10 * MS, lambda: ended.append(clock.now // MS))
    hot.begin(world)  # type: ignore[arg-type]
    processor.run(10 * MS, lambda: ended.append(clock.now // MS))
    slow.end(world)  # type: ignore[arg-type]
    processor.run(10 * MS, lambda: ended.append(clock.now // MS))
    hot.end(world)  # type: ignore[arg-type]
    processor.run(10 * MS, lambda: ended.append(clock.now // MS))
    clock.run()
    assert ended == [10, 60, 135, 150, 160]
