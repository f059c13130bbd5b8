"""The sector that a camera sees."""

import math

from genie_sim.base.grid import Area, area_around
from genie_sim.core.messages import CameraPose

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
