"""The detector of towns and traffic: what the laws let it find of what a camera has in view.

A *look* is one object in view of one slot. Its steps, in ``SyntheticDetector.detect``:

1. what the random numbers of each look hang on (``_looks``);
2. its score; 0 is a miss, and only the others go on;
3. how far behind its place it is put, and how far left of it, each with numbers of its own;
4. what it is called (``_labels``).

False positives that come back at a place are objects as all others, whose laws are those of ghosts;
those that are seen once are drawn frame by frame (``fleeting``).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.base.spans import Ints
from genie_sim.core.messages import Detection, Location
from genie_sim.data.trace import POSITION_DECIMALS, SCORE_DECIMALS
from genie_sim.worlds.scene import keys, noise
from genie_sim.worlds.scene.kept_words import PLACED_BY
from genie_sim.worlds.scene.laws import (
    MAX_VIEW_M,
    MIDDLE,
    STEPS_PER_Z,
    Copula,
    FittedLaws,
    quantile,
)
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, MIDDLES_M, Bits, ObjectColumns
from genie_sim.worlds.scene.view import ViewPoses, VisibleObjects


def detection(label: str, score: float, location: Location) -> Detection:
    """What a detector of a scene gives: it has no boxes, as there are no pictures."""
    return Detection(
        label, score, box=None, location=location, confidence=score, placed_by=PLACED_BY
    )


class DetectedObjects(NamedTuple):
    """What the detector finds, slot by slot: of each object its ``label`` (n,), and as ``placed``
    (n, 4) its score, east, north and up [m]. ``begins`` (slots + 1,) is where each slot's objects
    begin, and where the last one's end.
    """

    begins: list[int]
    label: Array
    placed: Array

    def detections(self, slot: int) -> list[Detection]:
        """What it finds in one frame, in the order of the view."""
        span = slice(self.begins[slot], self.begins[slot + 1])
        columns = zip(self.label[span].tolist(), self.placed[span].tolist(), strict=True)
        return [detection(label, score, (x, y, z)) for label, (score, x, y, z) in columns]


class _Looks(NamedTuple):
    """On what the random numbers of each look depend, as columns (n,)."""

    group: Ints
    """The group of the object's laws."""

    whole_m: Ints
    """How far away it is, in whole metres: the row of a copula's table."""

    smooth_row: Ints
    """Which of the smooth numbers (``noise.smooth_row``)."""

    key: Bits
    """Of the object in this frame: picks the numbers that are new at each look."""


class SyntheticDetector:
    """Samples detections, misses and false positives from the fitted laws, for a camera that stands
    anywhere in a scene.
    """

    def __init__(
        self,
        objects: ObjectColumns,
        laws: FittedLaws,
        *,
        on_grid: bool,
        view_m: float = MAX_VIEW_M,
    ) -> None:
        """``objects`` are all that may be in view; ``on_grid``: streets lead east and north, as a
        town's, and not anywhere; nothing is found farther away than ``view_m`` [m].
        """
        self._objects, self._laws = objects, laws
        self._on_grid, self._view_m = on_grid, view_m

    def detect(self, visible: VisibleObjects, poses: ViewPoses) -> DetectedObjects:
        """What it finds of the objects in view (n,) from some poses (slots,)."""
        objects, laws = self._objects, self._laws
        visible = visible.only(visible.away_m <= self._view_m)
        looks = self._looks(visible, poses)
        score = self._drawn(laws.score, objects.score_z[visible.row], looks, keys.LOOK_SCORE)
        found = np.flatnonzero(score)
        slot, row, _, east_m, north_m, away_m = visible.only(found)
        looks = _Looks._make(column[found] for column in looks)
        # Errors as shares of the distance, so that the line of sight need not be of length 1.
        behind = self._drawn(laws.along, objects.along_z[row], looks, keys.LOOK_ALONG) / away_m
        left = self._drawn(laws.across, objects.across_z[row], looks, keys.LOOK_ACROSS) / away_m
        dx, dy = east_m - poses.east_m[slot], north_m - poses.north_m[slot]
        placed = np.empty((len(found), 4))
        placed[:, 0], placed[:, 3] = score[found], objects.up_m[row]
        # In whole millimetres, halves upwards: not as a trace, but kept runs hold it.
        placed[:, 1] = np.floor((east_m + behind * dx - left * dy) * 1000.0 + 0.5) / 1000.0
        placed[:, 2] = np.floor((north_m + behind * dy + left * dx) * 1000.0 + 0.5) / 1000.0
        begins = np.searchsorted(slot, np.arange(len(poses.key) + 1)).tolist()
        return DetectedObjects(begins, self._labels(row, looks), placed)

    def fleeting(self, poses: ViewPoses, slot: int) -> list[Detection]:
        """The false positive that is seen once, if there is one: in one frame, anywhere in view."""
        east_m, north_m, cos, sin = (column.item(slot) for column in poses[:4])
        key = poses.key.item(slot)
        draw = keys.FRAME_FLEETING.share(key)
        for law in self._laws.fleeting:
            if draw < law.per_frame:
                break
            draw -= law.per_frame
        else:
            return []
        own_key = keys.mix(key)
        away_m = quantile(law.ranges_m, keys.FLEETING_RANGE.share(own_key))
        if away_m > self._view_m:
            return []
        angle_rad = (keys.FLEETING_ANGLE.share(own_key) - 0.5) * HORIZONTAL_FOV_RAD
        score = quantile(law.scores, keys.FLEETING_SCORE.share(own_key))
        ahead_m, left_m = away_m * math.cos(angle_rad), away_m * math.sin(angle_rad)
        location = (
            round(east_m + ahead_m * cos - left_m * sin, POSITION_DECIMALS),
            round(north_m + ahead_m * sin + left_m * cos, POSITION_DECIMALS),
            MIDDLES_M[law.label],
        )
        return [detection(law.label, round(score, SCORE_DECIMALS), location)]

    def _looks(self, visible: VisibleObjects, poses: ViewPoses) -> _Looks:
        """One for each object in view (n,)."""
        objects, slot, row = self._objects, visible.slot, visible.row
        if self._on_grid:
            gone_m, direction = _gone(poses)
            changed_m = visible.away_m - gone_m[slot]
            smooth_row = noise.smooth_row(changed_m, objects.offset[row], direction[slot])
        else:
            # How far the camera has gone past the object: on a straight street the same but for a
            # number that stays with each object, and in a bend without a jump.
            dx, dy = visible.east_m - poses.east_m[slot], visible.north_m - poses.north_m[slot]
            ahead_m = dx * poses.cos[slot] + dy * poses.sin[slot]
            smooth_row = noise.smooth_row(visible.away_m + ahead_m, objects.offset[row])
        return _Looks(
            group=objects.group[row],
            whole_m=(visible.away_m + 0.5).astype(np.int64),
            smooth_row=smooth_row,
            key=keys.look_keys(objects.key[row], poses.key[slot]),
        )

    def _drawn(self, copula: Copula, lasting_z: Array, looks: _Looks, draw: keys.BitField) -> Array:
        """A value (n,) of a copula's table for each look: for the sum of what stays with the object
        (``lasting_z``), of its view and of this look, whose ``draw`` are these bits of its key.
        """
        group = looks.group
        normal = noise.normals()[draw.of(looks.key)]
        z = lasting_z + copula.view_weight[group] * copula.views[group, looks.smooth_row]
        z += copula.look_weight[group] * normal
        column = (z * STEPS_PER_Z + MIDDLE).astype(np.int64)
        values: Array = copula.table[group, looks.whole_m, column]
        return values

    def _labels(self, row: Ints, looks: _Looks) -> Any:
        """What the detector calls the object of each look (n,)."""
        labels = self._objects.label[row]
        is_prone = keys.OBJECT_PRONE.of(self._objects.key[row]) < self._laws.prone[looks.group]
        prone = np.flatnonzero(is_prone)
        draws = keys.LOOK_NAME.of(looks.key[prone]).tolist()
        for look, draw in zip(prone.tolist(), draws, strict=True):
            called = (name for limit, name in self._laws.names if draw < limit)
            labels[look] = next(called, labels[look])
        return labels


def _gone(poses: ViewPoses) -> tuple[Array, Ints]:
    """How far [m] the camera has gone along its street (slots,), and the number of its direction
    (slots,): 0 to 3 for east, west, north and south.

    The view changes as the camera goes on and the range shrinks; turning into another street is
    another view.
    """
    is_along_east = np.abs(poses.cos) > np.abs(poses.sin)
    is_backwards = np.where(is_along_east, poses.cos, poses.sin) <= 0.0  # to the west or the south
    place_m = np.where(is_along_east, poses.east_m, poses.north_m)
    direction = np.where(is_along_east, 0, 2) + is_backwards
    return np.where(is_backwards, -place_m, place_m), direction
