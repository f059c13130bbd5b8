"""A generated town: the same for the same rules and seed, and fit to drive in for all rules. What
every scene keeps stands in ``tests.conformance.scenes``.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_S
from genie_sim.worlds.town import Town, TownRules
from genie_sim.worlds.town.routes import LEFT_MPS
from genie_sim.worlds.town.rules import LANE_M


def test_a_seed_makes_the_town_that_it_has_always_made():
    """Pinned, so that no renaming makes other towns of the seeds that published results name."""
    frame = Town(TownRules(blocks=(6, 6)), seed=1).drive("car1", 60 * NS_PER_S).frames["02"][100]
    assert (len(frame.truth()), len(frame.detections)) == (7, 5)
    assert (frame.detections[0].label, frame.detections[0].score) == ("car", 0.8211)


@pytest.mark.parametrize("times", [(0, 1, 0), (1, 0, 0), (1, 1, -1)])
def test_times_that_leave_no_frame_are_refused(times):
    with pytest.raises(UserError, match="town: drive of car1"):
        Town(TownRules(), 1).drive("car1", times[0], times[1], start_ns=times[2])
    with pytest.raises(UserError, match="town: seed: -1 is negative"):
        Town(TownRules(), -1)


@st.composite
def any_rules(draw) -> TownRules:
    """Towns with blocks from the shortest on, where no car has room to park, and with cars that are
    slow or quick to start and to stop.
    """
    speeds_mps = draw(st.tuples(st.floats(0.5, 25), st.floats(0.5, 25)))
    braking_mps2 = draw(st.floats(1.5, 6))
    shortest_m = max(32.0, math.ceil(max(speeds_mps) ** 2 / (2 * braking_mps2) + 24))
    few = {
        "blocks": draw(st.tuples(st.integers(1, 4), st.integers(1, 4))),
        "block_m": draw(st.floats(shortest_m, 300)),
        "main_every": draw(st.integers(1, 5)),
        "street_half_m": 8.0,
        "speed_mps": speeds_mps[0],
        "main_speed_mps": speeds_mps[1],
        "acceleration_mps2": draw(st.floats(0.1, 6)),
        "braking_mps2": braking_mps2,
        "destinations": draw(st.integers(1, 30)),
        "parked_cars_per_100m": 0.0,
    }
    bays = TownRules(**few).parking_bays
    room = 200 * bays / few["block_m"]
    return TownRules(**few | {"parked_cars_per_100m": draw(st.floats(0, min(room, 100)))})


@given(rules=any_rules(), seed=st.integers(0, 2**31))
@settings(max_examples=15)
@example(
    rules=TownRules(
        block_m=33, street_half_m=8, speed_mps=5, main_speed_mps=5, parked_cars_per_100m=0
    ),
    seed=1,
)
@example(rules=TownRules(acceleration_mps2=0.3), seed=3)  # no leg is long enough for the limit
def test_any_town_can_be_driven_in(rules, seed):
    """In the middle of the right-hand lane, no faster than the limit of the street or than is right
    in a turn. Nobody leaps: who does not turn goes as far as his speeds say.
    """
    town, step_s = Town(rules, seed), 0.1
    drive = town.drive("car1", 120 * NS_PER_S)
    motions = drive.course.at(np.arange(0, 120, step_s))
    is_straight = np.minimum(np.abs(motions.cos), np.abs(motions.sin)) < 1e-9
    leads_east = np.abs(motions.cos) > 0.5
    street = np.rint(np.where(leads_east, motions.north_m, motions.east_m) / rules.block_m)
    limits_mps = np.array([rules.limit_mps(int(number)) for number in street])
    limits_mps[~is_straight] = LEFT_MPS
    assert (motions.speed_mps <= limits_mps + 1e-6).all()
    across_m = np.where(leads_east, motions.north_m, motions.east_m) - street * rules.block_m
    right = np.sign(np.where(leads_east, -motions.cos, motions.sin))
    assert np.allclose((across_m * right)[is_straight], LANE_M)
    way_m = np.hypot(np.diff(motions.east_m), np.diff(motions.north_m))
    speeds_mps = motions.speed_mps[:-1], motions.speed_mps[1:]
    change_mps = step_s * max(rules.acceleration_mps2, rules.braking_mps2)
    assert (way_m <= (np.maximum(*speeds_mps) + change_mps) * step_s + 1e-6).all()
    goes_on = is_straight[:-1] & is_straight[1:] & (np.diff(motions.heading_rad) == 0)
    least_m = (np.minimum(*speeds_mps) - change_mps) * step_s - 1e-6
    assert (way_m >= least_m)[goes_on].all()
    for frame in drive.frames["02"][::30]:
        assert -2 <= frame.pose.east_m <= town.size_m[0] + 2
        assert -2 <= frame.pose.north_m <= town.size_m[1] + 2
