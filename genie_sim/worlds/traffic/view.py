"""What a camera among recorded traffic has in view: vehicles that no nearer vehicle hides."""

import numpy as np

from genie_sim.base.classes import MOVING_MPS
from genie_sim.base.geometry import Array
from genie_sim.base.spans import Flags, Ints, rows_of_spans
from genie_sim.worlds.scene.frames import CAMERA_UP_M, Motions
from genie_sim.worlds.scene.objects import LONGEST_M, ObjectColumns
from genie_sim.worlds.scene.view import (
    HALF_C,
    HALF_S,
    PlacedObjects,
    ViewPoses,
    VisibleObjects,
    in_view,
    shares_in_rectangle,
    shares_in_slab,
)
from genie_sim.worlds.traffic.vehicles import Vehicles

OWN_M = 1.5  # no other vehicle's middle is so near to a camera: it is the one that carries it
BEYOND_M = LONGEST_M / 2  # the longest vehicle may hide others before its middle is in view


class TrafficView:
    """What any camera among vehicles has in view, up to ``sight_m`` away.

    A vehicle is hidden where a nearer one covers its middle: where the line of sight from the
    camera to its middle, half its height above the ground, passes through the box of the other. So
    a lorry hides a car, and a camera looks over a car at a bus. The row of a vehicle among
    ``objects`` is its number.
    """

    def __init__(self, vehicles: Vehicles, objects: ObjectColumns, sight_m: float) -> None:
        self._vehicles, self._objects, self._sight_m = vehicles, objects, sight_m

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        vehicles = self._vehicles
        slot, sighting = vehicles.near(
            poses.east_m, poses.north_m, poses.t_s, self._sight_m + BEYOND_M
        )
        motions = vehicles.at(sighting, poses.t_s[slot])
        matters = self._may_matter(poses, slot, motions)
        motions = Motions._make(column[matters] for column in motions)
        candidates = self._placed(slot[matters], sighting[matters], motions)
        visible = in_view(poses, candidates, self._objects, self._sight_m)
        is_hidden = self._hidden(poses, visible, candidates, motions)
        return visible.only(~is_hidden)

    def _may_matter(self, poses: ViewPoses, slot: Ints, motions: Motions) -> Flags:
        """Which vehicles (n,) are seen in their slots (n,) or may hide others: those in a wedge
        that is wider than the field of view by a vehicle's length.
        """
        dx, dy = motions.east_m - poses.east_m[slot], motions.north_m - poses.north_m[slot]
        c, s = poses.cos[slot], poses.sin[slot]
        ahead_m, left_m = dx * c + dy * s, np.abs(dy * c - dx * s)
        in_wedge = left_m * HALF_C <= ahead_m * HALF_S + BEYOND_M * HALF_C
        is_own = np.maximum(np.abs(dx), np.abs(dy)) < OWN_M
        matters: Flags = in_wedge & (ahead_m > -BEYOND_M) & ~is_own
        return matters

    def _hidden(
        self,
        poses: ViewPoses,
        visible: VisibleObjects,
        candidates: PlacedObjects,
        motions: Motions,
    ) -> Flags:
        """Which of the objects in the field of view (n,) others hide.

        Parameters
        ----------
        poses : of the cameras
        visible : what is in their fields of view (n,)
        candidates : what may hide it (m,), slot by slot
        motions : of the candidates (m,)
        """
        counts = np.bincount(candidates.slot, minlength=len(poses.key))
        firsts = np.cumsum(counts) - counts
        # Pairs of two vehicles in one slot: the target, and the one that may hide it.
        hider, target = rows_of_spans(firsts[visible.slot], counts[visible.slot])
        are_two = candidates.row[hider] != visible.row[target]
        hider, target = hider[are_two], target[are_two]
        slot, vehicle = visible.slot[target], candidates.row[hider]
        from_east_m, from_north_m = poses.east_m[slot], poses.north_m[slot]
        to_x, to_y = visible.east_m[target] - from_east_m, visible.north_m[target] - from_north_m
        by_x, by_y = motions.east_m[hider] - from_east_m, motions.north_m[hider] - from_north_m
        c, s = motions.cos[hider], motions.sin[hider]
        # Shares of the line of sight between the ends, and between the sides, of the hider.
        along = shares_in_slab(
            by_x * c + by_y * s, to_x * c + to_y * s, self._vehicles.lengths_m[vehicle] / 2
        )
        across = shares_in_slab(
            by_y * c - by_x * s, to_y * c - to_x * s, self._vehicles.widths_m[vehicle] / 2
        )
        enters, leaves = shares_in_rectangle(along, across)
        rise_m = self._objects.up_m[visible.row[target]] - CAMERA_UP_M
        lowest_m = CAMERA_UP_M + np.minimum(enters * rise_m, leaves * rise_m)
        hides = (enters < leaves) & (lowest_m < self._vehicles.heights_m[vehicle])
        is_hidden = np.zeros(len(visible.slot), dtype=bool)
        is_hidden[target[hides]] = True
        return is_hidden

    def near(
        self, east_m: Array, north_m: Array, t_s: Array, *, class_: Ints, radius_m: float
    ) -> PlacedObjects:
        """As ``scene.SceneVisibility``, whatever the class."""
        slot, sighting = self._vehicles.near(east_m, north_m, t_s, radius_m)
        return self._placed(slot, sighting, self._vehicles.at(sighting, t_s[slot]))

    def _placed(self, slot: Ints, sighting: Ints, motions: Motions) -> PlacedObjects:
        """The vehicles of some sightings (n,) as objects, with how they move then (n,)."""
        return PlacedObjects(
            slot=slot,
            row=self._vehicles.vehicle[sighting],
            moving=motions.speed_mps > MOVING_MPS,
            east_m=motions.east_m,
            north_m=motions.north_m,
        )
