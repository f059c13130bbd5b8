"""Pairs of places that are near each other, against a look at all of them."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.judge import joins
from genie_sim.judge.joins import GroupedPlaces, near

Place = tuple[int, float, float]

# many at one place, on the border of a cell, exactly within reach and just beyond it
lengths_m = st.integers(-6, 6).map(float) | st.floats(-300.0, 300.0)
places = st.lists(st.tuples(st.integers(0, 2), lengths_m, lengths_m), max_size=30)


def columns(of: list[Place]) -> GroupedPlaces:
    groups = np.array([group for group, _, _ in of], dtype=np.int64)
    return GroupedPlaces(groups, *np.array([at for _, *at in of], dtype=float).reshape(-1, 2).T)


@given(places, places, st.sampled_from([0.5, 1.0, 2.0, 7.3]), st.sampled_from([0, 64]))
def test_all_pairs_of_a_group_within_reach_are_found_once(
    ours: list[Place], theirs: list[Place], reach_m: float, small_group: int
):
    expected = {}
    for i, (our_group, our_east_m, our_north_m) in enumerate(ours):
        for j, (their_group, their_east_m, their_north_m) in enumerate(theirs):
            east_m, north_m = their_east_m - our_east_m, their_north_m - our_north_m
            distance_m2 = east_m * east_m + north_m * north_m
            if our_group == their_group and distance_m2 <= reach_m * reach_m:
                expected[i, j] = distance_m2
    with mock.patch.object(joins, "SMALL_GROUP", small_group):
        pairs = near(columns(ours), columns(theirs), reach_m)
    found = [column.tolist() for column in pairs]
    assert len(found[0]) == len(expected)
    assert dict(zip(zip(*found[:2], strict=True), found[2], strict=True)) == expected


@pytest.mark.parametrize("away_m", [0.0, 1e6, -1e6])
def test_a_large_crowd_far_away(away_m: float):
    """Two thousand places in a square; each has itself and the next in its row within a metre."""
    side = np.arange(45.0)
    east_m, north_m = (axis.ravel() for axis in np.meshgrid(side + away_m, 3.0 * side))
    crowd = GroupedPlaces(np.zeros(len(east_m), dtype=np.int64), east_m, north_m)
    ours, theirs, distance_m2 = near(crowd, crowd, 1.0)
    assert len(ours) == 45 * (45 + 2 * 44)
    assert (distance_m2 == (ours != theirs)).all()
