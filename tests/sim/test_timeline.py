"""The calls of a run come when they are due, in the order in which they were scheduled."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from genie_sim.sim.timeline import Timeline

LARGEST = 2**63 - 1


def in_order(delays: list[int]) -> list[tuple[int, int]]:
    """Instant and number of each call, as they are carried out."""
    timeline, noted = Timeline(), []

    def note(number: int) -> None:
        noted.append((timeline.now, number))

    for number, delay_ns in enumerate(delays):
        timeline.after(delay_ns, note, (number,))
    timeline.pass_time(max(delays, default=0) + 1)
    return noted


@given(st.lists(st.integers(0, 20) | st.integers(0, 2**62)))
def test_calls_come_by_instant_then_in_their_order(delays: list[int]):
    expected = sorted((delay_ns, number) for number, delay_ns in enumerate(delays))
    assert in_order(delays) == expected


def test_thousands_of_calls_that_schedule_others_keep_the_order():
    """Against a list that is sorted anew for each call."""
    rng, timeline, noted, waiting = random.Random(1), Timeline(), [], []

    def schedule(number: int) -> None:
        at_ns = timeline.now + rng.randrange(40)
        waiting.append((at_ns, number))
        timeline.after(at_ns - timeline.now, carry_out, (number,))

    def carry_out(number: int) -> None:
        noted.append((timeline.now, number))
        due = min(waiting)
        waiting.remove(due)
        assert due == noted[-1]
        for following in range(rng.randrange(3)):
            if count[0] < 3000:
                count[0] += 1
                schedule(count[0] if following < 2 else -1)

    count = [200]
    for number in range(count[0]):
        schedule(number)
    timeline.pass_time(10_000)
    assert len(noted) == count[0] and waiting == []


def test_a_call_for_this_instant_comes_after_those_that_were_there():
    timeline, noted = Timeline(), []

    def first() -> None:
        noted.append("first")
        timeline.after(0, noted.append, ("third",))

    timeline.after(5, first)
    timeline.after(5, noted.append, ("second",))
    timeline.pass_time(6)
    assert noted == ["first", "second", "third"]


def test_what_is_due_at_the_end_is_left():
    timeline, noted = Timeline(), []
    for delay_ns in (3, 4, 5):
        timeline.after(delay_ns, noted.append, (delay_ns,))
    timeline.pass_time(4)
    assert (noted, timeline.now, timeline.next_ns()) == ([3], 4, 4)
    timeline.pass_time(4.5)
    assert (noted, timeline.now, timeline.next_ns()) == ([3, 4], 4, 5)


def test_one_step_is_one_call():
    timeline, noted = Timeline(), []
    timeline.after(7, noted.append, ("second",))
    timeline.after(2, noted.append, ("first",))
    timeline.after(7, noted.append, ("third",))
    for instant, told in ((2, "first"), (7, "second"), (7, "third")):
        assert timeline.next_ns() == instant
        timeline.step()
        assert (timeline.now, noted[-1]) == (instant, told)
    assert timeline.next_ns() is None
    with pytest.raises(IndexError):
        timeline.step()


@pytest.mark.parametrize("delay_ns", [LARGEST, 2**63, 10**30])
def test_what_is_too_far_away_never_comes(delay_ns: int):
    timeline, noted = Timeline(), []
    timeline.pass_time(10)
    timeline.after(delay_ns, noted.append, ("never",))
    timeline.after(1, noted.append, ("soon",))
    timeline.pass_time(2**62)
    assert noted == ["soon"] and not timeline.waits_only_for(print)


def test_a_delay_is_a_whole_number():
    timeline = Timeline()
    with pytest.raises(TypeError):
        timeline.after(1.5, print)  # type: ignore[arg-type]
    timeline.after(np.int64(3), print)  # type: ignore[arg-type]
    assert timeline.next_ns() == 3


def test_what_else_is_scheduled_is_seen():
    timeline, other = Timeline(), [].append
    assert timeline.waits_only_for(print)
    timeline.after(9, print)
    timeline.after(3, print)
    assert timeline.waits_only_for(print)
    timeline.after(5, other, (1,))
    assert not timeline.waits_only_for(print)
    timeline.clear()
    assert timeline.waits_only_for(print) and timeline.next_ns() is None


def test_a_call_that_fails_is_over_and_the_others_are_still_due():
    timeline, noted = Timeline(), []

    def fails() -> None:
        raise KeyError("it")

    timeline.after(1, fails)
    timeline.after(2, noted.append, (2,))
    with pytest.raises(KeyError):
        timeline.pass_time(9)
    timeline.pass_time(9)
    assert noted == [2] and timeline.now == 9


def test_the_arguments_of_what_was_carried_out_are_let_go():
    import gc
    import weakref

    class Payload:
        pass

    def take(payload: Any) -> None:
        pass

    timeline, payload = Timeline(), Payload()
    seen = weakref.ref(payload)
    timeline.after(1, take, (payload,))
    timeline.after(2, take, (0,))
    del payload
    gc.collect()
    assert seen() is not None
    timeline.pass_time(2)
    gc.collect()
    assert seen() is None


# Calls that a timeline of another process has scheduled


@given(
    st.lists(st.tuples(st.integers(0, 40), st.integers(0, 12), st.booleans()), max_size=12),
    st.integers(1, 12),
)
@example([(1, 0, True), (0, 1, False)], 6)
@example([(0, 1, False), (1, 0, False), (2, 0, True)], 6)
def test_calls_from_elsewhere_come_as_if_they_had_been_scheduled_here(
    plans: list[tuple[int, int, bool]], window_ns: int
):
    """Two timelines exchange calls after each window that take longer than a window, against one
    timeline with all calls.
    """

    def run(split: bool) -> list[tuple[int, int]]:
        here, there = Timeline(), Timeline()
        noted: list[tuple[int, int]] = []
        crossing: list[tuple[int, int, int]] = []

        def note(number: int) -> None:
            noted.append((here.now, number))

        def plan(timeline: Timeline, number: int, delay_ns: int) -> None:
            if timeline is here:
                here.after(delay_ns, note, (number,))
            else:
                crossing.append((there.now + delay_ns, there.now, number))

        for number, (begin_ns, delay_ns, is_here) in enumerate(plans):
            timeline = here if is_here or not split else there
            arguments = (timeline, number, delay_ns + window_ns)
            timeline.after(begin_ns, plan, arguments)
        for end_ns in range(window_ns, 40 + 12 + 3 * window_ns, window_ns):
            here.pass_time(end_ns)
            there.pass_time(end_ns)
            for at_ns, scheduled_ns, number in crossing:
                here.from_elsewhere(at_ns, scheduled_ns, note, (number,))
            crossing.clear()
        if split and here.has_ties:
            return run(split=False)
        return noted

    assert run(split=True) == run(split=False)


@pytest.mark.parametrize(("scheduled_ns", "is_tie"), [(0, False), (1, True), (3, False)])
def test_two_calls_of_one_instant_scheduled_at_one_instant_are_a_tie(
    scheduled_ns: int, is_tie: bool
):
    timeline = Timeline()
    timeline.pass_time(1)
    timeline.after(9, list)
    timeline.after(9, list)  # whose order is known here
    timeline.pass_time(5)
    timeline.from_elsewhere(10, scheduled_ns, list, ())
    timeline.from_elsewhere(10, 4, list, ())
    timeline.from_elsewhere(11, 4, list, ())
    timeline.pass_time(20)
    assert timeline.has_ties is is_tie


def test_the_timeline_tells_when_the_present_call_was_scheduled():
    timeline, told = Timeline(), []
    timeline.after(2, lambda: timeline.after(5, lambda: told.append(timeline.scheduled_ns)))
    timeline.pass_time(6)
    timeline.from_elsewhere(7, 4, lambda: told.append(timeline.scheduled_ns), ())
    timeline.pass_time(10)
    assert told == [2, 4]
