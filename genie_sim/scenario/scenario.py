"""A scenario: who drives where with which computers, links and readings of the paper.

``load_scenario`` reads a YAML file, applies ``--set`` overrides and checks everything that can be known before
simulating. In Python names carry units (``start_ns``), in YAML values do (``start: 3 s``).
"""

from __future__ import annotations

import copy
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, model_validator

from genie_sim import units
from genie_sim.errors import UserError, shown, unknown
from genie_sim.scenario import files
from genie_sim.scenario.fields import Count, Duration, Listed, Model, Name, PositiveSize, Probability, problem, validate
from genie_sim.scenario.fleet import MOST_EDGES, Fleet, InTown
from genie_sim.scenario.genie_settings import GenieSettings
from genie_sim.scenario.links import LINKS, Link
from genie_sim.scenario.overrides import Override, apply_overrides
from genie_sim.scenario.profiles import load_profile
from genie_sim.scenario.yaml_input import dump, read_mapping
from genie_sim.seeds import stream

Method = Literal["local", "remote", "genie"]
Record = Literal["lookups", "resources", "poses", "objects", "truth"]
RECORDS: tuple[Record, ...] = ("lookups", "resources", "poses", "objects", "truth")

EDGES = "edges"  # the network between edges, in the names of links

# How long a car that changes its edge can send and receive nothing. Drive tests see 30 to 80 ms within LTE and 50 to
# 150 ms within 5G [S: 5g6gacademy.com, 5G drive testing, lesson 12.3.5]: what both have in common.
HAND_OVER_GAP_NS = 50 * units.NS_PER_MS

# How much time a scenario may simulate. One car's frames of so long fill a computer's memory; whoever writes more has
# slipped by a unit or a few zeros, and would learn it only after hours.
LONGEST_DAYS = 30
DAY_NS = 24 * units.DURATIONS["h"]


class Recorded(Model):
    """What the cameras show comes from a perception trace."""

    source: Literal["recorded"] = "recorded"
    trace: str = "kitti_0005"


def _drive(name: str) -> str:
    if not re.fullmatch(r"\d{4}_\d{2}_\d{2}/\d{4}", name, re.ASCII):
        raise ValueError(f"must be a date and a number such as '2011_09_26/0005', not {shown(name)}")
    return name


class Live(Model):
    """The frames of a KITTI drive go through a detector while the scenario is prepared.

    ``kitti`` may begin with an environment variable, ``drive`` is ``date/number``.
    """

    source: Literal["live"] = "live"
    kitti: str = "$GENIE_SIM_KITTI"
    drive: Annotated[str, AfterValidator(_drive)] = "2011_09_26/0005"
    cameras: Annotated[tuple[Name, ...], Listed, Field(min_length=1)] = ("02", "03")
    detector: str = "yolox_nano"
    min_score: Probability = 0.3


def _default_source(value: object) -> object:
    return {"source": "recorded", **value} if isinstance(value, Mapping) else value


class Camera(Model):
    """One stream of every car: which recording stands for it, at which phase, and how large its images are.

    ``size_bytes`` of ``None`` is the recorded size.
    """

    name: Name
    recording: Name
    phase_ns: Duration = Field(default=0, alias="phase")
    size_bytes: PositiveSize | None = Field(default=None, alias="size")


# KITTI's two colour and two grey cameras at 10 Hz, at staggered phases. The grey ones are not recorded: a colour one
# stands for each, with the size of a mono8 image, a third of the bytes.
FOUR_CAMERAS = tuple(
    Camera.model_construct(name=name, recording=recording, phase_ns=phase_ns, size_bytes=size_bytes)
    for name, recording, phase_ns, size_bytes in (
        ("camera_02", "02", 0, None),
        ("camera_03", "03", 25 * units.NS_PER_MS, None),
        ("camera_00", "02", 50 * units.NS_PER_MS, 465_800),
        ("camera_01", "03", 75 * units.NS_PER_MS, 465_800),
    )
)


class Edge(Model):
    """An edge server. It shares with its ``neighbours`` over the edge network; ``None`` for all other edges."""

    name: Name
    device: str
    neighbours: Annotated[tuple[Name, ...], Listed] | None = None


class Route(Model):
    """Which part of a trace a car drives, when, and how often.

    ``trace`` of ``None`` is the scenario's, ``window_ns`` of ``None`` the whole drive. ``start_ns`` is when the car
    sets off, ``pause_ns`` the time between two laps.
    """

    trace: str | None = None
    window_ns: Annotated[tuple[Duration, Duration], Listed] | None = Field(default=None, alias="window")
    start_ns: Duration = Field(default=0, alias="start")
    laps: Count = 1
    pause_ns: Duration = Field(default=units.NS_PER_S, alias="pause")

    @model_validator(mode="after")
    def _window_in_order(self) -> Self:
        if self.window_ns is not None and self.window_ns[0] >= self.window_ns[1]:
            problem("window", "must be [begin, end] with begin before end")
        return self


class HandOver(Model):
    """At this instant of simulated time a car leaves its edge for another."""

    at_ns: Duration = Field(alias="at")
    edge: str


class Car(Model):
    """A car, its computer, and its link to its edge (both ``None`` for a car on its own).

    ``hand_overs``, in order of time, say when it changes to which other edge; the link stays of the same kind. A car
    without ``cameras`` has no detector either: it asks with its position and lives on what others have seen.
    """

    name: Name
    device: str
    edge: str | None = None
    link: Link | None = None
    route: Route = Route()
    cameras: bool = True
    genie: bool = True
    hand_overs: Annotated[tuple[HandOver, ...], Listed] = ()

    @model_validator(mode="before")
    @classmethod
    def _edge_has_a_link(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and data.get("edge") is not None and data.get("link") is None:
            return {**data, "link": "ethernet_1g"}
        return data

    @model_validator(mode="after")
    def _link_leads_to_an_edge(self) -> Self:
        if self.link is not None and self.edge is None:
            problem("link", "leads nowhere: the car has no 'edge'")
        if not self.cameras and (self.edge is None or not self.genie):
            problem("cameras", "a car without cameras needs an 'edge' and 'genie: true', or nobody answers it")
        if self.hand_overs and self.edge is None:
            problem("hand_overs", "the car has no 'edge' to leave")
        if self.hand_overs and not self.cameras:
            problem("hand_overs", "a car without cameras stays with the edge that serves it")
        return self


class Scenario(Model):
    """Everything that decides the outcome of a run, but for the files it names.

    Who drives is said by ``cars`` and ``edges``, or by ``fleet``. Of the tables beside the frames only those in
    ``record`` are written down, and of a fleet's resources only those of its edges.
    """

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": ["cars"]}, {"required": ["fleet"]}]})

    name: Name
    description: str = ""
    seed: Annotated[int, Field(ge=0)] = 1
    methods: Annotated[tuple[Method, ...], Listed, Field(min_length=1)] = ("local", "remote", "genie")
    model: str = "autoware_vision_detector"
    spread: Literal["isolated", "default", "loaded"] = "default"
    perception: Annotated[Recorded | Live | InTown, Field(discriminator="source"), BeforeValidator(_default_source)] = (
        Recorded()
    )
    origin: Annotated[tuple[float, float, float], Listed] | None = None
    cameras: Annotated[tuple[Camera, ...], Listed, Field(min_length=1)] = FOUR_CAMERAS
    start_jitter_ns: Duration = Field(default=100 * units.NS_PER_MS, alias="start_jitter")
    queue_length: Count = 1
    edges: Annotated[tuple[Edge, ...], Listed] = ()
    edge_network: Link = LINKS["ethernet_1g"]
    hand_over_gap_ns: Duration = Field(default=HAND_OVER_GAP_NS, alias="hand_over_gap")
    cars: Annotated[tuple[Car, ...], Listed] = ()
    fleet: Fleet | None = None
    genie: GenieSettings = GenieSettings()
    record: Annotated[tuple[Record, ...], Listed] = RECORDS

    @model_validator(mode="before")
    @classmethod
    def _somebody_drives(cls, data: Any) -> Any:
        if isinstance(data, Mapping) and "axes" in data:
            problem("axes", "belongs to a sweep, which 'genie-sim sweep' runs")
        if isinstance(data, Mapping) and data.get("fleet") is None and "cars" not in data:
            problem("cars", "missing")
        return data

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        _unique("methods", self.methods)
        _unique("record", self.record)
        _unique("cameras", [camera.name for camera in self.cameras], ".name")
        _unique("edges", [edge.name for edge in self.edges], ".name")
        self._cars_or_fleet()
        edges = {edge.name for edge in self.edges}
        _unique("cars", [car.name for car in self.cars], ".name", also=edges)
        for index, car in enumerate(self.cars):
            if car.name == EDGES:
                problem(f"cars[{index}].name", f"{EDGES!r} is what the network between the edges is called")
            if car.edge is not None and car.edge not in edges:
                problem(f"cars[{index}].edge", _unknown_edge(car.edge, edges))
            self._hand_overs_fit(index, car, edges)
            self._edge_fits(index, car)
        self._neighbours_fit(edges)
        if self.origin is not None and not (abs(self.origin[0]) <= 90 and abs(self.origin[1]) <= 180):
            problem("origin", "must be [latitude, longitude, altitude] in degrees, degrees and metres")
        return self

    def _cars_or_fleet(self) -> None:
        if self.fleet is None and not self.cars:
            problem("cars", "must not be empty")
        if self.fleet is not None:
            for field in ("cars", "edges"):
                if getattr(self, field):
                    problem(field, "a fleet brings its own; leave them out, or 'fleet'")
            if not isinstance(self.perception, InTown):
                problem("fleet", "needs a town to drive in: 'perception: {source: town}'")
            elif self.perception.edges(self.fleet.cell_m) > MOST_EDGES:
                problem("fleet.cell", f"makes more than {MOST_EDGES:,} edges of this town")
        if not isinstance(self.perception, InTown):
            return
        if self.origin is not None:
            problem("origin", "a town is where it is; leave it out")
        for index, car in enumerate(self.cars):
            if car.route.trace is not None:
                problem(f"cars[{index}].route.trace", "cars in a town make their own way; leave it out")
            for field, unusual in (("window", car.route.window_ns is not None), ("laps", car.route.laps > 1)):
                if unusual:
                    problem(f"cars[{index}].route.{field}", "a town's clock never goes back; use 'perception.duration'")
            if not car.cameras:
                problem(f"cars[{index}].cameras", "without cameras, cars drive recorded streets only")

    def _hand_overs_fit(self, index: int, car: Car, edges: Collection[str]) -> None:
        """Each leads to another edge that exists, after the one before is over."""
        edge, free_ns = car.edge, 0
        for place, one in enumerate(car.hand_overs):
            field = f"cars[{index}].hand_overs[{place}]"
            if one.edge not in edges:
                problem(f"{field}.edge", _unknown_edge(one.edge, edges))
            if one.edge == edge:
                problem(f"{field}.edge", f"the car is with {edge} already")
            if one.at_ns < free_ns:
                problem(f"{field}.at", f"comes before the one before it is over, at {units.duration_text(free_ns)}")
            edge, free_ns = one.edge, one.at_ns + self.hand_over_gap_ns

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
            _unique(f"edges[{index}].neighbours", edge.neighbours or ())

    def _edge_fits(self, index: int, car: Car) -> None:
        """A car without cameras has an edge without detector, and asks by position."""
        if car.cameras:
            return
        for other in self.cars:
            if other.cameras and car.edge in (other.edge, *(one.edge for one in other.hand_overs)):
                problem(f"cars[{index}].edge", f"serves {other.name}'s cameras; a car without needs one of its own")
        if self.genie.similarity.name != "pose_grid":
            problem(f"cars[{index}].cameras", "a car without cameras has only its position: similarity 'pose_grid'")

    @model_validator(mode="after")
    def _files_exist(self) -> Self:
        """Traces are there, devices too, and each knows the model."""
        traces = {f"cars[{i}].route.trace": car.route.trace for i, car in enumerate(self.cars) if car.route.trace}
        if isinstance(self.perception, Recorded):
            traces["perception.trace"] = self.perception.trace
        for field, trace in traces.items():
            try:
                files.find(files.TRACE, trace)
            except UserError as error:
                problem(field, str(error))
        first_use: dict[str, str] = {}
        for index, car in enumerate(self.cars):
            first_use.setdefault(car.device, f"cars[{index}].device")
        for index, edge in enumerate(self.edges):
            first_use.setdefault(edge.device, f"edges[{index}].device")
        if self.fleet is not None:
            first_use |= dict.fromkeys(self.fleet.devices, "fleet.devices")
            first_use.setdefault(self.fleet.edge_device, "fleet.edge_device")
        for device, field in first_use.items():
            try:
                profile = load_profile(device)
            except UserError as error:
                problem(field, str(error))
            try:
                law = profile.service_time(self.model, self.spread)
            except UserError as error:
                problem("model", str(error))
            expiry_ns = self.genie.request_expiry_ns
            if expiry_ns is not None and expiry_ns <= law.median_ns and "genie" in self.methods:
                takes, expiry = units.duration_text(law.median_ns), units.duration_text(expiry_ns)
                over = f"{expiry} is over before {self.model} answers on {device} ({takes}): lengthen it, or null"
                problem("genie.request_expiry", over)
        return self

    def set_off_ns(self, car: Car) -> int:
        """When a car sets off: at its route's start, and up to ``start_jitter`` later, drawn for every car."""
        jitter_ns = self.start_jitter_ns
        late_ns = int(stream(self.seed, car.name, "start").integers(jitter_ns)) if jitter_ns else 0
        return car.route.start_ns + late_ns

    def check_time(self, where: str, route: Route, recorded_ns: int) -> None:
        """Raises ``UserError`` if a car on this route through a drive so long would take frames for too long."""
        begin_ns, end_ns = route.window_ns or (0, recorded_ns)
        late_ns = route.start_ns + self.start_jitter_ns + max(camera.phase_ns for camera in self.cameras)
        total_ns = late_ns + route.laps * (end_ns - begin_ns) + (route.laps - 1) * route.pause_ns
        if total_ns > LONGEST_DAYS * DAY_NS:
            raise UserError(f"{where}: ends after {total_ns / DAY_NS:,.1f} days; at most {LONGEST_DAYS} are simulated")

    def to_yaml(self) -> str:
        """Every setting written out; reads back to an equal scenario."""
        return dump(self.model_dump(mode="json", by_alias=True))


def _unknown_edge(name: str, edges: Collection[str]) -> str:
    return unknown("edge", name, edges) if edges else f"unknown edge {name!r}; there are no edges"


def _unique(field: str, names: Sequence[str], of: str = "", also: Iterable[str] = ()) -> None:
    seen = set(also)
    for index, name in enumerate(names):
        if name in seen:
            problem(f"{field}[{index}]{of}", f"duplicate name {name!r}")
        seen.add(name)


def load_scenario(path_or_name: str | Path, overrides: Sequence[str] = (), seed: int | None = None) -> Scenario:
    """A scenario file, by path or by name, with ``path=value`` overrides. Raises ``UserError``."""
    path = files.find(files.SCENARIO, path_or_name)
    data = read_mapping(path)
    data.setdefault("name", path.stem)
    return read_scenario(data, overrides, seed, where=str(path))


def read_scenario(
    data: Mapping[str, Any], overrides: Sequence[str] = (), seed: int | None = None, where: str = "scenario"
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
