"""Processes of the user's own beside the simulated ones."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest
import simpy

from genie_sim.sim.clock import Clock
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.fault_process import run
from genie_sim.sim.network import Network
from tests.conformance import small

OWN = "tests.conformance.own"
MS = 1_000_000


@dataclass(frozen=True)
class Course:
    """A process that does what ``steps`` says."""

    steps: Any
    target: str = "edge1"

    def strike(self, network):
        return self.steps(network)


def course(steps: Any, until_ns: int = 100 * MS, **times: int) -> list[Any]:
    """The spans of a fault whose process takes these steps, on a network without hosts."""
    clock, spans = Clock(), []
    network = Network(clock, None, seed=1, host_names=(), queue_length=1)  # type: ignore[arg-type]
    timed = TimedFault(fault=Course(steps), name="course", **times)
    clock.process(run(timed, network, until_ns, spans))
    clock.run(until=until_ns)
    return spans


def test_it_starts_with_the_fault_and_is_interrupted_at_its_end():
    noted = []

    def steps(network):
        try:
            while True:
                noted.append(network.clock.now // MS)
                yield network.clock.timeout(10 * MS)
        except simpy.Interrupt:
            noted.append(("end", network.clock.now // MS))

    (span,) = course(steps, begin_ns=5 * MS, end_ns=30 * MS)
    assert noted == [5, 15, 25, ("end", 30)]
    assert (span.begin_ns, span.end_ns) == (5 * MS, 30 * MS)


def test_one_that_does_not_mind_its_interruption_just_ends():
    noted = []

    def steps(network):
        while True:
            noted.append(network.clock.now // MS)
            yield network.clock.timeout(10 * MS)

    course(steps, begin_ns=5 * MS, end_ns=30 * MS)
    assert noted == [5, 15, 25]


def test_one_that_is_over_before_its_end_is_not_interrupted():
    def steps(network):
        yield network.clock.timeout(1)

    (span,) = course(steps, begin_ns=5 * MS, end_ns=30 * MS)
    assert span.end_ns == 30 * MS


def test_one_may_work_first_and_then_wait_for_its_end_alone():
    noted = []

    def steps(network):
        yield network.clock.timeout(10 * MS)
        noted.append(network.clock.now // MS)
        yield
        noted.append(network.clock.now // MS)

    course(steps, begin_ns=5 * MS, end_ns=30 * MS)
    assert noted == [15, 30]


def test_a_stream_goes_on_where_it_stopped():
    network = Network(Clock(), None, seed=1, host_names=(), queue_length=1)  # type: ignore[arg-type]
    first = [network.stream("load", "edge1").random() for _ in range(3)]
    assert len(set(first)) == 3
    again = Network(Clock(), None, seed=1, host_names=(), queue_length=1)  # type: ignore[arg-type]
    assert again.stream("load", "edge1").random(3).tolist() == first
    assert again.stream("load", "edge2").random() not in first


@pytest.mark.parametrize("method", ["remote", "genie"])
def test_an_endless_process_changes_neither_end_nor_tables(method: str):
    endless = {"fault": f"{OWN}:Idles", "target": "edge1", "begin": "100 ms"}
    with_it, without = (
        small.rows(small.simulated(small.scenario([method], faults=faults)))
        for faults in ([endless], [])
    )
    del with_it["faults"], without["faults"]
    small.same(with_it, without)


@pytest.mark.parametrize("ends", [{"end": "40 s"}, {}])
def test_frames_on_a_host_that_stands_still_are_waited_for_if_it_goes_on(ends: dict[str, str]):
    stall = {"fault": "stall", "target": "edge1", "begin": "1 s", **ends}
    tables = small.tables(small.scenario(["remote"], faults=[stall]))
    last_ns = tables["resources"]["t_ns"].max()
    held = tables["frames"]["fresh_answer_ns"].max()
    assert (last_ns > 40_000 * MS) == (held > 40_000 * MS) == bool(ends)
    assert last_ns < 50_000 * MS, "not longer than needed"


def test_background_traffic_takes_its_share_of_a_link_and_does_not_prolong_the_run():
    load = {"fault": f"{OWN}:Floods", "target": "car1->edge1", "begin": "0 s"}
    loaded, free = (
        small.tables(small.scenario(["remote"], faults=faults)) for faults in ([load], [])
    )

    def last(tables: Any, name: str) -> Any:
        rows = tables["resources"]
        return rows[rows["resource"] == name].iloc[-1]

    one, other = last(loaded, "car1->edge1"), last(free, "car1->edge1")
    assert one["t_ns"] == other["t_ns"], "the run ends with its frames"
    assert one["busy_ns"] > 0.95 * one["t_ns"] > 2 * other["busy_ns"]
    assert one["bytes"] > 2 * other["bytes"]
    frames = loaded["frames"]
    assert (frames["fresh_answer_ns"].notna() | frames["drop"].notna()).all()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Yields", "strike() yields 3, but must yield an event of the clock"),
        ("Fraction", "a delay is a whole number of nanoseconds, not 1.5"),
        ("Raises", "KeyError: \"'lost'\""),
        ("Returns", "strike() is 3, but must be a generator"),
    ],
)
def test_a_broken_process_ends_the_run_with_one_line_and_writes_nothing(
    run_cli, tmp_path, name: str, why: str
):
    own = {"fault": f"{OWN}:{name}", "target": "edge1", "begin": "100 ms"}
    done = run_cli(
        "run",
        "street_1car_homo",
        "--methods",
        "remote",
        "--set",
        f"faults={json.dumps([own])}",
        "--out",
        "results/x",
    )
    (line,) = done.stderr.splitlines()
    assert done.returncode == 1
    assert line.startswith(f"genie-sim: fault '{OWN}:{name}'") and why in line
    assert not list((tmp_path / "results" / "x").glob("*"))
