"""Keyed random numbers: each depends on its key alone, not on the order in which they are drawn.

A key (64 bits) is mixed as in the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable
pseudorandom number generators", OOPSLA 2014, doi:10.1145/2660193.2660195); its bits pick a standard
normal number out of a table.
"""

import functools
import math
from array import array
from statistics import NormalDist

MASK = (1 << 64) - 1
NORMAL_BITS = 12
NORMAL_MASK = (1 << NORMAL_BITS) - 1
SMOOTH_MASK = (1 << 16) - 1


def mix(key: int) -> int:
    """64 well-mixed bits of a key."""
    key = (key + 0x9E3779B97F4A7C15) & MASK
    key = ((key ^ (key >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    key = ((key ^ (key >> 27)) * 0x94D049BB133111EB) & MASK
    return key ^ (key >> 31)


@functools.cache
def normals() -> tuple[float, ...]:
    """The standard normal distribution as so many equally likely numbers: take the one that 12
    random bits name.
    """
    count = 1 << NORMAL_BITS
    quantile = NormalDist().inv_cdf
    return tuple(round(quantile((i + 0.5) / count), 9) for i in range(count))


@functools.cache
def smooth_normals(step: float) -> "array[float]":
    """65,536 standard normal numbers in a row, in which numbers n places apart are correlated by
    exp(-n step).
    """
    table, correlation = normals(), math.exp(-step)
    innovation = math.sqrt(1.0 - correlation * correlation)
    value, row = 0.0, array("d")
    for i in range(-1024, SMOOTH_MASK + 1):
        value = correlation * value + innovation * table[mix(i & MASK) & NORMAL_MASK]
        row.append(round(value, 9))
    return row[1024:]
