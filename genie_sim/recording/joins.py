"""Which objects of two long lists are near each other, and which of them make pairs, in numpy."""

from typing import Any, NamedTuple

import numpy as np

from genie_sim.recording.near_pairs import near_pairs

Array = np.ndarray[Any, Any]


class GroupedPlaces(NamedTuple):
    """Places on the ground [m], each in a group; only places of one group are compared."""

    group: Array
    east_m: Array
    north_m: Array

    def rows(self, selection: Array) -> "GroupedPlaces":
        """Those of a mask or of indices."""
        return GroupedPlaces(*(column[selection] for column in self))


class Pairs(NamedTuple):
    """Pairs out of two lists: their indices, and the squared distance [m2] of each."""

    ours: Array
    theirs: Array
    distance_m2: Array

    def rows(self, selection: Array) -> "Pairs":
        """Those of a mask or of indices."""
        return Pairs(*(column[selection] for column in self))


def near(ours: GroupedPlaces, theirs: GroupedPlaces, reach_m: float) -> Pairs:
    """All pairs of one group within reach, in no order that matters."""
    return Pairs(*near_pairs(ours, theirs, reach_m))


def turns(codes: Array) -> Array:
    """Returns how often each code has been there before."""
    order = np.argsort(codes, kind="stable")
    in_order = codes[order]
    result = np.empty(len(codes), dtype=np.int64)
    result[order] = np.arange(len(codes)) - np.searchsorted(in_order, in_order)
    return result


def matches(pairs: Pairs) -> Array:
    """The indices of those pairs in which each object occurs once: greedy, in their order.

    A pair that comes first of both its objects is one of them; pairs that share an object with it
    are not. What remains is looked at in the same way.
    """
    left = np.arange(len(pairs.ours))
    first = [np.zeros(side.max(initial=-1) + 1, dtype=np.int64) for side in pairs[:2]]
    chosen = []
    while len(left):
        sides = [side[left] for side in pairs[:2]]
        for place, side in zip(first, sides, strict=True):
            place[side[::-1]] = left[::-1]  # of equal indices the last counts: the first pair
        is_first = [place[side] == left for place, side in zip(first, sides, strict=True)]
        best = left[is_first[0] & is_first[1]]
        chosen.append(best)
        taken = [np.zeros(len(place), dtype=bool) for place in first]
        for is_taken, side in zip(taken, pairs[:2], strict=True):
            is_taken[side[best]] = True
        left = left[~(taken[0][sides[0]] | taken[1][sides[1]])]
    return np.sort(np.concatenate(chosen)) if chosen else left
