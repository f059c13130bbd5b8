"""How fresh answers are: which frame a detector looked at for what a consumer gets."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from genie_sim.core.messages import CameraPose, Detection, Detections, Header, Image
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import ObjectMapRules
from genie_sim.paper.numbers import Number, of_tables
from genie_sim.record.log import Log
from genie_sim.record.records import new_tables
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario

MS = 1_000_000
POSE = CameraPose(0.0, 0.0, 1.6, 0.0)
FRAME = Header(1000 * MS, "camera_02", "car1")
EARLIER = Header(700 * MS, "camera_02", "car1")
OTHER_CAMERA = Header(1000 * MS, "camera_03", "car1")


def stored(*stamps_ms: int) -> tuple[Detection, ...]:
    """Objects out of a map, each seen last in a frame of this age."""
    return tuple(
        Detection(
            "car",
            0.9,
            None,
            (20.0, 5.0 * i, 0.0),
            0.9,
            "map",
            seen_in=Header(stamp_ms * MS, "camera_02", "car1"),
        )
        for i, stamp_ms in enumerate(stamps_ms)
    )


def row_of(*answers: Detections) -> dict[str, Any]:
    """The row of ``FRAME``, whose answers come 10 ms after each other."""
    tables = new_tables()
    log = Log("genie", tables, [])
    log.published(Image(FRAME, 1000, "", 0, POSE, 1.4), 0, 0)
    log.received(FRAME, FRAME.stamp_ns)
    for number, answer in enumerate(answers, 1):
        log.answered(answer, "somewhere", FRAME.stamp_ns + 10 * MS * number)
    log.close()
    (row,) = tables["frames"].to_frame().to_dict("records")
    for name in ("first", "result", "fresh"):
        instant = row.pop(f"{name}_answer_ns")
        row[name] = None if np.isnan(instant) else (instant - row["stamp_ns"]) / MS
    for name in ("first_looked_ns", "looked_ns"):
        row[name] = None if np.isnan(row[name]) else row[name] / MS
    return row


def assert_row(row: dict[str, Any], **expected: Any) -> None:
    assert {name: row[name] for name in expected} == expected


def test_a_detectors_answer_to_the_frame_is_fresh():
    row = row_of(Detections(FRAME, ()))
    assert_row(row, first=10, result=10, fresh=10, first_looked_ns=1000, looked_ns=1000)


def test_a_cached_answer_is_a_result_and_as_old_as_its_look():
    cached = Detections(EARLIER, ()).credited("cache", "car1/genie", FRAME)
    assert_row(row_of(cached), first=10, result=10, fresh=None, first_looked_ns=700, looked_ns=700)


def test_a_cached_answer_is_never_fresh():
    cached = Detections(FRAME, ()).credited("cache", "car1/genie", FRAME)
    assert_row(row_of(cached), result=10, fresh=None, looked_ns=1000)


def test_an_answer_that_is_replayed_twice_keeps_its_look():
    again = (
        Detections(EARLIER, ())
        .credited("cache", "edge1/genie", OTHER_CAMERA)
        .credited("cache", "car1/genie", FRAME)
    )
    assert_row(row_of(again), fresh=None, looked_ns=700)


@pytest.mark.parametrize("other", [EARLIER, OTHER_CAMERA], ids=["earlier", "other camera"])
def test_the_answer_to_an_equal_frame_is_no_look_at_this_one(other: Header):
    """Not even if that frame was taken at the same time."""
    coalesced = Detections(other, ()).restamped(FRAME)
    assert_row(row_of(coalesced), result=10, fresh=None, looked_ns=other.stamp_ns / MS)


def test_a_map_answer_is_as_old_as_the_newest_look_at_one_of_its_objects():
    of_map = Detections(FRAME, stored(400, 900, 650)).credited("map", "car1/genie")
    expected = {"first": 10, "result": None, "fresh": None, "looked_ns": 900}
    assert_row(row_of(of_map), **expected)
    nothing = Detections(FRAME, ()).credited("map", "car1/genie")
    assert_row(row_of(nothing), first=10, first_looked_ns=None, looked_ns=None)


def test_what_the_map_adds_to_a_cached_answer_counts():
    cached = Detections(EARLIER, stored(950)).credited("cache", "car1/genie", FRAME)
    assert_row(row_of(cached), fresh=None, looked_ns=950)


def test_the_newest_look_is_that_of_all_answers_to_the_frame():
    of_map = Detections(FRAME, stored(600)).credited("map", "car1/genie")
    cached = Detections(EARLIER, ()).credited("cache", "edge1/genie", FRAME)
    late = Detections(FRAME, stored(300)).credited("map", "car1/genie")
    row = row_of(of_map, cached, Detections(FRAME, ()), late)
    assert_row(row, first=10, result=20, fresh=30, first_looked_ns=600, looked_ns=1000)


def test_a_map_keeps_the_newest_look_at_an_object_whoever_tells_of_it():
    """A detector at 700 ms, then another map that knows of a look at 900, and one of 400 ms."""
    objects = ObjectMap(ObjectMapRules())

    def learn(answer: Detections) -> None:
        objects.enhanced_cache_new_data(answer, 0, names_changes=False)

    (car,) = stored(900)
    learn(Detections(EARLIER, (replace(car, placed_by="made up", seen_in=None),)))
    (known,) = objects
    assert known.as_detection().seen_in == EARLIER
    for stamp_ms, newest_ms in ((900, 900), (400, 900)):
        learn(Detections(FRAME, stored(stamp_ms)).credited("map", "edge1/genie"))
        assert known.as_detection().seen_in.stamp_ns == newest_ms * MS


def test_changes_of_an_answer_keep_its_look():
    seen = Detections(EARLIER, ()).restamped(FRAME)
    for changed in (seen.with_objects(()), seen.with_look(None, 5), seen.credited("detector", "x")):
        assert (changed.seen_in, changed.is_fresh) == (EARLIER, False)
    assert stored(900)[0].with_confidence(0.5).seen_in == stored(900)[0].seen_in


@pytest.fixture(scope="module", params=["genie", "genie that forgets", "recommended"])
def run(request: pytest.FixtureRequest) -> Any:
    settings = {"genie that forgets": {"object_map": {"forget_after": "1 s"}}}.get(request.param)
    entry = {"name": "genie", "method": request.param.partition(" ")[0]}
    methods = ["local", "remote", entry | ({"genie": settings} if settings else {})]
    laps = [f"cars[{car}].route.laps=2" for car in range(3)]
    window = [f"cars[{car}].route.window=[3 s, 5 s]" for car in range(3)]
    overrides = [*laps, *window, f"methods={json.dumps(methods)}"]
    return run_in_memory(load_scenario("street_3car_hetero", overrides))


def test_no_look_is_newer_than_the_answer_that_shows_it(run: Any):
    known = run.frames[run.frames["first_looked_ns"].notna()]
    assert len(known) > 200 and (known["first_looked_ns"] < known["first_answer_ns"]).all()
    assert (known["looked_ns"] >= known["first_looked_ns"]).all()


def test_answers_of_caches_and_maps_are_not_fresh_and_age_over_laps(run: Any):
    frames = run.frames[run.frames["method"] == "genie"]
    hits = frames[frames["source"].isin(["own_cache", "edge_cache", "peer_cache"])]
    keeps_answers = bool((run.lookups["kind"] == "image").any())
    assert (len(hits) > 20) == keeps_answers
    assert (
        hits["fresh_answer_ns"].isna() | (hits["fresh_answer_ns"] > hits["first_answer_ns"])
    ).all()
    assert (hits["result_answer_ns"] == hits["first_answer_ns"]).all()
    of_map = frames[frames["source"] == "map"]
    assert (of_map["fresh_answer_ns"] != of_map["first_answer_ns"]).all()


def test_local_and_remote_execution_answer_with_looks_at_the_frame(run: Any):
    frames = run.frames[run.frames["method"] != "genie"]
    assert frames["first_answer_ns"].equals(frames["fresh_answer_ns"])
    assert frames["first_answer_ns"].equals(frames["result_answer_ns"])
    answered = frames[frames["first_answer_ns"].notna()]
    assert (answered["first_looked_ns"] == answered["stamp_ns"]).all()


def test_the_paper_s_numbers_count_cached_answers_as_results(run: Any):
    numbers = of_tables(run.tables)
    share = {
        method: numbers[Number("result_answered_share", method)]
        for method in ("local", "remote", "genie")
    }
    by_method = run.frames.groupby("method", observed=True)["result_answer_ns"]
    assert share == pytest.approx((by_method.count() / by_method.size()).to_dict())
    own = {one.method: one.value for one in run.measured if one.metric == "fresh_answered_share"}
    assert own["genie"] < share["genie"] and own["local"] == pytest.approx(share["local"])
