"""When frames go up for a look: cases worked by hand, and the rule against a second writing of
it.
"""

from __future__ import annotations

import itertools
import math
import random

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from genie_sim.core.messages import Header
from genie_sim.recommended.pacing import LookArrival, Loss, NewestLooks, Pacer, RoundTrip

MS = 1_000_000
PHASES_MS = {"02": 0, "03": 25, "00": 50, "01": 75}


def header(stream: str, stamp_ms: float) -> Header:
    return Header(round(stamp_ms * MS), stream, "car1")


def pacer(every_ms: float = 0, in_flight: int = 99, stale_ms: float = 500) -> Pacer:
    return Pacer(every_ns=round(every_ms * MS), in_flight=in_flight, stale_ns=round(stale_ms * MS))


def sent(pace: Pacer, frames: list[tuple[int, str]], heading_rad: float = 0.0) -> list[str]:
    """Of frames (stamp in ms, stream), each at its stamp, those that go up, as ``stream@stamp``."""
    return [
        f"{stream}@{stamp_ms}"
        for stamp_ms, stream in sorted(frames)
        if pace.dispatch(header(stream, stamp_ms), heading_rad, stamp_ms * MS)
    ]


def four_cameras(until_ms: int) -> list[tuple[int, str]]:
    """Frames of four cameras at 10 Hz, at their phases."""
    return [
        (start_ms + phase_ms, stream)
        for start_ms in range(0, until_ms + 1, 100)
        for stream, phase_ms in PHASES_MS.items()
        if start_ms + phase_ms <= until_ms
    ]


def test_four_cameras_of_one_view_take_turns():
    expected = ["02@0", "01@75", "00@150", "03@225", "02@300"]
    assert sent(pacer(every_ms=75), four_cameras(300)) == expected


def test_a_turn_is_waited_for_half_a_gap_but_no_longer():
    """Of two cameras, each at 10 Hz; the second one's turn has come when a frame of the first is
    there just in time.
    """
    frames = [(start_ms, "02") for start_ms in range(0, 500, 100)]
    near = [(start_ms + 40, "03") for start_ms in range(0, 500, 100)]
    far = [(start_ms + 60, "03") for start_ms in range(0, 500, 100)]
    assert sent(pacer(every_ms=100), frames + near)[:4] == ["02@0", "03@140", "02@200", "03@340"]
    assert sent(pacer(every_ms=100), frames + far)[2:4] == ["02@200", "02@300"]


@pytest.mark.parametrize(
    ("every_ms", "stamps_ms"),
    [(75, [0, 100, 200, 300, 400]), (150, [0, 100, 300, 400]), (200, [0, 200, 400])],
)
def test_a_single_camera_sends_the_frames_nearest_to_what_is_due(
    every_ms: int, stamps_ms: list[int]
):
    """At 150 ms looks fall due at 150, 300, 450: of frames that are as near the earlier one goes.
    Before a second frame nobody knows how far apart they are.
    """
    frames = [(stamp_ms, "02") for stamp_ms in range(0, 500, 100)]
    assert sent(pacer(every_ms=every_ms), frames) == [f"02@{stamp}" for stamp in stamps_ms]


def test_a_frame_half_a_millisecond_early_is_in_time():
    """Two cameras 74.5 ms apart, and a look every 75: each second frame of each would be late."""
    pace = pacer(every_ms=75)
    frames = [(100.0 * k, "02") for k in range(90)] + [(74.5 + 100 * k, "03") for k in range(90)]
    up = [
        stamp_ms
        for stamp_ms, stream in sorted(frames)
        if pace.dispatch(header(stream, stamp_ms), 0.0, round(stamp_ms * MS))
    ]
    assert (up[-1] - up[0]) / (len(up) - 1) == pytest.approx(75, rel=0.01)


@example(every_ms=68, phases_ms=[0, 11, 11], period_ms=121, jitter=0, seed=0)  # two at one instant
@given(
    every_ms=st.floats(0, 400),
    phases_ms=st.lists(st.floats(0, 100), min_size=1, max_size=4),
    period_ms=st.floats(30, 150),
    jitter=st.floats(0, 0.1),
    seed=st.integers(0, 2**16),
)
def test_the_mean_gap_is_what_was_asked_or_what_the_cameras_give(
    every_ms: float, phases_ms: list[float], period_ms: float, jitter: float, seed: int
):
    """Within 5 %, whatever the phases, the rate and the jitter of stamps are. Where cameras take
    their frames close to one another, not all of these are wanted.
    """
    draw, looks = random.Random(seed), 200
    longest_ms = max(every_ms, period_ms)
    frames = sorted(
        (period_ms * (k + jitter * draw.uniform(-1, 1)) + phase_ms, f"camera {number}")
        for number, phase_ms in enumerate(phases_ms)
        for k in range(int(looks * longest_ms / period_ms) + 2)
    )
    in_turn = sorted(phase_ms % period_ms for phase_ms in phases_ms)
    apart_ms = [b - a for a, b in itertools.pairwise([*in_turn, in_turn[0] + period_ms])]
    least_ms = max(every_ms, period_ms / len(phases_ms))
    most_ms = max(every_ms, max(apart_ms) + 2 * jitter * period_ms)
    pace, up = pacer(every_ms=every_ms, in_flight=10**6), []
    for stamp_ms, stream in frames:
        departure = pace.dispatch(header(stream, stamp_ms), 0.0, round(stamp_ms * MS))
        if departure is not None:
            up.append(stamp_ms)
            gap_ns = None if len(up) == 1 else pytest.approx((up[-1] - up[-2]) * MS, abs=2)
            assert departure.gap_ns == gap_ns
    mean_ms = (up[-1] - up[0]) / (len(up) - 1)
    assert 0.95 * least_ms <= mean_ms <= 1.05 * most_ms


def test_cameras_that_look_elsewhere_have_views_of_their_own():
    pace = pacer(every_ms=200)
    assert pace.dispatch(header("ahead", 0), 0.0, 0)
    assert pace.dispatch(header("left", 10), math.radians(90), 10 * MS)
    assert not pace.dispatch(header("ahead again", 20), math.radians(-14), 20 * MS)
    assert pace.dispatch(header("right", 30), math.radians(-15.1), 30 * MS)


def test_the_newest_look_of_a_view_is_that_of_any_of_its_live_cameras():
    looks = NewestLooks()
    ahead, beside, left = header("02", 0), header("03", 25), header("left", 30)
    headings = {ahead: 0.0, beside: math.radians(14), left: math.radians(90)}
    assert [looks.add_frame(frame, headings[frame]) for frame in headings] == [None, None, None]
    looks.add_look(beside)
    looks.add_look(left)
    assert looks.add_frame(header("02", 100), 0.0) == 25 * MS
    looks.add_look(ahead)
    assert looks.add_frame(header("02", 200), 0.0) == 25 * MS, "an older look of the view"
    assert looks.add_frame(header("02", 600), 0.0) == 0, "03 has stopped"


def test_headings_on_both_sides_of_south_are_near():
    pace = pacer(every_ms=200)
    assert pace.dispatch(header("02", 0), math.radians(175), 0)
    assert not pace.dispatch(header("03", 10), math.radians(-175), 10 * MS)


def test_a_camera_that_stopped_is_not_waited_for():
    """Its turn would come, but nobody expects its next frame any more."""
    pace = pacer(every_ms=100)
    pace.dispatch(header("02", 0), 0.0, 0)
    pace.dispatch(header("03", 100), 0.0, 100 * MS)
    stamps_ms = range(200, 900, 100)
    up = [stamp for stamp in stamps_ms if pace.dispatch(header("03", stamp), 0.0, stamp * MS)]
    assert up == [200, 300, 400, 500, 600, 700, 800]


def test_the_way_takes_so_many_at_a_time_until_answers_come():
    pace = pacer(in_flight=2)
    assert sent(pace, [(stamp_ms, "02") for stamp_ms in (0, 100, 200, 299)]) == ["02@0", "02@100"]
    assert pace.answered(header("02", 0), 300 * MS) == LookArrival(True, True, [])
    assert pace.dispatch(header("02", 300), 0.0, 300 * MS)


def test_an_answer_to_a_later_frame_shows_that_earlier_ones_are_lost():
    pace = pacer(in_flight=2)
    sent(pace, [(0, "02"), (100, "02")])
    lost = [Loss(header("02", 0), "overtaken")]
    assert pace.answered(header("02", 100), 400 * MS) == LookArrival(True, True, lost)
    assert pace.outstanding == 0


def test_an_answer_nobody_waits_for_frees_nothing_and_measures_nothing():
    pace = pacer(in_flight=1)
    sent(pace, [(0, "02")])
    assert pace.answered(header("03", 0), 50 * MS) == LookArrival(True, False, ())
    assert pace.outstanding == 1 and pace.round_trip.smoothed_ns is None


def test_a_late_answer_is_no_look_but_frees_the_way():
    pace = pacer(in_flight=1, stale_ms=500)
    sent(pace, [(0, "02")])
    assert pace.answered(header("02", 0), 501 * MS) == LookArrival(False, True, [])
    assert pace.outstanding == 0
    sent(pace, [(600, "02")])
    assert pace.answered(header("02", 600), 1100 * MS) == LookArrival(True, True, [])


def test_a_way_slower_than_stale_carries_one_frame_at_a_time():
    pace = pacer(in_flight=3, stale_ms=500)
    sent(pace, [(0, "02")])
    pace.answered(header("02", 0), 501 * MS)
    assert sent(pace, [(600, "02"), (700, "02")]) == ["02@600"]


def test_the_timeout_follows_the_round_trips():
    way = RoundTrip()
    assert way.timeout_ns == 1000 * MS
    smoothed = []
    for round_trip_ms in (100, 100, 180):
        way.measured(round_trip_ms * MS)
        smoothed.append(way.smoothed_ns)
    assert smoothed == [100 * MS, 100 * MS, 110 * MS]
    assert way.timeout_ns == 302.5 * MS  # 110 + 4 x 48.125
    way.timed_out()
    assert way.timeout_ns == 605 * MS
    way.measured(110 * MS)
    assert way.timeout_ns < 302.5 * MS


def test_a_steady_way_has_half_a_round_trip_to_spare():
    """Without variation the timeout would be the round trip itself."""
    way = RoundTrip()
    for _ in range(100):
        way.measured(100 * MS)
    assert way.timeout_ns == 150 * MS


def test_the_timeout_grows_to_eight_times_and_five_seconds_at_most():
    way = RoundTrip()
    way.measured(10 * MS)
    usual_ns = way.timeout_ns
    for _ in range(10):
        way.timed_out()
    assert way.timeout_ns == 8 * usual_ns
    slow = RoundTrip()
    slow.measured(3000 * MS)
    slow.timed_out()
    assert slow.timeout_ns == 5000 * MS


def test_frames_on_a_dead_way_are_lost_and_fewer_follow():
    pace = pacer(in_flight=2)
    sent(pace, [(0, "02"), (100, "02")])
    assert pace.next_deadline_ns() == 1000 * MS
    assert pace.expire(999 * MS) == []
    assert pace.expire(1100 * MS) == [
        Loss(header("02", 0), "timed_out"),
        Loss(header("02", 100), "timed_out"),
    ]
    assert pace.outstanding == 0 and pace.next_deadline_ns() is None
    sent(pace, [(1200, "02")])
    assert pace.next_deadline_ns() == 3200 * MS, "lost together, they double the timeout once"


@pytest.mark.parametrize("round_trip_ms", [501, 800, 1500, 4000])
def test_looks_grow_rare_while_answers_come_too_late(round_trip_ms: int):
    """One probe at a time, after gaps that double up to ten seconds; 60 s with 10 frames each."""
    pace, up, answers = pacer(every_ms=75, in_flight=4), [], []
    for stamp_ms in range(0, 60_000, 100):
        while answers and answers[0] + round_trip_ms <= stamp_ms:
            answered_ms = answers.pop(0)
            pace.answered(header("02", answered_ms), (answered_ms + round_trip_ms) * MS)
        pace.expire(stamp_ms * MS)
        if pace.dispatch(header("02", stamp_ms), 0.0, stamp_ms * MS):
            up.append(stamp_ms)
            answers.append(stamp_ms)
    gaps_ms = [after - before for before, after in itertools.pairwise(up)]
    assert gaps_ms[-3:] == pytest.approx([10_000] * 3, abs=100)
    assert len(up) < 20


def test_one_answer_in_time_ends_the_probing():
    pace = pacer(every_ms=100, in_flight=1)
    sent(pace, [(0, "02")])
    pace.answered(header("02", 0), 600 * MS)
    assert sent(pace, [(stamp_ms, "02") for stamp_ms in range(600, 1300, 100)]) == ["02@600"]
    pace.answered(header("02", 600), 1300 * MS)
    late = [(stamp_ms, "02") for stamp_ms in range(1300, 2000, 100)]
    assert sent(pace, late) == ["02@1500"], "a second after the one before was due"
    pace.answered(header("02", 1500), 1900 * MS)
    assert sent(pace, [(2000, "02")]) == ["02@2000"]


@given(st.lists(st.tuples(st.integers(1, 400), st.sampled_from(["send", "answer", "expire"]))))
def test_what_goes_up_is_answered_lost_or_on_its_way(steps: list[tuple[int, str]]):
    pace = pacer(in_flight=3)
    now_ms, up, answered, lost = 0, [], 0, 0
    for gap_ms, step in steps:
        now_ms += gap_ms
        if step == "send" and pace.dispatch(header("02", now_ms), 0.0, now_ms * MS):
            up.append(header("02", now_ms))
        elif step == "answer" and up:
            before = pace.outstanding
            arrival = pace.answered(up[-1], now_ms * MS)
            lost += len(arrival.losses)
            answered += arrival.is_awaited
            assert before - pace.outstanding == len(arrival.losses) + arrival.is_awaited
        elif step == "expire":
            lost += len(pace.expire(now_ms * MS))
        assert len(up) == answered + lost + pace.outstanding
        assert pace.outstanding <= 3
