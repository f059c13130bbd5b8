"""Transforms of a bag: rotations, and poses between and beside those that are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from genie_sim.base.geometry import rigid
from genie_sim_ros.tf import EXTRAPOLATION_NS, Trajectory, TransformTree, rotation


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


def test_poses_are_found_along_the_tree_at_an_instant():
    """The car moves along x by 1 m in 100 ns; its camera looks from 2 m ahead and 1 m to the
    left, its laser from 3 m ahead.
    """
    tree = TransformTree()
    tree.add_static("base", "camera", rigid(np.eye(3), (2.0, 1.0, 0.0)))
    tree.add_static("base", "laser", rigid(np.eye(3), (3.0, 0.0, 0.0)))
    for stamp_ns, x in ((0, 0.0), (100, 1.0)):
        tree.add_moving("map", "base", stamp_ns, rigid(np.eye(3), (x, 5.0, 0.0)))

    def place(target: str, source: str, stamp_ns: int = 0) -> tuple[float, ...] | None:
        pose = tree.find(target, source, stamp_ns)
        return None if pose is None else tuple(pose[:3, 3].tolist())

    assert place("map", "camera") == (2.0, 6.0, 0.0)
    assert place("map", "camera", 50) == pytest.approx((2.5, 6.0, 0.0))
    assert place("laser", "camera") == (-1.0, 1.0, 0.0)
    assert place("camera", "/laser") == (1.0, -1.0, 0.0)
    assert place("base", "base") == (0.0, 0.0, 0.0)
    assert place("map", "radar") is None
    assert tree.names() == ["base", "camera", "laser", "map"]
    # long after the last pose nothing joins car and map, but the car's own parts stay together
    late_ns = 101 + EXTRAPOLATION_NS
    assert place("map", "camera", late_ns) is None
    assert place("base", "camera", late_ns) == (2.0, 1.0, 0.0)
    assert place("laser", "camera", late_ns) == (-1.0, 1.0, 0.0)


def test_frames_that_are_each_others_parent_end_the_search():
    tree = TransformTree()
    tree.add_static("one", "two", rigid(np.eye(3), (1.0, 0.0, 0.0)))
    tree.add_static("two", "one", rigid(np.eye(3), (1.0, 0.0, 0.0)))
    assert tree.find("map", "one", 0) is None
