"""When frames go up for a look: cases worked by hand, and the rule against a second writing of
it.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.core.messages import Header
from genie_sim.core.recommended.pacing import LookArrival, Loss, NewestLooks, Pacer, RoundTrip

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
        if pace.sends(header(stream, stamp_ms), heading_rad, stamp_ms * MS)
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


def test_a_turn_is_waited_for_even_when_another_camera_would_be_earlier():
    expected = ["02@0", "03@125", "00@250", "01@375", "02@500"]
    assert sent(pacer(every_ms=80), four_cameras(500)) == expected


@pytest.mark.parametrize(("every_ms", "stamps_ms"), [(75, [0, 100, 200, 300]), (150, [0, 200])])
def test_a_single_camera_sends_what_is_due(every_ms: int, stamps_ms: list[int]):
    frames = [(stamp_ms, "02") for stamp_ms in range(0, 400, 100)]
    assert sent(pacer(every_ms=every_ms), frames) == [f"02@{stamp}" for stamp in stamps_ms]


def test_cameras_that_look_elsewhere_have_views_of_their_own():
    pace = pacer(every_ms=200)
    assert pace.sends(header("ahead", 0), 0.0, 0)
    assert pace.sends(header("left", 10), math.radians(90), 10 * MS)
    assert not pace.sends(header("ahead again", 20), math.radians(-14), 20 * MS)
    assert pace.sends(header("right", 30), math.radians(-15.1), 30 * MS)


def test_the_newest_look_of_a_view_is_that_of_any_of_its_live_cameras():
    looks = NewestLooks()
    ahead, beside, left = header("02", 0), header("03", 25), header("left", 30)
    headings = {ahead: 0.0, beside: math.radians(14), left: math.radians(90)}
    assert [looks.looked_ns(frame, headings[frame]) for frame in headings] == [None, None, None]
    looks.learned(beside)
    looks.learned(left)
    assert looks.looked_ns(header("02", 100), 0.0) == 25 * MS
    looks.learned(ahead)
    assert looks.looked_ns(header("02", 200), 0.0) == 25 * MS, "an older look of the view"
    assert looks.looked_ns(header("02", 600), 0.0) == 0, "03 has stopped"


def test_headings_on_both_sides_of_south_are_near():
    pace = pacer(every_ms=200)
    assert pace.sends(header("02", 0), math.radians(175), 0)
    assert not pace.sends(header("03", 10), math.radians(-175), 10 * MS)


def test_a_camera_that_stopped_is_not_waited_for():
    """Its turn would come, but it has had no frame for more than half a second."""
    pace = pacer(every_ms=100)
    pace.sends(header("02", 0), 0.0, 0)
    pace.sends(header("03", 100), 0.0, 100 * MS)
    stamps_ms = range(200, 900, 100)
    up = [stamp for stamp in stamps_ms if pace.sends(header("03", stamp), 0.0, stamp * MS)]
    assert up == [600, 700, 800]


def test_the_way_takes_so_many_at_a_time_until_answers_come():
    pace = pacer(in_flight=2)
    assert sent(pace, [(stamp_ms, "02") for stamp_ms in (0, 100, 200, 299)]) == ["02@0", "02@100"]
    assert pace.answered(header("02", 0), 300 * MS) == LookArrival(True, True, [])
    assert pace.sends(header("02", 300), 0.0, 300 * MS)


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


def due_by_the_rule(every_ms: int, frames: list[tuple[int, str, float]]) -> list[int]:
    """The rule read again, from the definition: which frames (stamp in ms, stream, heading in
    degrees) go up while the way is always free.
    """
    up: list[int] = []
    for number, (stamp_ms, stream, heading) in enumerate(frames):
        newest = {name: (stamp, angle) for stamp, name, angle in frames[: number + 1]}
        view = {
            name
            for name, (stamp, angle) in newest.items()
            if stamp_ms - stamp <= 500
            and min(abs(heading - angle), 360 - abs(heading - angle)) < 15
        }
        last_up = {
            name: max((frames[i][0] for i in up if frames[i][1] == name), default=-math.inf)
            for name in view
        }
        waited_long = stamp_ms - max(last_up.values()) >= every_ms
        if waited_long and last_up[stream] == min(last_up.values()):
            up.append(number)
    return up


@given(
    every_ms=st.integers(0, 300),
    gaps_ms=st.lists(st.integers(1, 200), min_size=1, max_size=40),
    data=st.data(),
)
def test_the_pacer_follows_the_rule(every_ms: int, gaps_ms: list[int], data: st.DataObject):
    stamp_ms, frames = 0, []
    for gap_ms in gaps_ms:
        stamp_ms += gap_ms
        stream = data.draw(st.sampled_from("abcd"))
        frames.append((stamp_ms, stream, data.draw(st.sampled_from([0, 10, 20, 90, 356]))))
    pace = pacer(every_ms=every_ms)
    up = [
        number
        for number, (stamp_ms, stream, heading) in enumerate(frames)
        if pace.sends(header(stream, stamp_ms), math.radians(heading), stamp_ms * MS)
    ]
    assert up == due_by_the_rule(every_ms, frames)


@given(st.lists(st.tuples(st.integers(1, 400), st.sampled_from(["send", "answer", "expire"]))))
def test_what_goes_up_is_answered_lost_or_on_its_way(steps: list[tuple[int, str]]):
    pace = pacer(in_flight=3)
    now_ms, up, answered, lost = 0, [], 0, 0
    for gap_ms, step in steps:
        now_ms += gap_ms
        if step == "send" and pace.sends(header("02", now_ms), 0.0, now_ms * MS):
            up.append(header("02", now_ms))
        elif step == "answer" and up:
            before = pace.outstanding
            arrival = pace.answered(up[-1], now_ms * MS)
            lost += len(arrival.lost)
            answered += arrival.is_awaited
            assert before - pace.outstanding == len(arrival.lost) + arrival.is_awaited
        elif step == "expire":
            lost += len(pace.expire(now_ms * MS))
        assert len(up) == answered + lost + pace.outstanding
        assert pace.outstanding <= 3
