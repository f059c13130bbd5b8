"""Track or detect: the rule by hand, frames in order, and the published direction."""

from __future__ import annotations

import pytest
from track_or_detect import DriftPlusPenalty, EveryNth, Handler

import genie_sim as gs
from genie_sim.base.errors import UserError
from genie_sim.core.messages import (
    Detections,
    Expired,
    Publish,
)
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.method import IMAGES, OBJECTS, REMOTE
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track_map import TrackMap
from tests.conformance.methods import MethodConformance
from tests.make import frame, seen

MS = 1_000_000
CAR = seen()


@pytest.mark.parametrize(
    "method", ["track_or_detect:TrackOrDetect", "track_or_detect:FixedInterval"]
)
class TestConformance(MethodConformance):
    pass


def test_without_a_debt_every_frame_is_detected():
    rule = DriftPlusPenalty(required_ns=100 * MS, weight=1.0)
    rule.handled(80 * MS)  # earlier than required: nothing is saved up
    assert rule.debt == 0.0
    assert rule.detects(0, 5, 400 * MS)


def test_the_debt_is_what_frames_were_late_in_required_delays():
    rule = DriftPlusPenalty(required_ns=100 * MS, weight=1.0)
    rule.handled(300 * MS)
    assert rule.debt == pytest.approx(2.0)
    rule.handled(50 * MS)
    assert rule.debt == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("age_ms", "waiting", "round_trip_ms", "detects"),
    [  # the error age / 1 s against .5 x (1 + waiting) x round trip / 100 ms
        (400, 0, 80, True),  # .4 to .4
        (390, 0, 80, False),
        (400, 1, 80, False),  # to .8: one more waits
        (800, 1, 80, True),
        (400, 0, 90, False),  # to .45: the link is slower
        (5000, 0, 200, True),  # the error is 1 at most
        (5000, 0, 201, False),
    ],
)
def test_a_queue_and_a_slow_link_speak_against_detection(age_ms, waiting, round_trip_ms, detects):
    rule = DriftPlusPenalty(required_ns=100 * MS, weight=1.0)
    rule.handled(150 * MS)
    assert rule.detects(age_ms * MS, waiting, round_trip_ms * MS) is detects


@pytest.mark.parametrize(
    ("every", "expected"),
    [(1, [True] * 5), (2, [True, False, True, False, True]), (0, [True] + [False] * 4)],
)
def test_a_fixed_interval_counts_frames(every: int, expected: list[bool]):
    rule = EveryNth(every)
    assert [rule.detects(0, 0, 0) for _ in expected] == expected


def handler(every: int) -> Handler:
    tracks = TrackMap(ExistenceFilter(p_min=0.1))
    return Handler("car1/tracker", (EveryNth(every), tracks), (IMAGES,), (OBJECTS,))


def test_frames_wait_for_the_one_at_the_edge_and_are_answered_in_order():
    car, frames = handler(every=3), [frame(0), frame(0.1), frame(0.2), frame(0.3)]
    assert car.on_message(IMAGES, frames[0], 0) == [Publish(IMAGES + REMOTE, frames[0])]
    assert car.on_message(IMAGES, frames[1], 100 * MS) == []
    assert car.on_message(IMAGES, frames[2], 200 * MS) == []
    answer = Detections(frames[0].header, (CAR,))
    effects = car.on_message(OBJECTS + REMOTE, answer, 250 * MS)
    answers = [one.message for one in effects if isinstance(one, Publish)]
    assert [one.header for one in answers] == [one.header for one in frames[:3]]
    assert [one.source for one in answers] == ["detector", "map", "map"]
    for one in answers:  # all of what is there now
        assert one.valid_ns == 250 * MS
        assert [seen.location for seen in one.objects] == [CAR.location]
    assert car.on_message(IMAGES, frames[3], 300 * MS) == [Publish(IMAGES + REMOTE, frames[3])]


def test_a_frame_whose_answer_is_lost_is_tracked_after_a_second():
    car, lost = handler(every=0), frame(0)
    car.on_message(IMAGES, lost, 0)
    assert car.next_deadline_ns() == 1000 * MS
    assert car.on_deadline(999 * MS) == []
    tracked, expired = car.on_deadline(1000 * MS)
    assert expired == Expired(lost.header)
    assert tracked.message.header == lost.header and tracked.message.source == "map"
    late = car.on_message(OBJECTS + REMOTE, Detections(lost.header, (CAR,)), 1100 * MS)
    assert late == [] and car.next_deadline_ns() is None


def test_a_crash_takes_the_frames_that_wait():
    car, waits = handler(every=1), frame(0.1)
    car.on_message(IMAGES, frame(0), 0)
    car.on_message(IMAGES, waits, 100 * MS)
    assert car.on_memory_lost() == [Expired(waits.header)]


@pytest.mark.slow
@pytest.mark.nightly
def test_it_beats_fixed_intervals_where_the_rate_changes():
    fixed = ["always_edge", "every_2nd", "every_5th", "every_10th", "always_track"]
    run = gs.run(
        "track_or_detect.yaml",
        {"perception.duration": "5 s"},
        methods=["track_or_detect:TrackOrDetect", *fixed],
    )
    found = run.metrics[run.metrics["component"] == ""].set_index(["metric", "method"])["value"]
    f1, delay = found["streaming_f1"], found["first_answer_mean"]
    assert all(f1["TrackOrDetect"] > f1[one] for one in fixed), f1
    assert delay["always_track"] < delay["TrackOrDetect"] < delay["every_5th"], delay
    assert delay["every_5th"] < delay["every_2nd"] < delay["always_edge"], delay


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("TrackOrDetect, required: 0 s", "methods[0].required: must be"),
        ("TrackOrDetect, weight: -1", "methods[0].weight: must be"),
        ("FixedInterval, every: -1", "methods[0].every: must be"),
        ("FixedInterval, requires: 1 s", "unknown parameter"),
    ],
)
def test_a_setting_that_makes_no_sense_is_one_line(method: str, message: str):
    name, _, setting = method.partition(", ")
    entry = f'{{method: "track_or_detect:{name}", {setting}}}'
    with pytest.raises(UserError) as error:
        run_in_memory(load_scenario("track_or_detect.yaml", [f"methods=[{entry}]"]))
    assert message in str(error.value) and "\n" not in str(error.value)
