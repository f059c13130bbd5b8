"""Tables of standard normal numbers, out of which the bits of a key pick one."""

import functools
import itertools
import math
from statistics import NormalDist

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.worlds.scene.keys import BitField, mix

WARM_UP = 1024  # smooth numbers before the first that counts: they start at 0

# Rows of the tables of normal and of smooth numbers.
NORMALS, VIEWS = BitField(0, 12), BitField(0, 16)
# So many rows apart the smooth numbers of one look are independent: those of its score, of its
# errors along the line of sight and across, and, of a town, those of the camera's four directions.
ALONG, ACROSS, DIRECTION = 21 * 1021, 43 * 1021, 16411


@functools.cache
def normals() -> tuple[float, ...]:
    """The standard normal distribution as 4,096 equally likely numbers: take the one that a draw of
    12 bits names.
    """
    count = 1 << NORMALS.bits
    quantile = NormalDist().inv_cdf
    return tuple(round(quantile((i + 0.5) / count), 9) for i in range(count))


def smooth_normals(step: float) -> Array:
    """65,536 standard normal numbers in a row, in which numbers n rows apart are correlated by
    exp(-n step).
    """
    correlation = math.exp(-step)
    innovation = math.sqrt(1.0 - correlation * correlation)
    keys = mix(np.arange(-WARM_UP, 1 << VIEWS.bits).astype(np.uint64))
    fresh = innovation * np.array(normals())[NORMALS.of(keys)]
    values = itertools.accumulate(fresh.tolist(), lambda value, new: correlation * value + new)
    return np.array([round(value, 9) for value in values][WARM_UP:])
