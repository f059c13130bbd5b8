"""Feature vectors as they are stored: 64 integers from -127 to 127, quantised so that length 1
is 254.

Whole numbers because their distances are exact, in any order of adding up: every machine finds the
same neighbour.
"""

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from genie_sim.base.seeds import stream

DIMENSION = 64
UNIT = 254.0
# (64,), whole numbers; sums of 64 squares of them are exact in float32
Vector = npt.NDArray[np.float32]


@functools.cache
def _signs(length: int) -> npt.NDArray[np.float64]:
    """The projection (64, length) of vectors of this length: a sign for each pair (D. Achlioptas,
    JCSS 2003).
    """
    signs: npt.NDArray[np.float64] = stream(0, "feature projection", length).choice(
        [-1.0, 1.0], (DIMENSION, length)
    )
    return signs


def packed(vector: npt.ArrayLike) -> bytes:
    """A vector scaled to length 1, projected to 64 dimensions, rounded; the zero vector stays zero.

    Distances stay as they are up to about 9 % (Johnson and Lindenstrauss: 1 / sqrt(2 * 64)).
    """
    values = np.asarray(vector, dtype=np.float64).ravel()
    length = float(np.sqrt(values @ values))
    projected = _signs(len(values)) @ (values / (length or 1.0)) / np.sqrt(DIMENSION)
    return bytes(np.clip(np.rint(projected * UNIT), -127, 127).astype(np.int8))


def unpacked(feature: bytes) -> Vector:
    """The vector of whole numbers."""
    return np.frombuffer(feature, dtype=np.int8).astype(np.float32)


def feature_of(frame: Any, name: str) -> bytes | None:
    """A frame's feature; ``None`` where its source made none of that name."""
    features: dict[str, bytes] = getattr(frame, "features", {})
    return features.get(name)
