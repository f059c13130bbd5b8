"""What a camera among recorded traffic has in view: vehicles that no nearer vehicle hides."""

import numpy as np

from genie_sim.worlds.scene.frames import CAMERA_UP_M
from genie_sim.worlds.scene.objects import LONGEST_M, ObjectColumns
from genie_sim.worlds.scene.view import (
    HALF_C,
    HALF_S,
    Flags,
    Ints,
    PlacedObjects,
    ViewPoses,
    VisibleObjects,
    between,
    in_view,
)
from genie_sim.worlds.traffic.vehicles import Vehicles, VehicleStates

OWN_M = 1.5  # no other vehicle's middle is so near to a camera: it is the one that carries it
BEYOND_M = LONGEST_M / 2  # the longest vehicle may hide others before its middle is in view


class TrafficView:
    """What any camera among vehicles has in view, up to ``view_m`` away.

    A vehicle is hidden where a nearer one covers its middle: where the line of sight from the
    camera to its middle, half its height above the ground, passes through the box of the other. So
    a lorry hides a car, and a camera looks over a car at a bus.
    """

    def __init__(self, vehicles: Vehicles, objects: ObjectColumns, view_m: float) -> None:
        self._vehicles, self._objects, self._view_m = vehicles, objects, view_m

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        """Of all poses together; fastest if they are near each other."""
        radius_m = self._view_m + BEYOND_M
        stretches = self._vehicles.near(
            poses.east_m.min() - radius_m,
            poses.north_m.min() - radius_m,
            poses.east_m.max() + radius_m,
            poses.north_m.max() + radius_m,
            times_s=poses.t_s,
        )
        states = self._vehicles.at(stretches, poses.t_s[:, None])
        is_other = self._may_matter(poses, states)
        pose, column = np.nonzero(is_other)
        rows = self._vehicles.vehicle[stretches[column]]
        candidates = PlacedObjects(
            pose=pose,
            row=rows,
            number_offset=np.zeros(len(rows), dtype=np.int64),
            east_m=states.east_m[pose, column],
            north_m=states.north_m[pose, column],
        )
        visible = in_view(poses, candidates, self._objects, self._view_m)
        if not len(visible.pose):
            return visible
        is_hidden = self._hidden(poses, visible, stretches, states=states, is_other=is_other)
        return VisibleObjects._make(column[~is_hidden] for column in visible)

    def _may_matter(self, poses: ViewPoses, states: VehicleStates) -> Flags:
        """Which vehicles are seen from a pose or may hide others, (poses, stretches): those in a
        wedge that is wider than the field of view by a vehicle's length.
        """
        dx = states.east_m - poses.east_m[:, None]
        dy = states.north_m - poses.north_m[:, None]
        c, s = poses.cos[:, None], poses.sin[:, None]
        ahead_m, left_m = dx * c + dy * s, np.abs(dy * c - dx * s)
        in_wedge = left_m * HALF_C <= ahead_m * HALF_S + BEYOND_M * HALF_C
        is_own = np.maximum(np.abs(dx), np.abs(dy)) < OWN_M
        near: Flags = states.there & in_wedge & (ahead_m > -BEYOND_M) & ~is_own
        return near

    def _hidden(
        self,
        poses: ViewPoses,
        visible: VisibleObjects,
        stretches: Ints,
        *,
        states: VehicleStates,
        is_other: Flags,
    ) -> Flags:
        """Which of the objects in the field of view nearer vehicles hide.

        Parameters
        ----------
        poses : of the cameras
        visible : what is in their fields of view (n,)
        stretches : those that may hide something (m,)
        states : where they are (poses, m)
        is_other : which of them matter to which pose (poses, m)
        """
        vehicles = self._vehicles
        owner = vehicles.vehicle[stretches]
        target, column = np.nonzero(is_other[visible.pose] & (owner != visible.row[:, None]))
        pose = visible.pose[target]
        # Of each pair, seen from the camera: the target, and the vehicle that may hide it.
        from_east_m, from_north_m = poses.east_m[pose], poses.north_m[pose]
        to_x, to_y = visible.east_m[target] - from_east_m, visible.north_m[target] - from_north_m
        by_x = states.east_m[pose, column] - from_east_m
        by_y = states.north_m[pose, column] - from_north_m
        c, s = states.cos[pose, column], states.sin[pose, column]
        hider = owner[column]
        # Shares of the line of sight between the sides, and between the ends, of the vehicle.
        along = between(by_x * c + by_y * s, to_x * c + to_y * s, vehicles.lengths_m[hider] / 2)
        across = between(by_y * c - by_x * s, to_y * c - to_x * s, vehicles.widths_m[hider] / 2)
        enters = np.maximum(np.maximum(along[0], across[0]), 0.0)
        leaves = np.minimum(np.minimum(along[1], across[1]), 1.0)
        rise_m = self._objects.up_m[visible.row[target]] - CAMERA_UP_M
        lowest_m = CAMERA_UP_M + np.minimum(enters * rise_m, leaves * rise_m)
        hides = (enters < leaves) & (lowest_m < vehicles.heights_m[hider])
        is_hidden = np.zeros(len(visible.pose), dtype=bool)
        is_hidden[target[hides]] = True
        return is_hidden
