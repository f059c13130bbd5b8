"""Which objects of two long lists are near each other, and which of them match: what
``base.matching`` does object by object, in numpy for many scenes at once.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from genie_sim.base.spans import rows_of_spans

Array = np.ndarray[Any, Any]
Rows = TypeVar("Rows", bound=tuple[Array, ...])
SMALL_GROUP = 64  # places in a group that are not worth strips


class GroupedPlaces(NamedTuple):
    """Places on the ground [m], each in a group; only places of one group are compared."""

    group: Array
    east_m: Array
    north_m: Array


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


def rows_of(columns: Rows, selection: Array) -> Rows:
    """Some rows of columns (n,): those of a mask or of indices."""
    make: Callable[..., Rows] = type(columns)
    return make(*(column[selection] for column in columns))


def near(ours: GroupedPlaces, theirs: GroupedPlaces, reach_m: float) -> Pairs:
    """All pairs of one group within reach, in any order.

    Pairs of one strip of the ground that are near from west to east are looked at alone; then their
    distance decides, as in ``base.matching.near``.

    Two of ours at 0 and 5 m, three of theirs at 1, 4 and 7 m east:

    >>> group, north_m = np.zeros(3, dtype=int), np.zeros(3)
    >>> theirs = GroupedPlaces(group, np.array([1.0, 4.0, 7.0]), north_m)
    >>> near(GroupedPlaces(group[:2], np.array([0.0, 5.0]), north_m[:2]), theirs, 2.0)
    Pairs(ours=array([0, 1, 1]), theirs=array([0, 1, 2]), distance_m2=array([1., 1., 4.]))
    """
    if not len(ours.group) or not len(theirs.group):
        none = np.zeros(0, dtype=np.int64)
        return Pairs(none, none, np.zeros(0))
    our_strip, their_strip, neighbours = _strips(ours, theirs, reach_m)
    # each of ours is looked for in its own strip and in those beside it
    asked = np.tile(np.arange(len(our_strip)), len(neighbours))
    strip = our_strip[asked] + np.repeat(neighbours, len(our_strip))
    which, theirs_near = _side_by_side(
        (strip, ours.east_m[asked]), (their_strip, theirs.east_m), reach_m
    )
    ours_near = asked[which]
    east_m = theirs.east_m[theirs_near] - ours.east_m[ours_near]
    north_m = theirs.north_m[theirs_near] - ours.north_m[ours_near]
    distance_m2 = east_m * east_m + north_m * north_m
    is_near = distance_m2 <= reach_m * reach_m
    is_near &= ours.group[ours_near] == theirs.group[theirs_near]
    return rows_of(Pairs(ours_near, theirs_near, distance_m2), is_near)


def _strips(
    ours: GroupedPlaces, theirs: GroupedPlaces, reach_m: float
) -> tuple[Array, Array, tuple[float, ...]]:
    """The number of each place's strip, and in which strips the places near it are, counted from
    its own.

    A group is one strip. Where groups are large, they are cut into strips from west to east, as
    broad as the reach: what is near a place is in its own or in one of the two beside it.
    """
    if len(theirs.group) <= SMALL_GROUP * (np.ptp(theirs.group) + 1):
        return ours.group, theirs.group, (0.0,)
    breadth_m = reach_m * (1.0 + 1e-9)
    our_strip, their_strip = (np.floor(places.north_m / breadth_m) for places in (ours, theirs))
    # the first and the last strip of a group stay empty: they are beside those of other groups
    first = min(our_strip.min(), their_strip.min()) - 1.0
    strips = max(our_strip.max(), their_strip.max()) - first + 2.0
    return (
        ours.group * strips + our_strip - first,
        theirs.group * strips + their_strip - first,
        (-1.0, 0.0, 1.0),
    )


def _side_by_side(
    ours: tuple[Array, Array], theirs: tuple[Array, Array], reach_m: float
) -> tuple[Array, Array]:
    """The indices of all pairs of one strip of which one is within reach east or west of the other,
    and of a few more.

    Places are given by strip and east [m]. All strips are laid end to end, farther apart than the
    reach: on that line, those of theirs that are near one of ours follow one another.
    """
    (our_strip, our_east_m), (their_strip, their_east_m) = ours, theirs
    west_m = min(our_east_m.min(), their_east_m.min())
    length_m = max(our_east_m.max(), their_east_m.max()) - west_m + 2.0 * reach_m + 1.0
    our_at_m = our_strip * length_m + (our_east_m - west_m)
    their_at_m = their_strip * length_m + (their_east_m - west_m)
    order = np.argsort(their_at_m, kind="stable")
    their_at_m = their_at_m[order]
    # where they are on the line is rounded: a wider search finds all
    search_m = reach_m + 4.0 * np.spacing(max(our_at_m.max(), their_at_m[-1]))
    begins = np.searchsorted(their_at_m, our_at_m - search_m)
    ends = np.searchsorted(their_at_m, our_at_m + search_m, side="right")
    rows, our_index = rows_of_spans(begins, ends - begins)
    return our_index, order[rows]


def matches(pairs: Pairs) -> Pairs:
    """Those of the pairs in which each object occurs once: the nearest first, equally near ones in
    the order of ours, then of theirs (``base.matching.pairs``).

    The second of ours is nearest to the first of theirs, and leaves the other to the first of ours:

    >>> matches(Pairs(np.array([0, 0, 1]), np.array([0, 1, 0]), np.array([1.0, 4.0, 0.5])))
    Pairs(ours=array([1, 0]), theirs=array([0, 1]), distance_m2=array([0.5, 4. ]))
    """
    order = np.lexsort((pairs.theirs, pairs.ours, pairs.distance_m2))
    our_indices: set[int] = set()
    their_indices: set[int] = set()
    chosen = []
    in_order = pairs.ours[order].tolist(), pairs.theirs[order].tolist()
    for pair, i, j in zip(order.tolist(), *in_order, strict=True):
        if i not in our_indices and j not in their_indices:
            our_indices.add(i)
            their_indices.add(j)
            chosen.append(pair)
    return rows_of(pairs, np.array(chosen, dtype=np.int64))
