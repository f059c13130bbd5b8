"""Rigid transforms and the pinhole camera, in numpy alone.

A transform is a 4x4 array named ``destination_SE3_source``: it takes points of the source frame to
the destination frame, so that ``world_SE3_imu @ imu_SE3_camera`` reads as it composes. Camera
frames have x right, y down and z along the optical axis; the world is east, north, up.
"""

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Geodetic = tuple[float, float, float]  # latitude [deg], longitude [deg], altitude [m]


def rigid(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> Array:
    """The 4x4 transform of a 3x3 rotation followed by a translation."""
    SE3 = np.eye(4)
    SE3[:3, :3] = rotation
    SE3[:3, 3] = translation
    return SE3


def inverse(b_SE3_a: Array) -> Array:
    """``a_SE3_b``; exact for rigid transforms, where the inverse rotation is the transpose."""
    rotation = b_SE3_a[:3, :3].T
    return rigid(rotation, -rotation @ b_SE3_a[:3, 3])


def transform(b_SE3_a: Array, points_a: npt.ArrayLike) -> Array:
    """Points (..., 3) of frame ``a`` in frame ``b``."""
    points: Array = np.asarray(points_a, dtype=np.float64) @ b_SE3_a[:3, :3].T + b_SE3_a[:3, 3]
    return points


def rotation_from_rpy(roll_rad: float, pitch_rad: float, yaw_rad: float) -> Array:
    """Rotation of KITTI's OXTS angles: yaw about up, counter-clockwise from east, then pitch, then
    roll.
    """
    cr, sr = math.cos(roll_rad), math.sin(roll_rad)
    cp, sp = math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    rotation: Array = about_z @ about_y @ about_x
    return rotation


def heading_of(direction: npt.ArrayLike) -> float:
    """Heading [rad] of an east-north-up direction, counter-clockwise from east, in (-pi, pi]."""
    east, north = np.asarray(direction, dtype=np.float64)[:2].tolist()
    return math.atan2(north, east)


def project(intrinsics: Array, points_camera: npt.ArrayLike) -> Array:
    """Pixels (n, 2) of points (n, 3) in the camera's frame; ``nan`` for points that are not in
    front of it.
    """
    points = np.asarray(points_camera, dtype=np.float64)
    ahead = points[:, 2] > 0
    pixels = np.full((len(points), 2), np.nan)
    image = points[ahead] @ intrinsics.T
    pixels[ahead] = image[:, :2] / image[:, 2:]
    return pixels


def ray(intrinsics: Array, pixel: tuple[float, float]) -> Array:
    """Direction (3,) in the camera's frame, with z = 1, of the ray through a pixel: the inverse of
    ``project``.
    """
    direction: Array = np.linalg.solve(intrinsics, np.array([pixel[0], pixel[1], 1.0]))
    return direction


def horizontal_fov_rad(intrinsics: Array, width: int) -> float:
    """The angle a pinhole camera sees from its left to its right border."""
    focal, centre = float(intrinsics[0, 0]), float(intrinsics[0, 2])
    return math.atan2(centre, focal) + math.atan2(width - centre, focal)
