"""Where is the middle of a vehicle of which the laser saw one or two sides? Fit a rectangle of its
usual size.

The turn of the rectangle is found as in X. Zhang et al., 'Efficient L-Shape Fitting for Vehicle
Detection Using Laser Scanners', IV 2017 (closeness criterion): of all turns, the one in which the
points lie closest to the sides.
"""

import math

import numpy as np

from genie_sim.base.classes import Size
from genie_sim.base.geometry import Array

TURNS_RAD = np.deg2rad(np.arange(0, 90, 3))
TURNED_AXES = np.column_stack([np.cos(TURNS_RAD), np.sin(TURNS_RAD)])
NEAR_M = 0.05  # points closer to a side than this lie on it
STRAY_PERCENT = 2  # this share of the points may lie outside, on either side
SLACK_M = 0.3  # a side that is longer than a vehicle is wide, by this much, is its long one
MAX_POINTS = 400  # more say nothing new


def centre(points: Array, size: Size, cut: str | None = None) -> tuple[float, float] | None:
    """The middle (x, z) of a vehicle from points (n, 2) on its near sides; the laser is at (0, 0),
    z is ahead.

    ``None`` where only an end is seen, whole: then the middle of its box says more about where it
    is than the points. Where less is seen than ``size``, the rest lies behind what is seen, or, if
    the picture cuts the vehicle off at its ``left`` or ``right`` border, beyond that border.
    """
    points = points[:: math.ceil(len(points) / MAX_POINTS)]
    turn = _turn(points)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    ordered = np.sort(points @ axes.T, axis=0)
    low, high = percentile(ordered, STRAY_PERCENT), percentile(ordered, 100 - STRAY_PERCENT)
    extents, middle = high - low, (low + high) / 2
    if extents.max() >= size.width_m + SLACK_M:
        along = int(extents.argmax())
    elif cut is None:
        return None
    else:  # it is as long as it is along the line of sight
        along = int(np.abs(axes @ points.mean(axis=0)).argmax())
    for axis in (0, 1):
        usual_m = size.length_m if axis == along else size.width_m
        if extents[axis] < usual_m:
            seen_low = _low_end_is_seen(axis, (low, high), axes, cut)
            middle[axis] = low[axis] + usual_m / 2 if seen_low else high[axis] - usual_m / 2
    x, z = (middle @ axes).tolist()
    return x, z


def percentile(ordered: Array, percent: float) -> Array:
    """Of values in ascending order along the first axis; as ``numpy.percentile``, which takes ten
    times as long.
    """
    place = percent / 100 * (len(ordered) - 1)
    before = int(place)
    low, high = ordered[before], ordered[min(before + 1, len(ordered) - 1)]
    between: Array = low + (high - low) * (place - before)
    return between


def _low_end_is_seen(axis: int, ends: tuple[Array, Array], axes: Array, cut: str | None) -> bool:
    """Whether the vehicle ends where the points of an axis begin, and goes on where they end; or
    the other way.
    """
    low, high = ends
    middle = (low + high) / 2
    if cut is None:
        return bool(middle[axis] > 0)
    bearings = []
    for end in (low[axis], high[axis]):
        place = np.where(np.arange(2) == axis, end, middle) @ axes
        bearings.append(math.atan2(place[0], place[1]))
    return bearings[0] > bearings[1] if cut == "left" else bearings[0] < bearings[1]


def _turn(points: Array) -> float:
    # (2 turns, n)
    turned = np.concatenate([TURNED_AXES, TURNED_AXES[:, ::-1] * [-1, 1]]) @ points.T
    stray = int(len(points) * STRAY_PERCENT / 100)
    ordered = np.sort(turned, axis=1)
    off = np.minimum(
        np.abs(turned - ordered[:, [stray]]), np.abs(ordered[:, [-1 - stray]] - turned)
    )
    on_either = np.minimum(off[: len(TURNS_RAD)], off[len(TURNS_RAD) :])
    return float(TURNS_RAD[int((1.0 / np.maximum(on_either, NEAR_M)).sum(axis=1).argmax())])
