"""Streaming accuracy: a made-up scene by hand, truth tables, and whole runs on a trace and
in a town.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from genie_sim.analysis import metrics, screen, summary
from genie_sim.analysis.seed_runs import load_run
from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.core.messages import Detections, Header, Image
from genie_sim.data.sources import RecordedDrives
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.data.truth import (
    TruthRow,
    TruthTable,
    path_beside,
    read_truth_table,
    truth_beside,
    write_truth,
)
from genie_sim.judge.consumers import ConsumerJudge
from genie_sim.record.records import HELD, HELD_OBJECTS, ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue
from genie_sim.record.tables import Table
from genie_sim.report.output import Output
from genie_sim.runs.folder import rerun, run_in_memory, run_to_folder
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from tests.judge.judging import POSE, Frame, Step, Street, judged, last, thing
from tests.make import S, seen


def test_a_parked_car_stays_right():
    frame = Frame([thing("car", 20.0)])
    rows = judged((frame, [seen(21.0)]), (frame, None), (frame, None))
    counts = [
        (row["held"], row["right"], row["visible_static"], row["found_static"]) for row in rows
    ]
    assert counts == [(0, 0, 1, 0), (1, 1, 1, 1), (1, 1, 1, 1)], (
        "before the first answer it holds nothing"
    )
    assert rows[2]["error_m"] == pytest.approx(1.0)


def test_each_cause_is_counted_in_its_own_column():
    """One duplicate, two that never were there, three that moved away, four that are hidden."""
    aside_m = (0.0, 4.0, -4.0, 8.0)
    person = thing("person", 15.0)
    before = Frame([*(thing("car", 10.0, m, moving=True) for m in aside_m[:3]), person])
    now = Frame(
        [thing("car", 20.0, moving=True), person], hidden=[thing("car", 30.0, m) for m in aside_m]
    )
    answer = [
        *(seen(10.0, m) for m in aside_m[:3]),
        *(seen(35.0, m) for m in aside_m[:2]),
        *(seen(30.5, m) for m in aside_m),
        seen(15.0, label="person"),
        seen(16.5, label="person"),
        seen(12.0, label="traffic light"),
        seen(-10.0),
        seen(45.0),
    ]
    row = last((before, answer), (now, None))
    del row["method"], row["what"], row["car"], row["stream"], row["stamp_ns"], row["error_m"]
    assert row == {
        "held": 7,
        "right": 1,
        "moved_away": 3,
        "never_there": 2,
        "duplicate": 1,
        "hidden": 4,
        "visible_static": 1,
        "found_static": 1,
        "visible_moving": 1,
        "found_moving": 0,
    }


def objects_of(*steps: Step) -> list[tuple[Any, ...]]:
    """Label, metres east, judgement, first and last tenth of a second of each object; none: to the
    end.
    """
    table = Table(HELD_OBJECTS)
    judged(*steps, objects=table)
    rows = table.to_frame()
    tenths = (rows[["begin_ns", "end_ns"]] / (S // 10)).replace({float("nan"): None})
    return list(
        zip(
            rows["label"],
            rows["east_m"],
            rows["judged"],
            tenths["begin_ns"],
            tenths["end_ns"],
            strict=True,
        )
    )


def test_a_ghost_is_known_by_its_place_and_time():
    """The car at 10 m is gone from 0.2 s on, a car at 35 m, which is held twice then, never was;
    the answer to that frame has neither. In the order of ends, then of beginnings.
    """
    people = thing("person", 15.0), thing("person", 25.0)
    before = Frame([thing("car", 10.0, moving=True), *people])
    after = Frame([thing("car", 20.0, moving=True), *people])
    wrong = [seen(10.0), seen(15.0, label="person"), seen(16.5, label="person"), seen(35.0)]
    right = [seen(20.0), seen(15.0, label="person")]
    again = [*wrong, seen(35.0)]
    assert objects_of((before, wrong), (before, again), (after, right), (after, None)) == [
        ("car", 10.0, "missed", 0, 1),
        ("person", 15.0, "missed", 0, 1),
        ("car", 10.0, "right", 1, 2),
        ("person", 16.5, "duplicate", 1, 3),
        ("car", 35.0, "never_there", 1, 3),
        ("car", 10.0, "moved_away", 2, 3),
        ("car", 20.0, "missed", 2, 3),
        ("person", 25.0, "missed", 0, None),
        ("person", 15.0, "right", 1, None),
        ("car", 20.0, "right", 3, None),
    ]


def test_what_is_there_or_hidden_is_no_ghost():
    frame = Frame([thing("car", 20.0)], hidden=[thing("car", 30.0)])
    answer = [seen(21.0), seen(30.5)]
    assert objects_of((frame, answer), (frame, answer), (frame, None)) == [
        ("car", 20.0, "missed", 0, 1),
        ("car", 21.0, "right", 1, None),
    ]


def test_a_truck_is_a_car():
    assert (
        last(
            (Frame([thing("truck", 10.0)]), [seen(10.0)]),
            (Frame([thing("truck", 10.0)]), None),
        )["right"]
        == 1
    )


def test_the_zero_delay_detector_is_written_once():
    frame = Frame([thing("car", 20.0)], detections=(seen(20.5),))
    rows = judged((frame, None), earlier_cars=(), what="zero_delay")
    assert [(row["held"], row["right"]) for row in rows] == [(1, 1)]
    assert judged((frame, None), what="zero_delay") == []


def test_a_car_is_judged_at_the_frames_of_its_first_camera_only():
    table = Table(HELD)
    judge = ConsumerJudge("genie", {"car1": Street()}, table)
    cameras = [("camera_02", "car1"), ("camera_03", "car1"), ("camera_02", "car1")]
    for number, camera in enumerate([*cameras, ("camera_02", "car2")]):
        judge.published(Image(Header(number, *camera), 1000, "", 0, POSE, 1.4, Frame([])))
    judge.close()
    assert set(table.to_frame()["car"]) == {"car1"} and len(table) == 4, (
        "consumer and zero-delay detector, twice"
    )


def test_every_stream_is_judged_where_it_looks_if_all_are():
    """A car stands east, seen by the first camera, and one north, seen by the second."""
    table, objects = Table(HELD), Table(HELD_OBJECTS)
    judge = ConsumerJudge(
        "genie", {"car1": Street()}, table, ["car1"], held_objects=objects, all_streams=True
    )
    north = POSE._replace(heading_rad=math.pi / 2)
    for number in range(3):
        for stream, pose, there in (
            ("east", POSE, thing("car", 20.0)),
            ("north", north, thing("car", 0.0, 20.0)),
        ):
            header = Header(number * S // 10, stream, "car1")
            judge.published(Image(header, 1000, "", 0, pose, 1.4, Frame([there])))
            if number == 0:
                answer = [seen(20.5), seen(0.0, 30.0)] if stream == "east" else []
                judge.answered(Detections(header, tuple(answer)), header.stamp_ns)
    judge.close()
    rows = table.to_frame()
    counts = rows[["held", "right", "visible_static"]].to_numpy().tolist()
    assert counts[2:] == [[1, 1, 1], [1, 0, 1]] * 2, (
        "the ghost in the north is in the second's view"
    )
    spans = objects.to_frame()
    missed = spans[(spans["judged"] == "missed") & spans["end_ns"].isna()]
    assert missed[["north_m", "begin_ns"]].to_numpy().tolist() == [[20.0, 0.0]], "to the end"


def value(measured: Sequence[MetricValue], name: str, method: str, component: str = "") -> float:
    (found,) = (
        m.value for m in measured if (m.metric, m.method, m.component) == (name, method, component)
    )
    assert found is not None
    return found


def test_metrics_are_sums_over_instants():
    table = Table(HELD)
    counts = (4, 2, 1, 1, 0, 0, 2, 1, 2, 1), (0, 0, 0, 0, 0, 3, 1, 0, 0, 0)
    for number, of_instant in enumerate(counts):
        table.append(("genie", "consumer", "car1", "a", number * S, *of_instant, None))
    table.append(("genie", "zero_delay", "car1", "a", 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0.25))
    # a car that a later method alone drives
    table.append(("later", "zero_delay", "car2", "a", 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0, None))
    methods = [MethodInfo(name, name, baseline=False) for name in ("local", "genie", "later")]
    found = metrics.compute(methods, {"held": table.columns()})
    expected = {
        "object_precision": 0.5,
        "object_recall": 0.4,
        "object_recall_static": 1 / 3,
        "object_recall_moving": 0.5,
        "streaming_f1": 4 / 9,
        "ghost_share": 0.5,
        "ghost_share_moved_away": 0.25,
        "ghost_share_never_there": 0.25,
        "ghost_share_duplicate": 0.0,
        "place_error": 0.0,
    }
    assert {m.metric: m.value for m in found if not m.component} == pytest.approx(expected)
    assert value(found, "streaming_f1", "genie", ZERO_DELAY) == 0.5, "of both cars"
    assert not [number for number in found if number.method == "later" and number.component]


def short(*settings: str) -> Scenario:
    return load_scenario("street_1car_hetero", ["cars[0].route.window=[2 s, 4 s]", *settings])


def test_the_default_trace_has_its_truth_and_a_run_says_so(tmp_path: Path):
    made = run_to_folder(short("methods=[remote, genie]"), tmp_path, output=Output(page=False))
    run = load_run(made.folder)
    assert set(run.held["what"]) == {"consumer", "zero_delay"}
    for method in ("remote", "genie"):
        assert (
            0
            < value(run.measured, "streaming_f1", method)
            < value(run.measured, "streaming_f1", "remote", ZERO_DELAY)
        )
    assert "position error" in summary.markdown(run)
    assert "streaming F1" in screen.text(run)
    assert "zero-delay detector" in screen.text(run, 200)
    assert any(name.startswith("truth of") for name in run.facts["traces"])
    assert set(rerun(made.folder).values()) == {"identical"}, "the same bytes"


@pytest.mark.parametrize(
    "settings",
    [(), ("consumer=tracker",), ("judged=all",)],
    ids=["newest", "tracker", "cameras whose views overlap"],
)
def test_objects_that_are_open_at_an_instant_are_those_that_were_counted(settings: Sequence[str]):
    run = run_in_memory(short("methods=[local, genie]", *settings))
    counted = run.held[run.held["what"] == "consumer"]
    assert len(counted) > 30 and (counted["held"] > counted["right"]).any()
    held_objects = dict(list(run.held_objects.groupby(["method", "car", "stream"], observed=True)))
    for row in counted.itertuples():
        mine = held_objects[row.method, row.car, row.stream]
        there = mine[(mine["begin_ns"] <= row.stamp_ns) & ~(mine["end_ns"] <= row.stamp_ns)][
            "judged"
        ].value_counts()
        for name in ("right", "moved_away", "never_there", "duplicate"):
            assert there.get(name, 0) == getattr(row, name)
        missed = row.visible_static + row.visible_moving - row.found_static - row.found_moving
        assert there.get("missed", 0) == missed


def test_objects_need_the_counts_and_are_left_out_on_request():
    with pytest.raises(UserError, match="record: 'held_objects' needs 'held' too"):
        short("record=[held_objects]")
    made = run_in_memory(short("methods=[local]", "record=[held]"))
    assert made.held_objects.empty and made.resources.empty


def test_a_trace_without_truth_says_what_would_show_more(tmp_path: Path):
    write_trace(tmp_path / "own.parquet", read_trace(files.find(files.TRACE, "kitti_0005")))
    run = run_in_memory(short(f"perception.trace={tmp_path}/own.parquet"))
    assert run.held.empty and not any(m.metric == "streaming_f1" for m in run.measured)
    assert "genie-sim import truth" in " ".join(screen.text(run).split())


@pytest.fixture(scope="module")
def trace() -> Trace:
    return read_trace(files.find(files.TRACE, "kitti_0005"))


@pytest.mark.parametrize(
    ("recording", "more"), [("03", ()), ("02", ("judged=all",))], ids=["its only", "one of all"]
)
def test_a_car_is_not_judged_at_frames_of_which_its_truth_tells_nothing(
    *, table: TruthTable, trace: Trace, tmp_path: Path, recording: str, more: tuple[str, ...]
):
    path = tmp_path / "own.parquet"
    write_trace(path, trace)
    write_truth(path_beside(path), replace(table, cameras=("02",)))
    cameras = f"cameras=[{{name: a, recording: '{recording}'}}, {{name: b, recording: '03'}}]"
    setting = f"perception.trace={path}", cameras
    with pytest.raises(UserError, match=r"record: held: car.* at the frames of 03: .* of 02 alone"):
        run_in_memory(short(*setting, *more))
    if more:
        assert not run_in_memory(short(*setting, "methods=[local]")).held.empty


@pytest.fixture
def table(trace: Trace) -> TruthTable:
    rows = (
        TruthRow("02", 0, 0, 7, "car", False, True, 10.0, 2.0, 0.5),
        TruthRow("02", 0, 0, 8, "person", True, False, 12.0, 2.0, 0.5),
    )
    return TruthTable(trace.digest, trace.origin, rows, {"drive": "made up", "trace": trace.name})


def test_a_truth_table_comes_back_as_it_was_written(table: TruthTable, tmp_path: Path):
    paths = [tmp_path / "a.parquet", tmp_path / "b.parquet"]
    for path in paths:
        write_truth(path, table)
    again = read_truth_table(paths[0])
    assert (again, again.digest) == (table, table.digest)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert replace(table, rows=table.rows[:1]).digest != table.digest


def test_a_table_of_another_trace_is_refused_in_one_line(
    table: TruthTable, trace: Trace, tmp_path: Path
):
    path = tmp_path / "mine.parquet"
    write_trace(path, trace)
    assert truth_beside(path, trace) is None
    write_truth(path_beside(path), table)
    assert truth_beside(path, trace) == table
    write_truth(path_beside(path), replace(table, trace="0" * 64))
    with pytest.raises(
        UserError,
        match=r"mine\.truth\.parquet: belongs to the trace '000000000000', mine\.parquet is",
    ):
        RecordedDrives(trace, path=path).drive("car1", None, 0)
    path_beside(path).write_bytes(b"nothing")
    with pytest.raises(UserError, match="not a readable Parquet file"):
        truth_beside(path, trace)


def test_truth_tables_are_no_traces():
    assert not any("truth" in name for name in files.available(files.TRACE))


def town(*settings: str) -> Scenario:
    small = ("perception.duration=2 s", "fleet.cars=3", "perception.town={blocks: [2, 2]}")
    return load_scenario("fleet_30", [*small, *settings])


def test_a_town_is_judged_at_the_times_of_its_frames():
    made, silent = (
        run_in_memory(town()),
        run_in_memory(town("record=[lookups, resources]")),
    )
    zero_delay = made.held[made.held["what"] == "zero_delay"]
    assert len(zero_delay) == len(made.frames[["car", "frame"]].drop_duplicates()), (
        "once, though methods are several"
    )
    assert (made.held["right"] == made.held["found_static"] + made.held["found_moving"]).all()
    assert silent.held.empty and silent.frames.equals(made.frames)
    for method in {m.method for m in made.measured if m.metric == "answered_share"}:
        assert 0 < value(made.measured, "streaming_f1", method) < 1


def test_a_more_tolerant_town_finds_no_more_ghosts():
    shares = []
    for tolerance in ("0.1 m", "2 m", "20 m"):
        run = run_in_memory(town("methods=[local]", f"perception.tolerance={tolerance}"))
        shares.append(value(run.measured, "ghost_share", "local"))
    assert shares[0] > shares[1] > shares[2]
