"""Which objects of two lists are the same ones.

Cars, trucks and buses are one class: a detector that confuses them has still found the vehicle.
"""

from collections.abc import Iterable, Sequence
from typing import Protocol

from genie_sim.base.classes import class_of

SAME_M = 2.0  # half of what separates parked cars

Near = tuple[float, int, int]  # squared distance [m2] of a pair, and its indices in two lists
# an object's class, and where it is on the ground, east and north [m]
Placed = tuple[str, float, float]


class Labelled(Protocol):
    """An object of a class, such as a detection; ``location``: east, north and up [m], if known."""

    @property
    def label(self) -> str: ...

    @property
    def location(self) -> tuple[float, float, float] | None: ...


def placed(objects: Iterable[Labelled]) -> list[Placed]:
    """Those that have a place in the world."""
    return [
        (class_of(item.label), *item.location[:2]) for item in objects if item.location is not None
    ]


def near(ours: Sequence[Placed], theirs: Sequence[Placed], reach_m: float) -> list[Near]:
    """All pairs of one class within reach: squared distance [m2] and the two indices; nearest
    first, ties in the order of the lists.
    """
    by_class: dict[str, list[tuple[int, float, float]]] = {}
    for j, (label, east_m, north_m) in enumerate(theirs):
        by_class.setdefault(label, []).append((j, east_m, north_m))
    reach2_m2 = reach_m * reach_m
    candidates = []
    for i, (label, east_m, north_m) in enumerate(ours):
        for j, there_east_m, there_north_m in by_class.get(label, ()):
            away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
            distance2_m2 = away_east_m * away_east_m + away_north_m * away_north_m
            if distance2_m2 <= reach2_m2:
                candidates.append((distance2_m2, i, j))
    candidates.sort()
    return candidates


def pairs(candidates: Sequence[Near], reach_m: float = SAME_M) -> list[Near]:
    """Those of ``near`` that are within reach and in which each object occurs once: greedy, nearest
    first.
    """
    our_indices: set[int] = set()
    their_indices: set[int] = set()
    matches = []
    for candidate in candidates:
        distance2_m2, i, j = candidate
        if distance2_m2 <= reach_m * reach_m and i not in our_indices and j not in their_indices:
            our_indices.add(i)
            their_indices.add(j)
            matches.append(candidate)
    return matches


def f1(ours: Sequence[Placed], theirs: Sequence[Placed]) -> float:
    """F1 between two object lists; 1 for two empty lists."""
    total = len(ours) + len(theirs)
    return 2 * len(pairs(near(ours, theirs, SAME_M))) / total if total else 1.0
