"""What a camera sees: fields of view, and what nearer objects hide."""

import math
from collections.abc import Sequence

from genie_sim.core.tracking import kind_of
from genie_sim.messages import CameraPose, Look

NEAREST_M, FARTHEST_M = 3.5, 40.0  # where a detector that looks at an object should find it
MARGIN_RAD = math.radians(2.0)  # no object is missed at the border of a picture
BEHIND_M = 2.0  # so much farther away than a detection is hidden by it


class View:
    """The field of view of one look, with the shadows of what was detected."""

    def __init__(self, look: Look) -> None:
        self.pose = look.pose
        self._half_rad = look.horizontal_fov_rad / 2 - MARGIN_RAD
        self._ahead = math.cos(look.pose.heading_rad), math.sin(look.pose.heading_rad)
        self._least_ahead = math.cos(
            min(max(self._half_rad, 0.0), math.pi)
        )  # per metre of distance
        self._shadows: list[tuple[float, float, float]] = []  # bearing, half width, range
        for one in look.detections:
            if one.location is not None:
                range_m, bearing_rad = bearing(self.pose, one.location[0], one.location[1])
                half_rad = math.atan2(kind_of(one.label).half_width_m, max(range_m, 0.1))
                self._shadows.append((bearing_rad, half_rad, range_m + BEHIND_M))

    def range_m(self, east_m: float, north_m: float) -> float | None:
        """How far away a place is where the detector should find an object; ``None`` if it is not to be seen."""
        away_east_m, away_north_m = east_m - self.pose[0], north_m - self.pose[1]
        range_m = math.hypot(away_east_m, away_north_m)
        ahead_m = away_east_m * self._ahead[0] + away_north_m * self._ahead[1]
        if not NEAREST_M <= range_m <= FARTHEST_M or ahead_m < self._least_ahead * range_m:
            return None
        bearing_rad = bearing(self.pose, east_m, north_m)[1]
        for middle_rad, half_rad, from_m in self._shadows:
            if range_m > from_m and abs(bearing_rad - middle_rad) <= half_rad:
                return None
        return range_m


def bearing(pose: CameraPose, east_m: float, north_m: float) -> tuple[float, float]:
    """Distance [m] and angle [rad] of a place from a camera's axis, counter-clockwise, in [-pi, pi]."""
    away_east_m, away_north_m = east_m - pose[0], north_m - pose[1]
    turn_rad = math.remainder(math.atan2(away_north_m, away_east_m) - pose[3], 2 * math.pi)
    return math.hypot(away_east_m, away_north_m), turn_rad


def rectangle(
    pose: CameraPose, half_rad: float, range_m: float
) -> tuple[float, float, float, float]:
    """West, east, south and north of an upright rectangle around a view: around the kite that touches the arc of its
    circle sector at the ends and the middle, around the whole circle if the sector is wide."""
    east_m, north_m, _, heading_rad = pose
    easts: Sequence[float]
    if half_rad > WIDE_RAD:
        return east_m - range_m, east_m + range_m, north_m - range_m, north_m + range_m
    left, right, tip_m = (
        heading_rad + half_rad,
        heading_rad - half_rad,
        range_m / math.cos(half_rad),
    )
    easts = 0.0, range_m * math.cos(left), range_m * math.cos(right), tip_m * math.cos(heading_rad)
    norths = 0.0, range_m * math.sin(left), range_m * math.sin(right), tip_m * math.sin(heading_rad)
    return east_m + min(easts), east_m + max(easts), north_m + min(norths), north_m + max(norths)


WIDE_RAD = math.radians(60.0)  # half of a view that is looked for in a whole circle
