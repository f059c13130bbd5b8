"""Every fact that a claim looks at, from small tables made by hand."""

from __future__ import annotations

import math

import pytest

from genie_sim.analysis.registry import METRICS
from genie_sim.core.messages import Header
from genie_sim.paper.definitions import USUAL, Definitions, meant
from genie_sim.paper.facts import Fact, facts_of, placed
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, LOOKUPS, RESOURCES
from genie_sim.record.tables import Table
from tests.paper.notation import fact

MS, S = 1_000_000, 1_000_000_000
WAIT_MS = 2  # from a frame's stamp to when it is received
BEGIN_S = 1  # when the first frame is taken; times below are counted from there


def frames(lap_of=lambda frame: 0):
    """A frame a second of each car; first answer and result in ms after it was received."""
    took = {
        ("local", "car1"): [(300, 300), None, (200, 200), None],
        ("remote", "car1"): [(50, 50), (60, 60), (70, 70), (120, 120)],
        ("genie", "car1"): [(10, 10), (20, 90), (30, None), (40, 40)],
        ("genie", "car2"): [(20, 20), (40, 40), (60, 60), (200, None)],
    }
    sent = {"remote": [(1000, 10), (900, 9), (800, 0), (0, 7)], "genie": [(500, 50)] * 4}
    table = Table(FRAMES)
    for (method, car), answers in took.items():
        for frame, answer in enumerate(answers):
            stamp_ns = (BEGIN_S + frame) * S
            received_ns = stamp_ns + WAIT_MS * MS
            header = Header(stamp_ns, "camera_02", car)
            row = OpenFrame(method, header, frame, lap_of(frame))
            row.received_ns = received_ns
            if answer is not None:
                row.first_answer_ns, row.result_answer_ns = (
                    None if ms is None else received_ns + ms * MS for ms in answer
                )
            if method in sent:
                row.bytes_up, row.bytes_down = sent[method][frame]
            table.append(row.values())
    return table.columns()


def lookup(
    second, genie, kind, requests, hits, requester=None, updates=0, boost_sum=0.0, entries=1
):
    placement = "edge" if genie.startswith("edge") else "car"
    t_ns = round((BEGIN_S + second) * S)
    frame = ("car1", "camera_02", t_ns)
    counts = (requests, hits, updates, boost_sum, entries)
    return ("genie", t_ns, f"{genie}/genie", placement, kind, requester, *frame, None, *counts)


IMAGES = [
    lookup(0, "car1", "image", 50, 10, "client", entries=40),
    lookup(0.5, "edge1", "image", 50, 0, "neighbour", entries=50),
    lookup(0.6, "edge1", "image", 50, 30, "client", entries=60),
    lookup(0.7, "edge1", "image", 50, 10, "client", entries=70),
    lookup(1, "car1", "image", 50, 40, "client", entries=50),
    lookup(2, "car1", "image", 50, 35, "client", entries=65),
]
MAPS = [
    lookup(0, "car1", "sighting", 10, 2, updates=2, boost_sum=0.1, entries=5),
    lookup(0.3, "car2", "sighting", 10, 10, updates=10, boost_sum=0.2, entries=2),
    lookup(0.4, "edge1", "sighting", 20, 5, updates=4, boost_sum=0.04, entries=8),
    lookup(1, "car1", "boost", 10, 8, updates=8, boost_sum=0.3, entries=6),
]


def lookups(rows=(*IMAGES, *MAPS)):
    table = Table(LOOKUPS)
    for row in sorted(rows, key=lambda row: row[1]):
        table.append(row)
    return table.columns()


def resources():
    """The last samples come first in the table."""
    table = Table(RESOURCES)
    for method, second, resource, kind, busy_ms, completed in (
        ("genie", 4, "edge1.accelerator", "accelerator", 1000, 8),
        ("genie", 1, "edge1.accelerator", "accelerator", 400, 4),
        ("genie", 2, "edge1.accelerator", "accelerator", 600, 6),
        ("genie", 4, "car1.accelerator", "accelerator", 2000, 2),
        ("genie", 2, "car1.accelerator", "accelerator", 900, 1),
        ("remote", 4, "edge1.accelerator", "accelerator", 500, 30),
        ("genie", 4, "car1.cpu", "cpu", 880, 100),
        ("genie", 4, "edge1.cpu", "cpu", 2640, 300),
        ("genie", 1, "edge1.cpu", "cpu", 100, 100),
        ("remote", 4, "edge1.cpu", "cpu", 9000, 100),
        ("genie", 4, "car1->edge1", "link", 9000, 100),
    ):
        table.append(
            (
                method,
                (BEGIN_S + second) * S,
                resource,
                kind,
                1,
                busy_ms * MS,
                0,
                completed,
                0,
                None,
                0,
                0,
            )
        )
    return table.columns()


@pytest.fixture(scope="module")
def found():
    return facts_of(frames(), lookups(), resources())


WORKED = {
    # all eight first answers of Genie: 10 20 20 30 40 40 60 200 ms
    "first_answer_p10:genie": 17,
    "first_answer_p20:genie": 20,
    "first_answer_p30:genie": 21,
    "first_answer_p40:genie": 28,
    "first_answer_p50:genie": 35,
    "first_answer_p10:local": 210,
    "first_answer_p50:remote": 65,
    "first_answer_mean:genie": 52.5,
    "first_answer_mean:local": 250,
    "first_answer_mean:remote": 75,
    "first_answer_p95:genie": 151,  # 60 + 0.65 x 140
    "result_answer_mean:genie": (10 + 90 + 40 + 20 + 40 + 60) / 6,
    "improvement_first_answer:genie:local": 1 - 52.5 / 250,
    "improvement_first_answer:genie:remote": 1 - 52.5 / 75,
    "under_deadline_share:genie": 4 / 8,
    "under_deadline_share:local": 0,
    "result_under_deadline_share:genie": 2 / 8,
    # each car for itself
    "first_answer_mean:genie:car1": 25,
    "first_answer_mean:genie:car2": 80,
    "first_answer_p99:genie:car2": 60 + 0.97 * 140,
    "first_answer_p99:genie:car1": 39.7,
    # the last third of the frames is the fourth alone: the third stands at two thirds
    "late_result_share:genie": 0.5,
    "late_result_share:local": 0,
    "late_result_share:remote": 1,
    "late_answered_share:genie": 1,
    "late_answered_share:local": 0,
    # of remote's frames, those that went up and whose answers came down
    "image_to_objects_bytes:remote": 1900 / 19,
    # images: a window is 50 requests, so each message of a car is one
    "image_reuse:car": 85 / 150,
    "image_reuse_high:car": 0.8,
    "image_reuse:edge": 0.4,
    "image_reuse_with_neighbours:edge": 40 / 150,
    "image_reuse_with_neighbours:car": 85 / 150,
    "image_peak_at:car": 1 / 3,
    "stored_images:car": 65,
    "stored_images:edge": 70,
    # objects: the mean over Genies
    "object_reuse:car": (10 / 20 + 10 / 10) / 2,
    "object_reuse:edge": 0.25,
    "object_reuse:genie:car1/genie": 0.5,
    "object_reuse:genie:car2/genie": 1,
    "confidence_boost:car": 0.6 / 20,
    "confidence_boost:edge": 0.01,
    "boost_per_object:car": 0.6 / (6 + 2),
    "boost_per_object:edge": 0.04 / 8,
    "stored_objects:car": 4,
    # devices: CPU time over messages of all of Genie's, detections over busy time
    "handling_ms": 8.8,
    "accelerator_rate:genie:edge1": 8,
    "accelerator_rate:genie:car1": 1,
    "accelerator_rate:remote:edge1": 60,
    "detector_runs": 10,
}


@pytest.mark.parametrize(("name", "value"), WORKED.items())
def test_a_fact_is_what_the_tables_say(found, name, value):
    assert found[fact(name)] == pytest.approx(value, rel=1e-9, abs=1e-12)


# Under other definitions alone: what is not here is as usual.
STAMP = {  # the wait counts, too
    "first_answer_mean:genie": 54.5,
    "first_answer_mean:genie:car2": 82,
    "first_answer_p10:genie": 19,
    "first_answer_p99:genie:car1": 41.7,
    "improvement_first_answer:genie:remote": 1 - 54.5 / 77,
    "under_deadline_share:genie": 4 / 8,
    "result_answer_mean:local": 252,
    "late_result_share:genie": 0.5,
    "image_reuse:edge": 0.4,
}
ALL_REQUESTS = {
    "image_reuse:edge": 40 / 150,
    "image_reuse:car": 85 / 150,
    "image_reuse_with_neighbours:edge": 40 / 150,
    "object_reuse:car": 0.75,
}
RUNNING = {  # of the car: 0.2, 0.5, 0.567; of the edge 0.6, 0.4, and 0, 0.3, 0.267
    "image_reuse_high:car": 85 / 150,
    "image_reuse_high:edge": 0.6,
    "image_reuse_with_neighbours_high:edge": 0.3,
    "object_reuse_high:car": 1,
    "object_reuse_high:edge": 0.25,
    "image_peak_at:car": 2 / 3,
    "image_reuse:car": 85 / 150,
}
PER_OBJECT = {"confidence_boost:car": 0.6 / (6 + 2), "confidence_boost:edge": 0.04 / 8}


@pytest.mark.parametrize(
    ("definitions", "worked"),
    [
        (Definitions(time="stamp"), STAMP),
        (Definitions(image_reuse="all_requests"), ALL_REQUESTS),
        (Definitions(error_bars="running"), RUNNING),
        (Definitions(boost="per_object"), PER_OBJECT),
        (
            Definitions(image_reuse="all_requests", error_bars="running"),
            {"image_reuse_high:edge": 0.3},
        ),
    ],
)
def test_a_fact_is_what_its_definition_says(found, definitions, worked):
    for name, value in worked.items():
        asked = fact(name)
        asked = asked._replace(metric=meant(asked.metric, definitions))
        assert found[asked] == pytest.approx(value, rel=1e-9, abs=1e-12), name


def test_what_a_run_calls_by_a_name_no_definition_changes(found):
    """A definition of its own has a name of its own: a metric of a run means one thing."""
    other = Definitions("stamp", "all_requests", "running", "per_object")
    for metric in {one.metric for one in found}:
        assert meant(metric, USUAL) == metric
    assert meant("confidence_boost", other) not in METRICS
    assert meant("image_reuse", other) == "image_reuse_with_neighbours"
    assert meant("first_answer_mean", other) not in METRICS


def test_too_few_requests_have_no_window(found):
    assert math.isnan(found[placed("object_reuse_high", "car")])


def test_object_windows_are_of_50_look_ups():
    rows = [lookup(0, "edge1", "sighting", 50, 10), lookup(1, "edge1", "sighting", 50, 45)]
    facts = facts_of(frames(), lookups(rows), resources())
    assert facts[placed("object_reuse_high", "edge")] == 0.9
    assert facts[placed("object_reuse", "edge")] == 0.55


def test_without_laps_there_are_no_laps(found):
    assert not [one for one in found if "lap" in one.component]


def test_detector_runs_are_told_apart_by_lap():
    """The second lap begins with the frame at 2 s; what was done by then belongs to the first."""
    facts = facts_of(frames(lap_of=lambda frame: frame // 2), lookups(), resources())
    assert facts[Fact("detector_runs", component="lap1")] == 6 + 1
    assert facts[Fact("detector_runs", component="lap2")] == 2 + 1
    assert facts[Fact("detector_runs")] == 10


def test_what_did_not_happen_is_not_a_number():
    facts = facts_of(frames(), lookups(()), resources())
    for metric in ("image_peak_at", "image_peak_at_running", "boost_per_object"):
        assert math.isnan(facts[placed(metric, "car")])
    assert math.isnan(facts[placed("image_reuse_high_running", "edge")])
    never = [
        lookup(0, "car1", "image", 50, 0, "client"),
        lookup(1, "car1", "image", 50, 0, "client"),
    ]
    facts = facts_of(frames(), lookups(never), resources())
    assert math.isnan(facts[placed("image_peak_at", "car")]), "nothing was ever reused"
    assert facts[placed("image_reuse", "car")] == 0


def test_a_run_of_genie_alone_has_no_facts_of_the_others():
    alone = facts_of(frames().where(method="genie"), lookups(), resources().where(method="genie"))
    assert not [one for one in alone if {"local", "remote"} & set(one)]
