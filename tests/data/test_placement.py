"""Boxes are placed in the world by what the laser saw in them; made-up streets with known
distances.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.base.classes import ROAD_LABELS
from genie_sim.base.geometry import project, ray
from genie_sim.data.detectors.placement import (
    HALF_DEPTH_M,
    Placement,
    fit_ground,
    near_cluster,
    surface,
)
from genie_sim.data.detectors.shape import percentile
from genie_sim.data.kitti.pipeline import LASER_HEIGHT_M, TYPICAL_GROUND

SIZE = (1242, 375)
INTRINSICS = np.array([[721.5, 0.0, 609.6], [0.0, 721.5, 172.9], [0.0, 0.0, 1.0]])
# The laser has x ahead, y left, z up; the camera stands 8 cm lower at the same spot.
CAMERA_SE3_VELO = np.array([[0.0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, 0], [0, 0, 0, 1]])
ROAD_M = -LASER_HEIGHT_M


def road(slope=0.0):
    x, y = np.meshgrid(np.arange(4, 40, 0.4), np.arange(-8, 8.1, 0.4))
    return np.column_stack([x.ravel(), y.ravel(), ROAD_M + slope * x.ravel()])


def board(x, y, width, bottom, top, step=0.1):
    """Points of an upright surface that faces the car, ``x`` metres ahead, around ``y``."""
    across, up = np.meshgrid(
        np.arange(y - width / 2, y + width / 2, step), np.arange(bottom, top, step)
    )
    return np.column_stack([np.full(across.size, x), across.ravel(), up.ravel()])


def box_around(points):
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ CAMERA_SE3_VELO.T
    pixels = project(INTRINSICS, homogeneous[:, :3])
    return (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())


def placed(label, box, *surfaces):
    scan = np.concatenate(surfaces) if surfaces else None
    ground = TYPICAL_GROUND if scan is None else fit_ground(scan, LASER_HEIGHT_M)
    placement = Placement(INTRINSICS, SIZE, CAMERA_SE3_VELO, scan, ground=ground)
    location, method = placement.place(label, box)
    return (None if location is None else math.hypot(location[0], location[2])), method


def nearest(ranges_m, ground_m):
    return surface(ranges_m[near_cluster(ranges_m, ground_m)])


REAR = board(15.0, 1.0, 1.7, ROAD_M, ROAD_M + 1.5)


def test_a_car_is_where_its_rear_is_and_half_a_length_more():
    distance_m, method = placed("car", box_around(REAR), road(), REAR)
    assert method == "scan"
    assert distance_m == pytest.approx(math.hypot(15.0, 1.0) + HALF_DEPTH_M["car"], abs=0.1)


def test_the_wall_behind_does_not_pull_a_pedestrian_back():
    person = board(9.0, -2.0, 0.5, ROAD_M, ROAD_M + 1.7)
    wall = board(20.0, -2.0, 12.0, ROAD_M, 4.0)
    wide = box_around(board(9.0, -2.0, 0.9, ROAD_M, ROAD_M + 1.8))
    distance_m, _ = placed("person", wide, road(), person, wall)
    assert distance_m == pytest.approx(math.hypot(9.0, 2.0) + HALF_DEPTH_M["person"], abs=0.15)


def test_a_pole_in_front_does_not_pull_a_car_forward():
    pole = board(6.0, 0.45, 0.15, ROAD_M, 2.0, step=0.05)
    distance_m, _ = placed("car", box_around(REAR), road(), REAR, pole)
    assert distance_m == pytest.approx(math.hypot(15.0, 1.0) + HALF_DEPTH_M["car"], abs=0.15)


def test_a_half_hidden_parked_car_is_placed_by_its_foot_on_the_ground():
    """The nearer car fills more than half of the box; the box's bottom edge belongs to the farther
    one.
    """
    nearer = board(9.0, 1.1, 0.6, ROAD_M, ROAD_M + 1.5, step=0.05)
    distance_m, _ = placed("car", box_around(REAR), road(), REAR, nearer)
    assert distance_m == pytest.approx(math.hypot(15.0, 1.0) + HALF_DEPTH_M["car"], abs=0.15)


@pytest.mark.parametrize("slope", [-0.03, 0.0, 0.03])
def test_the_ground_is_found_on_sloping_roads(slope):
    points = np.concatenate([road(slope), REAR, board(20.0, -6.0, 6.0, 0.0, 4.0)])
    plane = fit_ground(points, LASER_HEIGHT_M)
    assert plane.slope == pytest.approx((slope, 0.0), abs=0.005)
    assert np.abs(plane.above_m(road(slope))).max() < 0.1


def test_the_ground_is_found_under_a_laser_of_another_height_if_it_is_told():
    points = road() + np.array([0.0, 0.0, LASER_HEIGHT_M - 2.5])
    assert fit_ground(points, LASER_HEIGHT_M) is None
    assert fit_ground(points, 2.6).height_m == pytest.approx(-2.5, abs=0.01)


def test_road_points_in_the_box_do_not_count():
    box = box_around(board(15.0, 1.0, 1.7, ROAD_M - 0.2, ROAD_M + 1.5))
    distance_m, _ = placed("car", box, road(), road() + np.array([0.2, 0.2, 0.02]), REAR)
    assert distance_m == pytest.approx(math.hypot(15.0, 1.0) + HALF_DEPTH_M["car"], abs=0.15)


@pytest.mark.parametrize("slope", [0.0, 0.02])
def test_without_points_the_foot_on_the_ground_says_how_far(slope):
    car = board(22.0, 3.0, 1.7, ROAD_M + slope * 22.0, ROAD_M + slope * 22.0 + 1.5)
    distance_m, method = placed("car", box_around(car), road(slope))
    assert method == "ground"
    assert distance_m == pytest.approx(math.hypot(22.0, 3.0) + HALF_DEPTH_M["car"], rel=0.05)


def test_without_any_scan_the_ground_is_that_of_kitti_s_streets():
    """Seen from the tilted laser, it rises."""
    foot_m = ROAD_M + TYPICAL_GROUND.slope[0] * 15.0
    distance_m, method = placed("car", box_around(board(15.0, 1.0, 1.7, foot_m, foot_m + 1.5)))
    assert method == "ground"
    assert distance_m == pytest.approx(math.hypot(15.0, 1.0) + HALF_DEPTH_M["car"], rel=0.02)


@pytest.mark.parametrize(
    ("label", "box", "why"),
    [
        ("traffic light", (600.0, 180.0, 620.0, 220.0), "hangs above the road"),
        ("car", (300.0, 150.0, 600.0, 374.0), "is cut off by the picture's border"),
        ("car", (600.0, 100.0, 640.0, 160.0), "ends above the horizon"),
        ("car", (600.0, 170.0, 610.0, 175.0), "is too far for its foot to say much"),
    ],
)
def test_an_object_is_not_placed_by_the_ground_when_it(label, box, why):
    assert placed(label, box, road()) == (None, "none"), why


@given(st.floats(20, 1200), st.floats(150, 300), st.floats(10, 200), st.floats(10, 100))
def test_the_centre_lies_behind_the_middle_of_the_box(x, y, width, height):
    box = (x, y, x + width, y + height)
    scan = np.concatenate([road(), REAR])
    ground = fit_ground(scan, LASER_HEIGHT_M)
    location, method = Placement(INTRINSICS, SIZE, CAMERA_SE3_VELO, scan, ground=ground).place(
        "car", box
    )
    if location is None:
        assert method == "none"
    else:
        ahead = ray(INTRINSICS, (x + width / 2, y + height / 2))
        if method == "ground":
            assert np.cross(ahead, location) == pytest.approx((0, 0, 0), abs=1e-6)
        # a fitted vehicle may lie beside the middle of a cut-off box
        slope = ahead[1] / math.hypot(ahead[0], ahead[2])
        assert location[1] == pytest.approx(slope * math.hypot(location[0], location[2]))
        assert location[2] > 0


@given(st.lists(st.floats(1, 80), min_size=5, max_size=60), st.one_of(st.none(), st.floats(1, 100)))
def test_the_surface_is_among_the_points(ranges_m, ground_m):
    surface_m = nearest(np.array(ranges_m), ground_m)
    assert min(ranges_m) - 1e-9 <= surface_m <= max(ranges_m) + 1e-9


def test_the_surface_is_the_near_end_of_a_dense_group():
    """A car seen from the side and the end: 12.0 to 16.0 m; rain or leaves in front of it; the wall
    behind it.
    """
    car_m, stray_m, wall_m = (
        np.linspace(12.0, 16.0, 80),
        np.linspace(3.0, 3.3, 6),
        np.linspace(25.0, 25.5, 40),
    )
    assert nearest(np.concatenate([wall_m, stray_m, car_m]), None) == pytest.approx(12.4, abs=0.05)


def test_every_road_label_has_a_depth():
    assert set(HALF_DEPTH_M) == ROAD_LABELS


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=60), st.floats(0, 100))
def test_a_percentile_is_numpy_s(values, percent):
    assert percentile(np.sort(values), percent) == pytest.approx(
        float(np.percentile(values, percent)), abs=1e-9
    )
