"""Answers against the detector's own answer to the same frame, by hand and in a whole run."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest

from genie_sim.analysis import metrics, summary
from genie_sim.analysis.metric import SHORT
from genie_sim.base.matching import SAME_M, near, pairs, placed
from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image
from genie_sim.judge.agreement import Agreement
from genie_sim.record.log import ComparedAnswer, Log
from genie_sim.record.records import ANSWERS, new_tables
from genie_sim.record.tables import Table
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.scenario.scenario import Scenario
from tests.make import METHODS, S, seen

HEADER = Header(500, "camera_02", "car1")
POSE = CameraPose(0.0, 0.0, 1.6, 0.0)


@dataclass
class Frame:
    detections: tuple[Detection, ...]


def compared(
    detected: Sequence[Detection], *answers: tuple[str, Sequence[Detection]]
) -> list[tuple]:
    """Which, source, served, detected, matched of each row."""
    tables = new_tables()
    log = Log("genie", tables, agreement=Agreement("genie", tables["answers"]))
    log.published(Image(HEADER, 1000, "", 0, POSE, 1.4, Frame(tuple(detected))), 0, 0)
    for source, objects in answers:
        log.answered(Detections(HEADER, tuple(objects), source), source, HEADER.stamp_ns)
    log.close()
    rows = tables["answers"].to_frame()[["which", "source", "served", "detected", "matched"]]
    return [
        tuple(row) for row in rows.astype({"which": str, "source": str}).itertuples(index=False)
    ]


def test_pairs_are_of_one_class_and_at_most_two_metres_apart():
    detected = [seen(10.0), seen(20.0, label="person"), seen(30.0)]
    served = [seen(12.0), seen(22.1, label="person"), seen(30.0, label="bicycle")]
    assert SAME_M == 2.0
    assert compared(detected, ("map", served)) == [("first", "map", 3, 3, 1)]


def test_a_truck_is_found_as_a_car():
    assert compared([seen(10.0, label="truck")], ("map", [seen(11.0, label="bus")])) == [
        ("first", "map", 1, 1, 1)
    ]


def test_each_object_is_paired_once_and_the_nearest_first():
    ours = placed([seen(10.0), seen(11.5)])
    assert pairs(near(ours, placed([seen(11.0)]), SAME_M)) == [(pytest.approx(0.5**2), 1, 0)]
    twins = [seen(10.0), seen(10.5), seen(11.0)]
    assert compared([seen(10.4)], ("map", twins)) == [("first", "map", 3, 1, 1)]


def test_ties_are_broken_by_the_order_of_the_lists():
    beside = [("car", 1.0, 0.0), ("car", -1.0, 0.0)]
    assert pairs(near([("car", 0.0, 0.0)], beside, SAME_M)) == [(1.0, 0, 0)]


@pytest.mark.parametrize("window", [1, 3, 1000])
def test_answers_are_compared_in_windows_of_any_size_as_one_by_one(window: int):
    rng = random.Random(window)

    def some() -> list[Detection]:
        places = [(rng.uniform(0.0, 9.0), rng.uniform(0.0, 3.0)) for _ in range(rng.randrange(6))]
        return [
            seen(
                None if rng.random() < 0.1 else east_m,
                north_m,
                label=rng.choice(["car", "truck", "person"]),
            )
            for east_m, north_m in places
        ]

    table, expected = Table(ANSWERS), []
    agreement = Agreement("genie", table, window)
    for number in range(40):
        header = Header(number, rng.choice(["left", "right"]), "car1")
        served, detected = some(), some()
        which = rng.choice([("first",), ("result",), ("first", "result")])
        agreement.add(ComparedAnswer(header, which, "map", served=served, detected=detected))
        matched = len(pairs(near(placed(served), placed(detected), SAME_M)))
        counts = len(placed(served)), len(placed(detected)), matched
        row = "genie", "car1", header.frame_id, number
        expected += [(*row, of_which, "map", *counts) for of_which in which]
    agreement.close()
    columns = table.columns()
    assert list(zip(*(columns[name].tolist() for name in columns.names), strict=True)) == expected


def test_objects_without_a_place_are_never_counted():
    detected = [seen(10.0), seen(None)]
    same = compared(detected, ("own_detector", detected))
    assert same == [("first", "own_detector", 1, 1, 1), ("result", "own_detector", 1, 1, 1)]
    assert compared(detected, ("map", [seen(None)])) == [("first", "map", 0, 1, 0)]


def test_first_answer_and_result_are_each_judged_once():
    detected = [seen(10.0)]
    answers = ("map", []), ("own_cache", detected), ("edge_detector", [])
    assert compared(detected, *answers) == [
        ("first", "map", 0, 1, 0),
        ("result", "own_cache", 1, 1, 1),
    ]


Row = tuple[str, str, int, int, int]


def values(*rows: Row) -> dict[tuple[str, str], tuple[float | None, int]]:
    """Of a row a second: which, source, served, detected, matched."""
    made = Table(ANSWERS)
    for number, (which, source, *counts) in enumerate(rows):
        made.append(("genie", "car1", "camera_02", number * S, which, source, *counts))
    found = metrics.compute(METHODS[-1:], {"answers": made.columns()})
    return {(metric.metric, metric.placement): (metric.value, metric.n) for metric in found}


def test_f1_of_answers_is_of_all_objects_together():
    found = values(("first", "map", 8, 4, 2), ("first", "map", 2, 4, 2))
    assert found["first_proxy_f1", "all"] == (pytest.approx(8 / 18), 18)
    assert not any(name.startswith("result") for name, _ in found)


def test_a_hit_is_wrong_below_an_f1_of_four_fifths():
    """F1 of the rows: 0.8, 8/11, 1 (both empty), 0; a detector's answer and a first answer are no
    hits.
    """
    found = values(
        ("result", "own_cache", 5, 5, 4),
        ("result", "own_cache", 6, 5, 4),
        ("result", "edge_cache", 0, 0, 0),
        ("result", "peer_cache", 0, 3, 0),
        ("result", "own_detector", 9, 3, 0),
        ("first", "own_cache", 9, 3, 0),
    )
    shares = {
        placement: found["wrong_hit_share", placement] for placement in ("all", "car", "edge")
    }
    assert shares == {"all": (0.5, 4), "car": (0.5, 2), "edge": (0.5, 2)}


def short(*settings: str) -> Scenario:
    """Two seconds of one car."""
    return load_scenario("street_1car_hetero", ["cars[0].route.window=[2 s, 4 s]", *settings])


def test_a_run_compares_every_answer_and_a_baseline_is_always_right():
    made = run_in_memory(short())
    counts = made.answers.astype({"which": str}).groupby(["method", "which"], observed=True).size()
    for method in ("local", "remote", "genie"):
        mine = made.frames[made.frames["method"] == method]
        assert counts[method, "first"] == mine["first_answer_ns"].notna().sum()
        assert counts[method, "result"] == mine["result_answer_ns"].notna().sum()
    assert (
        made.answers["matched"] <= np.minimum(made.answers["served"], made.answers["detected"])
    ).all()
    f1 = {one.method: one.value for one in made.measured if one.metric == "first_proxy_f1"}
    assert (f1["local"], f1["remote"]) == (1.0, 1.0)
    whole, brief = summary.main_table(made), summary.main_table(made, tier=SHORT)
    assert "wrong cache hits [%]" in [row.title for row in whole.rows]
    assert "Proxy" in " ".join(whole.notes) and "Proxy" not in " ".join(brief.notes)


def test_answers_may_be_left_out_and_change_nothing_else():
    full = run_in_memory(short())
    bare = run_in_memory(short("record=[lookups, resources]"))
    assert len(full.answers) and not len(bare.answers)
    assert full.frames.equals(bare.frames)
    assert not any("proxy" in one.metric for one in bare.measured)
    none = {name: full.tables[name].rows([]) for name in ("frames", "lookups", "resources")}
    nothing = metrics.compute(METHODS, {**none, "answers": bare.answers})
    assert nothing == []
