"""What cameras have in view, from many poses at once, as columns: what all scenes share."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from genie_sim.base.geometry import Array
from genie_sim.base.spans import Ints
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, Bits, Flags, ObjectColumns

NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
HALF_C, HALF_S = math.cos(HORIZONTAL_FOV_RAD / 2), math.sin(HORIZONTAL_FOV_RAD / 2)
SLOPE = math.tan(HORIZONTAL_FOV_RAD / 2)


class ViewPoses(NamedTuple):
    """From where [m], in which direction (cosine and sine of the heading) and when [s] a camera
    looks, as columns; ``key`` (64 bits) is each pose's own.
    """

    east_m: Array
    north_m: Array
    cos: Array
    sin: Array
    t_s: Array
    key: Bits


class PlacedObjects(NamedTuple):
    """Objects that may be seen: from which pose, the row of the object, whether it moves then, and
    where it is, east and north [m].
    """

    pose: Ints
    row: Ints
    moving: Flags
    east_m: Array
    north_m: Array


class VisibleObjects(NamedTuple):
    """All objects in view from some poses, ghosts too, pose by pose: as ``PlacedObjects``, and how
    far away each is [m].
    """

    pose: Ints
    row: Ints
    moving: Flags
    east_m: Array
    north_m: Array
    range_m: Array


def in_view(
    poses: ViewPoses, candidates: PlacedObjects, objects: ObjectColumns, view_m: float
) -> VisibleObjects:
    """Of the ``candidates`` those in the field of view, neither too near nor too far (up to
    ``view_m`` [m]), pose by pose and then row by row; what hides them is not looked at.

    ``objects`` are all that there are, of which ``candidates`` gives the rows.
    """
    pose = candidates.pose
    c, s = poses.cos[pose], poses.sin[pose]
    dx, dy = candidates.east_m - poses.east_m[pose], candidates.north_m - poses.north_m[pose]
    border_m, left_m = (dx * c + dy * s) * SLOPE, dy * c - dx * s
    range_m = np.sqrt(dx * dx + dy * dy)
    farthest_m = np.minimum(objects.reach_m[candidates.row], view_m)
    visible = (np.abs(left_m) <= border_m) & (range_m >= NEAREST_M) & (range_m <= farthest_m)
    chosen = np.flatnonzero(visible)
    chosen = chosen[np.lexsort((candidates.row[chosen], pose[chosen]))]
    return VisibleObjects._make(column[chosen] for column in (*candidates, range_m))


def near_pairs(tree: cKDTree, places_m: Array, radius_m: float) -> tuple[Ints, Ints]:
    """All pairs of a place (n, 2) and a point of a tree that is within a distance [m] of it: the
    numbers of the places, in order, and of the points.
    """
    near = tree.query_ball_point(places_m, radius_m)
    place = np.repeat(np.arange(len(near)), [len(points) for points in near])
    return place, np.fromiter(itertools.chain.from_iterable(near), dtype=np.int64)


def between(middle_m: Array, way_m: Array, half_m: Array | float) -> tuple[Array, Array]:
    """From which share of a line to which it is between two parallel borders: ``middle_m`` is their
    middle and ``half_m`` half their distance; the line begins at 0 and ends at ``way_m``.
    """
    # A line along the borders is between them all the time, or never.
    steep_m = np.where(np.abs(way_m) < 1e-9, 1e-9, way_m)
    first, last = (middle_m - half_m) / steep_m, (middle_m + half_m) / steep_m
    return np.minimum(first, last), np.maximum(first, last)


def inside(along: tuple[Array, Array], across: tuple[Array, Array]) -> tuple[Array, Array]:
    """From which share of a line to which it is in a rectangle, by those ``between`` its ends and
    its sides; where it never is, the first is not less than the last.
    """
    first = np.maximum(np.maximum(along[0], across[0]), 0.0)
    return first, np.minimum(np.minimum(along[1], across[1]), 1.0)
