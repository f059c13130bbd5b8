"""Processors that stand still or lose what they work on."""

from __future__ import annotations

from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Processor
from tests.sim.processes import job

MS = 1_000_000


def test_a_crash_at_the_instant_at_which_a_job_begins_leaves_the_server_free():
    """The second job is given the server when the first ends, and is interrupted before it runs."""
    clock = Clock()
    processor = Processor(clock, "car1.cpu", "cpu")
    ended: list[tuple[str, int]] = []
    jobs = {}

    def first_ends() -> None:
        jobs["second"].interrupt("crash")
        ended.append(("first", clock.now))

    job(processor, 10 * MS, first_ends)
    jobs["second"] = job(processor, 10 * MS, lambda: ended.append(("second", clock.now)))
    job(processor, 10 * MS, lambda: ended.append(("third", clock.now)))
    clock.run()
    assert ended == [("first", 10 * MS), ("third", 20 * MS)]
    assert (processor.busy_ns, processor.queued) == (20 * MS, 0)
