"""Objects that a camera may see in a scene, each with the random numbers that stay with it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import SIZES
from genie_sim.core.messages import Location
from genie_sim.data.trace import MIN_HEIGHT_PX
from genie_sim.worlds.scene import keys
from genie_sim.worlds.scene.laws import GroupLaws
from genie_sim.worlds.scene.noise import normals

# The colour cameras of KITTI's drive 2011_09_26/0005, as its trace has them (A. Geiger et al., IJRR
# 2013).
WIDTH, HEIGHT = 1242, 375
HORIZONTAL_FOV_RAD = 1.42116
FOCAL_PX = WIDTH / 2 / math.tan(HORIZONTAL_FOV_RAD / 2)

LONGEST_M = 70.0  # of a vehicle: SUMO's trains have 67.5 m
FEET_M = {"traffic light": 2.2, "stop sign": 2.0}  # assumed: of what does not stand on the ground
MIDDLES_M = {
    label: round(FEET_M.get(label, 0.0) + size.height_m / 2, 3) for label, size in SIZES.items()
}
# An object lower than KITTI's MIN_HEIGHT_PX in the picture is not judged, so no law is known of it:
# it is not in view.
REACHES_M = {label: FOCAL_PX * size.height_m / MIN_HEIGHT_PX for label, size in SIZES.items()}


class SceneObject(NamedTuple):
    """Something that a camera may see, real or a ghost.

    Where it is and from how far away it can be seen [m]; what it is, its number, the key of its
    random numbers, its lasting share in the copula of the score and of the errors along the line of
    sight and across, and its laws.
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

    def at(self, number: int, east_m: float, north_m: float) -> "SceneObject":
        """The same with another number, elsewhere."""
        return SceneObject._make((east_m, north_m, *self[2:5], number, *self[6:]))


class ObjectColumns:
    """All objects that cameras may see in a scene, as columns; ``rows`` are the objects themselves.

    ``key`` (64 bits) is each one's own, ``offset`` where its smooth numbers begin, ``group`` the
    number of its group of laws, and ``real`` is ``False`` for ghosts.
    """

    def __init__(self, rows: Sequence[SceneObject]) -> None:
        self.rows = rows
        self.up_m = np.array([row.up_m for row in rows])
        self.reach_m = np.array([row.reach_m for row in rows])
        self.score_z = np.array([row.score_z for row in rows])
        self.along_z = np.array([row.along_z for row in rows])
        self.across_z = np.array([row.across_z for row in rows])
        self.real = np.array([row.real for row in rows], dtype=bool)
        self.label = np.array([row.label for row in rows], dtype=object)
        self.key = np.array([row.key for row in rows], dtype=np.uint64)
        self.offset = keys.OBJECT_VIEW.of(self.key).astype(np.int64)
        self.group = np.array([row.laws.number for row in rows], dtype=np.int64)


def scene_object(
    laws: GroupLaws,
    seed_key: int,
    number: int,
    label: str,
    *,
    place: tuple[float, float] = (0.0, 0.0),
    moving: bool = False,
    real: bool = True,
) -> SceneObject:
    """An object with the random numbers that stay with it.

    Parameters
    ----------
    laws : how a detector sees it
    seed_key : of the scene
    number : the object's own
    label : its class
    place : east and north [m]; of what moves, ``SceneObject.at`` gives it
    moving : whether it moves
    real : ``False`` for a ghost
    """
    key, table = keys.object_key(seed_key, number), normals()
    return SceneObject(
        east_m=place[0],
        north_m=place[1],
        up_m=MIDDLES_M[label],
        reach_m=REACHES_M[label],
        label=label,
        number=number,
        key=key,
        score_z=laws.score_weight * table[keys.OBJECT_SCORE.of(key)],
        along_z=laws.along_weight * table[keys.OBJECT_ALONG.of(key)],
        across_z=laws.across_weight * table[keys.OBJECT_ACROSS.of(key)],
        laws=laws,
        moving=moving,
        real=real,
    )
