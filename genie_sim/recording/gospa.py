"""The GOSPA distance between two lists of objects, by the best assignment of one to the other."""

import math
from collections.abc import Iterable, Sequence

from genie_sim.core.matching import Near

GOSPA_CUT_M = 5.0


def gospa_m(
    candidates: Sequence[Near], ours: int, theirs: int, cut_m: float = GOSPA_CUT_M
) -> float:
    """Returns the GOSPA distance [m] of order 2 with alpha 2: the root of the squared distances of
    the best pairs, and of ``cut_m`` squared / 2 for each object without one.

    ``ours`` and ``theirs`` are the numbers of objects, ``candidates`` the pairs of them within
    ``cut_m`` as ``core.matching.near`` lists them.

    Source: A. S. Rahmathullah, A. F. Garcia-Fernandez, L. Svensson, "Generalized optimal
    sub-pattern assignment metric", FUSION 2017, Proposition 1.
    """
    cut_m2 = cut_m * cut_m
    rows, columns = ({one[side] for one in candidates} for side in (1, 2))
    if len(rows) == len(candidates) == len(columns):
        gained = sum(cut_m2 - distance_m2 for distance_m2, _, _ in candidates)
    else:
        gained = sum(_max_gain(group, cut_m2) for group in _groups(candidates))
    return math.sqrt(max(cut_m2 / 2 * (ours + theirs) - gained, 0.0))


def _groups(candidates: Sequence[Near]) -> Iterable[list[Near]]:
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


def _max_gain(group: Sequence[Near], cut_m2: float) -> float:
    """The most that pairing the objects of a group takes off, each paired at most once."""
    rows, columns = ({one[side]: None for one in group} for side in (1, 2))
    if len(rows) == 1 or len(columns) == 1:
        return cut_m2 - min(distance_m2 for distance_m2, _, _ in group)
    if len(rows) > len(columns):
        rows, columns, group = columns, rows, [(one[0], one[2], one[1]) for one in group]
    row, column = (
        {index: place for place, index in enumerate(indices)} for indices in (rows, columns)
    )
    gains = [[0.0] * len(columns) for _ in rows]
    for distance_m2, i, j in group:
        gains[row[i]][column[j]] = cut_m2 - distance_m2
    return math.fsum(gains[i][j] for i, j in enumerate(assigned(gains)))


def assigned(gains: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row, no two alike, whose gains sum to the most; there are at least as many
    columns as rows.

    Shortest augmenting paths, as in scipy's ``linear_sum_assignment``, which takes as long to
    import as a run takes. Source: R. Jonker, A. Volgenant, Computing 38, 1987. Place 0 of the lists
    is the row that is being assigned.
    """
    columns = range(1, len(gains[0]) + 1)
    # prices: none pays less than it costs
    of_row, of_column = [0.0] * (len(gains) + 1), [0.0] * (len(columns) + 1)
    owner = [0] * (len(columns) + 1)
    for row in range(1, len(gains) + 1):
        owner[0], here = row, 0
        least, came_from, done = [math.inf] * (len(columns) + 1), [0] * (len(columns) + 1), {0}
        while owner[here]:
            i = owner[here]
            for j in columns:
                cost = -gains[i - 1][j - 1] - of_row[i] - of_column[j]
                if j not in done and cost < least[j]:
                    least[j], came_from[j] = cost, here
            here = min((j for j in columns if j not in done), key=least.__getitem__)
            step = least[here]
            for j in (0, *columns):
                if j in done:
                    of_row[owner[j]] += step
                    of_column[j] -= step
                else:
                    least[j] -= step
            done.add(here)
        while here:
            owner[here] = owner[came_from[here]]
            here = came_from[here]
    found = {owner[j]: j - 1 for j in columns if owner[j]}
    return [found[row] for row in range(1, len(gains) + 1)]
