"""When faults happen: once at their times, or again and again with the times' own means."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from genie_sim.scenario.faults import timed
from genie_sim.sim.clock import Clock
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.fault_process import run
from tests.conformance import small

MS = 1_000_000
BEGIN_NS = 700 * MS
BETWEEN_NS, DURATION_NS = 400 * MS, 50 * MS


class Noted:
    """A fault that notes when it begins and ends."""

    target = "car1"

    def __init__(self) -> None:
        self.begins_ns: list[int] = []
        self.ends_ns: list[int] = []

    def strike(self, network):
        self.begins_ns.append(network.clock.now)
        yield
        self.ends_ns.append(network.clock.now)


def course(until_ns: int, seed: int = 1, **times: int) -> Noted:
    """A fault with these ``times``, after ``until_ns`` of a run whose last frame is taken then."""
    clock, fault = Clock(), Noted()
    network = SimpleNamespace(clock=clock, stream=lambda *names: np.random.default_rng(seed))
    timed = TimedFault(fault=fault, name="fault 0", **times)
    clock.process(run(timed, network, last_frame_ns=until_ns, spans=[]))
    clock.run(until=10 * until_ns)
    return fault


def recurring(until_ns: int, seed: int = 1) -> Noted:
    return course(
        until_ns,
        seed,
        begin_ns=BEGIN_NS,
        mean_time_between_ns=BETWEEN_NS,
        mean_duration_ns=DURATION_NS,
    )


def test_a_fault_draws_by_itself_whatever_else_goes_wrong():
    slow = {"fault": "slow", "target": "edge1", "factor": 2.0}
    slow |= {"mean_time_between": "1 s", "mean_duration": "1 s"}
    stall = {"fault": "stall", "target": "car1", "begin": "0 s", "end": "1 s"}
    names = [
        [fault.name for fault in timed(small.scenario(["genie"], faults=faults).faults)]
        for faults in ([slow], [stall, slow], [slow, slow])
    ]
    assert names[1][1] == names[0][0] == names[2][0] != names[2][1]


def test_once():
    fault = course(2000 * MS, begin_ns=BEGIN_NS, end_ns=BEGIN_NS + 5)
    assert (fault.begins_ns, fault.ends_ns) == ([BEGIN_NS], [BEGIN_NS + 5])
    assert course(2000 * MS, begin_ns=BEGIN_NS).ends_ns == [], "for good"


def test_gaps_and_durations_have_their_own_means():
    """Exponential means over about 1,000 faults (seed 1, margin 4 standard errors)."""
    fault = recurring(until_ns=1000 * (BETWEEN_NS + DURATION_NS))
    begins_ns, ends_ns = np.array(fault.begins_ns), np.array(fault.ends_ns)
    assert len(begins_ns) == len(ends_ns) > 900
    durations_ns, gaps_ns = ends_ns - begins_ns, begins_ns[1:] - ends_ns[:-1]
    margin = 4 / np.sqrt(len(gaps_ns))
    assert durations_ns.mean() == pytest.approx(DURATION_NS, rel=margin)
    assert gaps_ns.mean() == pytest.approx(BETWEEN_NS, rel=margin)


def test_the_first_comes_a_gap_after_the_begin():
    """The mean over 400 seeds (margin 4 standard errors)."""
    firsts_ns = [recurring(40 * BETWEEN_NS, seed).begins_ns[0] for seed in range(400)]
    assert min(firsts_ns) > BEGIN_NS
    waits_ns = np.array(firsts_ns) - BEGIN_NS
    assert waits_ns.mean() == pytest.approx(BETWEEN_NS, rel=4 / np.sqrt(400))


def test_none_begins_after_the_last_frame_and_each_ends():
    fault = recurring(until_ns=5000 * MS)
    assert max(fault.begins_ns) <= 5000 * MS
    assert len(fault.begins_ns) == len(fault.ends_ns) > 3
