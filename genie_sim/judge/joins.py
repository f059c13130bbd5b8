"""Which objects of two long lists are near each other, and which of them make pairs, in numpy."""

from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.spans import rows_of_spans

Array = np.ndarray[Any, Any]
SMALL_GROUP = 64  # places in a group that are not worth rows


class GroupedPlaces(NamedTuple):
    """Places on the ground [m], each in a group; only places of one group are compared."""

    group: Array
    east_m: Array
    north_m: Array

    def rows(self, selection: Array) -> "GroupedPlaces":
        """Those of a mask or of indices."""
        return GroupedPlaces(*(column[selection] for column in self))


def pair_codes(first: Array, second: Array, count: int) -> Array:
    """One number for each pair (n,) of a ``first`` and a ``second``, which is below ``count``:
    pairs are equal if their numbers are, and numbers sort as pairs do. ``np.divmod`` by ``count``
    gives the pair back.
    """
    codes: Array = first * count + second
    return codes


class Pairs(NamedTuple):
    """Pairs out of two lists: their indices, and the squared distance [m2] of each."""

    ours: Array
    theirs: Array
    distance_m2: Array

    def rows(self, selection: Array) -> "Pairs":
        """Those of a mask or of indices."""
        return Pairs(*(column[selection] for column in self))


def near(ours: GroupedPlaces, theirs: GroupedPlaces, reach_m: float) -> Pairs:
    """All pairs of one group within reach, in no order that matters.

    Theirs are sorted by group and from west to east, so those that may be near one of ours stand
    beside one another. Large groups are cut into rows, of which three are searched.
    """
    our_group, our_east_m, our_north_m = ours
    their_group, their_east_m, their_north_m = theirs
    if not len(our_group) or not len(their_group):
        none = np.zeros(0, dtype=np.int64)
        return Pairs(none, none, np.zeros(0))
    our_line, their_line = our_group, their_group
    lines: tuple[float, ...] = (0.0,)
    if len(their_group) > SMALL_GROUP * (np.ptp(their_group) + 1):
        side_m = reach_m * (1.0 + 1e-9)
        our_row, their_row = np.floor(our_north_m / side_m), np.floor(their_north_m / side_m)
        first_row = min(our_row.min(), their_row.min()) - 1.0
        rows = max(our_row.max(), their_row.max()) - first_row + 2.0
        our_line = our_group * rows + our_row - first_row
        their_line = their_group * rows + their_row - first_row
        lines = (-1.0, 0.0, 1.0)
    west_m = min(our_east_m.min(), their_east_m.min())
    width_m = max(our_east_m.max(), their_east_m.max()) - west_m + 2.0 * reach_m + 1.0
    our_keys = our_line * width_m + (our_east_m - west_m)
    their_keys = their_line * width_m + (their_east_m - west_m)
    order = np.argsort(their_keys, kind="stable")
    their_keys = their_keys[order]
    our_keys = np.concatenate([our_keys + line * width_m for line in lines])
    # The keys are rounded: a wider search finds all, and the distance decides.
    search_m = reach_m + 4.0 * np.spacing(max(our_keys.max(), their_keys[-1]))
    begins = np.searchsorted(their_keys, our_keys - search_m)
    counts = np.searchsorted(their_keys, our_keys + search_m, side="right") - begins
    rows, index = rows_of_spans(begins, counts)
    found = order[rows]
    if len(lines) > 1:
        index %= len(our_group)
    east_m = their_east_m[found] - our_east_m[index]
    north_m = their_north_m[found] - our_north_m[index]
    distance_m2 = east_m * east_m + north_m * north_m
    is_near = (distance_m2 <= reach_m * reach_m) & (our_group[index] == their_group[found])
    return Pairs(index[is_near], found[is_near], distance_m2[is_near])


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
