"""How held objects are judged: scenes by hand with distinct counts, and a judge that looks at one
object after the other.
"""

from __future__ import annotations

import random
from functools import partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from genie_sim.core.messages import (
    CameraPose,
    Detection,
    Detections,
    Header,
    Image,
    Location,
)
from genie_sim.judge.consumers import ConsumerJudge
from genie_sim.judge.joins import GroupedPlaces
from genie_sim.judge.recent_places import RecentPlaces
from genie_sim.record.records import HELD, HELD_OBJECTS
from genie_sim.record.tables import Table
from genie_sim.tracks.track import Motion
from tests.judge.judging import Frame, Street, Thing, judged, last, thing
from tests.judge.scalar_judge import ScalarJudge
from tests.make import S, seen

NOTHING = Frame([])


def test_three_metres_from_a_car_is_no_duplicate_of_it():
    """A duplicate is within reach: 2 m."""
    frame = Frame([thing("car", 20.0)])
    row = last((frame, [seen(20.0), seen(23.0)]), (frame, None))
    assert (row["duplicate"], row["never_there"]) == (0, 1)


@pytest.mark.parametrize("east_m", [8.2, 11.8, 12.1])
def test_a_car_beside_it_later_does_not_make_a_ghost_forgotten(east_m: float):
    """A car was at 10.1 m, and another at 11.9 m a moment later: both within one square of 2 m."""
    first, second = Frame([thing("car", 10.1)]), Frame([thing("car", 11.9)])
    answer = [seen(east_m)]
    row = last((first, None), (second, answer), (NOTHING, None))
    assert (row["moved_away"], row["never_there"]) == (1, 0)


def test_a_place_counts_as_left_for_exactly_ten_seconds():
    frame = Frame([thing("car", 10.0)])
    rows = judged((frame, [seen(10.0)]), *[(NOTHING, None)] * 101)
    assert [row["moved_away"] for row in rows[-3:]] == [1, 1, 0]


def test_places_with_nothing_visible_for_ten_seconds_are_forgotten():
    """A parked car, and another that is somewhere else each time."""
    places = RecentPlaces()
    now_ns = np.arange(0, 40 * S, S)
    for window in np.split(now_ns, 8):
        seen = [(0, 10.0, 0.0), *((0, 30.0, t_ns / S) for t_ns in window.tolist())]
        codes = np.array([places.codes[place] for place in seen])
        at = np.array([0, *range(len(window))])
        asked = GroupedPlaces(
            np.zeros(2, dtype=int), np.array([11.0, 30.0]), np.array([0.0, window[0] / S - 3])
        )
        there = places.were_there(
            asked, np.array([2.0, 2.0]), np.array([1, 0]), np.stack([codes, at]), window
        )
        assert there.tolist() == [True, window[0] > 0], "at an instant before"
    assert len(places.codes) < 30


class Town(Street):
    """The same, with people who are not known."""

    reach_m = 6.0

    def knows(self, label: str) -> bool:
        return label != "person"


Judge = ConsumerJudge | ScalarJudge
CARS = {"car1": Street(), "car2": Town()}


def drive(judge: Judge, seed: int, moments: int) -> None:
    """Two cars with two cameras each look at a strip of 30 m by 12 m, in which things come, go and
    stay; answers are early, late or missing, and some hold at an instant.
    """
    rng = random.Random(seed)
    # few places, so that things are at one place again and again, and twice at once
    places = [(rng.uniform(5.0, 35.0), rng.uniform(-6.0, 6.0), 0.0) for _ in range(12)]
    headers = []

    def somewhere(moving: bool) -> tuple[str, Location, bool]:
        east_m, north_m, up_m = rng.choice(places)
        if moving:
            east_m += rng.uniform(-1.0, 1.0)
        return rng.choice(["car", "car", "truck", "person"]), (east_m, north_m, up_m), moving

    def found() -> Detection:
        label, location, moving = somewhere(rng.random() < 0.3)
        motion = None
        if moving:
            seen = Header(rng.randrange(S), "left", rng.choice(["car1", "car2", "car3"]))
            motion = Motion((rng.uniform(-9.0, 9.0), 1.0), 0.5, 0.9, seen)
        place = None if rng.random() < 0.1 else location
        return Detection(label, 0.9, None, place, 0.9, "made up", motion)

    known = [found() for _ in range(10)]  # objects that several answers share

    def some() -> tuple[Detection, ...]:
        return tuple(rng.choice(known) if rng.random() < 0.6 else found() for _ in range(4))

    for number in range(moments):
        now_ns = number * S // 2
        for car in CARS:
            for stream, heading_rad in (("left", 0.4), ("right", -0.2)):
                things = [Thing(*somewhere(rng.random() < 0.3)) for _ in range(rng.randrange(4))]
                hidden = [Thing(*somewhere(False)) for _ in range(rng.randrange(2))]
                frame = Frame(things, hidden, some()[: rng.randrange(4)])
                header = Header(now_ns, stream, car)
                pose = CameraPose(rng.uniform(-1.0, 1.0), 0.0, 1.6, heading_rad)
                judge.published(Image(header, 1000, "", 0, pose, 1.4, frame))
                headers.append(header)
        for header in rng.sample(headers[-9:], k=3):
            answer = Detections(header, some()[: rng.randrange(5)])
            if rng.random() < 0.4:
                answer = answer.with_look(None, now_ns - rng.randrange(S))
            judge.answered(answer, now_ns)
    judge.close()


@pytest.mark.slow
@settings(deadline=None, max_examples=12)
@given(
    seed=st.integers(0, 2**32),
    window=st.sampled_from([1, 2, 3, 7, 20, 1024]),
    all_streams=st.booleans(),
    without_delay=st.sampled_from([(), ("car2",)]),
)
def test_windows_of_any_size_are_judged_as_one_object_after_the_other(
    seed: int, window: int, all_streams: bool, without_delay: tuple[str, ...]
):
    rows = []
    for make in (partial(ConsumerJudge, window=window), ScalarJudge):
        tables = Table(HELD), Table(HELD_OBJECTS)
        judge = make(
            "genie", CARS, tables[0], without_delay, held_objects=tables[1], all_streams=all_streams
        )
        drive(judge, seed, moments=8)
        rows.append([table.to_frame() for table in tables])
    for ours, theirs in zip(*rows, strict=True):
        pd.testing.assert_frame_equal(ours, theirs, rtol=1e-12, check_categorical=False)
