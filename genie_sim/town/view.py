"""What a camera has in view: of many looks at once, as columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from genie_sim.core.geometry import Array
from genie_sim.town.objects import HORIZONTAL_FOV_RAD, Things
from genie_sim.town.streets import Ints, Part, Street, Streets

NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
Bits = np.ndarray[Any, np.dtype[np.uint64]]
HALF_C, HALF_S = math.cos(HORIZONTAL_FOV_RAD / 2), math.sin(HORIZONTAL_FOV_RAD / 2)
SLOPE = math.tan(HORIZONTAL_FOV_RAD / 2)


class Looks(NamedTuple):
    """From where [m], in which direction (cosine and sine of the heading) and when [s] a camera looks; ``key`` (64
    bits) is each look's own."""

    east_m: Array
    north_m: Array
    cos: Array
    sin: Array
    t_s: Array
    key: Bits


class View(NamedTuple):
    """Everything in view of some looks, ghosts too, look by look: which look and thing, how much its number is less by
    because it has begun anew at the other end of its street, where it is and how far away [m]."""

    look: Ints
    thing: Ints
    less: Ints
    east_m: Array
    north_m: Array
    range_m: Array


class _Way(NamedTuple):
    """The streets of one direction, and of each look: where it is along and across them [m], what it may see of them,
    and on which of them it is, if on any."""

    streets: list[Street]
    along_m: Array
    across_m: Array
    low_m: Array
    high_m: Array
    number: Array
    is_on: np.ndarray[Any, np.dtype[np.bool_]]


class Eyes:
    """What any camera in a town has in view, up to ``view_m`` away."""

    def __init__(self, streets: Streets, things: Things, view_m: float) -> None:
        self._streets, self._things, self._view_m = streets, things, view_m

    def view(self, looks: Looks) -> View:
        """Of all looks together; fastest if they are near each other."""
        nothing, nowhere = np.zeros(0, np.int64), np.zeros(0)
        parts = [(nothing, nothing, nothing, nowhere, nowhere), *self._parts(looks)]
        return in_view(looks, parts, self._things, self._view_m)

    def _parts(self, looks: Looks) -> Iterator[Part]:
        """What no house hides: on the streets that a look is made from, then on those that cross them."""
        block_m, half_m = self._streets.block_m, self._streets.half_m
        x, y, view_m = looks.east_m, looks.north_m, self._view_m
        c1, s1 = looks.cos * HALF_C - looks.sin * HALF_S, looks.sin * HALF_C + looks.cos * HALF_S
        c2, s2 = looks.cos * HALF_C + looks.sin * HALF_S, looks.sin * HALF_C - looks.cos * HALF_S

        def way(
            streets: list[Street], along_m: Array, across_m: Array, ahead: Array, a: Array, b: Array
        ) -> _Way:
            least = np.where(-ahead >= HALF_C, -1.0, np.minimum(0.0, np.minimum(a, b)))
            most = np.where(ahead >= HALF_C, 1.0, np.maximum(0.0, np.maximum(a, b)))
            number = np.rint(across_m / block_m)
            is_on = (
                (np.abs(across_m - number * block_m) <= half_m)
                & (number >= 0)
                & (number < len(streets))
            )
            return _Way(
                streets,
                along_m,
                across_m,
                along_m + view_m * least,
                along_m + view_m * most,
                number,
                is_on,
            )

        east = way(self._streets.east, x, y, looks.cos, c1, c2)
        north = way(self._streets.north, y, x, looks.sin, s1, s2)
        for ours in (east, north):
            for k in np.unique(ours.number[ours.is_on]).tolist():
                rows = np.flatnonzero(ours.is_on & (ours.number == k))
                found = ours.streets[int(k)].seen(
                    ours.low_m[rows], ours.high_m[rows], looks.t_s[rows]
                )
                yield rows[found[0]], *found[1:]
        for ours, theirs in ((east, north), (north, east)):
            first, last = np.ceil(ours.low_m / block_m), np.floor(ours.high_m / block_m)
            on = np.flatnonzero(ours.is_on)
            if not len(on):
                continue
            for k in range(
                max(int(first[on].min()), 0), min(int(last[on].max()), len(theirs.streets) - 1) + 1
            ):
                street = theirs.streets[k]
                crosses = (
                    (first[on] <= k)
                    & (k <= last[on])
                    & ~(theirs.is_on[on] & (theirs.number[on] == k))
                )
                rows = on[crosses & (np.abs(street.middle_m - theirs.across_m[on]) > half_m)]
                if len(rows):
                    middle_m = ours.number[rows] * block_m
                    yield _through_gap(street, theirs, rows, looks.t_s[rows], middle_m, half_m)


def _through_gap(
    street: Street, way: _Way, rows: Ints, t_s: Array, middle_m: Array, half_m: float
) -> Part:
    """What can be seen of a crossing street past the corners of the houses.

    A look is made from a street whose middle is at ``middle_m`` along the crossing one; a line of sight must pass
    between the houses where it enters that.
    """
    along_m, across_m = way.along_m[rows], way.across_m[rows]
    to_m = np.abs(street.middle_m - across_m)
    near_m, far_m = to_m - half_m, to_m + half_m
    widest = far_m / near_m
    low_m = np.maximum(way.low_m[rows], along_m + (middle_m - half_m - along_m) * widest)
    high_m = np.minimum(way.high_m[rows], along_m + (middle_m + half_m - along_m) * widest)
    row, thing, less, east_m, north_m = street.seen(low_m, high_m, t_s)
    there_m, beyond_m = (north_m, east_m) if street.northbound else (east_m, north_m)
    entry_m = along_m[row] + (there_m - along_m[row]) * near_m[row] / np.abs(
        beyond_m - across_m[row]
    )
    clear = np.abs(entry_m - middle_m[row]) <= half_m
    return rows[row[clear]], thing[clear], less[clear], east_m[clear], north_m[clear]


def in_view(looks: Looks, parts: list[Part], things: Things, view_m: float) -> View:
    """Of the things that looks may see, those in the field of view, neither too near nor too far."""
    look, thing, less, east_m, north_m = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    c, s = looks.cos[look], looks.sin[look]
    dx, dy = east_m - looks.east_m[look], north_m - looks.north_m[look]
    reach_m, left_m = (dx * c + dy * s) * SLOPE, dy * c - dx * s
    range_m = np.sqrt(dx * dx + dy * dy)
    seen = (np.abs(left_m) <= reach_m) & (range_m >= NEAREST_M) & (range_m <= things.reach_m[thing])
    kept = np.flatnonzero(seen & (range_m <= view_m))
    kept = kept[np.argsort(look[kept], kind="stable")]
    return View(look[kept], thing[kept], less[kept], east_m[kept], north_m[kept], range_m[kept])
