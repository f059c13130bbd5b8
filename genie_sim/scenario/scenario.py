"""A scenario: who drives where with which computers, links and readings of the paper.

``load_scenario`` reads a YAML file, applies ``--set`` overrides and checks everything that can be known before
simulating. In Python names carry units (``start_ns``), in YAML values do (``start: 3 s``).
"""

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import ConfigDict, Field, PrivateAttr, ValidationError, model_validator

from genie_sim import files, methods, plugins, units
from genie_sim.core.consumer import ConsumerName
from genie_sim.core.rules import GenieRules
from genie_sim.errors import UserError, unknown
from genie_sim.messages import Encoding
from genie_sim.methods import METHODS
from genie_sim.perception.sources import SOURCES
from genie_sim.plugins import Choice
from genie_sim.scenario.convoy import Convoy
from genie_sim.scenario.faults import FaultField, check_faults
from genie_sim.scenario.fields import (
    Count,
    Duration,
    Listed,
    Model,
    Name,
    first_problem,
    problem,
    validate,
    wrong,
)
from genie_sim.scenario.fleet import MOST_EDGES, Fleet
from genie_sim.scenario.genie import GenieSection, with_preset
from genie_sim.scenario.links import LINKS, Link
from genie_sim.scenario.methods import (
    OVERRIDABLE,
    MethodEntry,
    MethodField,
    method_class,
    overridden,
    read_method,
)
from genie_sim.scenario.overrides import Override, apply_overrides
from genie_sim.scenario.parts import FOUR_CAMERAS, Camera, Car, Edge, Route, unique
from genie_sim.scenario.plain import PlugIn
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.scenario.yaml_input import dump, read_mapping
from genie_sim.seeds import stream

Record = Literal[
    "lookups", "resources", "poses", "objects", "answers", "held", "held_objects", "steps"
]
RECORDS: tuple[Record, ...] = get_args(Record)
USUAL_METHODS = tuple(map(read_method, methods.USUAL))

EDGES = "edges"  # the network between edges, in the names of links

# How much time a scenario may simulate. One car's frames of so long fill a computer's memory; whoever writes more has
# slipped by a unit or a few zeros, and would learn it only after hours.
LONGEST_DAYS = 30
DAY_NS = 24 * units.DURATIONS["h"]


class Overridable(Model):
    """The settings that a method of a scenario may have otherwise. Who drives where, and what cameras see, is the same
    for all."""

    model: str = "autoware_vision_detector"
    spread: Literal["isolated", "default", "loaded"] = "default"
    queue_length: Count = 1
    consumer: ConsumerName = "newest"
    image_encoding: Encoding = "raw"
    edge_network: Link = LINKS["ethernet_1g"]
    genie: GenieSection = GenieRules()


class Scenario(Overridable):
    """Everything that decides the outcome of a run, but for the files it names.

    Who drives is said by ``cars`` and ``edges``, which a ``convoy`` is turned into, or by ``fleet``. Of the tables
    beside the frames only those in ``record`` are written down, and of a fleet's resources only those of its edges.
    """

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": [who]} for who in ("cars", "convoy", "fleet")]}
    )

    name: Name
    description: str = ""
    seed: Annotated[int, Field(ge=0)] = 1
    methods: Annotated[tuple[MethodField, ...], Listed, Field(min_length=1)] = USUAL_METHODS
    perception: Annotated[
        Choice, PlugIn("frame source", SOURCES, key="source", default="recorded")
    ] = Choice("recorded", {"trace": "kitti_0005"})
    origin: Annotated[tuple[float, float, float], Listed] | None = None
    cameras: Annotated[tuple[Camera, ...], Listed, Field(min_length=1)] = FOUR_CAMERAS
    start_jitter_ns: Duration = Field(default=100 * units.NS_PER_MS, alias="start_jitter")
    edges: Annotated[tuple[Edge, ...], Listed] = ()
    cars: Annotated[tuple[Car, ...], Listed] = ()
    fleet: Fleet | None = None
    convoy: Convoy | None = None
    faults: Annotated[tuple[FaultField, ...], Listed] = ()
    record: Annotated[tuple[Record, ...], Listed] = RECORDS
    _profiles: dict[str, DeviceProfile] = PrivateAttr(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _somebody_drives(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "axes" in data:
            problem("axes", "belongs to a sweep, which 'genie-sim sweep' runs")
        if isinstance(data, Mapping) and data.get("convoy") is not None:
            data = _without_convoy(data)
        if isinstance(data, Mapping) and data.get("fleet") is None and "cars" not in data:
            problem("cars", "missing")
        return data

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        unique("methods", [entry.name for entry in self.methods], ".name")
        unique("record", self.record)
        if "held_objects" in self.record and "held" not in self.record:
            problem("record", "'held_objects' needs 'held' too")
        unique("cameras", [camera.name for camera in self.cameras], ".name")
        unique("edges", [edge.name for edge in self.edges], ".name")
        self._cars_or_fleet()
        edges = {edge.name for edge in self.edges}
        unique("cars", [car.name for car in self.cars], ".name", also=edges)
        for index, car in enumerate(self.cars):
            if car.name == EDGES:
                problem(
                    f"cars[{index}].name",
                    f"{EDGES!r} is what the network between the edges is called",
                )
            if car.edge is not None and car.edge not in edges:
                problem(f"cars[{index}].edge", _unknown_edge(car.edge, edges))
            self._edge_fits(index, car)
        self._neighbours_fit(edges)
        if self.fleet is None:
            for field, text in check_faults(
                self.faults, {car.name: car.edge for car in self.cars}, edges
            ):
                problem(field, text)
        if self.origin is not None and not (
            abs(self.origin[0]) <= 90 and abs(self.origin[1]) <= 180
        ):
            problem(
                "origin", "must be [latitude, longitude, altitude] in degrees, degrees and metres"
            )
        return self

    def _cars_or_fleet(self) -> None:
        if self.fleet is None and not self.cars:
            problem("cars", "must not be empty")
        town = self.source if hasattr(self.source, "town") else None
        if self.fleet is not None:
            for field in ("cars", "edges"):
                if getattr(self, field):
                    problem(field, "a fleet brings its own; leave them out, or 'fleet'")
            if town is None:
                problem("fleet", "needs a town to drive in: 'perception: {source: town}'")
            elif town.cells(self.fleet.cell_m) > MOST_EDGES:
                problem("fleet.cell", f"makes more than {MOST_EDGES:,} edges of this town")
        if town is None:
            return
        if self.origin is not None:
            problem("origin", "a town is where it is; leave it out")
        for index, car in enumerate(self.cars):
            if car.route.trace is not None:
                problem(
                    f"cars[{index}].route.trace", "cars in a town make their own way; leave it out"
                )
            for field, unusual in (
                ("window", car.route.window_ns is not None),
                ("laps", car.route.laps > 1),
            ):
                if unusual:
                    problem(
                        f"cars[{index}].route.{field}",
                        "a town's clock never goes back; use 'perception.duration'",
                    )
            if not car.cameras:
                problem(
                    f"cars[{index}].cameras", "without cameras, cars drive recorded streets only"
                )

    def _neighbours_fit(self, edges: Collection[str]) -> None:
        """Neighbours exist and agree: what one edge asks another, that one must be able to answer."""
        named = {edge.name: edge.neighbours for edge in self.edges}
        for index, edge in enumerate(self.edges):
            for place, other in enumerate(edge.neighbours or ()):
                field = f"edges[{index}].neighbours[{place}]"
                if other not in edges:
                    problem(field, _unknown_edge(other, edges))
                if other == edge.name:
                    problem(field, f"{other} is no neighbour of itself")
                theirs = named[other]
                if theirs is not None and edge.name not in theirs:
                    problem(field, f"{other} does not have {edge.name} among its own neighbours")
            unique(f"edges[{index}].neighbours", edge.neighbours or ())

    def _edge_fits(self, index: int, car: Car) -> None:
        """A car without cameras has an edge without detector, and asks by position."""
        if car.cameras:
            return
        for place, fault in enumerate(self.faults):
            if fault.target == car.name and "edge" in fault.fault.parameters:
                problem(
                    f"faults[{place}].target",
                    "a car without cameras stays with the edge that serves it",
                )
        for other in self.cars:
            joins = (
                fault.fault.parameters.get("edge")
                for fault in self.faults
                if fault.target == other.name
            )
            if other.cameras and car.edge in (other.edge, *joins):
                problem(
                    f"cars[{index}].edge",
                    f"serves {other.name}'s cameras; a car without needs one of its own",
                )
        for entry in self.methods:
            if self.under(entry).genie.similarity.name != "pose_grid":
                problem(
                    f"cars[{index}].cameras",
                    "a car without cameras has only its position: similarity 'pose_grid'",
                )

    @model_validator(mode="after")
    def _methods_fit(self) -> Self:
        """Every method's own settings make a scenario."""
        for index, entry in enumerate(self.methods):
            try:
                self.under(entry)
            except UserError as error:
                field, _, text = str(error).partition(": ")
                problem(f"methods[{index}].{field}", text)
        return self

    @model_validator(mode="after")
    def _files_exist(self) -> Self:
        """Traces are there, devices too, and each knows the model."""
        traces = {
            f"cars[{i}].route.trace": car.route.trace
            for i, car in enumerate(self.cars)
            if car.route.trace
        }
        if "trace" in self.perception.parameters:
            traces["perception.trace"] = self.perception.parameters["trace"]
        for field, trace in traces.items():
            with wrong(field):
                files.find(files.TRACE, trace)
        for device, field in self._devices().items():
            with wrong(field):
                self._profiles[device] = load_profile(device)
            for index, entry in enumerate(self.methods):
                self._model_fits(index, entry, self._profiles[device])
        return self

    def _devices(self) -> dict[str, str]:
        """Every device, and where it is named first."""
        used = [(car.device, f"cars[{index}].device") for index, car in enumerate(self.cars)]
        used += [(edge.device, f"edges[{index}].device") for index, edge in enumerate(self.edges)]
        if self.fleet is not None:
            used += [(device, "fleet.devices") for device in self.fleet.devices]
            used.append((self.fleet.edge_device, "fleet.edge_device"))
        first = dict(reversed(used))
        return {device: first[device] for device, _ in used}

    def _model_fits(self, index: int, entry: MethodEntry, profile: DeviceProfile) -> None:
        mine, where = (
            self.under(entry),
            f"methods[{index}]." if entry.settings.keys() & {"model", "genie"} else "",
        )
        with wrong(f"{where}model"):
            median_ns = profile.median_ns(mine.model)
        expiry_ns = mine.genie.request_expiry_ns
        if expiry_ns is None or expiry_ns > median_ns:
            return
        if plugins.is_own(entry.method.name) or not method_class(entry).baseline:
            takes, expiry = units.duration_text(median_ns), units.duration_text(expiry_ns)
            over = f"{expiry} is over before {mine.model} answers on {profile.name} ({takes}): lengthen it, or null"
            problem(f"{where}genie.request_expiry", over)

    @property
    def source(self) -> Any:
        """The frame source, ``None`` for one of the user's own, whose code is not run to check a scenario."""
        if plugins.is_own(self.perception.name):
            return None
        return plugins.make("frame source", self.perception, SOURCES)

    @property
    def profiles(self) -> Mapping[str, DeviceProfile]:
        """The profile of each device that is named here, as it was read when the scenario was checked."""
        return self._profiles

    def under(self, entry: MethodEntry) -> "Scenario":
        """The scenario with the settings that one method has otherwise. Raises ``UserError``."""
        if not entry.settings:
            return self
        known = self.model_dump(mode="json", by_alias=True, include=set(OVERRIDABLE))
        settings = {
            name: with_preset(said) if name == "genie" else said
            for name, said in entry.settings.items()
        }
        mine = validate(Overridable, overridden(known, settings), lambda _: "")
        return self.model_copy(update={name: getattr(mine, name) for name in entry.settings})

    def cameras_of(self, car: Car) -> Sequence[Camera]:
        """A car's own cameras, or the scenario's."""
        return car.cameras if isinstance(car.cameras, tuple) else self.cameras

    def start_ns(self, car: Car) -> int:
        """When a car starts: at its route's start, and up to ``start_jitter`` later, drawn for every car."""
        jitter_ns = self.start_jitter_ns
        late_ns = int(stream(self.seed, car.name, "start").integers(jitter_ns)) if jitter_ns else 0
        return car.route.start_ns + late_ns

    def check_time(self, where: str, route: Route, recorded_ns: int) -> None:
        """Raises ``UserError`` if a car on this route through a drive so long would take frames for too long."""
        begin_ns, end_ns = route.window_ns or (0, recorded_ns)
        cameras = [camera for car in self.cars for camera in self.cameras_of(car)] or self.cameras
        late_ns = route.start_ns + self.start_jitter_ns + max(camera.phase_ns for camera in cameras)
        total_ns = late_ns + route.laps * (end_ns - begin_ns) + (route.laps - 1) * route.pause_ns
        if total_ns > LONGEST_DAYS * DAY_NS:
            raise UserError(
                f"{where}: ends after {total_ns / DAY_NS:,.1f} days; at most {LONGEST_DAYS} are simulated"
            )

    def to_yaml(self) -> str:
        """Every setting written out; reads back to an equal scenario."""
        written = self.model_dump(mode="json", by_alias=True)
        return dump(
            {key: written[key] for key in ("name", "description", "seed", "methods")} | written
        )


def _without_convoy(data: Mapping[str, Any]) -> dict[str, Any]:
    """The scenario with the cars and edges that its convoy stands for."""
    for field in ("cars", "edges", "fleet"):
        if data.get(field):
            problem(field, "a convoy brings its own cars and edges; leave them out, or 'convoy'")
    try:
        return {**data, "convoy": None, **Convoy.model_validate(data["convoy"]).expanded()}
    except ValidationError as error:
        field, text = first_problem(error, data["convoy"])
        problem(f"convoy.{field}".rstrip("."), text)


def _unknown_edge(name: str, edges: Collection[str]) -> str:
    return unknown("edge", name, edges) if edges else f"unknown edge {name!r}; there are no edges"


def load_scenario(
    path_or_name: str | Path, overrides: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """A scenario file, by path or by name, with ``path=value`` overrides. Raises ``UserError``."""
    path = files.find(files.SCENARIO, path_or_name)
    data = read_mapping(path)
    data.setdefault("name", path.stem)
    return read_scenario(data, overrides, seed, where=str(path))


def with_methods(scenario: Scenario, names: Sequence[str], where: str = "methods") -> Scenario:
    """The scenario with these methods: its own entries by name, else ones by themselves. Raises ``UserError``."""
    written = scenario.model_dump(mode="json", by_alias=True)
    entries = {
        entry.name: one for entry, one in zip(scenario.methods, written["methods"], strict=True)
    }
    for name in names:
        try:
            entries.setdefault(plugins.checked_name("method", name, {**METHODS, **entries}), name)
        except ValueError as error:
            raise UserError(f"{where}: {error}") from error
    return read_scenario({**written, "methods": [entries[name] for name in names]}, where=where)


def read_scenario(
    data: Mapping[str, Any],
    overrides: Sequence[str] = (),
    seed: int | None = None,
    where: str = "scenario",
) -> Scenario:
    """The scenario in ``data``, written as in YAML; ``where`` begins the errors."""
    settings = copy.deepcopy(dict(data))
    applied = apply_overrides(settings, overrides)
    if seed is not None:
        settings["seed"] = seed
    return validate(Scenario, settings, lambda field: _culprit(field, applied, where))


def _culprit(field: str, applied: Iterable[Override], where: str) -> str:
    """The override that set ``field``, else the file."""
    for override in applied:
        if field == override.path or field.startswith((f"{override.path}.", f"{override.path}[")):
            return override.text
    return where
