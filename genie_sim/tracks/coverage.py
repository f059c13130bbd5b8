"""What a look covers: where it should find objects, and what nearer ones hide in it."""

import math
from dataclasses import dataclass

from genie_sim.core.messages import CameraPose, Header, Look
from genie_sim.core.view import ViewSector
from genie_sim.tracks.track import kind_of

# Assumed. Where a detector that looks at an object should find it: nearer ones are cut off by the
# picture's border, farther ones are small. At a picture's left and right border, too, none counts
# as missed. What is farther away than a detection by ``HIDDEN_BEHIND_M`` is hidden by it.
NEAREST_M, FARTHEST_M = 3.5, 40.0
MARGIN_RAD = math.radians(2.0)
HIDDEN_BEHIND_M = 2.0


@dataclass(slots=True)
class Viewer:
    """Who asks, and from where its camera looks."""

    header: Header
    pose: CameraPose
    horizontal_fov_rad: float


class Coverage:
    """Where one look should find objects: in its field of view, outside the shadows of others."""

    def __init__(self, look: Look) -> None:
        self.pose = look.pose
        self._sector = ViewSector(
            look.pose, look.horizontal_fov_rad - 2 * MARGIN_RAD, range_m=FARTHEST_M
        )
        # of each detection: bearing of its middle, half of the angle that it takes, and from which
        # distance on it hides what is there
        self._shadows: list[tuple[float, float, float]] = []
        for detection in look.detections:
            if detection.location is not None:
                range_m, bearing_rad = bearing(self.pose, *detection.location[:2])
                half_rad = math.atan2(kind_of(detection.label).half_width_m, max(range_m, 0.1))
                self._shadows.append((bearing_rad, half_rad, range_m + HIDDEN_BEHIND_M))

    def range_m(self, east_m: float, north_m: float) -> float | None:
        """How far away a place is where the detector should find an object; ``None`` where it
        cannot be expected to.
        """
        range_m = self._sector.distance_m(east_m, north_m)
        if range_m is None or range_m < NEAREST_M:
            return None
        _, bearing_rad = bearing(self.pose, east_m, north_m)
        for middle_rad, half_rad, from_m in self._shadows:
            if range_m > from_m and abs(bearing_rad - middle_rad) <= half_rad:
                return None
        return range_m


def bearing(pose: CameraPose, east_m: float, north_m: float) -> tuple[float, float]:
    """Distance [m] and angle [rad] of a place from a camera's axis, counter-clockwise, in [-pi,
    pi].
    """
    away_east_m, away_north_m = east_m - pose[0], north_m - pose[1]
    turn_rad = math.remainder(math.atan2(away_north_m, away_east_m) - pose[3], 2 * math.pi)
    return math.hypot(away_east_m, away_north_m), turn_rad
