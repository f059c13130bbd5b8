"""A scene: what there is to see for all cars."""

import functools
from collections.abc import Mapping, Sequence
from typing import ClassVar, Protocol

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.base.seeds import stream
from genie_sim.base.spans import Flags, Ints
from genie_sim.worlds.scene.detector import SyntheticDetector
from genie_sim.worlds.scene.keys import named_key
from genie_sim.worlds.scene.laws import FittedLaws, synthetic_laws
from genie_sim.worlds.scene.objects import FARTHEST_M, ObjectColumns, SceneObject
from genie_sim.worlds.scene.surrogate import FEATURES
from genie_sim.worlds.scene.view import PlacedObjects, ViewPoses, VisibleObjects


class SceneVisibility(Protocol):
    """Where the objects of a scene are at any time. What it tells of a slot hangs on no other."""

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        """What is in view from some poses (slots,), ghosts too: not hidden, in the field of view,
        up to the scene's ``sight_m`` away (``view.in_view``). Fastest if the poses are near each
        other.
        """

    def near(
        self, east_m: Array, north_m: Array, t_s: Array, *, class_: Ints, radius_m: float
    ) -> PlacedObjects:
        """Objects near places (slots,) at their times (slots,), whether they can be seen or not:
        all of a place's ``class_`` (slots,) that are within a distance [m] of it, and maybe others.
        """


class Scene:
    """Objects, where they are at any time of the scene's clock, and how a detector sees them.

    A subclass gives ``name``, ``random_name``, ``digest``, ``objects``, ``visibility`` and
    ``facts``; ``tests.conformance.scenes`` holds it to that. No random number hangs on its
    ``digest``, but on ``random_name`` and the seed: other settings are another scene of the same
    draws.
    """

    name: ClassVar[str]
    """What it is called in ``run.json`` and in the names of its drives."""

    random_name: ClassVar[str]
    """Names the random numbers: another word draws anew for every seed."""

    on_grid: ClassVar[bool] = False
    """Whether all cars drive east, west, north or south, but for their turns."""

    digest: str
    """The sha256 of all that decides what cameras see: the same digest is the same scene."""

    def __init__(self, seed: int, view_m: float, range_m: float) -> None:
        """``view_m`` is the largest distance at which a camera's detector finds anything, and up to
        ``range_m`` objects are judged. So it is known what is in view up to the farther of both,
        ``sight_m``: a detector that looks less far misses what is beyond.
        """
        self.seed, self.view_m = seed, view_m
        self.sight_m = min(max(view_m, range_m), FARTHEST_M)
        self.key = named_key(self.random_name, seed)
        self.laws: FittedLaws = synthetic_laws()

    def random(self, *names: str | int) -> np.random.Generator:
        """The random numbers of a name, which hang on the seed and the name alone."""
        return stream(self.seed, self.random_name, *names)

    @property
    def objects(self) -> ObjectColumns:
        """All that cameras may see, at any time."""
        raise NotImplementedError

    @property
    def visibility(self) -> SceneVisibility:
        """Where the objects are, and what of them is in view."""
        raise NotImplementedError

    @functools.cached_property
    def detector(self) -> SyntheticDetector:
        """The detector of every camera."""
        return SyntheticDetector(self.objects, self.laws, on_grid=self.on_grid, view_m=self.view_m)

    def knows(self, label: str) -> bool:
        """Whether objects with a label would be among ``objects`` if they were there."""
        return True

    def are_there(
        self,
        labels: Sequence[str],
        east_m: Array,
        north_m: Array,
        *,
        t_s: Array,
        tolerance_m: float,
    ) -> Flags:
        """Whether anything of the class of each label (n,) is within a distance [m] of each place
        (n,) at its time (n,), whether it can be seen or not.
        """
        class_ = self.objects.classes_of(labels)
        near = self.visibility.near(east_m, north_m, t_s, class_=class_, radius_m=tolerance_m)
        slot = near.slot
        away_m = np.hypot(near.east_m - east_m[slot], near.north_m - north_m[slot])
        # An unknown label has the code of nothing, as ghosts have, which are not there.
        is_right = (class_[slot] != self.objects.nothing) & (away_m <= tolerance_m)
        is_right &= self.objects.class_[near.row] == class_[slot]
        are_there = np.zeros(len(labels), dtype=bool)
        are_there[slot[is_right]] = True
        return are_there

    def truth(self, visible: VisibleObjects) -> list[SceneObject]:
        """The real ones of some visible objects, without the ghosts."""
        visible = visible.only(self.objects.real[visible.row])
        objects, row = self.objects, visible.row
        columns = (
            objects.label[row],
            visible.moving,
            visible.east_m,
            visible.north_m,
            objects.up_m[row],
        )
        return list(map(SceneObject, *(column.tolist() for column in columns)))

    def facts(self) -> Mapping[str, object]:
        """What the scene is made from, besides its seed."""
        raise NotImplementedError

    def provenance(self) -> dict[str, object]:
        """Where it comes from, for ``run.json``."""
        return {
            "source": self.name,
            **self.facts(),
            "seed": self.seed,
            "laws": dict(self.laws.provenance),
            "laws_digest": self.laws.digest,
            "features": dict.fromkeys(FEATURES, "surrogate"),
        }
