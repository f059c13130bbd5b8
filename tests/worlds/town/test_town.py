"""A generated town: the same for the same rules and seed, whoever asks for what in which order."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_S
from genie_sim.data.trace import TraceFrame, read_trace
from genie_sim.worlds.scene.frames import SceneDrive
from genie_sim.worlds.town import Town, TownRules
from tests.worlds.town.town_truth import truth_near

REPOSITORY = Path(__file__).resolve().parents[3]

RULES = TownRules(blocks=(4, 4))
DURATION_NS = 5 * NS_PER_S


@pytest.fixture(scope="module")
def town() -> Town:
    return Town(RULES, seed=7)


def content(drive: SceneDrive) -> list:
    return [
        (f.digest, f.dhash, f.pose, f.detections, f.truth())
        for frames in drive.frames.values()
        for f in frames
    ]


def test_a_seed_makes_the_town_that_it_has_always_made():
    """Pinned, so that no renaming makes other towns of the seeds that published results name."""
    frame = Town(TownRules(blocks=(6, 6)), seed=1).drive("car1", 60 * NS_PER_S).frames["02"][100]
    assert (len(frame.truth()), len(frame.detections)) == (7, 5)
    assert (frame.detections[0].label, frame.detections[0].score) == ("car", 0.8211)


def test_the_same_rules_and_seed_give_the_same_drive(town):
    again, other = Town(RULES, seed=7), Town(RULES, seed=8)
    assert content(again.drive("car1", DURATION_NS)) == content(town.drive("car1", DURATION_NS))
    assert content(again.drive("car1", DURATION_NS)) != content(other.drive("car1", DURATION_NS))
    assert again.digest == town.digest != other.digest


def test_who_looks_less_far_or_less_often_or_longer_sees_the_same_of_what_is_left(town):
    """The draws hang on the seed, the car, the camera and the time, and on no other setting."""
    near = Town(dataclasses.replace(RULES, view_m=30.0, walkers_per_100m=0.0), seed=7)
    usual = town.drive("car1", DURATION_NS).frames["02"]
    seen = {frame.scene_ns: {*frame.detections} for frame in usual}
    few = near.drive("car1", 2 * DURATION_NS, 250_000_000).frames["02"]
    kept = [({*frame.detections}, seen[at]) for frame in few if (at := frame.scene_ns) in seen]
    assert all(left <= usual for left, usual in kept)
    assert any(left for left, _ in kept) and any(left < usual for left, usual in kept)


def test_frames_do_not_depend_on_the_order_in_which_they_are_asked_for(town):
    forwards = content(town.drive("car1", DURATION_NS))
    drive = town.drive("car1", DURATION_NS)
    backwards = [
        drive.frames[camera][i]
        for camera in ("03", "02")
        for i in reversed(range(len(drive.frames[camera])))
    ]
    assert [(f.digest, f.dhash, f.pose, f.detections, f.truth()) for f in backwards][
        ::-1
    ] == forwards


def test_no_two_pictures_are_the_same(town):
    frames = [
        f
        for car in ("a", "b")
        for frames in town.drive(car, DURATION_NS).frames.values()
        for f in frames
    ]
    assert len({f.digest for f in frames}) == len({f.dhash for f in frames}) == len(frames) == 200
    assert all(len(f.digest) == 64 and int(f.digest, 16) and 0 <= f.dhash < 2**64 for f in frames)


def test_a_new_car_changes_nobody(town):
    alone = content(Town(RULES, seed=7).drive("car1", DURATION_NS))
    crowded = Town(RULES, seed=7)
    for k in range(20):
        content(crowded.drive(f"other{k}", NS_PER_S))
    assert content(crowded.drive("car1", DURATION_NS)) == alone


def test_frames_look_like_those_of_a_trace(town):
    """Everything that a TraceFrame tells, a frame of the town tells as well, from KITTI's own
    camera.
    """
    real = read_trace(files.find(files.TRACE, "kitti_0005")).frames["02"][0]
    frames = town.drive("car1", DURATION_NS).frames
    assert sorted(frames) == ["02", "03"]
    assert len(frames["02"]) == 50
    made = frames["02"][-1]
    for field in dataclasses.fields(TraceFrame):
        assert type(getattr(made, field.name)) is type(getattr(real, field.name)), field.name
    for name in ("width", "height", "size_bytes", "horizontal_fov_rad"):
        assert getattr(made, name) == getattr(real, name)
    assert (made.camera, made.index, made.stamp_ns) == ("02", 49, 4_900_000_000)
    with pytest.raises(IndexError):
        frames["02"][50]


def test_detections_are_kept_while_the_frame_is(town):
    frame = town.drive("car1", DURATION_NS).frames["02"][0]
    assert frame.detections is frame.detections


def test_what_moves_is_at_one_place_for_all(town):
    """Two drives that begin at different times see one town: its clock is that of start_ns plus the
    stamp.
    """
    early, late = (
        town.drive("car1", DURATION_NS),
        town.drive("car2", DURATION_NS, start_ns=5 * NS_PER_S),
    )
    for drive, begin_ns in ((early, 0), (late, 5 * NS_PER_S)):
        for frame in drive.frames["02"][::20]:
            there = truth_near(
                town, frame.pose.east_m, frame.pose.north_m, 61.0, begin_ns + frame.stamp_ns
            )
            assert set(frame.truth()) <= set(there)


@pytest.mark.parametrize("times", [(0, 1, 0), (1, 0, 0), (1, 1, -1)])
def test_times_that_leave_no_frame_are_refused(town, times):
    with pytest.raises(UserError, match="town: drive of car1"):
        town.drive("car1", times[0], times[1], start_ns=times[2])
    with pytest.raises(UserError, match="town: seed: -1 is negative"):
        Town(RULES, -1)


@st.composite
def any_rules(draw) -> TownRules:
    """Towns with blocks from the shortest on, where no car has room to park."""
    speeds_mps = draw(st.tuples(st.floats(0.5, 15), st.floats(0.5, 15)))
    shortest_m = max(32.0, math.ceil(max(speeds_mps) ** 2 / 4 + 24))
    few = {
        "blocks": draw(st.tuples(st.integers(1, 4), st.integers(1, 4))),
        "block_m": draw(st.floats(shortest_m, 300)),
        "main_every": draw(st.integers(1, 5)),
        "street_half_m": 8.0,
        "speed_mps": speeds_mps[0],
        "main_speed_mps": speeds_mps[1],
        "destinations": draw(st.integers(1, 30)),
        "parked_cars_per_100m": 0.0,
    }
    slots = TownRules(**few).parking_slots
    room = 200 * slots / few["block_m"]
    return TownRules(**few | {"parked_cars_per_100m": draw(st.floats(0, min(room, 100)))})


@given(rules=any_rules(), seed=st.integers(0, 2**31))
@settings(max_examples=15)
@example(
    rules=TownRules(
        block_m=33, street_half_m=8, speed_mps=5, main_speed_mps=5, parked_cars_per_100m=0
    ),
    seed=1,
)
def test_any_town_can_be_driven_in(rules, seed):
    """And nobody drives faster than the limit of the street, or of both streets of a turn."""
    town = Town(rules, seed)
    drive = town.drive("car1", 30 * NS_PER_S)
    motions = drive.course.at(np.arange(0, 30, 0.1))
    is_straight = np.minimum(np.abs(motions.cos), np.abs(motions.sin)) < 1e-9
    leads_east = np.abs(motions.cos) > 0.5
    street = np.rint(np.where(leads_east, motions.north_m, motions.east_m) / rules.block_m)
    limits_mps = np.array([rules.limit_mps(int(number)) for number in street])
    limits_mps[~is_straight] = max(rules.speed_mps, rules.main_speed_mps)
    assert (motions.speed_mps <= limits_mps + 1e-6).all()
    for frame in drive.frames["02"][::30]:
        assert -2 <= frame.pose.east_m <= town.size_m[0] + 2
        assert -2 <= frame.pose.north_m <= town.size_m[1] + 2
        assert all(
            0 <= d.score <= 1 and d.box is None and d.placed_by == "town" for d in frame.detections
        )
        scores = [d.score for d in frame.detections]
        assert scores == sorted(scores, reverse=True)
