"""The oracle's answers are right ones; the scheduler's estimates come true."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.base.matching import f1, placed
from genie_sim.core.messages import Header
from genie_sim.methods.deadline import LinearEstimate, Scheduler
from genie_sim.methods.oracle import AnswerHistory
from tests.methods.caches.vectors import answer

MS = 10**6


def test_the_oracle_finds_the_newest_right_answer_of_all():
    rng = np.random.default_rng(3)
    known, answers = AnswerHistory(), []
    hits = 0
    for _ in range(400):
        asked = answer(*rng.uniform(0.0, 60.0, rng.integers(0, 4)))
        right = [one for one in answers if f1(placed(one.objects), placed(asked.objects)) >= 0.8]
        found = known.right(asked.objects)
        assert found == (right[-1] if right else None)
        hits += found is not None
        answers.append(asked)
        known.add(asked)
    assert 50 < hits < 390


def test_time_is_a_line_in_bytes():
    line = LinearEstimate()
    assert line.at(1000) is None
    line.add(1000, 10 * MS)
    assert line.at(500) == pytest.approx(5 * MS), "of one size: it is all the link"
    for size in (1000, 2000, 500) * 20:
        line.add(size, 3 * MS + 4000 * size)
    assert line.at(4000) == pytest.approx(3 * MS + 4000 * 4000, rel=0.01)


def header(number: int) -> Header:
    return Header(number * 100 * MS, "front", "car1")


def drive(
    scheduler: Scheduler, frames: int, local_ms: int, remote_ms: float, per_byte_ns: int = 0
) -> list[list]:
    """The ways of each frame, where both answer before the next one."""
    chosen = []
    for number in range(frames):
        now_ns = number * 2_000 * MS
        one = header(number)
        ways = scheduler.choose(one, 1000, now_ns)
        for way in ways:
            took_ms = (
                local_ms if way.way == "local" else remote_ms + per_byte_ns * way.size_bytes / MS
            )
            scheduler.answered(way.way, one, now_ns + round(took_ms * MS))
        chosen.append([(way.way, way.size_bytes) for way in ways])
    return chosen


def test_the_faster_way_is_taken_once_both_are_known():
    never = 10**18
    for local_ms, remote_ms, expected in ((300, 50, "remote"), (30, 50, "local")):
        ways = drive(Scheduler(400 * MS, (1.0,), never), 10, local_ms, remote_ms)
        assert {way for way, _ in ways[0]} == {"local", "remote"}, "nothing is known yet"
        assert ways[1:] == [[(expected, 1000)]] * 9


def test_quality_is_lowered_to_meet_the_deadline_or_the_frame_is_dropped():
    slow = Scheduler(60 * MS, (1.0, 0.5, 0.1), 10**18)
    ways = drive(slow, 6, 300, 0, per_byte_ns=100_000)  # 100 ms for all of it
    assert ways[1:] == [[("remote", 500)]] * 5
    late = Scheduler(5 * MS, (1.0, 0.5, 0.1), 10**18)
    assert drive(late, 4, 300, 0, per_byte_ns=100_000)[1:] == [[], [], []]


def test_a_way_not_used_for_long_is_probed():
    ways = drive(Scheduler(400 * MS, (1.0,), 3_000 * MS), 9, 300, 50)
    assert [len(one) for one in ways] == [2, 1, 2, 1, 2, 1, 2, 1, 2]


def test_frames_that_wait_for_the_own_detector_make_it_later():
    scheduler = Scheduler(400 * MS, (1.0,), 10**18)
    (first,) = {way.way for way in scheduler.choose(header(0), 1000, 0)} - {"remote"}
    scheduler.answered(first, header(0), 150 * MS)
    scheduler.answered("remote", header(0), 350 * MS)
    assert [scheduler.choose(header(n), 1000, 500 * MS)[0].way for n in (1, 2, 3)] == [
        "local",
        "local",
        "remote",
    ]


def test_the_service_time_is_without_the_wait_for_the_detector():
    """100 ms each, whether a frame has waited for another or not: two have time until 200 ms. The
    edge never answers.
    """
    scheduler = Scheduler(200 * MS, (1.0,), 10**18)

    def ways(number: int, now_ms: int) -> set[str]:
        return {way.way for way in scheduler.choose(header(number), 1000, now_ms * MS)}

    ways(0, 0)
    scheduler.answered("local", header(0), 100 * MS)
    assert ways(1, 150) == ways(2, 160) == {"local"}
    scheduler.answered("local", header(1), 250 * MS)
    scheduler.answered("local", header(2), 350 * MS)
    assert ways(3, 400) == ways(4, 401) == {"local"}
    assert ways(5, 402) == set()


def test_an_answer_shows_which_earlier_frames_were_dropped():
    scheduler = Scheduler(10_000 * MS, (1.0,), 10**18)
    scheduler.choose(header(0), 1000, 0)
    scheduler.answered("local", header(0), 100 * MS)  # 100 ms each; the edge never answers
    for number in (1, 2, 3):
        assert [way.way for way in scheduler.choose(header(number), 1000, number * 100 * MS)] == [
            "local"
        ]
    scheduler.answered("local", header(2), 350 * MS)
    scheduler.answered("local", header(1), 360 * MS)  # nobody waits for it any more
    assert scheduler._pending["local"].keys() == {header(3)}
