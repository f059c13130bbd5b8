"""The shipped worlds, and a yard: as little as a world has to give."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from genie_sim.worlds.scene.frames import Motions, SceneDrive
from genie_sim.worlds.scene.objects import ObjectColumns
from genie_sim.worlds.scene.scene import Scene
from genie_sim.worlds.scene.source import SceneDrives, SceneSource
from genie_sim.worlds.scene.view import PlacedObjects, in_view
from tests.conformance.scenes import SceneConformance

TOWN = {"source": "town", "town": {"blocks": [4, 4]}}
TRAFFIC = {"source": "traffic", "fcd": "sumo_grid", "begin": "62 s"}
YARD = {"source": f"{__name__}:InYard"}
NEAR_IN_TOWN = {"town": {"blocks": [4, 4], "view": "20 m"}}
NEAR = {"view": "20 m"}


class TestTown(SceneConformance):
    world, near_sighted = TOWN, NEAR_IN_TOWN


class TestTraffic(SceneConformance):
    world, near_sighted = TRAFFIC, NEAR
    cars = "veh_east.8", "veh_bus.1"


class Yard(Scene):
    """In a row on both sides of a way to the east: cars, persons, and ghosts of cars. Nothing hides
    anything, and whatever is asked about, all of it is told.
    """

    name = random_name = "yard"

    def __init__(self, seed, settings):
        super().__init__(seed, settings.view_m, settings.range_m)
        self.digest = f"{seed} {settings.view_m}"

    @functools.cached_property
    def objects(self):
        labels, real = ["car", "person", "car"] * 20, [True, True, False] * 20
        return ObjectColumns(labels, range(60), real, laws=self.laws, seed_key=self.key)

    @property
    def visibility(self):
        return self

    def near(self, east_m, north_m, t_s, **_):
        slot, row = (number.ravel() for number in np.indices((len(t_s), 60)))
        east_m, north_m = 4.0 * row, 5.0 * (-1.0) ** (row // 3)
        return PlacedObjects(slot, row, np.zeros(len(row), dtype=bool), east_m, north_m)

    def visible(self, poses):
        near = self.near(poses.east_m, poses.north_m, poses.t_s)
        return in_view(poses, near, self.objects, self.sight_m)

    def at(self, t_s):
        """The course of every car: to the east, at 5 m/s."""
        still = np.zeros(len(t_s))
        return Motions(5.0 * t_s, still, still, cos=still + 1.0, sin=still, speed_mps=still + 5.0)

    def facts(self):
        return {}


class YardDrives(SceneDrives):
    def drive(self, car, trace, start_ns):
        return SceneDrive(
            self.scene,
            car,
            lambda: self.scene,
            duration_ns=self.settings.duration_ns,
            interval_ns=self.settings.interval_ns,
            start_ns=start_ns,
        )


@dataclass(frozen=True)
class InYard(SceneSource):
    view_m: float = 60.0

    def open(self, seed, origin, progress=None):
        return YardDrives(Yard(seed, self), self)


class TestYard(SceneConformance):
    world, near_sighted = YARD, NEAR
