"""Which objects of two long lists are near each other, and which of them make pairs, in numpy."""

from typing import Any, NamedTuple

import numpy as np

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


def repeated(begins: Array, counts: Array) -> tuple[Array, Array]:
    """Returns the numbers of ranges and, beside each, the index of its range: ``counts[i]`` numbers
    from ``begins[i]`` on.
    """
    index = np.repeat(np.arange(len(counts)), counts)
    skipped = np.cumsum(counts) - counts
    return np.arange(len(index)) - skipped[index] + begins[index], index


def near(ours: GroupedPlaces, theirs: GroupedPlaces, reach_m: float) -> Pairs:
    """All pairs of one group within reach, in no order that matters.

    Theirs are sorted by group and then from west to east, so those that may be near one of ours
    stand beside one another.
    """
    if not len(ours.group) or not len(theirs.group):
        none = np.zeros(0, dtype=np.int64)
        return Pairs(none, none, np.zeros(0))
    west_m = min(ours.east_m.min(), theirs.east_m.min())
    width_m = max(ours.east_m.max(), theirs.east_m.max()) - west_m + 2.0 * reach_m + 1.0
    our_keys = ours.group * width_m + (ours.east_m - west_m)
    their_keys = theirs.group * width_m + (theirs.east_m - west_m)
    order = np.argsort(their_keys, kind="stable")
    their_keys = their_keys[order]
    # The keys are rounded: a wider search finds all, and the distance decides.
    search_m = reach_m + 4.0 * np.spacing(max(our_keys.max(), their_keys[-1]))
    begins = np.searchsorted(their_keys, our_keys - search_m)
    ends = np.searchsorted(their_keys, our_keys + search_m, side="right")
    places, index = repeated(begins, ends - begins)
    found = order[places]
    east_m = theirs.east_m[found] - ours.east_m[index]
    north_m = theirs.north_m[found] - ours.north_m[index]
    distance_m2 = east_m * east_m + north_m * north_m
    selection = (distance_m2 <= reach_m * reach_m) & (ours.group[index] == theirs.group[found])
    return Pairs(index, found, distance_m2).rows(selection)


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
