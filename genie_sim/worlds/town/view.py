"""What a camera has in view: from many poses at once, as columns."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.worlds.town.objects import HORIZONTAL_FOV_RAD, ObjectColumns
from genie_sim.worlds.town.streets import NO_OBJECTS, Ints, Street, StreetObjects, Streets

NEAREST_M = 3.5  # KITTI's nearest labelled object is 3 m away: nearer ones leave the picture
Bits = np.ndarray[Any, np.dtype[np.uint64]]
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


class VisibleObjects(NamedTuple):
    """All objects in view from some poses, ghosts too, pose by pose.

    Rows of the pose and of the object, how much the object's number is lower because it has begun
    anew at the other end of its street, where it is and how far away [m].
    """

    pose: Ints
    row: Ints
    number_offset: Ints
    east_m: Array
    north_m: Array
    range_m: Array


class _StreetSpans(NamedTuple):
    """The streets of one direction, and of each pose: where it is along and across them [m], what
    may be seen of them from it, and on which of them it is, if on any.
    """

    streets: list[Street]
    along_m: Array
    across_m: Array
    low_m: Array
    high_m: Array
    number: Array
    is_on: np.ndarray[Any, np.dtype[np.bool_]]


class Visibility:
    """What any camera in a town has in view, up to ``view_m`` away."""

    def __init__(self, streets: Streets, objects: ObjectColumns, view_m: float) -> None:
        self._streets, self._objects, self._view_m = streets, objects, view_m

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        """Of all poses together; fastest if they are near each other."""
        parts = [NO_OBJECTS, *self._unhidden(poses)]
        return in_view(poses, parts, self._objects, self._view_m)

    def _unhidden(self, poses: ViewPoses) -> Iterator[StreetObjects]:
        """What no house hides on the streets that a camera is on, then on those that cross them."""
        block_m, half_m = self._streets.block_m, self._streets.half_m
        # The borders of the field of view, left and right, as directions.
        left_cos = poses.cos * HALF_C - poses.sin * HALF_S
        left_sin = poses.sin * HALF_C + poses.cos * HALF_S
        right_cos = poses.cos * HALF_C + poses.sin * HALF_S
        right_sin = poses.sin * HALF_C - poses.cos * HALF_S

        def direction(
            streets: list[Street],
            along_m: Array,
            across_m: Array,
            *,
            ahead: Array,
            borders: tuple[Array, Array],
        ) -> _StreetSpans:
            """``ahead`` and ``borders`` are parts of directions along the streets, from -1 to 1."""
            lowest = np.where(-ahead >= HALF_C, -1.0, np.minimum(0.0, np.minimum(*borders)))
            highest = np.where(ahead >= HALF_C, 1.0, np.maximum(0.0, np.maximum(*borders)))
            number = np.rint(across_m / block_m)
            on_street = np.abs(across_m - number * block_m) <= half_m
            return _StreetSpans(
                streets=streets,
                along_m=along_m,
                across_m=across_m,
                low_m=along_m + self._view_m * lowest,
                high_m=along_m + self._view_m * highest,
                number=number,
                is_on=on_street & (number >= 0) & (number < len(streets)),
            )

        east = direction(
            self._streets.east,
            poses.east_m,
            poses.north_m,
            ahead=poses.cos,
            borders=(left_cos, right_cos),
        )
        north = direction(
            self._streets.north,
            poses.north_m,
            poses.east_m,
            ahead=poses.sin,
            borders=(left_sin, right_sin),
        )
        for own in (east, north):
            for k in np.unique(own.number[own.is_on]).tolist():
                rows = np.flatnonzero(own.is_on & (own.number == k))
                yield (
                    own.streets[int(k)]
                    .seen(own.low_m[rows], own.high_m[rows], poses.t_s[rows])
                    .of_poses(rows)
                )
        for own, other in ((east, north), (north, east)):
            first, last = np.ceil(own.low_m / block_m), np.floor(own.high_m / block_m)
            on = np.flatnonzero(own.is_on)
            if not len(on):
                continue
            lowest = max(int(first[on].min()), 0)
            highest = min(int(last[on].max()), len(other.streets) - 1)
            for k in range(lowest, highest + 1):
                street = other.streets[k]
                in_reach = (first[on] <= k) & (k <= last[on])
                crosses = in_reach & ~(other.is_on[on] & (other.number[on] == k))
                rows = on[crosses & (np.abs(street.middle_m - other.across_m[on]) > half_m)]
                if len(rows):
                    yield _through_gap(
                        street,
                        other,
                        rows,
                        t_s=poses.t_s[rows],
                        middle_m=own.number[rows] * block_m,
                        half_m=half_m,
                    )


def _through_gap(
    street: Street,
    direction: _StreetSpans,
    rows: Ints,
    *,
    t_s: Array,
    middle_m: Array,
    half_m: float,
) -> StreetObjects:
    """What can be seen of a crossing street past the corners of the houses.

    Parameters
    ----------
    street : the crossing street
    direction : its own
    rows : of the poses from which it may be seen, (n,)
    t_s : when, (n,)
    middle_m : of the street that the camera is on, its middle along the crossing one, (n,); a line
        of sight must pass between the houses where it enters the crossing one
    half_m : from the middle of a street to its houses
    """
    along_m, across_m = direction.along_m[rows], direction.across_m[rows]
    to_m = np.abs(street.middle_m - across_m)
    near_m, far_m = to_m - half_m, to_m + half_m
    widest = far_m / near_m
    low_m = np.maximum(direction.low_m[rows], along_m + (middle_m - half_m - along_m) * widest)
    high_m = np.minimum(direction.high_m[rows], along_m + (middle_m + half_m - along_m) * widest)
    objects = street.seen(low_m, high_m, t_s)
    pose, there_m, beyond_m = objects.pose, objects.east_m, objects.north_m
    if street.northbound:
        there_m, beyond_m = beyond_m, there_m
    entry_m = along_m[pose] + (there_m - along_m[pose]) * near_m[pose] / np.abs(
        beyond_m - across_m[pose]
    )
    clear = np.abs(entry_m - middle_m[pose]) <= half_m
    return StreetObjects._make(column[clear] for column in objects).of_poses(rows)


def in_view(
    poses: ViewPoses, parts: Sequence[StreetObjects], objects: ObjectColumns, view_m: float
) -> VisibleObjects:
    """Of the objects that no house hides, those in the field of view, neither too near nor too far.

    ``parts`` are parts of them, ``objects`` all that there are, of which ``parts`` give the rows.
    """
    unhidden = StreetObjects._make(np.concatenate(column) for column in zip(*parts, strict=True))
    pose = unhidden.pose
    c, s = poses.cos[pose], poses.sin[pose]
    dx, dy = unhidden.east_m - poses.east_m[pose], unhidden.north_m - poses.north_m[pose]
    border_m, left_m = (dx * c + dy * s) * SLOPE, dy * c - dx * s
    range_m = np.sqrt(dx * dx + dy * dy)
    farthest_m = np.minimum(objects.reach_m[unhidden.row], view_m)
    visible = (np.abs(left_m) <= border_m) & (range_m >= NEAREST_M) & (range_m <= farthest_m)
    rows = np.flatnonzero(visible)
    rows = rows[np.argsort(pose[rows], kind="stable")]
    return VisibleObjects._make(column[rows] for column in (*unhidden, range_m))
