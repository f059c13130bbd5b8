"""Which objects of two lists are the same ones.

Cars, trucks and buses are one class: a detector that confuses them has still found the vehicle.
"""

from collections.abc import Iterable, Sequence

from genie_sim.messages import Detection

SAME_M = 2.0  # half of what separates parked cars
_CLASSES = {"truck": "car", "bus": "car"}


Near = tuple[float, int, int]  # squared distance [m2] of a pair, and its indices in two lists


Placed = tuple[
    str, float, float
]  # an object's class, and where it is on the ground, east and north [m]


def class_of(label: str) -> str:
    """The class under which an object of this label is compared."""
    return _CLASSES.get(label, label)


def placed(objects: Iterable[Detection]) -> list[Placed]:
    """Those that have a place in the world."""
    return [
        (_CLASSES.get(one.label, one.label), *one.location[:2])
        for one in objects
        if one.location is not None
    ]


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


def f1(ours: Sequence[Placed], theirs: Sequence[Placed]) -> float:
    """F1 of the objects of two lists that are the same; 1 for two empty lists."""
    total = len(ours) + len(theirs)
    return 2 * len(pairs(near(ours, theirs, SAME_M))) / total if total else 1.0
