"""Transforms of a bag: rotations, and poses between and beside those that are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from genie_sim.core.geometry import rigid
from genie_sim.ros.tf import EXTRAPOLATION_NS, Trajectory, rotation


def turn(x: float, y: float, z: float, w: float) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z, w=w)


def test_a_quarter_turn_to_the_left():
    quarter = rotation(turn(0.0, 0.0, 0.5**0.5, 0.5**0.5))
    assert quarter is not None
    assert quarter @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])


@pytest.mark.parametrize("length", [0.2, 1.0, 9.0])
def test_a_quaternion_need_not_have_unit_length(length: float):
    assert rotation(turn(0.0, 0.0, 0.0, length)) == pytest.approx(np.eye(3))


@pytest.mark.parametrize("length", [0.0, 0.05, 11.0])
def test_a_quaternion_far_from_unit_length_is_unknown(length: float):
    assert rotation(turn(0.0, 0.0, 0.0, length)) is None


def test_a_trajectory_is_interpolated_and_ends():
    poses = [(stamp_ns, rigid(np.eye(3), (x, 0.0, 0.0))) for stamp_ns, x in ((0, 0.0), (100, 8.0))]
    trajectory = Trajectory(poses)

    def x_at(stamp_ns: int) -> float | None:
        pose = trajectory.at(stamp_ns)
        return None if pose is None else float(pose[0, 3])

    assert x_at(0) == 0.0 and x_at(100) == 8.0
    assert x_at(25) == pytest.approx(2.0)
    assert x_at(-EXTRAPOLATION_NS) == 0.0 and x_at(-EXTRAPOLATION_NS - 1) is None
    assert x_at(100 + EXTRAPOLATION_NS) == 8.0 and x_at(101 + EXTRAPOLATION_NS) is None
    assert Trajectory([]).at(0) is None
