"""Where everything is in a town, and what of it a camera has in view.

Who keeps a speed stands still in a frame that moves along: of all that moves along one axis at one
speed there is one tree of places, periodic in the length of the streets, and one of all that
stands. So of a car that goes east at 10 m/s, from 140 m on at time 0, on a street of 300 m: after
20 s it has left at the eastern end, entered at the western one, and is at 140 + 200 - 300 = 40 m.
In its own frame it is at 140 m still, and who asks for 42 m then asks for 42 - 200 = -158 m, or,
300 m farther, 142 m: the car is 2 m away.

Houses fill the blocks between the streets and hide what is behind them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from genie_sim.base.geometry import Array
from genie_sim.base.spans import Flags, Ints
from genie_sim.worlds.scene.objects import ObjectColumns
from genie_sim.worlds.scene.view import (
    HALF_C,
    PlacedObjects,
    ViewPoses,
    VisibleObjects,
    in_view,
    near_pairs,
    shares_in_rectangle,
    shares_in_slab,
)
from genie_sim.worlds.town.rules import TownRules
from genie_sim.worlds.town.streets import Street

ROUNDING_M = 1e-6


class _Tracks(NamedTuple):
    """How all objects move, as columns: where each is at time 0 [m], along and across its street,
    its speed [m/s] along it, whether the street leads north, and its length [m].
    """

    along_m: Array
    across_m: Array
    speed_mps: Array
    northbound: Flags
    length_m: Array


class _SameVelocity:
    """Objects that stand, or that go at one speed along one axis: their rows among all of the town,
    which classes they are of, by code, and the tree of their places along and across at time 0.
    """

    def __init__(self, rows: Ints, tracks: _Tracks, has_class: Flags) -> None:
        self._row, self.has_class = rows, has_class
        self.speed_mps = tracks.speed_mps.item(rows[0])
        self.northbound = tracks.northbound.item(rows[0])
        self._length_m = tracks.length_m.item(rows[0])
        box = [self._length_m, 0.0] if self.speed_mps else None
        self._tree = cKDTree(np.column_stack(tracks[:2])[rows], boxsize=box)

    def near(self, moved_m: Array, radius_m: float) -> tuple[Ints, Ints]:
        """All pairs of a place (n, 2), in the frame that moves with these objects, and one of them
        within a distance [m]: the numbers of the places, in order, and the rows.
        """
        if self.speed_mps:
            along_m = moved_m[:, 0] % self._length_m
            along_m[along_m == self._length_m] = 0.0
            moved_m = np.column_stack([along_m, moved_m[:, 1]])
        place, number = near_pairs(self._tree, moved_m, radius_m + ROUNDING_M)
        return place, self._row[number]


class Places:
    """Where everything is in a town at any time, ghosts too.

    ``objects`` are those of the ``streets``, street by street; up to ``sight_m`` they are in view.
    """

    def __init__(
        self, rules: TownRules, streets: Sequence[Street], objects: ObjectColumns, sight_m: float
    ) -> None:
        self._objects, self._sight_m, self._block_m = objects, sight_m, rules.block_m
        self._house_m = rules.block_m / 2 - rules.street_half_m  # from the middle of a block
        rows = [
            (item.along_m, item.across_m, item.speed_mps, street.northbound, street.length_m)
            for street in streets
            for item in street.objects
        ]
        self._tracks = _Tracks._make(np.array(column) for column in zip(*rows, strict=True))
        ways = np.array([self._tracks.speed_mps, self._tracks.northbound])
        different, way = np.unique(ways, axis=1, return_inverse=True)
        self._velocities = []
        for number in range(different.shape[1]):
            of_way = np.flatnonzero(way.ravel() == number)
            has_class = np.bincount(objects.class_[of_way], minlength=objects.nothing + 1) > 0
            self._velocities.append(_SameVelocity(of_way, self._tracks, has_class))

    def _moved(self, east_m: Array, north_m: Array, t_s: Array) -> Array:
        """Places (n,) at their times in the frame of each velocity (velocities, n, 2)."""
        speed_mps = np.array([each.speed_mps for each in self._velocities])[:, None]
        northbound = np.array([each.northbound for each in self._velocities])[:, None]
        along_m = np.where(northbound, north_m, east_m) - speed_mps * t_s
        return np.stack([along_m, np.where(northbound, east_m, north_m)], axis=-1)

    def _at(self, row: Ints, t_s: Array) -> tuple[Array, Array]:
        """East and north [m] of objects at some times; the two are broadcast together."""
        start_m, across_m, speed_mps, northbound, length_m = (
            column[row] for column in self._tracks
        )
        gone_m = speed_mps * t_s
        # how often each has begun anew: negative for those who come back
        laps = np.where(speed_mps == 0.0, 0.0, np.floor_divide(start_m + gone_m, length_m))
        along_m = start_m + (gone_m - laps * length_m)
        east_m = np.where(northbound, across_m, along_m)
        north_m = np.where(northbound, along_m, across_m)
        return east_m, north_m

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        """As ``scene.SceneVisibility``: of each velocity what is near any of the poses, of that
        what is in the field of view, and of that what no house hides.
        """
        ahead_m = self._sight_m / (2 * HALF_C)  # in a circle is all that is in view, and the camera
        moved_m = self._moved(
            poses.east_m + ahead_m * poses.cos, poses.north_m + ahead_m * poses.sin, poses.t_s
        )
        low_m, high_m = moved_m.min(axis=1), moved_m.max(axis=1)
        middle_m, radius_m = (low_m + high_m) / 2, ahead_m + np.hypot(*(high_m - low_m).T) / 2
        row = np.concatenate(
            [
                velocity.near(middle_m[number, None], radius_m.item(number))[1]
                for number, velocity in enumerate(self._velocities)
            ]
        )
        east_m, north_m = self._at(row, poses.t_s[:, None])
        slot = np.arange(len(poses.t_s))
        candidates = PlacedObjects(
            slot=np.repeat(slot, len(row)),
            row=np.tile(row, len(slot)),
            moving=np.tile(self._tracks.speed_mps[row] != 0.0, len(slot)),
            east_m=east_m.ravel(),
            north_m=north_m.ravel(),
        )
        visible = in_view(poses, candidates, self._objects, self._sight_m)
        clear = ~self._behind_houses(
            (poses.east_m[visible.slot], visible.east_m),
            (poses.north_m[visible.slot], visible.north_m),
        )
        return visible.only(clear)

    def _behind_houses(self, east_m: tuple[Array, Array], north_m: tuple[Array, Array]) -> Flags:
        """Which lines of sight, each from one place to another, pass through the square of a
        block.
        """
        hidden = np.zeros(len(east_m[0]), dtype=bool)
        for along, across in itertools.product(
            self._shares_in_blocks(*east_m), self._shares_in_blocks(*north_m)
        ):
            hidden |= np.less(*shares_in_rectangle(along, across))
        return hidden

    def _shares_in_blocks(self, from_m: Array, to_m: Array) -> list[tuple[Array, Array]]:
        """From which share of each line to which it is between the borders of houses, along one
        axis, for each of the blocks that it passes.

        In blocks of 150 m, houses stand from 10 to 140 m and from 160 to 290 m: a line from 100 to
        200 m passes them from -.9 to .4 and from .6 to 1.9 of its length.
        """
        first = np.floor(np.minimum(from_m, to_m) / self._block_m)
        last = np.floor(np.maximum(from_m, to_m) / self._block_m)
        shares = []
        for number in range(int((last - first).max(initial=0.0)) + 1):
            middle_m = (np.minimum(first + number, last) + 0.5) * self._block_m
            shares.append(shares_in_slab(middle_m - from_m, to_m - from_m, self._house_m))
        return shares

    def near(
        self, east_m: Array, north_m: Array, t_s: Array, *, class_: Ints, radius_m: float
    ) -> PlacedObjects:
        """As ``scene.SceneVisibility``, but speed by speed."""
        places, rows = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        moved_m = self._moved(east_m, north_m, t_s)
        for number, velocity in enumerate(self._velocities):
            asked = np.flatnonzero(velocity.has_class[class_])
            if len(asked):
                place, row = velocity.near(moved_m[number, asked], radius_m)
                places.append(asked[place])
                rows.append(row)
        place, row = np.concatenate(places), np.concatenate(rows)
        moving = self._tracks.speed_mps[row] != 0.0
        return PlacedObjects(place, row, moving, *self._at(row, t_s[place]))
