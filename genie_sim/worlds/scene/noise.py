"""Keyed random numbers: each depends on its key alone, not on the order in which they are drawn.

A key (64 bits) is mixed as in the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable
pseudorandom number generators", OOPSLA 2014, doi:10.1145/2660193.2660195); its bits pick a standard
normal number out of a table.
"""

import functools
import hashlib
import math
from array import array
from statistics import NormalDist
from typing import Any, NamedTuple

MASK = (1 << 64) - 1
WARM_UP = 1024  # smooth numbers before the first that counts: they start at 0


class Draw(NamedTuple):
    """One draw out of a key: so many of its ``bits``, from bit ``first`` on."""

    first: int
    bits: int

    def of(self, keys: Any) -> Any:
        """The whole numbers of some keys, an int or an array of uint64."""
        return keys >> self.first & (1 << self.bits) - 1

    def share(self, key: int) -> float:
        """The number of a key as a share of all, in [0, 1)."""
        share: float = self.of(key) / (1 << self.bits)
        return share


# Which bits of a key are which draw: draws of one key share no bit.
# The key of an object:
OBJECT_SCORE, OBJECT_ALONG, OBJECT_ACROSS = Draw(0, 12), Draw(12, 12), Draw(24, 12)
OBJECT_VIEW, OBJECT_PRONE = Draw(36, 16), Draw(52, 12)
# Of a look at an object:
LOOK_SCORE, LOOK_ALONG, LOOK_ACROSS, LOOK_NAME = (
    Draw(0, 12),
    Draw(12, 12),
    Draw(24, 12),
    Draw(40, 16),
)
# Of a frame: its surrogate features, and whether it has a false positive that is seen once; the key
# of that one is mixed anew.
FRAME_FEATURES, FRAME_TRANSIENT = Draw(0, 12), Draw(48, 16)
TRANSIENT_RANGE, TRANSIENT_ANGLE, TRANSIENT_SCORE = Draw(16, 16), Draw(32, 16), Draw(48, 16)
# Of a crossing: when its light turns green.
LIGHT = Draw(0, 16)

# Rows of the tables of normal and of smooth numbers.
NORMALS, VIEWS = Draw(0, 12), Draw(0, 16)
# So many rows apart the smooth numbers of one look are independent: those of its score, of its
# errors along the line of sight and across, and, of a town, those of the camera's four directions.
ALONG, ACROSS, DIRECTION = 21 * 1021, 43 * 1021, 16411
MULTIPLIER = 0xBF58476D1CE4E5B9  # of the finaliser; it is odd: no two keys become one


def mix(key: int) -> int:
    """64 well-mixed bits of a key."""
    key = (key + 0x9E3779B97F4A7C15) & MASK
    key = ((key ^ (key >> 30)) * MULTIPLIER) & MASK
    key = ((key ^ (key >> 27)) * 0x94D049BB133111EB) & MASK
    return key ^ (key >> 31)


def key_of_seed(stream: str, seed: int) -> int:
    """64 bits of a scene's seed, by the name of the scene's random numbers."""
    return int.from_bytes(hashlib.sha256(f"{stream} {seed}".encode()).digest()[:8], "big")


@functools.cache
def normals() -> tuple[float, ...]:
    """The standard normal distribution as 4,096 equally likely numbers: take the one that a draw of
    12 bits names.
    """
    count = 1 << NORMALS.bits
    quantile = NormalDist().inv_cdf
    return tuple(round(quantile((i + 0.5) / count), 9) for i in range(count))


@functools.cache
def smooth_normals(step: float) -> "array[float]":
    """65,536 standard normal numbers in a row, in which numbers n rows apart are correlated by
    exp(-n step).
    """
    table, correlation = normals(), math.exp(-step)
    innovation = math.sqrt(1.0 - correlation * correlation)
    value, row = 0.0, array("d")
    for i in range(-WARM_UP, 1 << VIEWS.bits):
        value = correlation * value + innovation * table[NORMALS.of(mix(i & MASK))]
        row.append(round(value, 9))
    return row[WARM_UP:]
