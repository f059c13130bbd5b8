"""Rigid transforms and the pinhole camera."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.base.geometry import (
    heading_of,
    horizontal_fov_rad,
    inverse,
    project,
    ray,
    rigid,
    rotation_from_rpy,
    transform,
)

INTRINSICS = np.array([[721.5, 0.0, 609.6], [0.0, 721.5, 172.9], [0.0, 0.0, 1.0]])
angles = st.floats(-3.1, 3.1)
metres = st.floats(-1e4, 1e4)


@given(angles, angles, angles, st.tuples(metres, metres, metres), st.tuples(metres, metres, metres))
def test_a_transform_and_its_inverse_bring_a_point_back(roll, pitch, yaw, translation, point):
    world_SE3_car = rigid(rotation_from_rpy(roll, pitch, yaw), translation)
    there = transform(world_SE3_car, point)
    assert transform(inverse(world_SE3_car), there) == pytest.approx(point, abs=1e-6)
    assert inverse(world_SE3_car) @ world_SE3_car == pytest.approx(np.eye(4), abs=1e-9)


def test_transforms_compose_as_their_names_read():
    world_SE3_car = rigid(rotation_from_rpy(0, 0, math.pi / 2), (10, 0, 0))
    car_SE3_laser = rigid(np.eye(3), (1, 0, 0))
    assert transform(world_SE3_car @ car_SE3_laser, (2, 0, 0)) == pytest.approx((10, 3, 0))


def test_yaw_turns_counter_clockwise_from_east():
    ahead = rotation_from_rpy(0.0, 0.0, math.radians(90)) @ [1, 0, 0]
    assert heading_of(ahead) == pytest.approx(math.pi / 2)  # north
    assert heading_of((-1, 0, 0)) == pytest.approx(math.pi)
    assert heading_of((0, -2, 5)) == pytest.approx(-math.pi / 2)


def test_pitch_and_roll_follow_the_oxts_convention():
    """Positive pitch is nose down, positive roll is left side up (KITTI's dataformat.txt)."""
    assert (rotation_from_rpy(0, 0.1, 0) @ [1, 0, 0])[2] < 0
    assert (rotation_from_rpy(0.1, 0, 0) @ [0, 1, 0])[2] > 0


@given(st.floats(0, 1242), st.floats(0, 375), st.floats(0.5, 80))
def test_a_pixels_ray_projects_onto_the_pixel(x, y, depth_m):
    point = ray(INTRINSICS, (x, y)) * depth_m
    assert point[2] == pytest.approx(depth_m)
    assert project(INTRINSICS, point[None])[0] == pytest.approx((x, y), abs=1e-6)


def test_points_behind_the_camera_are_in_no_picture():
    pixels = project(INTRINSICS, [(0, 0, -5), (1, 1, 0), (0, 0, 5)])
    assert np.isnan(pixels[:2]).all()
    assert pixels[2] == pytest.approx((609.6, 172.9))


def test_field_of_view_reaches_from_border_to_border():
    left, right = ray(INTRINSICS, (0, 100)), ray(INTRINSICS, (1242, 100))
    between = math.atan2(right[0], right[2]) - math.atan2(left[0], left[2])
    assert horizontal_fov_rad(INTRINSICS, 1242) == pytest.approx(between)
    assert math.degrees(between) == pytest.approx(81.4, abs=0.1)
