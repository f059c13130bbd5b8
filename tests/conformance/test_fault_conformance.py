"""The shipped faults, and faults of the tests' own that take a host's work and memory."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.settings import from_plain
from genie_sim.core.messages import Expired, Header
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.methods import MethodEntry
from genie_sim.sim.fault import FAULTS
from genie_sim.sim.method import DETECTOR
from genie_sim.sim.nodes import InterceptorNode
from tests.conformance import small
from tests.conformance.faults import FaultConformance, RandomFaultConformance, S
from tests.sim.processes import job

OWN = "tests.conformance.own"
OUTAGES = [{"fault": "outage", "target": target} for target in ("car1", "car1->edge1")]
HAND_OVER = {"fault": "hand_over", "target": "car1", "edge": "edge2", "gap": "600 ms"}
CRASHES = [
    {"fault": "crash", "target": "car1", "memory": "warm"},
    {"fault": f"{OWN}:Crash", "target": "car1"},
]
WITHOUT_LOSSES = [
    {"fault": "outage", "target": "edges"},  # no frame goes there, only what edges tell one another
    {"fault": "stall", "target": "car1"},
    {"fault": "slow", "target": "edge1", "factor": 5.0},
    {"fault": "gnss", "target": "car1", "bias": "3 m", "noise": "1 m"},
]
PARTITION = {"fault": "partition", "target": ["car1", "edge2"]}
BLIND = {"fault": "camera", "target": "car1"}


def test_every_shipped_fault_is_tested_here():
    tested = (*OUTAGES, HAND_OVER, CRASHES[0], *WITHOUT_LOSSES, PARTITION, BLIND)
    assert {fault["fault"] for fault in tested} == {*FAULTS}


@pytest.mark.parametrize("fault", OUTAGES)
class TestOutage(FaultConformance):
    drops = ":outage"


@pytest.mark.parametrize("fault", [HAND_OVER])
class TestHandOver(FaultConformance):
    times = {"begin": "0.5 s"}  # its gap says when it ends  # noqa: RUF012
    drops = "car1:hand_over"


@pytest.mark.parametrize("fault", CRASHES)
class TestCrash(FaultConformance):
    drops = ":crash"


@pytest.mark.parametrize("fault", WITHOUT_LOSSES)
class TestFaultThatDropsNothingItself(FaultConformance):
    drops = None


@pytest.mark.parametrize("fault", [PARTITION])
class TestPartition(FaultConformance):
    drops = ":partition"


@pytest.mark.parametrize("fault", [BLIND])
class TestCamerasThatShowNothing(FaultConformance):
    drops = ":camera"


@pytest.mark.parametrize("fault", [{"fault": f"{OWN}:Blackout", "target": "edge1"}])
class TestBlackout(FaultConformance):
    drops = ":blackout"


@pytest.mark.parametrize("fault", [OUTAGES[1], WITHOUT_LOSSES[3]])
class TestFaultsAtRandomTimes(RandomFaultConformance):
    pass


def working(target: str, method: str, since_s: float):
    """The world of a method at the first moment from ``since_s`` on in which a host has something
    to lose, the tables, and the frames that it has: in service, in queues, and those that a Genie
    owes an answer.
    """
    world, tables = small.world(small.scenario([method]))
    graph = world.network.graphs[target]
    host = graph.host
    here: list[Header] = []
    while not here:
        world.clock.run(until=max(world.clock.now + 1_000_000, round(since_s * S)))
        here = [message.header for node in graph.nodes for message in node.messages]
        owing = [node.pure for node in graph.nodes if isinstance(node, InterceptorNode)]
        here += [
            one.header
            for pure in owing
            for one in pure.on_memory_lost()
            if isinstance(one, Expired)
        ]
    return world, tables, host, graph, set(here)


VOIDED = [
    ("car1", "local"),
    ("edge1", "remote"),
    ("car1", "genie"),
    ("edge1", "genie"),
    ("car1", f"{OWN}:Again"),
]


@pytest.mark.parametrize(("target", "method"), VOIDED)
def test_what_is_voided_says_who_did_it(target: str, method: str):
    world, tables, host, graph, here = working(target, method, 0.9)
    served = host.accelerator.completed
    world.network.void(target, "test:crash")
    world.monitor.close()
    rows = tables["frames"].to_frame()
    mine = rows[
        [
            header in here
            for header in zip(rows["stamp_ns"], rows["stream"], rows["car"], strict=True)
        ]
    ]
    assert len(mine) == len(here)
    lost = mine[mine["result_answer_ns"].isna()]
    assert len(lost) and (lost["drop"] == "test:crash").all(), lost
    assert not (rows["drop"] == "test:crash")[rows.index.difference(lost.index)].any(), (
        "and nothing else was lost"
    )

    assert host.accelerator.queued == host.cpu.queued == 0
    assert not any(node.messages for node in graph.nodes)
    busy_ns = host.accelerator.busy_ns, host.cpu.busy_ns
    world.clock.run(until=world.clock.now + 1000)
    assert (host.accelerator.busy_ns, host.cpu.busy_ns) == busy_ns, "nobody works on what is gone"
    world.run()
    rows = tables["frames"].to_frame()
    small.check_conserved(rows, [from_plain(MethodEntry, method).name])
    if method in ("local", "remote"):
        assert (rows["drop"] == "test:crash").sum() == len(lost), "there is no other copy"
        assert host.accelerator.completed > served, "it goes on with what comes next"
        assert host.accelerator.busy_ns > busy_ns[0]


@pytest.mark.parametrize("what", ["accelerator", "cpu"])
def test_a_processor_of_interrupted_jobs_is_idle_and_never_finishes_them(what: str):
    world, _ = small.world(small.scenario(["local"]))
    processor, done = getattr(world.network.graphs["edge1"].host, what), []
    jobs = [
        job(processor, 100, lambda number=number: done.append(number))
        for number in range(processor.capacity + 2)
    ]
    world.clock.run(until=40)
    assert processor.busy_ns == 40 * processor.capacity and processor.queued == 2
    for one in jobs:
        one.interrupt("crash")
    world.clock.run(until=41)
    assert processor.queued == 0
    world.clock.run(until=70)
    job(processor, 100, lambda: done.append("next"))
    world.clock.run(until=169)
    assert done == [], "the old jobs would have been done by now"
    world.clock.run(until=171)
    assert done == ["next"] and processor.completed == 1
    assert processor.busy_ns == 40 * processor.capacity + 100, "while it was idle it did not work"


def test_a_node_alone_can_be_voided():
    """Its host drops the job with it, and goes on with what comes next."""
    world, tables, host, graph, here = working("car1", "local", 0.9)
    detector = graph.node(f"car1/{DETECTOR}")
    assert detector.queued == 1 and len(detector.messages) == 2
    first, completed = detector.messages[0].header, detector.completed
    detector.void("test:node")
    world.run()
    rows = tables["frames"].to_frame()
    small.check_conserved(rows, ["local"])
    mine = rows[
        [
            header in here
            for header in zip(rows["stamp_ns"], rows["stream"], rows["car"], strict=True)
        ]
    ]
    assert len(mine) == len(here) and (mine["drop"] == "test:node").all()
    assert first in here and detector.completed > completed
    assert host.accelerator.completed == detector.completed, "no job was for nothing"


def test_a_host_forgets_what_it_knew():
    world, tables, _, graph, _ = working("edge1", "genie", 1.5)
    genie = next(node for node in graph.nodes if isinstance(node, InterceptorNode))
    before = genie.pure
    assert len(before.object_map) and before.cache_entries()
    resources = list(world.network.resources)
    world.network.void("edge1", "test:crash")
    assert (
        genie.pure is not before
        and not len(genie.pure.object_map)
        and not genie.pure.cache_entries()
    )
    assert world.network.resources == resources, "it is the same node, with a fresh state"
    changes = tables["objects"].to_frame().query("genie == 'edge1/genie'")
    last = changes.groupby("object").tail(1)
    assert last["confidence"].isna().all(), "every object of its map is told to be gone"


def test_a_host_that_is_not_there_is_one_line():
    world, _ = small.world(small.scenario(["local"]))
    with pytest.raises(
        UserError,
        match=r"^unknown host 'edge3' \(did you mean 'edge2'\?\)",
    ):
        world.network.void("edge3", "test")
    blind = small.scenario(["local"], cars=[small.car(1, cameras=False), small.car(2)])
    world, _ = small.world(blind)
    assert "car1" not in world.network.graphs
    world.network.void("car1", "test")  # local execution has nothing there


@dataclass(frozen=True)
class Halt:
    """A fault that does not check its target before the run."""

    target: str

    def strike(self, network):
        network.void(self.target, "halt")
        yield


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (
            {"fault": "outag", "target": "car1"},
            r"faults\[0\]\.?\w*: unknown fault 'outag' \(did you mean 'outage'\?\)",
        ),
        ({"fault": f"{OWN}:Nobody", "target": "car1"}, "has no attribute 'Nobody'"),
        ({"fault": f"{OWN}:Radio", "slot_ms": 1.0}, "has no strike"),
        ({"fault": f"{OWN}:Crash"}, r"faults\[0\].target: missing"),
        (
            {"fault": f"{OWN}:Blackout", "target": "car1", "how": "hard"},
            r"faults\[0\].how: unknown parameter of .*:Blackout 'how'",
        ),
        (
            {"fault": f"{__name__}:Halt", "target": "edge7"},
            r"^fault '.*:Halt': unknown host 'edge7'",
        ),
    ],
)
def test_a_fault_that_does_not_work_is_one_line(fault, message: str):
    with pytest.raises(UserError, match=message) as error:
        run_in_memory(small.scenario(["local"], faults=[{**fault, "begin": "1 s"}]))
    assert "\n" not in str(error.value)
