"""The parts that call ROS, with stand-ins for its packages."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest import mock

import pytest

from genie_sim_ros import ros1_graph
from genie_sim_ros.codec import WireType
from genie_sim_ros.genie_process import GenieProcess
from genie_sim_ros.plan import AttachPlan
from tests.ros.stand_ins import imported


@pytest.fixture
def ros1() -> Iterator[ModuleType]:
    yield from imported("ros1")


@pytest.fixture
def ros2() -> Iterator[ModuleType]:
    yield from imported("ros2")


@pytest.fixture
def genie(ros1: ModuleType) -> Any:
    """A Genie for /left and /right, which the node answers on /cars and /signs."""
    genie = ros1.Ros1Genie.__new__(ros1.Ros1Genie)
    genie.plan = SimpleNamespace(requests=("/left", "/right"), answers=("/cars", "/signs"))
    genie._publishers, genie._subscribers = {}, []
    return genie


def end(topic: str, connections: int) -> SimpleNamespace:
    return SimpleNamespace(resolved_name=topic, get_num_connections=lambda: connections)


CONNECTED = [((1, 1), True), ((0, 1), False), ((2, 0), False)]


@pytest.mark.parametrize(("connections", "is_connected"), CONNECTED)
def test_every_answer_needs_its_publisher(genie, connections, is_connected):
    first, second = connections
    genie._subscribers = [
        end("/cars_local", first),
        end("/signs_local", second),
        end("/left", 0),  # of the robot, not of the node
    ]
    assert bool(genie.answers_have_publisher()) is is_connected


@pytest.mark.parametrize(("connections", "is_connected"), CONNECTED)
def test_every_request_needs_its_subscriber(genie, connections, is_connected):
    for topic, count in zip(("/left_local", "/right_local"), connections, strict=True):
        genie._publishers[topic] = (None, end(topic, count), None)
    genie._publishers["/cars"] = (None, end("/cars", 0), None)
    assert bool(genie.requests_have_subscriber()) is is_connected


def test_a_genie_of_ros_2_has_its_plan(ros2: ModuleType, monkeypatch: pytest.MonkeyPatch):
    begun = mock.Mock()
    monkeypatch.setattr(GenieProcess, "__init__", lambda self, *given: begun(*given))
    plan = AttachPlan(node="/a/detector", name="car1", role="car", requests=(), answers=())
    ros2.Ros2Genie(plan)
    begun.assert_called_once_with(plan, 2)
    assert ros2.rclpy.create_node.call_args.args == ("genie_a_detector",)


def test_types_of_installed_packages_alone_are_looked_up(monkeypatch: pytest.MonkeyPatch):
    image = SimpleNamespace(_md5sum="12ab", _full_text="Header header")
    known = {"sensor_msgs/Image": image}
    roslib = SimpleNamespace(message=SimpleNamespace(get_message_class=known.get))
    monkeypatch.setitem(sys.modules, "roslib", roslib)
    monkeypatch.setitem(sys.modules, "roslib.message", roslib.message)
    assert ros1_graph._installed("sensor_msgs/Image") == WireType(
        "sensor_msgs/Image", "12ab", "Header header"
    )
    assert ros1_graph._installed("my_msgs/Unknown") is None
    assert ros1_graph._installed("*") is None, "a name without a package is no type"
