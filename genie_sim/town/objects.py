"""Objects that a camera may see in the town, each with the random numbers that stay with it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.messages import Location
from genie_sim.perception.trace import MIN_HEIGHT_PX
from genie_sim.town.laws import GroupLaws
from genie_sim.town.noise import NORMAL_MASK, mix, normals

# The colour cameras of KITTI's drive 2011_09_26/0005, as its trace has them (A. Geiger et al., IJRR 2013).
WIDTH, HEIGHT = 1242, 375
HORIZONTAL_FOV_RAD = 1.42116
FOCAL_PX = WIDTH / 2 / math.tan(HORIZONTAL_FOV_RAD / 2)

SIZES_M = {  # assumed: usual heights
    "car": 1.5,
    "truck": 3.0,
    "person": 1.75,
    "bicycle": 1.1,
    "traffic light": 0.9,
    "stop sign": 0.75,
    "fire hydrant": 0.75,
    "bench": 0.85,
}
FEET_M = {"traffic light": 2.2, "stop sign": 2.0}  # assumed: of what does not stand on the ground
MIDDLES_M = {
    label: round(FEET_M.get(label, 0.0) + size_m / 2, 3) for label, size_m in SIZES_M.items()
}
# An object lower than KITTI's MIN_HEIGHT_PX in the picture is not judged, so no law is known of it: it is not in view.
REACHES_M = {label: FOCAL_PX * size_m / MIN_HEIGHT_PX for label, size_m in SIZES_M.items()}


class TownObject(NamedTuple):
    """Something that a camera may see, real or a ghost.

    Where it is and from how far away it can be seen [m]; what it is, its number, the key of its random numbers, its
    lasting share in the copula of the score and of the errors along the line of sight and across, and its laws.
    """

    east_m: float
    north_m: float
    up_m: float
    reach_m: float
    label: str
    number: int
    key: int
    score_z: float
    along_z: float
    across_z: float
    laws: GroupLaws
    moving: bool
    real: bool

    @property
    def location(self) -> Location:
        """Where its middle is, at the time it was asked for."""
        return self.east_m, self.north_m, self.up_m

    def at(self, number: int, east_m: float, north_m: float) -> "TownObject":
        """The same with another number, elsewhere."""
        return TownObject._make((east_m, north_m, *self[2:5], number, *self[6:]))


class Things:
    """Columns of the numbers of all ``objects`` that cameras may see; ``group`` is the place of an object's laws."""

    def __init__(self, objects: Sequence[TownObject]) -> None:
        self.objects = objects
        up_m, reach_m, score_z, along_z, across_z = (
            np.array([getattr(one, name) for one in objects])
            for name in ("up_m", "reach_m", "score_z", "along_z", "across_z")
        )
        self.up_m, self.reach_m = up_m, reach_m
        self.score_z, self.along_z, self.across_z = score_z, along_z, across_z
        self.label = np.array([one.label for one in objects], dtype=object)
        self.key = np.array([one.key for one in objects], dtype=np.uint64)
        self.offset = (self.key >> np.uint64(36)).astype(np.int64)
        self.group = np.array([one.laws.place for one in objects], dtype=np.int64)


def town_object(
    laws: GroupLaws,
    seed_key: int,
    number: int,
    label: str,
    east_m: float,
    north_m: float,
    moving: bool,
    real: bool = True,
) -> TownObject:
    """An object of this number, with the numbers that stay with it."""
    key = mix(seed_key ^ mix(number))
    table = normals()
    return TownObject(
        east_m,
        north_m,
        MIDDLES_M[label],
        REACHES_M[label],
        label,
        number,
        key,
        laws.score[0] * table[key & NORMAL_MASK],
        laws.along[0] * table[key >> 12 & NORMAL_MASK],
        laws.across[0] * table[key >> 24 & NORMAL_MASK],
        laws,
        moving,
        real,
    )
