"""Detectors of edges that serve pictures in batches: when a batch begins, what it takes, in which
order, and who is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose, Detections, Header, Image
from genie_sim.data.trace import TraceFrame
from genie_sim.runs import build
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim import world
from genie_sim.sim.batching import BatchingDetectorNode
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host
from genie_sim.sim.method import IMAGES, OBJECTS
from genie_sim.sim.ros_graph import Graph, Subscriber
from genie_sim.sim.settings import Serving
from tests.make import FOV_RAD, fixed_device, scenario
from tests.sim.processes import job

MS = 1_000_000
SERVICE_MS = 10
FIXED = 0.6  # a batch of 3 takes 0.6 + 0.4 * 3 = 1.8 times as long as one picture
POSE = CameraPose(0.0, 0.0, 1.6, 0.0)


class Bench(Subscriber):
    """A detector that takes 10 ms for a picture, fed by hand; it notes what is answered and what is
    lost, and when [ms].
    """

    def __init__(self, queue_length: int = 100, clock: Clock | None = None, **serving: Any) -> None:
        self.clock = Clock() if clock is None else clock
        self.paths: list[Any] = []  # of the answers
        device = build.device(
            fixed_device("edge1", detector=f"{SERVICE_MS} ms", hop="0 ms", per_megabyte="0 ms"),
            "autoware_vision_detector",
        )
        self.host = Host(self.clock, "edge1", replace(device, batch_fixed=FIXED), seed=1)
        self.answered: list[tuple[str, float]] = []
        self.lost: list[tuple[str, str, float]] = []
        graph = Graph(self.host, queue_length, self._lost)
        self.graph = graph
        self.detector = BatchingDetectorNode(
            "detector", graph, (IMAGES,), (OBJECTS,), serving=Serving(**serving)
        )
        graph.subscribe(OBJECTS, self)

    address = "consumer"

    def deliver(self, topic: str, answer: Detections, sender: str) -> None:
        header = answer.header
        if self.clock.path is not None:
            self.paths.append(self.clock.path)
        self.answered.append((f"{header.origin}@{header.stamp_ns // MS}", self.clock.now / MS))

    def _lost(self, message: Any, where: str) -> None:
        header = message.header
        name = f"{header.origin}@{header.stamp_ns // MS}"
        self.lost.append((name, where, self.clock.now / MS))

    def run(self, pictures: Sequence[tuple[str, int, int]], until_ms: int = 1000) -> Bench:
        """``pictures``: the car, when its picture was taken, and when it arrives [ms]."""
        for car, stamp_ms, arrives_ms in pictures:
            self.clock.after(arrives_ms * MS, self._inject, (car, stamp_ms * MS))
        self.clock.run(until=until_ms * MS)
        return self

    def _inject(self, car: str, stamp_ns: int) -> None:
        frame = TraceFrame(
            "02", 0, stamp_ns, 1242, 375, 1_000, f"{car}-{stamp_ns}", 0, POSE, FOV_RAD, ()
        )
        header = Header(stamp_ns, "camera", car)
        image = Image(header, 1_000, frame.digest, 0, POSE, FOV_RAD, frame)
        self.clock.begin(header)
        self.graph.inject(IMAGES, image, car)


def test_a_batch_takes_as_many_as_wait_and_at_most_a_full_one():
    """D/D/1 by hand: the first begins alone; the four that wait then make a batch of three, 18 ms,
    and one picture.
    """
    bench = Bench(batch=3).run([(f"car{i}", i, i) for i in range(5)])
    assert bench.answered == [
        ("car0@0", 10),
        ("car1@1", 28),
        ("car2@2", 28),
        ("car3@3", 28),
        ("car4@4", 38),
    ]
    accelerator = bench.host.accelerator
    assert (accelerator.completed, accelerator.jobs, accelerator.busy_ns) == (5, 3, 38 * MS)
    assert bench.detector.completed == 5 and bench.detector.queued == 0


def test_an_idle_detector_waits_for_a_full_batch_but_not_longer_than_allowed():
    # the third picture makes the batch full, at 4 ms
    assert Bench(batch=3, wait_ns=6 * MS).run([("a", 0, 0), ("b", 1, 1), ("c", 4, 4)]).answered == [
        ("a@0", 22),
        ("b@1", 22),
        ("c@4", 22),
    ]
    # the third comes after the oldest has waited for 6 ms, and waits for the batch; then its own
    # wait is over
    assert Bench(batch=3, wait_ns=6 * MS).run([("a", 0, 0), ("b", 1, 1), ("c", 7, 7)]).answered == [
        ("a@0", 20),
        ("b@1", 20),
        ("c@7", 30),
    ]
    # alone, it waits for nothing but the 6 ms
    assert Bench(batch=3, wait_ns=6 * MS).run([("a", 0, 0)]).answered == [("a@0", 16)]


def test_the_wait_counts_from_the_oldest_that_is_left():
    """A camera's newer picture takes the place of the one that waits: its wait begins anew."""
    bench = Bench(1, batch=3, wait_ns=6 * MS, queue="per_camera")
    bench.run([("a", 0, 0), ("a", 4, 4)])
    assert bench.answered == [("a@4", 20)]
    assert bench.lost == [("a@0", f"detector:{IMAGES}", 4)]


def test_no_picture_waits_longer_than_wait_and_one_batch():
    """As long as a batch has room for all that wait."""
    rng = np.random.default_rng(4)
    arrivals = np.cumsum(rng.integers(1, 12, 200)).tolist()
    bench = Bench(batch=200, wait_ns=5 * MS)
    bench.run([("car", at, at) for at in arrivals], until_ms=100_000)
    ends = sorted({end for _, end in bench.answered})
    longest_batch_ms = max(end - before for before, end in zip([0.0, *ends], ends, strict=False))
    sizes = {end: sum(at == end for _, at in bench.answered) for end in ends}
    longest_ms = SERVICE_MS * max(FIXED + (1 - FIXED) * size for size in sizes.values())
    for name, end in bench.answered:
        service_ms = SERVICE_MS * (FIXED + (1 - FIXED) * sizes[end])
        waited_ms = end - service_ms - float(name.partition("@")[2])
        assert waited_ms <= 5 + longest_ms + 1e-9
    assert len(bench.answered) == 200 and longest_batch_ms > SERVICE_MS


def test_queues_are_shared_or_each_cameras_own():
    pictures = [("a", 0, 0), ("a", 1, 1), ("b", 2, 2), ("a", 3, 3)]
    shared = Bench(1, batch=1).run(pictures)
    assert [name for name, _ in shared.answered] == ["a@0", "a@3"]
    assert [name for name, *_ in shared.lost] == ["a@1", "b@2"]
    own = Bench(1, batch=1, queue="per_camera").run(pictures)
    assert [name for name, _ in own.answered] == ["a@0", "b@2", "a@3"]
    assert own.lost == [("a@1", f"detector:{IMAGES}", 3)]
    assert own.detector.drops == 1


def test_a_fault_loses_what_waits_and_what_is_in_service():
    bench = Bench(batch=2)
    bench.run([("a", 0, 0), ("b", 1, 1), ("c", 2, 2)], until_ms=5)
    bench.graph.void("outage")
    assert {name for name, *_ in bench.lost} == {"a@0", "b@1", "c@2"}
    assert bench.detector.drops == 3 and bench.detector.queued == 0
    bench.run([("d", 6, 1)])
    assert bench.answered == [("d@6", 16)]


def test_one_picture_at_a_time_is_the_usual_detector_to_the_byte(monkeypatch):
    """Every table of a run, steps included, with the batching detector in place of the usual
    one.
    """
    short = [f"cars[{i}].route.window=[{i} s, {i + 1} s]" for i in range(3)]
    settings = load_scenario(
        "street_3car_hetero", [*short, "methods=[remote,genie,sim_lru,{method: foggycache}]"]
    )
    usual = run_in_memory(settings)
    monkeypatch.setattr(world, "ONE_BY_ONE", None)  # no setting is the usual detector's any more
    batching = run_in_memory(settings)
    assert len(usual.tables["steps"]) > 100
    for name, table in usual.tables.items():
        assert table.to_frame().equals(batching.tables[name].to_frame()), name


def test_steps_of_a_batch_add_up_and_name_the_wait():
    settings = load_scenario(
        "street_3car_hetero",
        [
            "methods=[{method: remote, serving: {batch: 4, wait: 15 ms, queue: per_camera}}]",
            *(f"cars[{i}].route.window=[{i} s, {i + 2} s]" for i in range(3)),
            *(f"cars[{i}].edge=edge1" for i in (1, 2)),
        ],
    )
    run = run_in_memory(settings)
    steps, frames = run.tables["steps"].to_frame(), run.tables["frames"].to_frame()
    keys = ["car", "stream", "stamp_ns"]
    of_frames = (steps["end_ns"] - steps["begin_ns"]).groupby([steps[key] for key in keys]).sum()
    answered = frames[frames["fresh_answer_ns"].notna()].set_index(keys)
    response = answered["fresh_answer_ns"] - answered["received_ns"]
    assert len(of_frames) == len(response) > 50
    assert (of_frames.sort_index() == response.sort_index()).all()
    inference = steps[steps["part"] == "inference"]
    together = inference.groupby(["place", "begin_ns", "end_ns"]).size()
    assert together.max() > 1, "pictures of one batch have the same inference"
    assert ((steps["part"] == "queueing") & (steps["place"] == "edge1/vision_darknet_detect")).any()


def test_every_picture_of_a_batch_has_the_time_of_a_slow_and_stalled_accelerator():
    """Two pictures wait for a key that is computed, 4 ms, then take 3 times 14 ms, and 5 ms in
    which the accelerator stands still.
    """
    bench = Bench(batch=2, wait_ns=MS, clock=Clock(keeps_paths=True))
    accelerator = bench.host.accelerator
    job(accelerator, 5 * MS)
    bench.clock.after(0, accelerator.slow, (3.0,))
    bench.clock.after(20 * MS, accelerator.stall)
    bench.clock.after(25 * MS, accelerator.go_on)
    bench.run([("a", 0, 0), ("b", 1, 1)])
    assert bench.answered == [("a@0", 52), ("b@1", 52)]
    for path, arrived_ms in zip(bench.paths, (0, 1), strict=True):
        steps = [
            (label.part, (end_ns - begin_ns) // MS) for label, begin_ns, end_ns in path.since(0)
        ]
        waited = [("queueing", 1)] if arrived_ms == 0 else []
        assert steps == [*waited, ("queueing", 4), ("inference", 47)]


def test_an_edge_has_a_serving_of_its_own_and_methods_another():
    settings = scenario(
        [
            {"name": "car1", "device": "jetson_tx2", "edge": "edge1"},
            {"name": "car2", "device": "jetson_tx2", "edge": "edge2"},
        ],
        edges=[
            {"name": "edge1", "device": "agx_xavier"},
            {"name": "edge2", "device": "agx_xavier", "serving": {"queue": "per_camera"}},
        ],
        methods=["remote", {"name": "slow", "method": "remote", "serving": {"wait": "9 ms"}}],
    )
    assert settings.edges[1].serving == Serving(queue="per_camera")
    assert settings.method_settings[settings.methods[0].name].serving == Serving()
    assert settings.method_settings[settings.methods[1].name].serving == Serving(wait_ns=9 * MS)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "serving={batch: 4}",
            "--set serving={batch: 4}: serving.batch: 4 pictures never wait in one queue of 1: "
            "use 'queue: per_camera', or a longer 'queue_length'",
        ),
        (
            "edges[1]={name: edge2, device: agx_xavier, serving: {batch: 2}}",
            "edges[1].serving.batch: 2 pictures never wait",
        ),
        ("serving={batch: 0}", "serving.batch: must be from 1 to 1,024, not 0"),
        ("serving={wait: -1 ms}", "serving.wait: "),
        ("serving={batches: 2}", "serving.batches: unknown"),
        (
            "methods=[{method: remote, serving: {batch: 4}}]",
            "methods[0].serving.batch: 4 pictures never wait",
        ),
    ],
)
def test_wrong_settings_are_one_line(change: str, said: str):
    with pytest.raises(UserError) as error:
        load_scenario("street_3car_hetero", [change])
    assert said in str(error.value) and "\n" not in str(error.value)


def test_what_batches_gain_is_told_with_its_source():
    """162 frames/s alone and 284 in fours on the card that was measured."""
    model = load_profile("rtx_a4500").models["autoware_vision_detector"]
    assert model.batch.tag == "D" and "162" in model.batch.source
    device = build.device(load_profile("rtx_a4500"), "autoware_vision_detector")
    assert device.batch_factor(4) == pytest.approx(4 * 162 / 284, abs=0.001)
    assert device.batch_factor(1) == 1.0
    xavier = build.device(load_profile("agx_xavier"), "autoware_vision_detector")
    assert xavier.batch_factor(4) == 4.0, "no source: batches gain nothing"
