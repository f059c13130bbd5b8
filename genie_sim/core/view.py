"""What a camera sees: the sector of its field of view, and what nearer objects hide in it."""

import math

from genie_sim.base.grid import Area, area_around
from genie_sim.core.messages import CameraPose, Look
from genie_sim.core.tracking import kind_of

NEAREST_M, FARTHEST_M = 3.5, 40.0  # where a detector that looks at an object should find it
MARGIN_RAD = math.radians(2.0)  # no object is missed at the border of a picture
HIDDEN_BEHIND_M = 2.0  # what is farther away than a detection by this much is hidden by it
WIDE_RAD = math.radians(60.0)  # half angle from which on a sector's box is that of the whole disc


class ViewSector:
    """The part of the ground plane in a camera's horizontal field of view, up to a range.

    ``ahead`` is the direction of its axis, east and north; ``min_cosine`` is that of the angle from
    there to its border.
    """

    __slots__ = ("ahead", "half_rad", "min_cosine", "pose", "range_m")

    def __init__(
        self, pose: CameraPose, horizontal_fov_rad: float, range_m: float = math.inf
    ) -> None:
        self.pose, self.range_m = pose, range_m
        self.half_rad = min(max(horizontal_fov_rad / 2, 0.0), math.pi)
        self.ahead = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
        # a whole turn shall see everything, whatever is rounded
        self.min_cosine = math.cos(self.half_rad) if self.half_rad < math.pi else -2.0

    def distance_m(self, east_m: float, north_m: float) -> float | None:
        """How far away from the camera a place in view is; ``None`` for a place out of view."""
        pose, ahead = self.pose, self.ahead
        away_east_m, away_north_m = east_m - pose[0], north_m - pose[1]
        ahead_m = away_east_m * ahead[0] + away_north_m * ahead[1]
        if ahead_m < 0.0 <= self.min_cosine:
            return None
        distance_m = math.hypot(away_east_m, away_north_m)
        if distance_m > self.range_m or ahead_m < self.min_cosine * distance_m:
            return None
        return distance_m

    def box(self) -> Area:
        """An upright rectangle around the sector: around the kite that touches its arc at the ends
        and the middle, or around the whole disc if the sector is wide.
        """
        east_m, north_m = self.pose[:2]
        range_m = self.range_m
        if self.half_rad > WIDE_RAD:
            return area_around(east_m, north_m, range_m)
        # to where its axis and its borders lead
        ahead_east_m, ahead_north_m = range_m * self.ahead[0], range_m * self.ahead[1]
        cosine = self.min_cosine
        sine = math.sqrt(1.0 - cosine * cosine)
        left_east_m = ahead_east_m * cosine - ahead_north_m * sine
        left_north_m = ahead_north_m * cosine + ahead_east_m * sine
        right_east_m = ahead_east_m * cosine + ahead_north_m * sine
        right_north_m = ahead_north_m * cosine - ahead_east_m * sine
        tip_east_m, tip_north_m = ahead_east_m / cosine, ahead_north_m / cosine
        return (
            east_m + min(0.0, left_east_m, right_east_m, tip_east_m),
            north_m + min(0.0, left_north_m, right_north_m, tip_north_m),
            east_m + max(0.0, left_east_m, right_east_m, tip_east_m),
            north_m + max(0.0, left_north_m, right_north_m, tip_north_m),
        )


class View:
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
