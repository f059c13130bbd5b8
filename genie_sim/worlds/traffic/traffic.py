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
from typing import TYPE_CHECKING

from genie_sim.base.classes import PERSONS, VEHICLES
from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.units import NS_PER_S, duration_text
from genie_sim.worlds.scene.frames import SceneDrive
from genie_sim.worlds.scene.kept_words import TRAFFIC_DRAWS
from genie_sim.worlds.scene.objects import ObjectColumns
from genie_sim.worlds.scene.scene import Scene
from genie_sim.worlds.scene.source import SceneDrives
from genie_sim.worlds.traffic.fcd import VehicleRows
from genie_sim.worlds.traffic.vehicles import Stretch, Vehicles
from genie_sim.worlds.traffic.view import TrafficView

if TYPE_CHECKING:
    from genie_sim.worlds.traffic.source import RecordedTraffic

SHORTEST_S = 1.0  # a vehicle that is there for less carries no cameras
# Which classes such a file knows all of: what else a detector reports is not judged.
KNOWN = (*VEHICLES, "train", "motorcycle", "bicycle")

PREFIX, LONGEST_NAME = "veh_", 100
NO_NAME = re.compile(r"[^A-Za-z0-9_.-]", re.ASCII)  # what no name may hold

log = logging.getLogger(__name__)


class Traffic(Scene):
    """Vehicles as a scene for cameras. Its clock begins where the simulation does, and ends at
    ``end_s``.

    ``digest`` is of the rows of the file that were read, when the clock begins, how far a
    detector looks, what the vehicles are, the seed and the detector's laws.
    """

    name, random_name = "traffic", TRAFFIC_DRAWS

    def __init__(
        self, rows: VehicleRows, settings: "RecordedTraffic", path: Path, seed: int
    ) -> None:
        super().__init__(seed, settings.view_m, settings.range_m)
        self.path, self.report = path, rows.report
        self.end_s = min(settings.duration_ns / NS_PER_S, rows.times_s.item(-1) - rows.begin_s)
        self.vehicles = Vehicles(rows, settings.types)
        self._content = _content(rows)
        types = sorted(self.vehicles.types_by_name.items())
        self._types = {name: asdict(kind) for name, kind in types}
        seen = [self._content, rows.begin_s, self.view_m, self._types, seed, self.laws.digest]
        self.digest = hashlib.sha256(json.dumps(seen).encode()).hexdigest()

    @functools.cached_property
    def objects(self) -> ObjectColumns:
        """All vehicles, whose rows are their numbers."""
        labels = self.vehicles.labels
        return ObjectColumns(
            labels,
            range(len(labels)),
            [True] * len(labels),
            laws=self.laws,
            seed_key=self.key,
        )

    @functools.cached_property
    def visibility(self) -> TrafficView:
        return TrafficView(self.vehicles, self.objects, self.sight_m)

    def warn(self) -> None:
        """Logs what was not read as it stands in the file."""
        for line in self.report.lines(only=("left out", "chosen")):
            log.warning("%s: %s", self.path, line)
        jumps = self.vehicles.jumps
        if jumps.any():
            some = f"{(jumps > 0).sum():,} of {len(jumps):,}"
            text = "%s: %s vehicles teleport, %d times in all: each drives its longest stretch"
            log.warning(text, self.path, some, jumps.sum())

    def knows(self, label: str) -> bool:
        return label in KNOWN or (label in PERSONS and any(self.vehicles.is_person))

    def facts(self) -> Mapping[str, object]:
        # Names no detector, so that maps take the assumed laws: what was measured of this one in a
        # town, on other streets and among other traffic, is no measurement here.
        vehicles = self.vehicles
        return {
            "file": self.path.name,
            "content_sha256": self._content,
            "vehicles": len(vehicles.carriers),
            "teleports": int(vehicles.jumps.sum()),
            "vehicles_that_teleport": int((vehicles.jumps > 0).sum()),
            "import": self.report.facts(),
            "types": self._types,
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

    scene: Traffic
    settings: "RecordedTraffic"

    def __init__(self, traffic: Traffic, settings: "RecordedTraffic") -> None:
        super().__init__(traffic, settings)
        vehicles = traffic.vehicles
        self.extent_m = vehicles.extent_m
        numbers = vehicles.carriers.tolist()
        self._ids = [vehicles.ids[number] for number in numbers]
        self._names = car_names(traffic.path, self._ids)
        # of each car that is there long enough: its course, and when it begins and ends
        self._stretches: dict[str, tuple[Stretch, int, int]] = {}
        for number, name in zip(numbers, self._names, strict=True):
            stretch = vehicles.longest(number, traffic.end_s)
            if stretch.end_s - stretch.begin_s >= SHORTEST_S:
                # Of a difference of floats: 3600.3 s less 3600 s are 300000001 ns. Another rounding
                # would draw the frames of kept runs anew.
                span_ns = math.ceil(stretch.begin_s * 1e9), math.floor(stretch.end_s * 1e9)
                self._stretches[name] = (stretch, *span_ns)

    def starts_ns(self) -> dict[str, int]:
        """When each equipped vehicle appears [ns], by its car's name. Raises ``UserError`` where
        there is none.
        """
        equipped = self._equipped()
        starts_ns = {name: self._stretches[name][1] for name in equipped if name in self._stretches}
        if not starts_ns:
            raise UserError(
                f"{self.scene.path}: perception.equipped: none of {len(self._ids):,} vehicles is "
                f"equipped and there for {SHORTEST_S:g} s; see 'equipped', 'begin' and 'duration'"
            )
        left_out = len(equipped) - len(starts_ns)
        if left_out:
            log.warning(
                "%s: %d equipped vehicles are there for less than %g s: they carry no cameras",
                self.scene.path,
                left_out,
                SHORTEST_S,
            )
        return starts_ns

    def _equipped(self) -> list[str]:
        """The names of the equipped vehicles: as they are listed, or of a share in the order in
        which they appear.
        """
        equipped, ids = self.settings.equipped, self._ids
        if isinstance(equipped, tuple):
            numbers = {vehicle: number for number, vehicle in enumerate(ids)}
            for vehicle in equipped:
                if vehicle not in numbers:
                    what = unknown("vehicle", vehicle, ids)
                    raise UserError(f"{self.scene.path}: perception.equipped: {what}")
            return [self._names[numbers[vehicle]] for vehicle in equipped]
        return [
            name
            for name, vehicle in zip(self._names, ids, strict=True)
            if equipped == 1.0 or self.scene.random("equipped", vehicle).random() < equipped
        ]

    def drive(self, car: str, trace: str | None, start_ns: int) -> SceneDrive:
        if car not in self._stretches:
            what = unknown("vehicle", car, self._stretches)
            raise UserError(f"{self.scene.path}: {what}")
        stretch, begin_ns, end_ns = self._stretches[car]
        if not begin_ns <= start_ns < end_ns:
            raise UserError(
                f"{self.scene.path}: {car} starts at {duration_text(start_ns)}, but is there from "
                f"{duration_text(begin_ns)} to {duration_text(end_ns)}: see 'route.start' and "
                "'start_jitter'"
            )
        return SceneDrive(
            self.scene,
            car,
            lambda: stretch,
            duration_ns=end_ns - start_ns,
            interval_ns=self.settings.interval_ns,
            start_ns=start_ns,
        )
