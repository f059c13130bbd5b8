"""Which objects of two lists are the same ones: equal class, near each other on the ground, each paired once.

Cars, trucks and buses are one class: a detector that confuses them has still found the vehicle.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from genie_sim.messages import Detection

SAME_M = 2.0  # half of what separates parked cars
_CLASSES = {"truck": "car", "bus": "car"}


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


def pairs(ours: Sequence[Placed], theirs: Sequence[Placed], reach_m: float = SAME_M) -> list[tuple[float, int, int]]:
    """Distance [m] and the two indices of each pair: greedy, nearest first, ties in the order of the lists."""
    by_class: dict[str, list[tuple[int, float, float]]] = {}
    for j, (label, east_m, north_m) in enumerate(theirs):
        by_class.setdefault(label, []).append((j, east_m, north_m))
    reach_m2, near = reach_m * reach_m, []
    for i, (label, east_m, north_m) in enumerate(ours):
        for j, there_east_m, there_north_m in by_class.get(label, ()):
            away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
            distance_m2 = away_east_m * away_east_m + away_north_m * away_north_m
            if distance_m2 <= reach_m2:
                near.append((distance_m2, i, j))
    near.sort()
    mine: set[int] = set()
    other: set[int] = set()
    found = []
    for distance_m2, i, j in near:
        if i not in mine and j not in other:
            mine.add(i)
            other.add(j)
            found.append((distance_m2**0.5, i, j))
    return found
