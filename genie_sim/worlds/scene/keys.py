"""Whole numbers that hold several things in their bits: the keys from which all random numbers of a
scene are drawn, and what the keys are made from. What is packed or unpacked is so here.

A key (64 bits) is mixed as in the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast splittable
pseudorandom number generators", OOPSLA 2014, doi:10.1145/2660193.2660195): each number depends on
its key alone, not on the order in which they are drawn.
"""

import hashlib
from typing import Any, NamedTuple

MASK = (1 << 64) - 1
MULTIPLIER = 0xBF58476D1CE4E5B9  # of the finaliser; it is odd: no two keys become one


class BitField(NamedTuple):
    """Some bits of a whole number: so many ``bits``, from bit ``first`` on."""

    first: int
    bits: int

    def of(self, keys: Any) -> Any:
        """What some numbers have there, an int or an array of uint64."""
        return keys >> self.first & (1 << self.bits) - 1

    def share(self, key: int) -> float:
        """What a key has there as a share of all that could be, in [0, 1)."""
        share: float = self.of(key) / (1 << self.bits)
        return share


# Draws: which bits of a key are which random number; draws of one key share no bit.
# The key of an object:
OBJECT_SCORE, OBJECT_ALONG, OBJECT_ACROSS = BitField(0, 12), BitField(12, 12), BitField(24, 12)
OBJECT_VIEW, OBJECT_PRONE = BitField(36, 16), BitField(52, 12)
# Of a look at an object:
LOOK_SCORE, LOOK_ALONG, LOOK_ACROSS = BitField(0, 12), BitField(12, 12), BitField(24, 12)
LOOK_NAME = BitField(40, 16)
# Of a frame: its surrogate features, and whether it has a false positive that is seen once; the key
# of that one is mixed anew.
FRAME_FEATURES, FRAME_FLEETING = BitField(0, 12), BitField(48, 16)
FLEETING_RANGE, FLEETING_ANGLE = BitField(16, 16), BitField(32, 16)
FLEETING_SCORE = BitField(48, 16)
# Of a crossing: when its light turns green.
LIGHT = BitField(0, 16)

# Rows of the tables of normal and of smooth numbers (``noise``), whose lengths are powers of two.
NORMALS, VIEWS = BitField(0, 12), BitField(0, 16)

# The number of an object of a town: the street, the stream on it (0 for what stands; a stream of
# cyclists has a second one for the persons on the bicycles), and below these, in 32 bits, which one
# it is of those.
STREAM, STREET = BitField(32, 4), BitField(36, 28)


def mix(key: Any) -> Any:
    """64 well-mixed bits of a key, an int or an array of uint64."""
    key = (key + 0x9E3779B97F4A7C15) & MASK
    key = ((key ^ (key >> 30)) * MULTIPLIER) & MASK
    key = ((key ^ (key >> 27)) * 0x94D049BB133111EB) & MASK
    return key ^ (key >> 31)


def named_key(*names: str | int) -> int:
    """The key of a scene's random numbers and seed, or of a car with these."""
    text = " ".join(map(str, names))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")


def frame_key(of_car: int, camera: str, scene_ns: int) -> int:
    """The key of the frame that one of a car's cameras, "02" or "03", takes at a time."""
    key: int = mix(of_car ^ scene_ns << 8 ^ int(camera))
    return key


def look_keys(of_objects: Any, of_frames: Any) -> Any:
    """The keys (n,) of looks at objects (n,) in frames (n,), all of them arrays of uint64."""
    keys = (of_objects ^ of_frames) * MULTIPLIER
    return keys ^ keys >> 32


def crossing_key(east: int, north: int) -> int:
    """The key of the crossing of two streets of a town, by their numbers."""
    key: int = mix(east << 20 | north)
    return key


def object_number(northbound: bool, street: int, stream: int, member: int) -> int:
    """The number of an object of a town; no two have the same.

    Parameters
    ----------
    northbound : whether the street leads north, or east
    street : its number, from the west or from the south
    stream : 0 for what stands
    member : which one of these
    """
    return (street * 2 + northbound) << STREET.first | stream << STREAM.first | member
