"""Where the truth is known, every first answer is compared with it: by hand in a made-up street, and in whole runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pytest
from made_up_run import METHODS
from sim.street import build, scenario
from test_fleet import small

from genie_sim import runner
from genie_sim.analysis.metrics import compute
from genie_sim.messages import CameraPose, Detection, Detections, Header, Image
from genie_sim.recording import results
from genie_sim.recording.records import TRUTH
from genie_sim.recording.results import Metric
from genie_sim.recording.tables import Table
from genie_sim.recording.truth import Truth
from genie_sim.runner import prepare, simulate
from genie_sim.town import Town, TrueObject

STAMP_NS, BEGIN_NS = 500, 7_000
REACH_M, RANGE_M = 3.0, 50.0
HEADER = Header(STAMP_NS + BEGIN_NS, "camera_02", "car1")


def real(label: str, east_m: float, north_m: float = 0.0) -> TrueObject:
    return TrueObject(0, label, (east_m, north_m, 0.8), False)


def served(label: str, east_m: float | None, north_m: float = 0.0) -> Detection:
    place = None if east_m is None else (east_m, north_m, 0.0)
    return Detection(label, 0.9, None, place, 0.9, "town")


@dataclass
class Frame:
    """What the camera took at the origin, looking east."""

    view: Sequence[TrueObject]
    stamp_ns: int = STAMP_NS

    def truth(self) -> Sequence[TrueObject]:
        return self.view


class Street:
    """A town in which everything is in view, but for what is behind the camera."""

    def __init__(self, *objects: TrueObject) -> None:
        self.objects = objects
        self.asked: list[tuple[str, float, float, float, int]] = []

    def frame(self) -> Frame:
        return Frame([one for one in self.objects if one.location[0] > 0])

    def is_there(self, label: str, east_m: float, north_m: float, range_m: float, t_ns: int) -> bool:
        self.asked.append((label, east_m, north_m, range_m, t_ns))
        places = [one.location for one in self.objects if one.label == label]
        return any(math.hypot(place[0] - east_m, place[1] - north_m) <= range_m for place in places)


def judged(
    town: Street, *answers: tuple[str, Sequence[Detection]], at: tuple[float, float] = (0.0, 0.0)
) -> list[tuple[str, tuple[int, ...]]]:
    """Source and counts (served, true, not in view, in view, found) of each answer that was judged."""
    table = Table(TRUTH)
    truth = Truth("genie", town, {"car1": BEGIN_NS}, REACH_M, RANGE_M, table)
    pose = CameraPose(*at, 1.6, 0.0)
    truth.published(Image(HEADER, 1000, "", 0, pose, 1.4, town.frame()))
    for source, objects in answers:
        truth.answered(Detections(HEADER, tuple(objects)), source)
    rows = table.to_frame()
    counts = rows[["served", "true", "not_in_view", "in_view", "found"]]
    return list(zip(rows["source"].astype(str), counts.itertuples(index=False, name=None), strict=True))


def test_what_is_there_within_reach_is_true_and_everything_else_a_ghost():
    town = Street(real("car", 10.0), real("person", 20.0))
    answer = [served("car", 12.9), served("car", 13.1), served("truck", 10.0), served("person", 20.0)]
    assert judged(town, ("map", answer)) == [("map", (4, 2, 2, 2, 2))]


def test_distances_are_those_on_the_ground_wherever_the_camera_is():
    """4 m east and 40 m north of the camera is 40.2 m away, 4 m and 50 m is too far; 2 m and 2 m are within 3 m."""
    town = Street(real("car", 104.0, 240.0), real("car", 104.0, 250.0), real("person", 102.0, 200.0))
    answer = [served("car", 106.0, 242.0), served("car", 106.5, 252.5), served("person", 102.0, 203.5)]
    assert judged(town, ("map", answer), at=(100.0, 200.0)) == [("map", (3, 1, 2, 2, 1))]


def test_an_object_that_is_really_there_but_behind_the_camera_is_true_and_not_in_view():
    town = Street(real("car", 10.0), real("car", -30.0))
    assert judged(town, ("own_cache", [served("car", -30.0)])) == [("own_cache", (1, 1, 1, 1, 0))]


def test_what_is_farther_than_the_view_range_need_not_be_served_but_may():
    town = Street(real("car", 49.0), real("car", 55.0))
    assert judged(town, ("map", [])) == [("map", (0, 0, 0, 1, 0))]
    assert judged(town, ("map", [served("car", 56.0)])) == [("map", (1, 1, 0, 1, 0))]


def test_one_served_object_may_stand_for_two_and_two_for_one():
    twins = Street(real("car", 10.0), real("car", 12.0))
    assert judged(twins, ("map", [served("car", 11.0)])) == [("map", (1, 1, 0, 2, 2))]
    assert judged(Street(real("car", 11.0)), ("map", [served("car", 10.0), served("car", 12.0)])) == [
        ("map", (2, 2, 0, 1, 1))
    ]


def test_only_the_first_answer_to_a_frame_that_was_published_counts():
    town = Street(real("car", 10.0))
    assert [source for source, _ in judged(town, ("map", []), ("own_detector", [served("car", 10.0)]))] == ["map"]
    nothing = Table(TRUTH)
    Truth("genie", town, {"car1": 0}, REACH_M, RANGE_M, nothing).answered(Detections(HEADER, ()), "map")
    assert not len(nothing), "nobody asked"


def test_objects_without_a_place_are_not_counted():
    assert judged(Street(), ("map", [served("car", None)])) == [("map", (0, 0, 0, 0, 0))]


def test_the_truth_is_asked_for_where_something_out_of_view_was_served_at_the_time_of_the_frame():
    town = Street(real("car", 10.0))
    judged(town, ("map", [served("car", 30.0, 40.0)]))
    assert town.asked == [("car", 30.0, 40.0, REACH_M, STAMP_NS + BEGIN_NS)]


def rows(*counts: tuple[str, int, int, int, int, int]) -> pd.DataFrame:
    """A row a second: source, served, true, not in view, in view, found."""
    table = Table(TRUTH)
    for number, (source, *numbers) in enumerate(counts):
        table.append(("genie", "car1", "camera_02", number * 10**9, source, *numbers))
    return table.to_frame()


def test_shares_are_of_objects_and_of_cache_hits():
    setting = scenario(1)
    _, tables = build(setting, "local")
    nothing = [table.to_frame() for table in (tables.frames, tables.lookups, tables.resources)]
    truth = rows(
        ("map", 4, 1, 4, 5, 1),
        ("own_cache", 6, 5, 1, 5, 5),
        ("edge_cache", 2, 2, 0, 0, 0),
        ("own_cache", 0, 0, 0, 2, 0),
    )
    found = {metric.metric: metric for metric in compute(METHODS, *nothing, truth)}
    assert {name: (metric.value, metric.n) for name, metric in found.items()} == {
        "ghost_share": (pytest.approx(4 / 12), 12),
        "wrong_hit_share": (pytest.approx(1 / 3), 3),
        "object_recall": (pytest.approx(6 / 12), 12),
    }
    assert compute(METHODS, *nothing) == compute(METHODS, *nothing, truth.iloc[:0]) == []


def value(measured: Sequence[Metric], name: str, method: str) -> float:
    found = next(metric.value for metric in measured if (metric.metric, metric.method) == (name, method))
    assert found is not None
    return found


def test_a_run_asks_for_the_truth_at_the_times_of_its_frames_and_by_one_ruler_whatever_the_gate(monkeypatch):
    asked, is_there = [], Town.is_there
    monkeypatch.setattr(Town, "is_there", lambda *given: asked.append(given[4:]) or is_there(*given))
    city = {"source": "town", "duration": "2 s", "tolerance": "1.75 m", "town": {"blocks": [2, 2]}}
    genie = {**small().model_dump(mode="json", by_alias=True)["genie"], "object_map": {"gate": "1.5 m"}}
    prepared = prepare(small(perception=city, start_jitter="10 s", genie=genie))
    simulate(prepared)
    begins = [drive.start_ns for drive in prepared.drives.values()]
    assert len(set(begins)) > 1
    frames = {begin_ns + number * 100_000_000 for begin_ns in begins for number in range(20)}
    assert asked and {range_m for range_m, _ in asked} == {1.75}
    assert {t_ns for _, t_ns in asked} <= frames


def test_a_run_in_a_city_is_judged_its_folder_holds_the_table_and_is_made_again(tmp_path: Path):
    made = runner.run_to_folder(small(methods=["local", "genie"]), tmp_path)
    run = results.load(made.folder)
    assert run.truth is not None
    first = run.frames[run.frames["first_answer_ns"].notna()]
    key = ["method", "car", "stream", "stamp_ns"]
    both = run.truth.astype(dict.fromkeys(key[:3], str)).merge(
        first.astype(dict.fromkeys(key[:3], str)), on=key, validate="one_to_one", suffixes=("", "_of_frame")
    )
    assert len(both) == len(first) == len(run.truth), "every answered frame, and no other"
    assert (both["source"].astype(str) == both["source_of_frame"].astype(str)).all()
    assert (both["served"] <= both["objects_served"]).all()
    for name in ("true", "not_in_view"):
        assert (both[name] <= both["served"]).all()
    assert (both["found"] <= both["in_view"]).all()
    for method in ("local", "genie"):
        assert 0 <= value(run.measured, "ghost_share", method) < 1
        assert 0 < value(run.measured, "object_recall", method) <= 1
    assert "truth.parquet" in runner.provenance.read_run_json(made.folder)["digests"]
    assert all(runner.rerun(made.folder).values())


def test_a_more_tolerant_city_finds_no_more_ghosts():
    shares = []
    for tolerance in ("0 m", "2 m", "50 m"):
        city = {**small().model_dump(mode="json", by_alias=True)["perception"], "tolerance": tolerance}
        tables = simulate(prepare(small(methods=["local"], perception=city)))
        assert tables.truth is not None
        counts = tables.truth.to_frame()
        shares.append(1 - counts["true"].sum() / counts["served"].sum())
    assert shares[0] > shares[1] > shares[2]


def test_truth_may_be_left_out_and_changes_nothing_else():
    judging, silent = simulate(prepare(small())), simulate(prepare(small(record=["lookups", "resources"])))
    assert judging.truth is not None and silent.truth is None
    assert judging.frames.to_frame().equals(silent.frames.to_frame())
