"""Objects that a camera may see in a scene, each with the random numbers that stay with it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from genie_sim.base.classes import SIZES, class_of
from genie_sim.base.geometry import Array
from genie_sim.base.spans import Flags, Ints
from genie_sim.core.messages import Location
from genie_sim.data.trace import MIN_HEIGHT_PX
from genie_sim.worlds.scene import keys
from genie_sim.worlds.scene.laws import Copula, FittedLaws
from genie_sim.worlds.scene.noise import normals

Bits = npt.NDArray[np.uint64]

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
FARTHEST_M = max(REACHES_M.values())


class SceneObject(NamedTuple):
    """Something that is really there, at some time: what it is, whether it moves at that instant
    (``base.classes.MOVING_MPS``), and where its middle is [m].
    """

    label: str
    moving: bool
    east_m: float
    north_m: float
    up_m: float

    @property
    def location(self) -> Location:
        return self.east_m, self.north_m, self.up_m


class ObjectColumns:
    """All objects that cameras may see in a scene, real ones and ghosts, as columns (objects,):
    what stays the same of each wherever it is, with its random numbers.

    Parameters
    ----------
    label : its class
    number : its own, from which its random numbers follow
    real : ``False`` for a ghost
    laws : how a detector sees them
    seed_key : of the scene's seed
    """

    def __init__(
        self,
        label: Sequence[str],
        number: Sequence[int],
        real: Sequence[bool],
        *,
        laws: FittedLaws,
        seed_key: int,
    ) -> None:
        self.label = np.array(label, dtype=object)
        self.real: Flags = np.array(real, dtype=bool)
        # height of its middle, and from how far away it can be seen [m]
        self.up_m = np.array([MIDDLES_M[name] for name in label])
        self.reach_m = np.array([REACHES_M[name] for name in label])
        classes = [class_of(name) for name in label]
        self._codes = {name: code for code, name in enumerate(dict.fromkeys(classes))}
        # the code of its class, and of a ghost that of nothing
        self.class_: Ints = np.array([self._codes[name] for name in classes], dtype=np.int64)
        self.class_[~self.real] = self.nothing = len(self._codes)
        groups = map(laws.group_of, label, real)
        self.group: Ints = np.array(list(groups), dtype=np.int64)
        self.key: Bits = keys.mix(seed_key ^ keys.mix(np.array(number, dtype=np.uint64)))
        # where its smooth numbers begin
        self.offset: Ints = keys.OBJECT_VIEW.of(self.key).astype(np.int64)
        # its lasting share in the copulas of the score and of the errors along and across
        self.score_z = self._lasting(laws.score, keys.OBJECT_SCORE)
        self.along_z = self._lasting(laws.along, keys.OBJECT_ALONG)
        self.across_z = self._lasting(laws.across, keys.OBJECT_ACROSS)

    def classes_of(self, labels: Sequence[str]) -> Ints:
        """The codes of the classes of labels (n,), or that of nothing."""
        codes = (self._codes.get(class_of(label), self.nothing) for label in labels)
        return np.fromiter(codes, dtype=np.int64, count=len(labels))

    def _lasting(self, copula: Copula, draw: keys.BitField) -> Array:
        lasting: Array = copula.object_weight[self.group] * normals()[draw.of(self.key)]
        return lasting
