"""Where the time of a frame goes: every step of an answer's way, by hand and for every method that
there is.
"""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest

from genie_sim.core.messages import CameraPose, Detections, Header, Image, Publish
from genie_sim.record.log import Log
from genie_sim.record.records import Tables, new_tables
from genie_sim.runs.build import device
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import RECORDS
from genie_sim.sim.clock import Clock
from genie_sim.sim.host import Host, Processor
from genie_sim.sim.method import IMAGES, METHODS, OBJECTS, Interceptor
from genie_sim.sim.monitor import Span, SpanLabel
from genie_sim.sim.nodes import InterceptorNode
from genie_sim.sim.ros_graph import Graph, Subscriber
from tests.make import build, scenario, street
from tests.sim.test_way_of_one_frame import (
    CAR_DETECTOR,
    CAR_GENIE,
    CAR_HOP_ANSWER,
    CAR_HOP_EMPTY,
    CAR_HOP_IMAGE,
    DECODE,
    EDGE_DETECTOR,
    EDGE_GENIE,
    EDGE_HOP_ANSWER,
    EDGE_HOP_IMAGE,
    ENCODE,
    LINK_ANSWER,
    LINK_IMAGE,
    LINK_SENT,
    MS,
    ONE_CAMERA,
    ONE_FRAME,
    SENT,
    car,
    fixed,
    trace,
    view,
)

S = 1000 * MS

UP = [("hop", CAR_HOP_IMAGE), ("uplink", LINK_IMAGE)]
ON_EDGE = [
    ("hop", EDGE_HOP_IMAGE),
    ("inference", EDGE_DETECTOR),
    ("hop", EDGE_HOP_ANSWER),
    ("genie", EDGE_GENIE),
]
DOWN = [("hop", EDGE_HOP_ANSWER), ("downlink", LINK_ANSWER)]
LAST = [("genie", CAR_GENIE), ("hop", CAR_HOP_ANSWER)]


def tables(method: str, of: Any, setting: Any, record: Any = RECORDS, **options: Any) -> Tables:
    written = new_tables()
    world, _ = build(setting, method, of, options.get("devices"), written, options.get("sent"))
    world = type(world)(world.setup, world._method, Log(method, written, record))
    world.run()
    return written


def way(
    method: str,
    of: Any = ONE_FRAME,
    fleet: Any = None,
    number: int = 0,
    which: str = "last",
    **more: Any,
) -> Any:
    """Part and length of each step to the last (or first) answer to one frame."""
    options = {name: more.pop(name) for name in ("sent",) if name in more}
    setting = scenario(
        fleet or [car("car1", "edge1")], **({"cameras": ONE_CAMERA, "start_jitter": "0 s"} | more)
    )
    found = tables(method, of, setting, devices=fixed(), **options)["steps"].to_frame()
    stamp_ns = sorted(found["stamp_ns"].unique())[number]
    rows = found[found["stamp_ns"] == stamp_ns]
    answers = rows["which"].unique().tolist()  # in order of time
    rows = rows[rows["which"] == answers[-1 if which == "last" else 0]]
    return list(zip(rows["part"], rows["end_ns"] - rows["begin_ns"], strict=True))


def test_without_caches():
    assert way("local") == [("inference", CAR_DETECTOR), ("hop", CAR_HOP_ANSWER)]
    assert way("remote") == [("uplink", LINK_IMAGE), ("inference", EDGE_DETECTOR), *DOWN]


def test_genie():
    assert way("genie", which="first") == [("genie", CAR_GENIE), ("hop", CAR_HOP_EMPTY)]
    assert way("genie") == [
        ("genie", CAR_GENIE),
        *UP,
        ("genie", EDGE_GENIE),
        *ON_EDGE,
        *DOWN,
        *LAST,
    ]


def test_with_two_passes_what_a_genie_answers_itself_costs_on_the_way_out_too():
    rules = {"passes": 2}
    assert way("genie", which="first", genie=rules) == [
        ("genie", 2 * CAR_GENIE),
        ("hop", CAR_HOP_EMPTY),
    ]
    assert way("genie", genie=rules) == way("genie"), "a detection pays when it comes in"
    again = trace(view(0, 0, 0.5), view(1, 2 * S, 0.5))
    (once, took), _ = way("genie", again, number=1)
    assert way("genie", again, number=1, genie=rules)[0] == (once, took + CAR_GENIE), "a hit"


def test_an_edge_answers_out_of_its_cache_in_two_passes():
    cars = [car("car1", "edge1"), car("car2", "edge1", start="2 s")]
    rules = {"miss_policy": "blocking", "passes": 2}
    there, back = [("genie", CAR_GENIE), *UP], [*DOWN, *LAST]
    assert way("genie", fleet=cars, number=1, genie=rules) == [
        *there,
        ("genie", 2 * EDGE_GENIE),
        *back,
    ]


def test_encoded_pictures():
    steps = way("remote", sent=SENT, image_encoding="jpeg80")
    coded = [("encoding", ENCODE), ("uplink", LINK_SENT), ("encoding", DECODE)]
    assert steps[:4] == [*coded, ("inference", EDGE_DETECTOR)]


def test_a_frame_that_waits_for_an_equal_one_and_one_that_waits_for_the_wire_and_the_detector():
    whole = sum(took for _, took in way("genie"))
    coalesced = way("genie", trace(view(0, 0, 0.5), view(1, 50 * MS, 0.7)), number=1)
    assert coalesced == [
        ("genie", CAR_GENIE),
        ("pending", whole - 50 * MS - CAR_GENIE - CAR_HOP_ANSWER),
        ("hop", CAR_HOP_ANSWER),
    ]
    later = trace(view(0, 0, 0.5), view(1, 2 * MS, 5.5))
    encoded = LINK_IMAGE - 200_000
    waits = EDGE_DETECTOR - encoded  # while the first is looked at
    assert way("remote", later, number=1) == [
        ("queueing", encoded - 2 * MS),
        ("uplink", LINK_IMAGE),
        ("queueing", waits),
        ("inference", EDGE_DETECTOR),
        *DOWN,
    ]


@pytest.mark.parametrize("passes", [1, 2])
def test_a_peer_answers(passes):
    cars = [car("car1", "edge1"), car("car2", "edge2", start="1 s")]
    rules = {"miss_policy": "blocking", "share_answers": "on_request", "passes": passes}
    there = [("hop", EDGE_HOP_IMAGE), ("edges", LINK_IMAGE), ("genie", EDGE_GENIE)]
    back = [("hop", EDGE_HOP_ANSWER), ("edges", LINK_ANSWER), ("genie", EDGE_GENIE)]
    network = {"rate_up": "1 Gbit/s", "rate_down": "1 Mbit/s"}  # an edge's port only sends
    assert way("genie", fleet=cars, number=1, genie=rules, edge_network=network) == [
        ("genie", CAR_GENIE),
        *UP,
        ("genie", EDGE_GENIE),
        *there,
        *back,
        *DOWN,
        *LAST,
    ]


@pytest.mark.parametrize(
    "settings",
    [
        ("start_jitter=30 ms",),
        pytest.param(
            (
                "genie.miss_policy=blocking",
                "genie.same_key_pending=forward",
                "queue_length=3",
                "cars[0].link=wifi",
            ),
            marks=pytest.mark.slow,
        ),
        pytest.param(
            (
                "faults=[{fault: outage, target: car1, begin: 500 ms, end: 1 s}]",
                "genie.share_answers=on_request",
            ),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_steps_of_every_answer_of_every_method_add_up_to_the_nanosecond(settings):
    windows = [f"cars[{i}].route.window=[{3 * i} s, {3 * i + 1} s]" for i in range(3)]
    others = ["methods[11]=paced_remote", "methods[12]=recommended"]
    run = run_in_memory(load_scenario("baselines", [*others, *windows, *settings]))
    assert {one.name for one in run.methods} == set(METHODS)
    key = ["method", "car", "stream", "stamp_ns"]
    for which in ("first", "fresh"):
        ways = run.steps[run.steps["which"].isin([which, "both"])].groupby(key, observed=True)
        known = run.frames[run.frames[f"{which}_answer_ns"].notna()].set_index(key).sort_index()
        assert set(known.index.get_level_values("method")) == set(METHODS)
        steps = pd.DataFrame(
            {"begin": ways["begin_ns"].first(), "end": ways["end_ns"].last(), "n": ways.size()}
        )
        steps["sum"] = ways["end_ns"].sum() - ways["begin_ns"].sum()
        steps["whole"] = known[f"{which}_answer_ns"] - known["received_ns"]
        assert steps.index.equals(known.index) and (steps["sum"] == steps["whole"]).all()
        assert (steps["begin"] == known["received_ns"]).all() and (
            steps["end"] == known[f"{which}_answer_ns"]
        ).all()
    took = run.steps["end_ns"] - run.steps["begin_ns"]
    assert (took > 0).all(), "what takes no time is no step"
    waits = (
        run.steps.assign(took=took)
        .groupby(["method", "part"], observed=True)["took"]
        .sum()
        .unstack()
    )
    assert waits.loc["local"].dropna().index.isin(["queueing", "inference", "hop"]).all()
    assert (
        waits.loc["remote"]
        .dropna()
        .index.isin(["queueing", "uplink", "inference", "downlink", "hop"])
        .all()
    )


def test_nothing_else_changes_because_of_it():
    setting = scenario(2, start_jitter="30 ms")
    others = [one for one in RECORDS if one != "steps"]
    with_steps, without = (
        tables("genie", street(3.0), setting, record) for record in (RECORDS, others)
    )
    for name, table in with_steps.items():
        if name != "steps":
            pd.testing.assert_frame_equal(table.to_frame(), without[name].to_frame())
    assert len(with_steps["steps"]) and not len(without["steps"])


def test_steps_in_a_row_at_one_place_are_one():
    header: Any = None
    uplink = SpanLabel("uplink", "car1->edge1")
    taken = Span(None, 0, before=None, header=header)
    hop = Span(SpanLabel("hop", "car1"), 10, before=taken, header=header)
    up = Span(uplink, 25, before=Span(uplink, 20, before=hop, header=header), header=header)
    assert up.since(10) == [(uplink, 10, 25)]
    assert up.since(0) == [(SpanLabel("hop", "car1"), 0, 10), (uplink, 10, 25)]
    assert up.since(12) == [(uplink, 12, 25)]
    assert up.since(25) == []


def test_what_waits_for_a_processor_keeps_its_own_way():
    clock = Clock(keeps_paths=True)
    processor, paths = Processor(clock, "car1.accelerator", "accelerator"), []
    label = SpanLabel("inference", "detector")

    def frame(number: int):
        clock.begin(Header(number, "camera", "car1"))
        yield from processor.serve(10, label)
        paths.append(clock.path)

    for number in range(2):
        clock.process(frame(number))
    clock.run(until=100)
    queueing = SpanLabel("queueing", "car1.accelerator")
    assert [one.since(-1) for one in paths] == [
        [(label, 0, 10)],
        [(queueing, 0, 10), (label, 10, 20)],
    ]
    assert [one.header.stamp_ns for one in paths] == [0, 1]


class InTwos(Interceptor):
    """Answers two frames at once, the older first."""

    name = "car1/twos"

    def __init__(self) -> None:
        self.waiting: list[Any] = []

    def subscriptions(self):
        return (IMAGES,)

    def publications(self):
        return (OBJECTS,)

    def on_message(self, topic, message, now_ns, sender=None):
        self.waiting.append(message.header)
        return (
            [Publish(OBJECTS, Detections(one, ())) for one in self.waiting]
            if len(self.waiting) == 2
            else []
        )


def test_an_answer_to_an_older_frame_does_not_take_over_the_way_of_the_others():
    clock, ways = Clock(keeps_paths=True), {}
    host = Host(clock, "car1", device(fixed()["jetson_tx2"], "autoware_vision_detector"), seed=1)
    graph = Graph(host)
    node = InterceptorNode(InTwos, graph, lambda *_: None)

    class Consumer(Subscriber):
        address = "consumer"

        def deliver(self, topic, answer, sender):
            ways.setdefault(answer.header.stamp_ns, clock.path)

    graph.subscribe(OBJECTS, Consumer())
    for stamp_ns in (MS, 5 * MS):
        clock.run(until=stamp_ns)
        header = Header(stamp_ns, "camera", "car1")
        clock.begin(header)
        node.deliver(IMAGES, Image(header, 0, "", 0, CameraPose(0.0, 0.0, 0.0, 0.0), 1.0), "camera")
        clock.path = None
    clock.run(until=100 * MS)
    parts = {
        stamp_ns: [label.part for label, _, _ in one.since(-1)] for stamp_ns, one in ways.items()
    }
    assert parts == {MS: ["genie", "pending", "hop"], 5 * MS: ["genie", "hop"]}


def test_who_samples_right_behind_a_camera_follows_no_frame():
    """With seed 7 a sample of the resources comes right behind a first frame. Taken for a part of
    its way, it would keep the run going until all patience is over, ten minutes after the last
    frame.
    """
    run = run_in_memory(load_scenario("street_3car_homo", ["seed=7", "methods=[local]"]))
    assert run.resources["t_ns"].max() < 20_000 * MS
