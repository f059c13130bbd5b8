"""Where in the world is the object in a box? The laser scan's points inside the box say how far,
the box which way.

Points on the ground are removed; the rest falls into clusters, one behind the other: whatever
stands in front, the object, the wall behind it. Of the clusters that are dense enough, the one is
taken that agrees best with where the box's bottom edge meets the ground. The laser sees only the
near surface: a rectangle of a vehicle's usual size is laid along it; for everything else, and for
vehicles hit by few points, half the depth of such an object is added.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from genie_sim.base.classes import SIZES, VEHICLES
from genie_sim.base.geometry import Array, ray
from genie_sim.core.messages import Box, Location
from genie_sim.data.detectors import shape

Indices = npt.NDArray[np.intp]

# Distance [m] from the nearest surface to the object's centre, by label: half the length, for on a
# street most vehicles are seen from an end. A 12 m bus comes out too near. A tram is passed at its
# side. Of a bicycle it is assumed to be between half the width and half the length.
HALF_DEPTH_M = {label: size.length_m / 2 for label, size in SIZES.items()}
HALF_DEPTH_M |= {"train": 1.27, "bicycle": 0.4, "motorcycle": 0.5}
MIN_SHAPE_POINTS = 20
NOT_ON_THE_GROUND = frozenset({"traffic light", "stop sign"})

GROUND_REACH_M = 30.0  # around the car it is taken for a plane
MIN_GROUND_POINTS = 50
GROUND_CLEARANCE_M = 0.25  # points lower than this are road or kerb

# Margin, gap and share, and the choice of a cluster by its foot on the ground, were picked by
# comparing a few of each on the labels of drive 2011_09_26/0005: an error measured on that drive is
# that of a method fitted to it.
BOX_MARGIN = 0.1  # this share of a box at each side is background more often than object
CLUSTER_GAP_M = 0.5  # two clusters are further apart than this along the line of sight
DENSE_SHARE = 0.25  # a cluster is dense with this share of the points in the box
MIN_POINTS = 5
# nearest surface: not the very first point, which may be an antenna or noise
SURFACE_PERCENTILE = 10

# where one pixel moves the ground point by 3 m: range^2 / (focal length * camera height)
MAX_GROUND_RANGE_M = 60.0
BORDER_PX = 4  # a box that ends closer than this to the picture's border is cut off


@dataclass(frozen=True, slots=True)
class Plane:
    """The ground in the laser's frame: z = slope . (x, y) + height."""

    slope: tuple[float, float]
    height_m: float

    def above_m(self, points: Array) -> Array:
        """Height of points (n, 3) above the ground."""
        above_m: Array = points[:, 2] - points[:, :2] @ np.array(self.slope) - self.height_m
        return above_m


def fit_ground(points: Array, laser_height_m: float) -> Plane | None:
    """The ground around the car: least squares through the points near the plane found so far, in a
    narrowing band. ``None`` where too few points are near the first one.

    Parameters
    ----------
    points : of the scan, (n, 3)
    laser_height_m : above flat ground, from which it starts; half a metre off does no harm
    """
    plane, is_fitted = Plane((0.0, 0.0), -laser_height_m), False
    # 1, x, y, z: contiguous, because this takes most of the time of a placement
    columns = np.empty((4, len(points)))
    columns[0], columns[1:] = 1.0, points.T
    columns = np.compress(columns[1] ** 2 + columns[2] ** 2 < GROUND_REACH_M**2, columns, axis=1)
    for band_m in (0.5, 0.3, 0.2, 0.15, 0.15):
        above_m = np.array([-plane.height_m, -plane.slope[0], -plane.slope[1], 1.0]) @ columns
        near = np.compress(np.abs(above_m) < band_m, columns, axis=1)
        if near.shape[1] < MIN_GROUND_POINTS:
            break
        sums = near @ near.T
        try:
            c, a, b = np.linalg.solve(sums[:3, :3], sums[:3, 3]).tolist()
        except np.linalg.LinAlgError:  # all points in one line
            break
        plane, is_fitted = Plane((a, b), c), True
    return plane if is_fitted else None


class Placement:
    """Places the boxes of one picture, given the scan taken with it (``None``: by the ground plane
    alone).
    """

    def __init__(
        self,
        intrinsics: Array,
        image_size: tuple[int, int],
        camera_SE3_velo: Array,
        scan: Array | None,
        *,
        ground: Plane,
    ) -> None:
        """A picture, ready for its boxes.

        Parameters
        ----------
        intrinsics : of the camera, (3, 3)
        image_size : width and height [pixels]
        camera_SE3_velo : from the laser's frame to the camera's, (4, 4)
        scan : the laser's points, (n, 3), or ``None``
        ground : in the laser's frame
        """
        self._intrinsics = intrinsics
        self._image_width, self._image_height = image_size
        velo_SE3_camera = np.asarray(np.linalg.inv(camera_SE3_velo), dtype=np.float64)
        self._height_m = float(ground.above_m(velo_SE3_camera[None, :3, 3])[0])
        # towards the ground, for a direction
        self._falls = np.array([*ground.slope, -1.0]) @ velo_SE3_camera[:3, :3]
        scan = np.empty((0, 3)) if scan is None else scan
        # Points are columns here (3, n), because numpy is several times as fast with them.
        standing = np.compress(ground.above_m(scan) > GROUND_CLEARANCE_M, scan.T, axis=1)
        points = camera_SE3_velo[:3, :3] @ standing + camera_SE3_velo[:3, 3:]
        self._points = np.compress(points[2] > 0, points, axis=1)  # those ahead of the camera
        across, down, scale = intrinsics @ self._points
        across, down = across / scale, down / scale
        self._order = np.argsort(across)  # so that the points of a box are a slice
        self._across, self._down = across[self._order], down[self._order]

    def place(self, label: str, box: Box) -> tuple[Location | None, str]:
        """The object's centre in the camera's frame, and how it was found.

        ``scan``: by the laser points in the box. ``ground``: there are too few; by where the box's
        bottom edge meets the ground. ``none``: neither is possible, the centre is ``None``.
        """
        if label not in HALF_DEPTH_M:  # nobody knows how large it is
            return None, "none"
        ground_m = None if label in NOT_ON_THE_GROUND else self._ground_range_m(box)
        inside = self._inside(box)
        ahead = ray(self._intrinsics, ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2))
        if len(inside) >= MIN_POINTS:
            right, ahead_of_it = self._points[0, inside], self._points[2, inside]
            ranges_m = np.hypot(right, ahead_of_it)
            cluster = near_cluster(ranges_m, ground_m)
            if label in VEHICLES and len(cluster) >= MIN_SHAPE_POINTS:
                outline = np.column_stack([right[cluster], ahead_of_it[cluster]])
                middle = shape.centre(outline, SIZES[label], self._cut(box))
                if middle is not None:
                    x, z = middle
                    return (
                        x,
                        float(ahead[1]) * math.hypot(x, z) / math.hypot(ahead[0], ahead[2]),
                        z,
                    ), "scan"
            surface_m, placed_by = surface(ranges_m[cluster]), "scan"
        elif ground_m is not None and ground_m <= MAX_GROUND_RANGE_M:
            surface_m, placed_by = ground_m, "ground"
        else:
            return None, "none"
        centre = ahead * (surface_m + HALF_DEPTH_M[label]) / math.hypot(ahead[0], ahead[2])
        x, y, z = centre.tolist()
        return (x, y, z), placed_by

    def _inside(self, box: Box) -> Indices:
        """The points in the inner part of a box."""
        margin_x, margin_y = BOX_MARGIN * (box[2] - box[0]), BOX_MARGIN * (box[3] - box[1])
        low = (box[0] + margin_x, box[1] + margin_y)
        high = (box[2] - margin_x, box[3] - margin_y)
        first, end = (
            np.searchsorted(self._across, low[0], "right"),
            np.searchsorted(self._across, high[0]),
        )
        down = self._down[first:end]
        return np.sort(self._order[first:end][(down > low[1]) & (down < high[1])])

    def _cut(self, box: Box) -> str | None:
        """The one side of the picture at which the box ends because the picture does."""
        left, right = box[0] < BORDER_PX, box[2] > self._image_width - BORDER_PX
        return None if left == right else "left" if left else "right"

    def _ground_range_m(self, box: Box) -> float | None:
        """Distance at which the middle of the box's bottom edge meets the ground; ``None`` where
        that says nothing: the box is cut off by the picture's border, or ends above the horizon.
        """
        if box[3] > self._image_height - BORDER_PX:
            return None
        direction = ray(self._intrinsics, ((box[0] + box[2]) / 2, box[3]))
        falling = float(self._falls @ direction)
        if falling <= 0 or self._height_m <= 0:
            return None
        return self._height_m / falling * math.hypot(direction[0], direction[2])


def near_cluster(ranges_m: Array, ground_m: float | None) -> Indices:
    """Which of the points in a box, given their distances, are the object's.

    Dense clusters are compared with the distance of the object's foot on the ground; without it the
    nearest one counts.
    """
    clusters = clusters_of(ranges_m)
    enough = max(MIN_POINTS, DENSE_SHARE * len(ranges_m))
    dense = [cluster for cluster in clusters if len(cluster) >= enough] or [max(clusters, key=len)]
    if ground_m is None:
        return dense[0]
    return min(dense, key=lambda cluster: abs(math.log(surface(ranges_m[cluster]) / ground_m)))


def clusters_of(ranges_m: Array) -> list[Indices]:
    """Points by distance, a new cluster after each gap."""
    order = np.argsort(ranges_m, kind="stable")
    ordered = ranges_m[order]
    ends = [
        0,
        *(np.flatnonzero(ordered[1:] - ordered[:-1] > CLUSTER_GAP_M) + 1).tolist(),
        len(order),
    ]
    return [order[first:end] for first, end in pairwise(ends)]


def surface(ranges_m: Array) -> float:
    """Distance of the near surface of one cluster of points."""
    return float(shape.percentile(np.sort(ranges_m), SURFACE_PERCENTILE))
