"""Tables of standard normal numbers: ``normals``, out of which the bits of a key pick one, and
``smooth_normals``, which change little from row to row, as what a camera sees from frame to frame.
"""

import functools
import itertools
import math
from statistics import NormalDist

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.base.spans import Ints
from genie_sim.worlds.scene.keys import NORMALS, VIEWS, mix

WARM_UP = 1024  # smooth numbers before the first that counts: they start at 0
VIEW_STEP_M = 0.25  # by which a view changes from one smooth number to the next
# So many rows apart the smooth numbers of one look are independent: the errors along the line of
# sight and across begin later than the score, and so do, in a town, the camera's four directions.
ALONG, ACROSS, DIRECTION = 21 * 1021, 43 * 1021, 16411


@functools.cache
def normals() -> Array:
    """The standard normal distribution as 4,096 equally likely numbers: take the one that a draw of
    12 bits names.
    """
    count = 1 << NORMALS.bits
    quantile = NormalDist().inv_cdf
    return np.array([round(quantile((i + 0.5) / count), 9) for i in range(count)])


def smooth_normals(step: float) -> Array:
    """65,536 standard normal numbers in a row, in which numbers n rows apart are correlated by
    exp(-n step).
    """
    correlation = math.exp(-step)
    innovation = math.sqrt(1.0 - correlation * correlation)
    keys = mix(np.arange(-WARM_UP, 1 << VIEWS.bits).astype(np.uint64))
    fresh = innovation * normals()[NORMALS.of(keys)]
    values = itertools.accumulate(fresh.tolist(), lambda value, new: correlation * value + new)
    return np.array([round(value, 9) for value in values][WARM_UP:])


def smooth_row(changed_m: Array, offset: Ints, direction: Ints | int = 0) -> Ints:
    """In which rows (n,) of the smooth numbers some looks find theirs: a row on for each
    ``VIEW_STEP_M`` by which the view has changed, and after the last row comes the first.

    From row 60,000 on, after 20.3 m (81 steps), to the north (direction 2):
    60,000 + 81 + 2 * 16,411 = 92,903, and that less 65,536 is

    >>> smooth_row(np.array([20.3]), offset=np.array([60_000]), direction=2)
    array([27367])

    Parameters
    ----------
    changed_m : how far the view has changed, from anywhere on (n,)
    offset : of the object: where its numbers begin (n,)
    direction : of the camera on a grid of streets: 0 to 3 (n,)
    """
    # Cut towards 0, so the row around it is two steps wide; kept runs hold that.
    steps = (changed_m / VIEW_STEP_M).astype(np.int64)
    rows: Ints = VIEWS.of(steps + offset + direction * DIRECTION)
    return rows
