"""The GOSPA distance between two lists of objects, by the best assignment of one to the other."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from genie_sim.base.matching import Near
from genie_sim.judge.joins import Array, Pairs

GOSPA_CUT_M = 5.0
CUT_M2 = GOSPA_CUT_M**2


def gospa_m(pairs: Pairs, row: Array, objects: Array) -> Array:
    """Returns the GOSPA distances [m] of order 2 with alpha 2 between many pairs of lists, row by
    row: the root of the squared distances of the best pairs, and of ``GOSPA_CUT_M`` squared / 2 for
    each object without one.

    ``pairs`` are those of objects within ``GOSPA_CUT_M``, row by row and nearest first; each object
    has an index of its own. ``row`` is the row of each pair, ``objects`` the number of objects in
    each row, of both lists.

    Source: A. S. Rahmathullah, A. F. Garcia-Fernandez, L. Svensson, "Generalized optimal
    sub-pattern assignment metric", FUSION 2017, Proposition 1.
    """
    gains = CUT_M2 - pairs.distance_m2
    # How many pairs our and their object of each pair are in.
    ours, theirs = (np.bincount(side)[side] for side in pairs[:2])
    is_star = np.zeros(len(row), dtype=bool)
    for side, count, others in ((pairs.ours, ours, theirs), (pairs.theirs, theirs, ours)):
        # An object whose partners have no other one is paired with the nearest of them.
        most = np.zeros(side.max(initial=-1) + 1, dtype=np.int64)
        np.maximum.at(most, side, others)
        star = most[side] == 1
        first = np.zeros(len(row), dtype=bool)
        first[np.unique(side, return_index=True)[1]] = True
        gains[star & ~first & (count > 1)] = 0.0
        is_star |= star
    others = np.flatnonzero(~is_star)
    gains[others] = 0.0
    columns = (column[others].tolist() for column in (pairs.distance_m2, pairs.ours, pairs.theirs))
    candidates = list(zip(*columns, strict=True))
    for group in _groups(candidates):
        gains[others[group[0]]] = _max_gain([candidates[place] for place in group])
    gained = np.bincount(row, weights=gains, minlength=len(objects))
    distances_m: Array = np.sqrt(np.maximum(CUT_M2 / 2 * objects - gained, 0.0))
    return distances_m


def _groups(candidates: Sequence[Near]) -> Iterable[list[int]]:
    """Groups of pairs, by their indices, that share objects with no other group."""
    parents: dict[int, int] = {}  # of ours i at i, of theirs j at ~j

    def root(end: int) -> int:
        while (above := parents.setdefault(end, end)) != end:
            end = above
        return end

    for _, i, j in candidates:
        parents[root(i)] = root(~j)
    groups: dict[int, list[int]] = {}
    for place, one in enumerate(candidates):
        groups.setdefault(root(one[1]), []).append(place)
    return groups.values()


def _max_gain(group: Sequence[Near]) -> float:
    """The most that pairing the objects of a group takes off, each paired at most once."""
    rows, columns = ({one[side]: None for one in group} for side in (1, 2))
    if len(rows) == 1 or len(columns) == 1:
        return CUT_M2 - min(distance_m2 for distance_m2, _, _ in group)
    if len(rows) > len(columns):
        rows, columns, group = columns, rows, [(one[0], one[2], one[1]) for one in group]
    row, column = (
        {index: place for place, index in enumerate(indices)} for indices in (rows, columns)
    )
    gains = [[0.0] * len(columns) for _ in rows]
    for distance_m2, i, j in group:
        gains[row[i]][column[j]] = CUT_M2 - distance_m2
    return math.fsum(gains[i][j] for i, j in enumerate(assigned(gains)))


def assigned(gains: list[list[float]]) -> list[int]:
    """The column of each row, no two alike, whose gains sum to the most; there are at least as many
    columns as rows.

    Shortest augmenting paths, as in scipy's ``linear_sum_assignment``, which takes as long to
    import as a run takes. Source: R. Jonker, A. Volgenant, Computing 38, 1987. Place 0 of the lists
    is the row that is being assigned.
    """
    places = len(gains[0]) + 1
    # prices: none pays less than it costs
    of_row, of_column = [0.0] * (len(gains) + 1), [0.0] * places
    owner = [0] * places
    for row in range(1, len(gains) + 1):
        owner[0], here = row, 0
        least, came_from, is_done = [math.inf] * places, [0] * places, [True] + [False] * places
        while owner[here]:
            i, step, following = owner[here], math.inf, 0
            for j in range(1, places):
                if is_done[j]:
                    continue
                cost = -gains[i - 1][j - 1] - of_row[i] - of_column[j]
                if cost < least[j]:
                    least[j], came_from[j] = cost, here
                if least[j] < step:
                    step, following = least[j], j
            for j in range(places):
                if is_done[j]:
                    of_row[owner[j]] += step
                    of_column[j] -= step
                else:
                    least[j] -= step
            is_done[following], here = True, following
        while here:
            owner[here] = owner[came_from[here]]
            here = came_from[here]
    found = {owner[j]: j - 1 for j in range(1, places) if owner[j]}
    return [found[row] for row in range(1, len(gains) + 1)]
