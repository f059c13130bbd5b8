"""Recorded traffic as a scene: cameras see its vehicles, and some of these carry cameras."""

import functools
import hashlib
import json
import logging
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.base.classes import MOVING_MPS, PERSONS, VEHICLES, class_of
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.geometry import Array
from genie_sim.base.seeds import stream
from genie_sim.base.units import NS_PER_S
from genie_sim.data.world_table import SOMEWHERE
from genie_sim.worlds.scene.detector import SyntheticDetector
from genie_sim.worlds.scene.frames import Motion, SceneDrive, SceneDrives, SceneTruth
from genie_sim.worlds.scene.laws import synthetic_laws
from genie_sim.worlds.scene.noise import key_of_seed
from genie_sim.worlds.scene.objects import ObjectColumns, SceneObject, scene_object
from genie_sim.worlds.scene.surrogate import LAWS
from genie_sim.worlds.scene.view import VisibleObjects
from genie_sim.worlds.traffic.fcd import VehicleRows
from genie_sim.worlds.traffic.vehicles import Vehicles, VehicleType
from genie_sim.worlds.traffic.view import TrafficView

if TYPE_CHECKING:
    from genie_sim.worlds.traffic.source import RecordedTraffic

STREAM = "traffic"
SHORTEST_S = 1.0  # a vehicle that is there for less carries no cameras
# Which classes such a file knows all of: what else a detector reports is not judged.
KNOWN = (*VEHICLES, "train", "motorcycle", "bicycle")

PREFIX, LONGEST_NAME = "veh_", 100
NO_NAME = re.compile(r"[^A-Za-z0-9_.-]", re.ASCII)  # what no name may hold

log = logging.getLogger(__name__)


class Traffic:
    """Vehicles as a scene for cameras. Its clock begins where the simulation does.

    ``digest`` is the sha256 of what decides what cameras see: the rows of the file that were read,
    the settings, the seed and the detector's laws.
    """

    name = "traffic"

    def __init__(
        self, rows: VehicleRows, settings: "RecordedTraffic", path: Path, seed: int
    ) -> None:
        self.seed, self.settings, self.path, self.report = seed, settings, path, rows.report
        begin_s = rows.times_s[0] if settings.begin_ns is None else settings.begin_ns / NS_PER_S
        own_types = {
            name: VehicleType(kind.label, kind.length_m, kind.width_m)
            for name, kind in settings.types.items()
        }
        self.end_s = min(settings.duration_ns / NS_PER_S, float(rows.times_s[-1] - begin_s))
        self.vehicles = Vehicles(rows, float(begin_s), own_types)
        self.known = (*KNOWN, *PERSONS) if any(rows.is_person) else KNOWN
        self.laws = synthetic_laws()
        self.content = _content(rows)
        decisive = {name: value for name, value in asdict(settings).items() if name != "accept"}
        text = json.dumps([self.content, decisive | {"fcd": ""}, seed, self.laws.digest])
        self.digest = hashlib.sha256(text.encode()).hexdigest()
        key = key_of_seed(STREAM, seed)
        self.objects = ObjectColumns(
            [
                scene_object(self.laws.of(kind.label), key, number, kind.label, moving=True)
                for number, kind in enumerate(self.vehicles.types)
            ]
        )
        self.detector = SyntheticDetector(self.objects, self.laws, on_grid=False)
        self.visibility = TrafficView(self.vehicles, self.objects, settings.view_m)
        self._warn()

    def _warn(self) -> None:
        """What was not read as it stands in the file."""
        for line in self.report.lines(only=("left out", "chosen")):
            log.warning("%s: %s", self.path, line)
        if self.vehicles.jumps.any():
            some = f"{(self.vehicles.jumps > 0).sum():,} of {len(self.vehicles):,}"
            log.warning(
                "%s: %s vehicles teleport, %d times in all: each drives its longest stretch",
                self.path,
                some,
                self.vehicles.jumps.sum(),
            )

    def truth(self, visible: VisibleObjects, t_s: Array) -> list[SceneObject | None]:
        """The vehicles that are visible from some poses, as they are at each pose's time [s]."""
        stretches = self.vehicles.stretch(visible.row, t_s[visible.pose])
        speeds = self.vehicles.at(stretches, t_s[visible.pose]).speed_mps
        objects = self.objects.rows
        columns = (visible.row, visible.east_m, visible.north_m, speeds > MOVING_MPS)
        return [
            objects[row]._replace(east_m=east_m, north_m=north_m, moving=moving)
            for row, east_m, north_m, moving in zip(*(c.tolist() for c in columns), strict=True)
        ]

    @property
    def provenance(self) -> Mapping[str, object]:
        """Where it comes from, for ``run.json``."""
        types = {name: kind._asdict() for name, kind in sorted(self.vehicles.types_by_name.items())}
        return {
            "source": "traffic",
            "file": self.path.name,
            "content_sha256": self.content,
            "vehicles": len(self.vehicles) - sum(self.vehicles.is_person),
            "teleports": int(self.vehicles.jumps.sum()),
            "vehicles_that_teleport": int((self.vehicles.jumps > 0).sum()),
            "import": self.report.facts(),
            "types": types,
            "seed": self.seed,
            "laws": dict(self.laws.provenance),
            "laws_digest": self.laws.digest,
            "features": dict.fromkeys(LAWS, "surrogate"),
        }


def _content(rows: VehicleRows) -> str:
    """The sha256 of what was read of a file, however it is written."""
    content = hashlib.sha256()
    for column in (rows.times_s, rows.step, rows.vehicle, rows.x_m, rows.y_m, rows.angle_deg):
        content.update(column.tobytes())
    persons = [number for number, is_person in enumerate(rows.is_person) if is_person]
    named = [rows.ids, rows.types, *[persons] * bool(persons)]
    content.update(json.dumps(named).encode())
    return content.hexdigest()


class _Course:
    """Where one vehicle is during one stretch."""

    def __init__(self, vehicles: Vehicles, stretch: int) -> None:
        self._times_s, self._east_m, self._north_m, self._heading = vehicles.rows_of(stretch)

    def at(self, t_s: float) -> Motion:
        times_s = self._times_s
        last = len(times_s) - 1
        k = min(max(int(times_s.searchsorted(t_s, side="right")) - 1, 0), max(last - 1, 0))
        following = min(k + 1, last)
        begin_s = times_s.item(k)
        whole_s = (times_s.item(following) - begin_s) or 1.0
        share = min(max((t_s - begin_s) / whole_s, 0.0), 1.0)
        east_m, north_m = self._east_m.item(k), self._north_m.item(k)
        dx, dy = self._east_m.item(following) - east_m, self._north_m.item(following) - north_m
        heading_rad = self._heading.item(k)
        heading_rad += share * math.remainder(self._heading.item(following) - heading_rad, math.tau)
        return Motion(
            east_m + share * dx,
            north_m + share * dy,
            heading_rad,
            math.cos(heading_rad),
            math.sin(heading_rad),
            math.hypot(dx, dy) / whole_s,
        )


class TrafficDrive(SceneDrive):
    """What the cameras of one vehicle see until it leaves."""

    origin = SOMEWHERE

    def __init__(
        self, traffic: Traffic, car: str, stretch: int, *, start_ns: int, end_ns: int
    ) -> None:
        super().__init__(
            traffic,
            car,
            duration_ns=end_ns - start_ns,
            interval_ns=traffic.settings.interval_ns,
            start_ns=start_ns,
        )
        self._vehicles, self._stretch = traffic.vehicles, stretch

    @functools.cached_property
    def course(self) -> _Course:
        return _Course(self._vehicles, self._stretch)


def car_names(path: Path, ids: Sequence[str]) -> list[str]:
    """The names of cars by the ids of their vehicles: what a name may not hold becomes ``_``.

    Raises UserError where two get one name.
    """
    names: dict[str, str] = {}
    for vehicle in ids:
        name = (PREFIX + NO_NAME.sub("_", vehicle))[:LONGEST_NAME]
        if name in names:
            raise UserError(
                f"{path}: vehicles {short_repr(names[name])} and {short_repr(vehicle)} would both "
                f"be called {name}: rename one"
            )
        names[name] = vehicle
    return list(names)


class TrafficDrives(SceneDrives):
    """Traffic with the drives of its equipped vehicles."""

    def __init__(self, traffic: Traffic) -> None:
        super().__init__(traffic)
        self.traffic = traffic
        self.extent_m = traffic.vehicles.extent_m
        vehicles, end_s = traffic.vehicles, traffic.end_s
        names = zip(vehicles.ids, vehicles.is_person, strict=True)
        self._numbers = [number for number, (_, is_person) in enumerate(names) if not is_person]
        self._ids = [vehicles.ids[number] for number in self._numbers]
        self._names = car_names(traffic.path, self._ids)
        # Of each car: its stretch, and when it begins and ends.
        self._stretches: dict[str, tuple[int, int, int]] = {}
        for number, name in zip(self._numbers, self._names, strict=True):
            begin_s, last_s, stretch = vehicles.longest(number, end_s)
            if last_s - begin_s >= SHORTEST_S:
                span_ns = math.ceil(begin_s * 1e9), math.floor(last_s * 1e9)
                self._stretches[name] = (stretch, *span_ns)

    def starts_ns(self) -> dict[str, int]:
        """When each equipped vehicle appears [ns], by its car's name. Raises ``UserError`` where
        there is none.
        """
        equipped = self._equipped()
        starts_ns = {name: self._stretches[name][1] for name in equipped if name in self._stretches}
        if not starts_ns:
            raise UserError(
                f"{self.traffic.path}: perception.equipped: none of {len(self._ids):,} vehicles is "
                f"equipped and there for {SHORTEST_S:g} s; raise the share or 'duration'"
            )
        left_out = len(equipped) - len(starts_ns)
        if left_out:
            log.warning(
                "%s: %d equipped vehicles are there for less than %g s: they carry no cameras",
                self.traffic.path,
                left_out,
                SHORTEST_S,
            )
        return starts_ns

    def _equipped(self) -> list[str]:
        """The names of the equipped vehicles, in the order in which they appear."""
        equipped, ids = self.traffic.settings.equipped, self._ids
        if isinstance(equipped, tuple):
            numbers = {vehicle: number for number, vehicle in enumerate(ids)}
            for vehicle in equipped:
                if vehicle not in numbers:
                    what = unknown("vehicle", vehicle, ids)
                    raise UserError(f"{self.traffic.path}: perception.equipped: {what}")
            return [self._names[numbers[vehicle]] for vehicle in equipped]
        return [
            name
            for name, vehicle in zip(self._names, ids, strict=True)
            if equipped == 1.0
            or stream(self.traffic.seed, STREAM, "equipped", vehicle).random() < equipped
        ]

    def drive(self, car: str, trace: str | None, start_ns: int) -> TrafficDrive:
        if car not in self._stretches:
            what = unknown("vehicle", car, self._stretches)
            raise UserError(f"{self.traffic.path}: {what}")
        stretch, begin_ns, end_ns = self._stretches[car]
        if not begin_ns <= start_ns < end_ns:
            raise UserError(
                f"{self.traffic.path}: {car} starts at {start_ns / 1e9:g} s, but is there from "
                f"{begin_ns / 1e9:g} to {end_ns / 1e9:g} s: see 'route.start' and 'start_jitter'"
            )
        return TrafficDrive(self.traffic, car, stretch, start_ns=start_ns, end_ns=end_ns)

    def truth_of(self, drive: TrafficDrive) -> "TrafficTruth":
        drive.is_judged = True
        return TrafficTruth(self.traffic)


class TrafficTruth(SceneTruth):
    """What is there on the drive of a car."""

    def __init__(self, traffic: Traffic) -> None:
        super().__init__(traffic.settings.tolerance_m, traffic.settings.range_m)
        self._traffic = traffic

    def knows(self, label: str) -> bool:
        return label in self._traffic.known

    def are_there(
        self, frames: Sequence[Any], labels: Sequence[str], east_m: Array, north_m: Array
    ) -> Array:
        vehicles, tolerance_m = self._traffic.vehicles, self.tolerance_m
        t_s = np.array([frame.scene_ns for frame in frames]) * 1e-9
        stretches = vehicles.near(
            east_m.min() - tolerance_m,
            north_m.min() - tolerance_m,
            east_m.max() + tolerance_m,
            north_m.max() + tolerance_m,
            times_s=t_s,
        )
        states = vehicles.at(stretches, t_s[:, None])
        dx, dy = states.east_m - east_m[:, None], states.north_m - north_m[:, None]
        is_near = states.there & (np.hypot(dx, dy) <= tolerance_m)
        asked = np.array([class_of(label) for label in labels])
        there = self._traffic.objects.label[vehicles.vehicle[stretches]].tolist()
        classes = np.array([class_of(label) for label in there])
        result: Array = (is_near & (asked[:, None] == classes)).any(axis=1)
        return result
