"""The middle of a vehicle from the sides that a laser saw, by hand. Places are (x, z), z ahead."""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.base.classes import Size
from genie_sim.data.detectors.shape import centre

CAR = Size(height_m=1.5, width_m=1.8, length_m=4.0)
Place = tuple[float, float]


def side(begin: Place, end: Place, points: int = 60) -> np.ndarray:
    return np.linspace(begin, end, points)


def turned(points: np.ndarray, by_deg: float, about: Place) -> np.ndarray:
    """Counter-clockwise, seen from above with x to the right and z upwards."""
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    return (points - about) @ np.array([[cos, sin], [-sin, cos]]) + about


def close_to(x: float, z: float) -> object:
    return pytest.approx((x, z), abs=0.1)


def test_a_whole_rear_and_a_whole_side_surround_the_middle():
    seen = np.concatenate([side((2.1, 10.0), (3.9, 10.0)), side((2.1, 10.0), (2.1, 14.0))])
    assert centre(seen, CAR) == close_to(3.0, 12.0)


@pytest.mark.parametrize("by_deg", [-30.0, 15.0, 60.0])
def test_a_turned_car_is_found_in_its_own_axes(by_deg: float):
    seen = np.concatenate([side((2.1, 10.0), (3.9, 10.0)), side((2.1, 10.0), (2.1, 14.0))])
    assert centre(turned(seen, by_deg, (3.0, 12.0)), CAR) == close_to(3.0, 12.0)


def test_what_is_not_seen_of_a_side_lies_behind_what_is():
    seen = np.concatenate([side((2.1, 10.0), (3.9, 10.0)), side((2.1, 10.0), (2.1, 12.5))])
    assert centre(seen, CAR) == close_to(3.0, 12.0)


def test_a_side_alone_hides_the_width_behind_it():
    assert centre(side((2.1, 10.0), (2.1, 14.0)), CAR) == close_to(3.0, 12.0)
    assert centre(side((-2.1, 10.0), (-2.1, 14.0)), CAR) == close_to(-3.0, 12.0)
    assert centre(side((3.0, 10.0), (7.0, 10.0)), CAR) == close_to(5.0, 10.9)


def test_an_end_alone_says_nothing():
    assert centre(side((2.1, 10.0), (3.9, 10.0)), CAR) is None


def test_an_end_is_a_side_from_two_metres_ten_on():
    """1.8 m of width and .3 m of slack; strays of 2 % at both ends are left out."""
    assert centre(side((2.0, 10.0), (4.05, 10.0)), CAR) is None
    assert centre(side((2.0, 10.0), (4.3, 10.0)), CAR) == close_to(4.0, 10.9)


@pytest.mark.parametrize(("cut", "sign"), [("right", 1.0), ("left", -1.0)])
def test_what_the_picture_cuts_off_lies_beyond_its_border(cut: str, sign: float):
    """Of a car beside the own one its farther 2.5 m are in the picture."""
    seen = np.concatenate([side((sign * x, 8.0), (sign * x, 10.5)) for x in (3.0, 3.1)])
    assert centre(seen, CAR, cut) == close_to(sign * 3.9, 8.5)


def test_the_other_border_cuts_off_the_other_end():
    """Of a car that stands across; its width is not looked at here."""
    seen = side((-1.0, 10.0), (1.5, 10.0))
    to_the_right, to_the_left = centre(seen, CAR, "right"), centre(seen, CAR, "left")
    assert to_the_right is not None and to_the_right[0] == pytest.approx(1.0, abs=0.1)
    assert to_the_left is not None and to_the_left[0] == pytest.approx(-0.5, abs=0.1)


def test_an_end_at_the_border_is_as_long_as_it_is_along_the_line_of_sight():
    """1.2 m of a rear to the right of the own car: the car goes on ahead of it."""
    seen = side((3.0, 8.0), (4.2, 8.0))
    found = centre(seen, CAR, "right")
    assert found is not None and found[0] == pytest.approx(3.9, abs=0.1)


def test_many_points_say_what_a_few_say():
    seen = np.concatenate(
        [side((2.1, 10.0), (3.9, 10.0), 500), side((2.1, 10.0), (2.1, 14.0), 700)]
    )
    assert centre(seen, CAR) == close_to(3.0, 12.0)
