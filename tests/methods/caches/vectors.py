"""Keys and answers for the tests of similarity caches."""

from __future__ import annotations

from itertools import count

import numpy as np

from genie_sim.base.features import DIMENSION, UNIT
from genie_sim.core.messages import CameraPose, Detection, Detections, Header
from genie_sim.methods.nearest import FeatureKey

HERE = CameraPose(0.0, 0.0, 1.6, 0.0)
TOPIC = "/objects"
NUMBERS = count()  # no two pictures are the same


def key(*place: float, stream: str = "front", pose: CameraPose = HERE) -> FeatureKey:
    """A key at whole numbers, 254 of which are a distance of 1."""
    vector = np.zeros(DIMENSION, np.float32)
    vector[: len(place)] = place
    return FeatureKey(vector, Header(next(NUMBERS), stream, "car1"), pose)


def at(distance: float) -> FeatureKey:
    """A key on a line, so far from nought."""
    return key(round(distance * UNIT))


def answer(*east_m: float) -> Detections:
    """A car at each of these places."""
    found = tuple(Detection("car", 0.8, None, (x, 0.0, 0.8), 0.8) for x in east_m)
    return Detections(Header(0, "front", "car1"), found)
