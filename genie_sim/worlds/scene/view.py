"""What cameras have in view, from many poses at once, as columns: what all scenes share.

A scene says what is near the cameras and where it is then (``PlacedObjects``), ``in_view`` keeps
what is in the field of view, and the scene takes out what others hide, whom the lines of sight
cross (``shares_in_rectangle``).
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from genie_sim.base.geometry import Array
from genie_sim.base.spans import Flags, Ints
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, Bits, ObjectColumns

NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
HALF_C, HALF_S = math.cos(HORIZONTAL_FOV_RAD / 2), math.sin(HORIZONTAL_FOV_RAD / 2)
SLOPE = math.tan(HORIZONTAL_FOV_RAD / 2)


class ViewPoses(NamedTuple):
    """From where [m], in which direction (cosine and sine of the heading) and when [s] a camera
    looks, as columns (slots,); ``key`` (64 bits) is each frame's own.
    """

    east_m: Array
    north_m: Array
    cos: Array
    sin: Array
    t_s: Array
    key: Bits


class PlacedObjects(NamedTuple):
    """Objects where they are when they are asked for, as columns (n,): for which of the poses or
    places that are asked about at once (``slot``), the ``row`` of the object, whether it moves at
    that instant, and where it is, east and north [m].
    """

    slot: Ints
    row: Ints
    moving: Flags
    east_m: Array
    north_m: Array


class VisibleObjects(NamedTuple):
    """All objects in view, ghosts too, slot by slot and then row by row: as ``PlacedObjects``, and
    how far away each is [m].
    """

    slot: Ints
    row: Ints
    moving: Flags
    east_m: Array
    north_m: Array
    away_m: Array

    def only(self, chosen: Flags | Ints | slice) -> VisibleObjects:
        """Some of them."""
        return VisibleObjects._make(column[chosen] for column in self)


def in_view(
    poses: ViewPoses, candidates: PlacedObjects, objects: ObjectColumns, sight_m: float
) -> VisibleObjects:
    """Of the ``candidates`` those in the field of view, neither too near nor too far (up to
    ``sight_m`` [m]), in order; what hides them is not looked at.

    ``objects`` are all that there are, of which ``candidates`` gives the rows.
    """
    slot = candidates.slot
    c, s = poses.cos[slot], poses.sin[slot]
    dx, dy = candidates.east_m - poses.east_m[slot], candidates.north_m - poses.north_m[slot]
    border_m, left_m = (dx * c + dy * s) * SLOPE, dy * c - dx * s
    away_m = np.sqrt(dx * dx + dy * dy)
    farthest_m = np.minimum(objects.reach_m[candidates.row], sight_m)
    visible = (np.abs(left_m) <= border_m) & (away_m >= NEAREST_M) & (away_m <= farthest_m)
    chosen = np.flatnonzero(visible)
    chosen = chosen[np.lexsort((candidates.row[chosen], slot[chosen]))]
    return VisibleObjects(*candidates, away_m).only(chosen)


def near_pairs(tree: cKDTree, places_m: Array, radius_m: float) -> tuple[Ints, Ints]:
    """All pairs of a place (n, 2) and a point of a tree that is within a distance [m] of it: the
    numbers of the places, in order, and of the points.
    """
    near = tree.query_ball_point(places_m, radius_m)
    place = np.repeat(np.arange(len(near)), [len(points) for points in near])
    return place, np.fromiter(itertools.chain.from_iterable(near), dtype=np.int64)


def shares_in_slab(middle_m: Array, way_m: Array, half_m: Array | float) -> tuple[Array, Array]:
    """From which share of each line (n,) to which it is between two parallel borders. Across these,
    the line goes from 0 to ``way_m`` (n,), ``middle_m`` (n,) is the borders' middle, and ``half_m``
    half their distance. A share may be below 0 or above 1: that is before or after the line.
    """
    # A line along the borders is between them all the time, or never.
    steep_m = np.where(np.abs(way_m) < 1e-9, 1e-9, way_m)
    first, last = (middle_m - half_m) / steep_m, (middle_m + half_m) / steep_m
    return np.minimum(first, last), np.maximum(first, last)


def shares_in_rectangle(
    along: tuple[Array, Array], across: tuple[Array, Array]
) -> tuple[Array, Array]:
    """From which share of each line (n,) to which, in [0, 1], it is in a rectangle, by those in the
    slab of its ends and of its sides; where it never is, the first is not less than the last.
    """
    first = np.maximum(np.maximum(along[0], across[0]), 0.0)
    return first, np.minimum(np.minimum(along[1], across[1]), 1.0)
