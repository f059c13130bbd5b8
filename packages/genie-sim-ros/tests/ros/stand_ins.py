"""Modules of the package that need ROS, imported without it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from types import ModuleType
from unittest import mock

STAND_INS = ("rospy", "rclpy", "rclpy.context", "rclpy.executors", "rclpy.qos")


def imported(name: str) -> Iterator[ModuleType]:
    """A module of genie_sim_ros, imported anew with the stand-ins, for one test."""
    package = importlib.import_module("genie_sim_ros")
    with mock.patch.dict(sys.modules, {stand_in: mock.MagicMock() for stand_in in STAND_INS}):
        sys.modules.pop(f"genie_sim_ros.{name}", None)
        before = package.__dict__.pop(name, None)
        yield importlib.import_module(f"genie_sim_ros.{name}")
        package.__dict__.pop(name, None)
    if before is not None:
        setattr(package, name, before)
