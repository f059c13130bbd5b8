"""What a camera in a generated town has in view, against a slow search through all objects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.base.units import NS_PER_S
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, REACHES_M
from genie_sim.worlds.scene.view import NEAREST_M
from genie_sim.worlds.town import Town, TownRules
from tests.worlds.town.town_truth import truth_near

RULES = TownRules(blocks=(5, 5))
MARGIN_M = 0.05  # objects this near to a border of the view may count either way


@pytest.fixture(scope="module")
def town() -> Town:
    return Town(RULES, seed=11)


def _clear(start: tuple[float, float], end: tuple[float, float], half_m: float) -> bool:
    """Whether no house, which fills its block up to ``half_m`` from the streets' middles, is on the
    line of sight.
    """
    way = np.linspace(start, end, 400)
    into_m = np.abs(way - np.round(way / RULES.block_m) * RULES.block_m) - half_m
    return not ((into_m > 0).all(axis=1)).any()


def _in_view(pose, location, margin_m) -> bool:
    east_m, north_m = location[0] - pose.east_m, location[1] - pose.north_m
    range_m = math.hypot(east_m, north_m)
    off = abs(math.remainder(math.atan2(north_m, east_m) - pose.heading_rad, math.tau))
    inside = off <= HORIZONTAL_FOV_RAD / 2 - margin_m / max(range_m, 0.1)
    return inside and range_m >= NEAREST_M + margin_m


def test_in_view_is_what_no_house_hides(town):
    """Truth of 600 frames, turns included: nothing that is there and visible is missing, nothing
    else is in it.
    """
    seen_count = hidden_count = 0
    for car in range(10):
        drive = town.drive(f"car{car}", 120 * NS_PER_S)
        for frame in drive.frames["02"][::20]:
            pose = frame.pose
            visible = set(frame.truth())
            for item in truth_near(
                town, pose.east_m, pose.north_m, RULES.view_m + 5, frame.stamp_ns
            ):
                reach_m = min(RULES.view_m, REACHES_M[item.label])
                range_m = math.dist(pose[:2], item.location[:2])
                sight = pose[:2], item.location[:2]
                if item in visible:
                    assert _in_view(pose, item.location, -MARGIN_M)
                    assert range_m <= reach_m
                    assert _clear(*sight, RULES.street_half_m + MARGIN_M)
                    seen_count += 1
                elif _in_view(pose, item.location, MARGIN_M) and range_m <= reach_m:
                    assert not _clear(*sight, RULES.street_half_m - MARGIN_M), (pose, item)
                    hidden_count += 1
    assert seen_count > 2000
    assert hidden_count > 200, "houses hide something"


def test_nothing_low_in_the_picture_is_in_view(town):
    """A person of 1.75 m seen from 51 m is 25 pixels high at KITTI's focal length of 721 pixels."""
    assert REACHES_M["person"] == pytest.approx(721 * 1.75 / 25, rel=0.002)
    frames = [
        f for car in range(10) for f in town.drive(f"car{car}", 60 * NS_PER_S).frames["03"][::20]
    ]
    far = [
        math.dist(f.pose[:2], item.location[:2])
        for f in frames
        for item in f.truth()
        if item.label == "bicycle"
    ]
    assert 0.8 * REACHES_M["bicycle"] < max(far) <= REACHES_M["bicycle"]
