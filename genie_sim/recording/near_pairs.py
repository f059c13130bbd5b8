"""Which places of two long lists are near each other."""

from collections.abc import Sequence
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]


def near_pairs(
    ours: Sequence[Array], theirs: Sequence[Array], reach_m: float
) -> tuple[Array, Array, Array]:
    """Returns all pairs of one group within reach, in no order that matters: indices of both, and
    squared distances [m2].

    ``ours`` and ``theirs`` are places: whole numbers of their groups, east and north [m].

    Theirs are sorted by group and by rows of cells, and within a row from west to east, so those
    that may be near one of ours stand beside one another in each of three rows.
    """
    our_group, our_east_m, our_north_m = ours
    their_group, their_east_m, their_north_m = theirs
    if not len(our_group) or not len(their_group):
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros(0)
    side_m = reach_m * (1.0 + 1e-9)
    our_row, their_row = np.floor(our_north_m / side_m), np.floor(their_north_m / side_m)
    first_row = min(our_row.min(), their_row.min()) - 1.0
    rows = max(our_row.max(), their_row.max()) - first_row + 2.0
    west_m = min(our_east_m.min(), their_east_m.min())
    width_m = max(our_east_m.max(), their_east_m.max()) - west_m + 2.0 * reach_m + 1.0
    our_keys = (our_group * rows + our_row - first_row) * width_m + (our_east_m - west_m)
    their_keys = (their_group * rows + their_row - first_row) * width_m + (their_east_m - west_m)
    order = np.argsort(their_keys, kind="stable")
    their_keys = their_keys[order]
    our_keys = np.concatenate([our_keys - width_m, our_keys, our_keys + width_m])
    # The keys are rounded: a wider search finds all, and the distance decides.
    search_m = reach_m + 4.0 * np.spacing(max(our_keys.max(), their_keys[-1]))
    begins = np.searchsorted(their_keys, our_keys - search_m)
    counts = np.searchsorted(their_keys, our_keys + search_m, side="right") - begins
    index = np.repeat(np.arange(len(counts)), counts)
    found = order[np.arange(len(index)) + (begins - np.cumsum(counts) + counts)[index]]
    index %= len(our_group)
    east_m = their_east_m[found] - our_east_m[index]
    north_m = their_north_m[found] - our_north_m[index]
    distance_m2 = east_m * east_m + north_m * north_m
    is_near = (distance_m2 <= reach_m * reach_m) & (our_group[index] == their_group[found])
    return index[is_near], found[is_near], distance_m2[is_near]
