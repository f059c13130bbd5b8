"""Every number that only the evaluation asks for, from small tables made by hand."""

from __future__ import annotations

import math

import pandas as pd
import pytest

from genie_sim.analysis import metrics
from genie_sim.core.messages import Header
from genie_sim.paper.numbers import (
    METHODS,
    SCHEMA,
    Number,
    differences,
    of_metrics,
    of_tables,
    placed,
    read,
    write,
)
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, LOOKUPS, RESOURCES
from genie_sim.record.tables import Table
from tests import make
from tests.paper.notation import number

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


def lookup(second, genie, kind, requests, **cells):
    return make.row(
        LOOKUPS,
        method="genie",
        t_ns=round((BEGIN_S + second) * S),
        genie=f"{genie}/genie",
        placement="edge" if genie.startswith("edge") else "car",
        kind=kind,
        requests=requests,
        **{"entries": 1, **cells},
    )


IMAGES = [
    lookup(0, "car1", "image", 50, hits=10, requester="client", entries=40),
    lookup(0.5, "edge1", "image", 50, hits=0, requester="neighbour", entries=50),
    lookup(0.6, "edge1", "image", 50, hits=30, requester="client", entries=60),
    lookup(0.7, "edge1", "image", 50, hits=10, requester="client", entries=70),
    lookup(1, "car1", "image", 50, hits=40, requester="client", entries=50),
    lookup(2, "car1", "image", 50, hits=35, requester="client", entries=65),
]
MAPS = [
    lookup(0, "car1", "sighting", 10, hits=2, updates=2, boost_sum=0.1, entries=5),
    lookup(0.3, "car2", "sighting", 10, hits=10, updates=8, boost_sum=0.2, entries=2),
    lookup(0.4, "edge1", "sighting", 20, hits=5, updates=4, boost_sum=0.04, entries=8),
    lookup(1, "car1", "boost", 10, hits=8, updates=8, boost_sum=0.3, entries=6),
]


def lookups(rows=(*IMAGES, *MAPS)):
    return make.table(LOOKUPS, *sorted(rows, key=lambda row: row[1])).columns()


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
        busy = {"capacity": 1, "busy_ns": busy_ms * MS, "completed": completed}
        where = {"method": method, "resource": resource, "kind": kind}
        table.append(make.row(RESOURCES, t_ns=(BEGIN_S + second) * S, **where, **busy))
    return table.columns()


def numbers_of(frames, lookups, resources):
    tables = {"frames": frames, "lookups": lookups, "resources": resources}
    return of_metrics(metrics.compute(METHODS, tables)) | of_tables(tables)


@pytest.fixture(scope="module")
def found():
    return numbers_of(frames(), lookups(), resources())


WORKED = {
    # all eight first answers of Genie: 10 20 20 30 40 40 60 200 ms after 2 ms of waiting
    "first_answer_p10:genie": 19,
    "first_answer_p20:genie": 22,
    "first_answer_p30:genie": 23,
    "first_answer_p40:genie": 30,
    "first_answer_p50:genie": 37,
    "first_answer_p10:local": 212,
    "first_answer_p50:remote": 67,
    "first_answer_mean:genie": 54.5,
    "first_answer_mean:local": 252,
    "first_answer_mean:remote": 77,
    "first_answer_p95:genie": 153,  # 62 + 0.65 x 140
    "result_answer_mean:genie": (10 + 90 + 40 + 20 + 40 + 60) / 6 + 2,
    "result_answered_share:genie": 6 / 8,
    "under_deadline_share:genie": 4 / 8,
    "under_deadline_share:local": 0,
    "result_under_deadline_share:genie": 2 / 8,
    # each car for itself
    "first_answer_mean:genie:car1": 27,
    "first_answer_mean:genie:car2": 82,
    "first_answer_p50:genie:car2": 52,
    "first_answer_p99:genie:car2": 62 + 0.97 * 140,
    "first_answer_p99:genie:car1": 41.7,
    "first_answer_max:genie:car2": 202,
    # the last third of the frames is the fourth alone: the third stands at two thirds
    "late_result_share:genie": 0.5,
    "late_result_share:local": 0,
    "late_result_share:remote": 1,
    "late_answered_share:genie": 1,
    "late_answered_share:local": 0,
    # of remote's frames, those that went up and whose answers came down
    "image_to_objects_bytes:remote": 1900 / 19,
    # images: of clients and of neighbours; the running ratio of the car is 0.2, 0.5, 0.567
    "image_reuse:car": 85 / 150,
    "image_reuse_lowest:car": 0.2,
    "image_reuse_highest:car": 85 / 150,
    "image_reuse:edge": 40 / 150,
    "image_reuse_lowest:edge": 0,
    "image_reuse_highest:edge": 0.3,
    "image_peak_at:car": 2 / 3,
    # objects: the mean over Genies
    "object_reuse:car": (10 / 20 + 10 / 10) / 2,
    "object_reuse:edge": 0.25,
    "object_reuse_highest:car": 1,
    "object_reuse:genie:car1/genie": 0.5,
    "object_reuse:genie:car2/genie": 1,
    "confidence_boost:car": 0.6 / (6 + 2),
    "confidence_boost:edge": 0.04 / 8,
    # devices: CPU time over messages of all of Genie's, detections over busy time
    "handling_ms": 8.8,
    "accelerator_rate:genie:edge1": 8,
    "accelerator_rate:genie:car1": 1,
    "accelerator_rate:remote:edge1": 60,
    "detector_runs": 10,
}


@pytest.mark.parametrize(("name", "value"), WORKED.items())
def test_a_number_is_what_the_tables_say(found, name, value):
    assert found[number(name)] == pytest.approx(value, rel=1e-9, abs=1e-12)


def test_a_number_is_called_by_its_method_or_its_place():
    names = ["image_reuse:car:car1", "first_answer_mean:remote", "accelerator_rate:remote:edge1"]
    assert [str(number(name)) for name in names] == names


def test_without_laps_there_are_no_laps(found):
    assert not [one for one in found if "lap" in one.component]


def test_detector_runs_are_told_apart_by_lap():
    """The second lap begins with the frame at 2 s; what was done by then belongs to the first."""
    numbers = numbers_of(frames(lap_of=lambda frame: frame // 2), lookups(), resources())
    assert numbers[Number("detector_runs", component="lap1")] == 6 + 1
    assert numbers[Number("detector_runs", component="lap2")] == 2 + 1
    assert numbers[Number("detector_runs")] == 10


def test_what_did_not_happen_is_not_a_number():
    numbers = numbers_of(frames(), lookups(()), resources())
    assert math.isnan(numbers[placed("image_peak_at", "car")])
    assert placed("image_reuse_highest", "car") not in numbers
    never = [
        lookup(0, "car1", "image", 50, hits=0, requester="client"),
        lookup(1, "car1", "image", 50, hits=0, requester="client"),
    ]
    numbers = numbers_of(frames(), lookups(never), resources())
    assert math.isnan(numbers[placed("image_peak_at", "car")]), "nothing was ever reused"
    assert numbers[placed("image_reuse", "car")] == 0


def test_a_number_that_differs_is_named(found):
    of = number("first_answer_mean")
    assert differences(found, found) == []
    assert differences(found, found | {of: found[of] * (1 + 1e-9)}) == []
    (line,) = differences(found, found | {of: found[of] * 1.01})
    assert line.startswith(f"{of}: ") and " is now " in line
    assert differences(found, {n: v for n, v in found.items() if n != of}) == [str(of)]


def test_numbers_are_read_as_they_were_written(found, tmp_path):
    rows = [("base", "1car_homo", 7, *of, value) for of, value in found.items()]
    table = pd.DataFrame(rows, columns=[column.name for column in SCHEMA.columns])
    write(tmp_path, table)
    again = read(tmp_path)
    assert len(again) == len(found) and {*again["seed"]} == {7}
    known = {Number(*map(str, row[3:7])): row[7] for row in again.itertuples(index=False)}
    assert differences(found, known) == []


def test_a_run_of_genie_alone_has_no_numbers_of_the_others():
    alone = numbers_of(frames().where(method="genie"), lookups(), resources().where(method="genie"))
    assert not [one for one in alone if {"local", "remote"} & set(one)]
