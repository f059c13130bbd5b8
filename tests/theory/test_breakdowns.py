"""Servers that break down, against renewal theory and by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from genie_sim.base.seeds import stream
from genie_sim.faults.slow import Slow
from genie_sim.faults.stall import Stall
from genie_sim.sim.clock import Clock
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.fault_process import run
from genie_sim.sim.host import Processor
from tests.sim.processes import job

S, MS = 1_000_000_000, 1_000_000
SEED, CYCLES = 3, 1000


def network(clock: Clock, processor: Processor) -> SimpleNamespace:
    return SimpleNamespace(
        clock=clock,
        stream=lambda *names: stream(SEED, *names),
        processors=lambda host: (processor,),
    )


@pytest.mark.slow
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
        job(processor, service_ns, serve)

    serve()
    end_ns = round(CYCLES * (up_s + down_s) * S)
    timed = TimedFault(
        fault=Stall("edge1"),
        name="fault 0",
        mean_time_between_ns=round(up_s * S),
        mean_duration_ns=round(down_s * S),
    )
    clock.process(run(timed, network(clock, processor), end_ns, []))  # type: ignore[arg-type]
    clock.run(until=end_ns)
    share = sum(served_ns[:-1]) / end_ns
    expected = up_s / (up_s + down_s)
    error = expected * (1 - expected) * math.sqrt(2 / CYCLES)
    print(f"\navailability {share:.4f}, theory {expected} +- {error:.4f}")
    assert share == pytest.approx(expected, abs=3 * error)


def test_a_stall_by_hand():
    """Two servers: what is in service takes as much longer as the stall lasts, what comes waits."""
    clock, ended = Clock(), {}
    cpu = Processor(clock, "car1.cpu", "cpu", units=2)

    def serve(name: str, service_ms: int) -> None:
        job(cpu, service_ms * MS, lambda: ended.update({name: clock.now // MS}))

    serve("within", 30)  # would end during the stall
    serve("across", 100)  # would end after it
    clock.after(20 * MS, cpu.stall)
    clock.after(40 * MS, serve, ("later", 10))
    clock.after(70 * MS, cpu.go_on)
    clock.run()
    assert ended == {"within": 80, "later": 90, "across": 150}
    assert cpu.completed == 3 and cpu.queued == 0


def test_two_stalls_that_overlap_and_one_job_over_two_stalls():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    job(processor, 50 * MS, lambda: ended.append(clock.now // MS))
    for at_ms, call in ((10, processor.stall), (20, processor.stall), (30, processor.go_on)):
        clock.after(at_ms * MS, call)
    for at_ms, call in ((60, processor.go_on), (80, processor.stall), (90, processor.go_on)):
        clock.after(at_ms * MS, call)
    clock.run()
    assert ended == [50 + (60 - 10) + (90 - 80)]


def test_interrupted_jobs_of_a_stalled_processor_are_forgotten():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    old = [job(processor, 10 * MS, lambda: ended.append("old")) for _ in range(2)]
    clock.after(5 * MS, processor.stall)
    for process in old:
        clock.after(20 * MS, process.interrupt)
    clock.after(30 * MS, processor.go_on)
    clock.after(31 * MS, job, (processor, 10 * MS, lambda: ended.append(clock.now // MS)))
    clock.run()
    assert ended == [41] and processor.completed == 1 and processor.queued == 0
    assert processor.busy_ns == (20 + 10) * MS


def test_a_job_that_is_interrupted_at_the_instant_of_its_turn_makes_room_for_the_next():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    first, second, third = (
        job(processor, 10 * MS, lambda name=name: ended.append((name, clock.now // MS)))
        for name in ("first", "second", "third")
    )

    def crash() -> None:
        processor.stall()
        second.interrupt()
        processor.go_on()

    clock.after(5 * MS, processor.stall)
    clock.after(7 * MS, first.interrupt)
    clock.after(8 * MS, processor.go_on)
    clock.after(8 * MS, crash)
    clock.run()
    assert ended == [("third", 18)]
    assert third.processed and processor.busy_ns == (7 + 10) * MS


def test_jobs_of_a_slow_host_take_longer():
    clock, ended = Clock(), []
    processor = Processor(clock, "edge1.accelerator", "accelerator")
    slow, hot = Slow("edge1", factor=5.0), Slow("edge1", factor=1.5)
    world = network(clock, processor)

    def come() -> None:
        job(processor, 10 * MS, lambda: ended.append(clock.now // MS))
        clock.run(clock.timeout(0))  # it is in the queue

    come()  # before: as usual
    of_slow, of_hot = (fault.strike(world) for fault in (slow, hot))  # type: ignore[arg-type]
    for steps in (of_slow, of_hot, of_slow, of_hot):
        next(steps, None)
        come()
    clock.run()
    assert ended == [10, 60, 135, 150, 160]
