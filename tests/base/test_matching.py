"""Which objects of two lists are the same ones, against a search through all pairs."""

from __future__ import annotations

import math
import random

import pytest

from genie_sim.base.matching import SAME_M, f1, near, pairs, placed
from genie_sim.core.messages import Detection


def scene(seed: int, count: int) -> list[tuple[str, float, float]]:
    source = random.Random(seed)
    return [
        (source.choice(("car", "person")), source.uniform(0, 12), source.uniform(0, 12))
        for _ in range(count)
    ]


@pytest.mark.parametrize("seed", range(5))
def test_all_pairs_of_a_class_within_reach_nearest_first(seed: int):
    ours, theirs = scene(seed, 12), scene(seed + 100, 15)
    expected = sorted(
        (math.dist(a[1:], b[1:]), i, j)
        for i, a in enumerate(ours)
        for j, b in enumerate(theirs)
        if a[0] == b[0] and math.dist(a[1:], b[1:]) <= 3.0
    )
    candidates = near(ours, theirs, 3.0)
    assert [(i, j) for _, i, j in candidates] == [(i, j) for _, i, j in expected]
    assert [math.sqrt(distance_m2) for distance_m2, _, _ in candidates] == pytest.approx(
        [distance_m for distance_m, _, _ in expected]
    )


@pytest.mark.parametrize("seed", range(5))
def test_each_object_has_one_partner_and_no_nearer_pair_is_left(seed: int):
    ours, theirs = scene(seed, 12), scene(seed + 100, 15)
    candidates = near(ours, theirs, SAME_M)
    matches = pairs(candidates)
    for side in (1, 2):
        indices = [match[side] for match in matches]
        assert len(indices) == len(set(indices))
    for distance_m2, i, j in candidates:
        rivals = [match for match in matches if match[1] == i or match[2] == j]
        assert rivals and min(rivals)[0] <= distance_m2


def test_reach_is_included_and_may_be_shorter_than_that_of_the_candidates():
    ours, theirs = [("car", 0.0, 0.0)], [("car", 0.0, SAME_M), ("car", 3.0, 0.0)]
    assert near(ours, theirs, SAME_M) == [(SAME_M**2, 0, 0)]
    assert pairs(near(ours, theirs, 5.0)) == [(SAME_M**2, 0, 0)]
    assert pairs(near(ours, theirs, 5.0), reach_m=SAME_M - 0.01) == []


def test_vehicles_are_one_class_and_what_has_no_place_is_left_out():
    detections = [
        Detection(label, 0.5, None, location, 0.5)
        for label, location in (
            ("truck", (1.0, 2.0, 0.5)),
            ("bus", (3.0, 4.0, 0.5)),
            ("person", (5.0, 6.0, 0.5)),
            ("car", None),
        )
    ]
    expected = [("car", 1.0, 2.0), ("car", 3.0, 4.0), ("person", 5.0, 6.0)]
    assert placed(detections) == expected


def test_f1_counts_partners_of_both_lists():
    ours = [("car", 0.0, 0.0), ("car", 10.0, 0.0), ("person", 0.0, 0.0)]
    theirs = [("car", 0.5, 0.0), ("car", 30.0, 0.0)]
    assert f1(ours, theirs) == pytest.approx(2 / 5)
    assert f1([], []) == 1.0
    assert f1(ours, []) == 0.0
