"""Which objects of two lists are the same ones, and how far apart the lists are.

Cars, trucks and buses are one class: a detector that confuses them has still found the vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from genie_sim.messages import Detection

SAME_M = 2.0  # half of what separates parked cars
GOSPA_CUT_M = 5.0
_CLASSES = {"truck": "car", "bus": "car"}


Near = tuple[float, int, int]  # squared distance [m2] of a pair, and its indices in two lists


class Placed(NamedTuple):
    """An object's class, and where it is on the ground [m]."""

    label: str
    east_m: float
    north_m: float


def placed(objects: Iterable[Detection]) -> list[Placed]:
    """Those that have a place in the world."""
    return [
        Placed(_CLASSES.get(one.label, one.label), one.location[0], one.location[1])
        for one in objects
        if one.location is not None
    ]


def class_of(label: str) -> str:
    """The class under which an object of this label is compared."""
    return _CLASSES.get(label, label)


def near(ours: Sequence[Placed], theirs: Sequence[Placed], reach_m: float) -> list[Near]:
    """All pairs of one class within reach: squared distance [m2] and the two indices; nearest first, ties in the order
    of the lists."""
    by_class: dict[str, list[tuple[int, float, float]]] = {}
    for j, (label, east_m, north_m) in enumerate(theirs):
        by_class.setdefault(label, []).append((j, east_m, north_m))
    reach_m2, found = reach_m * reach_m, []
    for i, (label, east_m, north_m) in enumerate(ours):
        for j, there_east_m, there_north_m in by_class.get(label, ()):
            away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
            distance_m2 = away_east_m * away_east_m + away_north_m * away_north_m
            if distance_m2 <= reach_m2:
                found.append((distance_m2, i, j))
    found.sort()
    return found


def pairs(candidates: Sequence[Near], reach_m: float = SAME_M) -> list[Near]:
    """Those of ``near`` that are within reach and in which each object occurs once: greedy, nearest first."""
    mine: set[int] = set()
    other: set[int] = set()
    found = []
    for one in candidates:
        distance_m2, i, j = one
        if distance_m2 <= reach_m * reach_m and i not in mine and j not in other:
            mine.add(i)
            other.add(j)
            found.append(one)
    return found


def gospa_m(candidates: Sequence[Near], ours: int, theirs: int, cut_m: float = GOSPA_CUT_M) -> float:
    """The GOSPA distance [m] of order 2 with alpha 2 between so many objects, of which ``near`` gave those within
    ``cut_m``: squared distances of the best pairs, and ``cut_m`` squared / 2 for each object without one.

    Source: A. S. Rahmathullah, A. F. Garcia-Fernandez, L. Svensson, "Generalized optimal sub-pattern assignment
    metric", FUSION 2017, Proposition 1.
    """
    cut_m2 = cut_m * cut_m
    rows, columns = ({one[side] for one in candidates} for side in (1, 2))
    if len(rows) == len(candidates) == len(columns):
        gained = sum(cut_m2 - distance_m2 for distance_m2, _, _ in candidates)
    else:
        gained = sum(_most_gained(group, cut_m2) for group in _connected(candidates))
    return math.sqrt(max(cut_m2 / 2 * (ours + theirs) - gained, 0.0))


def _connected(candidates: Sequence[Near]) -> Iterable[list[Near]]:
    """Groups of pairs that share objects with no other group."""
    parents: dict[int, int] = {}  # of ours i at i, of theirs j at ~j

    def root(end: int) -> int:
        while (above := parents.setdefault(end, end)) != end:
            end = above
        return end

    for _, i, j in candidates:
        parents[root(i)] = root(~j)
    groups: dict[int, list[Near]] = {}
    for one in candidates:
        groups.setdefault(root(one[1]), []).append(one)
    return groups.values()


def _most_gained(group: Sequence[Near], cut_m2: float) -> float:
    """The most that pairing the objects of a group takes off, each paired at most once."""
    rows, columns = ({one[side]: None for one in group} for side in (1, 2))
    if len(rows) == 1 or len(columns) == 1:
        return cut_m2 - min(distance_m2 for distance_m2, _, _ in group)
    from scipy.optimize import linear_sum_assignment

    row, column = ({index: place for place, index in enumerate(indices)} for indices in (rows, columns))
    gains = [[0.0] * len(columns) for _ in rows]
    for distance_m2, i, j in group:
        gains[row[i]][column[j]] = cut_m2 - distance_m2
    return math.fsum(gains[i][j] for i, j in zip(*linear_sum_assignment(gains, maximize=True), strict=True))
