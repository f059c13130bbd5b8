"""Surrogate features: a town has no pictures, so its frames get vectors that are as far apart as
those of real ones.

For a camera that moves s metres, the distance between the features of drive 2011_09_26/0005 is
sqrt(n^2 + 2 a^2 (1 - k(s))), k being exp(-s / L) for ``yolox_gap`` and exp(-(s / L)^2 / 2) for
``hsv``; n, a and L are fitted to the medians over 0.45 to 29 m. A surrogate has random Fourier
features of that kernel (A. Rahimi, B. Recht, NIPS 2007) in place and heading, and a random part of
its own for each frame. Of what moves in the picture it knows nothing.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from genie_sim.base.features import DIMENSION, UNIT
from genie_sim.base.seeds import stream
from genie_sim.core.messages import CameraPose
from genie_sim.worlds.scene.keys import FRAME_FEATURES
from genie_sim.worlds.scene.noise import normals

# assumed: how far a place must be for its picture to differ as much as one turned by a radian
TURN_M = 20.0


class Law(NamedTuple):
    """Of a feature's distances: the part of each frame, the part of the place, its length [m], and
    its kernel.
    """

    noise: float
    of_place: float
    length_m: float
    gaussian: bool


FEATURES = {"hsv": Law(0.0966, 0.525, 9.84, True), "yolox_gap": Law(0.138, 0.350, 9.71, False)}


class Surrogate:
    """The features of one name in the scene of one seed."""

    def __init__(self, seed: int, name: str) -> None:
        self._law = law = FEATURES[name]
        rng = stream(seed, "surrogate feature", name)
        rows = rng.standard_normal((DIMENSION, 4)) / law.length_m
        if not law.gaussian:  # Cauchy's law, whose transform is exp(-s / L)
            rows /= np.abs(rng.standard_normal((DIMENSION, 1)))
        self._rows = rows
        self._phases = rng.uniform(0.0, 2 * math.pi, DIMENSION)
        common = rng.standard_normal(DIMENSION)
        rest = math.sqrt(1.0 - law.of_place**2 - law.noise**2 / 2)
        self._common = rest * common / math.sqrt(float(common @ common))

    def at(self, pose: CameraPose, key: int) -> bytes:
        """Of the picture that a camera takes there; ``key`` (64 bits) is the frame's own."""
        law, heading = self._law, pose.heading_rad
        at = pose.east_m, pose.north_m, TURN_M * math.cos(heading), TURN_M * math.sin(heading)
        of_place = np.cos(self._rows @ at + self._phases) * math.sqrt(2 / DIMENSION)
        vector = (
            self._common
            + law.of_place * of_place
            + law.noise / math.sqrt(2 * DIMENSION) * _noise(key)
        )
        return np.clip(np.rint(vector * UNIT), -127, 127).astype(np.int8).tobytes()


@functools.cache
def surrogates(seed: int) -> dict[str, Surrogate]:
    """Every feature of a town."""
    return {name: Surrogate(seed, name) for name in FEATURES}


@functools.cache
def _table() -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    shuffled = stream(0, "surrogate noise").permutation(normals())
    return np.concatenate([shuffled, shuffled[:DIMENSION]])


def _noise(key: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    begin = FRAME_FEATURES.of(key)
    return _table()[begin : begin + DIMENSION]
