"""A scenario: who drives where with which computers, links and readings of the paper.

``load_scenario`` reads a YAML file, applies ``--set`` overrides and checks everything that can be
known before simulating. In Python names carry units (``start_ns``), in YAML values do (``start: 3
s``).
"""

import copy
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

from genie_sim import methods
from genie_sim.base import files, plugins, units
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.plugins import Choice
from genie_sim.base.seeds import stream
from genie_sim.base.settings import (
    Bounds,
    IfGiven,
    Name,
    NotEmpty,
    PlugIn,
    SettingError,
    Short,
    from_plain,
    merged,
    names_of,
    plain_data,
)
from genie_sim.core.rules import GenieRules, ToldRules
from genie_sim.core.without_effect import check_effect
from genie_sim.data.sources import SOURCES
from genie_sim.methods import METHODS
from genie_sim.scenario import setting_paths
from genie_sim.scenario.convoy import Convoy
from genie_sim.scenario.faults import FaultEntry, check_faults
from genie_sim.scenario.fleet import MAX_EDGES, Fleet
from genie_sim.scenario.methods import METHOD, MethodEntry, method_class
from genie_sim.scenario.overrides import Override, apply_overrides
from genie_sim.scenario.power import InterfaceName
from genie_sim.scenario.profiles import DeviceProfile, load_profile
from genie_sim.scenario.yaml_input import dump, read_mapping
from genie_sim.sim.link_models.presets import LINK
from genie_sim.sim.settings import (
    FOUR_CAMERAS,
    Camera,
    Car,
    Edge,
    MethodSettings,
    Route,
    check_unique,
)

Record = Literal[
    "lookups",
    "looks",
    "resources",
    "poses",
    "objects",
    "answers",
    "held",
    "held_objects",
    "steps",
]
RECORDS: tuple[Record, ...] = get_args(Record)
METRIC = PlugIn("metric", {}, ("of", "title", "view"))
FRAME_SOURCE = PlugIn("frame source", SOURCES, ("open",), key="source", default="recorded")
USUAL_TRACE = Choice("recorded", {"trace": "kitti_0005"})
USUAL_METHODS = tuple(from_plain(MethodEntry, name) for name in methods.USUAL)

EDGES = "edges"  # the network between edges, in the names of links

# The longest time that a scenario may simulate. The frames of one car over that time fill a
# computer's memory; more is almost certainly a unit error and would be noticed only after hours.
MAX_DAYS = 30
DAY_NS = 24 * units.DURATIONS["h"]


class Origin(NamedTuple):
    """Where the settings of a scenario come from."""

    file: str = "scenario"
    overrides: tuple[Override, ...] = ()

    def of(self, path: str) -> str:
        """The override that set what is at ``path``, else the file."""
        for override in self.overrides:
            below = (f"{override.path}.", f"{override.path}[")
            if path == override.path or path.startswith(below):
                return override.text
        return self.file


@dataclass(frozen=True, kw_only=True)
class Scenario(MethodSettings):
    """Everything that decides the outcome of a run, but for the files it names."""

    name: Name
    """The name of the results; by default that of the file."""

    description: str = ""
    """A sentence for whoever reads the results."""

    seed: Annotated[int, Bounds(minimum=0)] = 1
    """Seed of all streams of random numbers. The same seed gives the same bytes."""

    methods: Annotated[tuple[Annotated[MethodEntry, Short(plug_in=METHOD)], ...], NotEmpty()] = (
        USUAL_METHODS
    )
    """The methods to compare, in this order, each on the same random numbers. A method's name, or a
    mapping with `name`, `method`, `title`, the method's own arguments, and settings of the scenario
    that differ for this entry (`genie`, `model`, `spread`, `queue_length`, `consumer`,
    `image_encoding`, `edge_network`, `serving`)."""

    perception: Annotated[Choice, FRAME_SOURCE] = USUAL_TRACE
    """Where frames and detections come from."""

    origin: tuple[float, float, float] | None = None
    """Latitude [deg], longitude [deg] and altitude [m] of the map's origin; by default that of the
    first trace. Cars on two drives share one map."""

    cameras: Annotated[tuple[Camera, ...], NotEmpty()] = FOUR_CAMERAS
    """The streams of every car. By default KITTI's two colour and two grey cameras, 25 ms apart;
    the two recorded ones stand for all four."""

    start_jitter_ns: int = 100 * units.NS_PER_MS
    """Every car starts up to this much later, drawn uniformly. Assumed; it keeps cars from running
    in step."""

    edges: tuple[Edge, ...] = ()
    """The edge servers."""

    cars: tuple[Car, ...] = ()
    """The cars; instead of them, a `convoy` or a `fleet`."""

    fleet: Fleet | None = None
    """Cars that are alike, in a town, instead of `cars` and `edges`."""

    convoy: Convoy | None = None
    """Cars that are alike and replay one drive. A convoy takes the place of `cars` and `edges` and
    is expanded to car1, car2, ... and edge1, edge2, ..."""

    interface: InterfaceName = "auto"
    """The network interface of cars, for the energy that it takes: by default the one that fits
    their link. `none` does not count it."""

    faults: tuple[FaultEntry, ...] = ()
    """What goes wrong, and when."""

    judged: Literal["first", "all"] = "first"
    """At which frames of a car what it holds is judged, each time within the frame's field of view:
    those of its first stream, or of all, such as four cameras that look all around it."""

    record: tuple[Record, ...] = RECORDS
    """The tables written beside `frames`. Look-ups take the most space. For a fleet, only the
    resources of edges are written; `held_objects` needs `held`."""

    metrics: Annotated[tuple[Annotated[str, METRIC], ...], IfGiven()] = ()
    """Metrics of your own, beside all others: classes, each `package.module:Class`."""

    read_from: Origin = field(
        default=Origin(), compare=False, repr=False, metadata={"setting": False}
    )
    profiles: Mapping[str, DeviceProfile] = field(
        default_factory=dict, compare=False, repr=False, metadata={"setting": False}
    )  # of each device that is named here, as it was read when the scenario was checked
    sequence: str | None = field(
        default=None, compare=False, repr=False, metadata={"setting": False}
    )  # that the recordings of all cars are of, on one clock, as they said it then

    @classmethod
    def expand(cls, value: object) -> object:
        """Turns a convoy into the cars and edges that it stands for."""
        if not isinstance(value, Mapping):
            return value
        if "axes" in value:
            raise SettingError("axes", "belongs to a sweep, which 'genie-sim sweep' runs")
        if value.get("convoy") is not None:
            for key in ("cars", "edges", "fleet"):
                if value.get(key):
                    text = "a convoy brings its own cars and edges; leave them out, or 'convoy'"
                    raise SettingError(key, text)
            try:
                convoy = from_plain(Convoy, value["convoy"])
            except SettingError as error:
                raise error.below("convoy") from error
            value = {**value, "convoy": None, **convoy.expanded()}
        if value.get("fleet") is None and "cars" not in value:
            raise SettingError("cars", "missing")
        return value

    @property
    def source(self) -> Any:
        """The frame source, ``None`` for one of the user's own, whose code is not run to check a
        scenario.
        """
        if plugins.is_custom(self.perception.name):
            return None
        return FRAME_SOURCE.make(self.perception)

    def under(self, entry: MethodEntry) -> MethodSettings:
        """The settings of one method: the scenario's with those that the entry has otherwise.
        Raises ``SettingError``.
        """
        settings = self.asked(entry)
        looks = settings.genie.looks
        if looks is None or looks.told != "auto":
            return settings
        told = ToldRules() if self.is_one_world and looks.edge == "beside" else None
        genie = replace(settings.genie, looks=replace(looks, told=told))
        return replace(settings, genie=genie)

    def asked(self, entry: MethodEntry) -> MethodSettings:
        """The settings of one method as they are written: what is ``auto`` stays so. Raises
        ``SettingError``.
        """
        usual = MethodSettings(**{name: getattr(self, name) for name in names_of(MethodSettings)})
        return merged(usual, entry.settings) if entry.settings else usual

    @property
    def is_one_world(self) -> bool:
        """Whether all cars are in one world at one time, and do not replay one recording at
        different times.
        """
        return self.sequence is not None or bool(getattr(self.source, "is_one_world", False))

    def cameras_of(self, car: Car) -> Sequence[Camera]:
        """A car's own cameras, or the scenario's."""
        return car.streams(self.cameras)

    def start_ns(self, car: Car) -> int:
        """When a car starts: at its route's start, and up to ``start_jitter`` later, drawn for
        every car.
        """
        jitter_ns = self.start_jitter_ns
        late_ns = int(stream(self.seed, car.name, "start").integers(jitter_ns)) if jitter_ns else 0
        return car.route.start_ns + late_ns

    def check_time(self, where: str, route: Route, recorded_ns: int) -> None:
        """Raises ``UserError`` if a car on this route through a drive so long would take frames for
        too long.
        """
        begin_ns, end_ns = route.window_ns or (0, recorded_ns)
        cameras = [camera for car in self.cars for camera in self.cameras_of(car)] or self.cameras
        late_ns = route.start_ns + self.start_jitter_ns + max(camera.phase_ns for camera in cameras)
        total_ns = late_ns + route.laps * (end_ns - begin_ns) + (route.laps - 1) * route.pause_ns
        if total_ns > MAX_DAYS * DAY_NS:
            days = total_ns / DAY_NS
            raise UserError(
                f"{where}: ends after {days:,.1f} days; at most {MAX_DAYS} are simulated"
            )

    def to_yaml(self) -> str:
        """Every setting written out; reads back to an equal scenario."""
        written = plain_data(self)
        first = {key: written[key] for key in ("name", "description", "seed", "methods")}
        return dump(first | written)


def load_scenario(
    path_or_name: str | Path, overrides: Sequence[str] = (), seed: int | None = None
) -> Scenario:
    """A scenario file, by path or by name, with ``path=value`` overrides. Raises ``UserError``."""
    path = files.find(files.SCENARIO, path_or_name)
    data = read_mapping(path)
    data.setdefault("name", path.stem)
    return read_scenario(data, overrides, seed, where=str(path))


def with_methods(scenario: Scenario, names: Sequence[str], where: str = "methods") -> Scenario:
    """The scenario with these methods: its own entries by name, else ones by themselves. Raises
    ``UserError``.
    """
    entries: dict[str, MethodEntry] = {entry.name: entry for entry in scenario.methods}
    for name in names:
        try:
            plugins.checked_name("method", name, {**METHODS, **entries})
        except ValueError as error:
            raise UserError(f"{where}: {error}") from error
        if name not in entries:
            entries[name] = from_plain(MethodEntry, name)
    try:
        return checked(replace(scenario, methods=tuple(entries[name] for name in names)))
    except SettingError as error:
        raise UserError(f"{where}: {error.field}: {error.message}") from error


def read_scenario(
    data: Mapping[str, Any],
    overrides: Sequence[str] = (),
    seed: int | None = None,
    where: str = "scenario",
) -> Scenario:
    """The scenario in ``data``.

    Parameters
    ----------
    data : mapping
        Plain data as in YAML.
    overrides : sequence of str
        Settings to change, as ``path=value``.
    seed : int, optional
        A seed in place of the one in ``data``.
    where : str
        The file, to begin errors with.

    Raises
    ------
    UserError
        In one line, for the first mistake.
    """
    settings = copy.deepcopy(dict(data))
    origin = Origin(where, tuple(apply_overrides(settings, overrides)))
    if seed is not None:
        settings["seed"] = seed
    try:
        scenario = checked(replace(from_plain(Scenario, settings), read_from=origin))
    except SettingError as error:
        message = error.message
        if message.startswith("unknown field"):
            message = setting_paths.hint(Scenario, error.field, message)
        parts = (origin.of(error.field), error.field, message)
        raise UserError(": ".join(part for part in parts if part)) from error
    return scenario


def checked(scenario: Scenario) -> Scenario:
    """The scenario with the profiles of its devices. Raises ``SettingError`` unless the settings
    fit together, and to the files that they name.
    """
    check_unique("methods", [entry.name for entry in scenario.methods], ".name")
    check_unique("record", scenario.record)
    check_unique("metrics", scenario.metrics)
    if "held_objects" in scenario.record and "held" not in scenario.record:
        raise SettingError("record", "'held_objects' needs 'held' too")
    scenario = replace(scenario, sequence=_sequence(scenario))
    check_unique("cameras", [camera.name for camera in scenario.cameras], ".name")
    check_unique("edges", [edge.name for edge in scenario.edges], ".name")
    _check_cars_or_fleet(scenario)
    _check_cars(scenario)
    _check_neighbours(scenario.edges)
    _check_links(scenario)
    if scenario.fleet is None:
        edge_of = {car.name: car.edge for car in scenario.cars}
        edges = [edge.name for edge in scenario.edges]
        for path, text in check_faults(scenario.faults, edge_of, edges):
            raise SettingError(path, text)
    _check_origin(scenario)
    for index, entry in enumerate(scenario.methods):
        _check_looks(scenario, index, entry)
        _check_serving(scenario, index, entry)
    _check_traces(scenario)
    profiles = {}
    for device, path in _devices(scenario).items():
        with _wrong(path):
            profiles[device] = load_profile(device)
        for index, entry in enumerate(scenario.methods):
            _check_model(scenario, index, entry, profiles[device])
    return replace(scenario, profiles=profiles)


def _check_cars_or_fleet(scenario: Scenario) -> None:
    """Somebody drives: cars of their own, or a fleet in a town."""
    source = scenario.source
    own = plugins.is_custom(scenario.perception.name)  # looked at when it is open
    is_map = bool(getattr(source, "is_map", False))
    if scenario.fleet is None and not scenario.cars:
        raise SettingError("cars", "must not be empty")
    if scenario.fleet is not None:
        for key in ("cars", "edges"):
            if getattr(scenario, key):
                raise SettingError(key, "a fleet brings its own; leave them out, or 'fleet'")
        if not (is_map or own):
            text = "needs a town to drive in: 'perception: {source: town}'"
            raise SettingError("fleet", text)
        if scenario.fleet.cars is None and not (own or getattr(source, "has_cars", False)):
            raise SettingError("fleet.cars", "missing")
        if hasattr(source, "cells") and source.cells(scenario.fleet.cell_m) > MAX_EDGES:
            raise SettingError("fleet.cell", f"makes more than {MAX_EDGES:,} edges of this town")
    if is_map:
        _check_on_map(scenario)


def _check_on_map(scenario: Scenario) -> None:
    """Cars in a town, or on any other map, have no recording to replay."""
    if scenario.origin is not None:
        raise SettingError("origin", "a town is where it is; leave it out")
    for index, car in enumerate(scenario.cars):
        path, route = f"cars[{index}]", car.route
        if route.trace is not None:
            text = "cars in a town make their own way; leave it out"
            raise SettingError(f"{path}.route.trace", text)
        for key, given in (("window", route.window_ns is not None), ("laps", route.laps > 1)):
            if given:
                text = "a town's clock never goes back; use 'perception.duration'"
                raise SettingError(f"{path}.route.{key}", text)
        if not car.cameras:
            text = "without cameras, cars drive recorded streets only"
            raise SettingError(f"{path}.cameras", text)


def _check_cars(scenario: Scenario) -> None:
    """Names are free, edges exist, and a car without cameras has an edge of its own."""
    edges = {edge.name for edge in scenario.edges}
    check_unique("cars", [car.name for car in scenario.cars], ".name", also=edges)
    for index, car in enumerate(scenario.cars):
        if car.name == EDGES:
            text = f"{EDGES!r} is what the network between the edges is called"
            raise SettingError(f"cars[{index}].name", text)
        if car.edge is not None and car.edge not in edges:
            raise SettingError(f"cars[{index}].edge", _unknown_edge(car.edge, edges))
        if not car.cameras:
            _check_without_cameras(scenario, index, car)


def _check_without_cameras(scenario: Scenario, index: int, car: Car) -> None:
    """A car without cameras has an edge without detector, and asks by position."""
    for place, fault in enumerate(scenario.faults):
        if fault.target == car.name and "edge" in fault.fault.parameters:
            text = "a car without cameras stays with the edge that serves it"
            raise SettingError(f"faults[{place}].target", text)
    for other in scenario.cars:
        edges = [other.edge]
        edges += [
            fault.fault.parameters.get("edge")
            for fault in scenario.faults
            if fault.target == other.name
        ]
        if other.cameras and car.edge in edges:
            text = f"serves {other.name}'s cameras; a car without needs one of its own"
            raise SettingError(f"cars[{index}].edge", text)
    for place, entry in enumerate(scenario.methods):
        if _under(scenario, place, entry).genie.similarity.name != "pose_grid":
            text = "a car without cameras has only its position: similarity 'pose_grid'"
            raise SettingError(f"cars[{index}].cameras", text)


def _check_looks(scenario: Scenario, index: int, entry: MethodEntry) -> None:
    """Edges tell cars of one another only where what one car sees is there for the others, and
    every setting that is given has an effect.
    """
    genie = _under(scenario, index, entry).genie
    looks = genie.looks
    if looks is None:
        return
    where = f"methods[{index}]." if "genie" in entry.settings else ""
    if all(car.cameras for car in scenario.cars):  # else they decide about those without
        written: Any = GenieRules.expand(entry.settings["genie"]) if where else None
        try:
            check_effect(genie, written)
        except SettingError as error:
            raise SettingError(f"{where}genie.{error.field}", error.text) from error
    if looks.told is not None and scenario.source is not None and not scenario.is_one_world:
        text = "cars replay recordings at different times, so what one sees is not there for others"
        hint = "leave it out, or use a town or recordings of one sequence"
        raise SettingError(f"{where}genie.looks.told", f"{text}; {hint}")
    for place, car in enumerate(scenario.cars):
        if not car.cameras and looks.told is None:
            text = "a car without cameras lives on what edges tell: it needs 'genie.looks.told'"
            raise SettingError(f"cars[{place}].cameras", text)


def _check_serving(scenario: Scenario, index: int, entry: MethodEntry) -> None:
    """As many pictures as a batch takes can wait."""
    settings = _under(scenario, index, entry)
    where = f"methods[{index}]." if "serving" in entry.settings else ""
    servings = {f"{where}serving": settings.serving}
    for place, edge in enumerate(scenario.edges):
        if edge.serving is not None:
            servings[f"edges[{place}].serving"] = edge.serving
    for path, serving in servings.items():
        if serving.queue == "shared" and serving.batch > settings.queue_length:
            text = (
                f"{serving.batch} pictures never wait in one queue of {settings.queue_length}: "
                "use 'queue: per_camera', or a longer 'queue_length'"
            )
            raise SettingError(f"{path}.batch", text)


def _check_links(scenario: Scenario) -> None:
    """Edges have places where a link model needs them, and one that needs cars is not between
    edges.
    """
    for path, link in links_of(scenario):
        model = LINK.make(link)
        if hasattr(model, "check"):
            with _wrong(path):
                model.check()
        if path.endswith("edge_network"):
            if getattr(model, "needs_cars", False):
                text = f"link model {link.name!r} needs cars, and there are none between edges"
                raise SettingError(path, text)
        elif getattr(model, "needs_sites", False):
            for place, edge in enumerate(scenario.edges):
                if edge.at_m is None:
                    text = f"missing; link model {link.name!r} needs it"
                    raise SettingError(f"edges[{place}].at", text)


def links_of(scenario: Scenario) -> Iterator[tuple[str, Choice]]:
    """The path and the choice of each link that a scenario names, those of the user's own left
    out: their code runs only where a scenario does.
    """
    named = [(f"cars[{index}].link", car.link) for index, car in enumerate(scenario.cars)]
    if scenario.fleet is not None:
        named.append(("fleet.link", scenario.fleet.link))
    for index, entry in enumerate(scenario.methods):
        where = f"methods[{index}]." if "edge_network" in entry.settings else ""
        named.append((f"{where}edge_network", _under(scenario, index, entry).edge_network))
    seen = set()
    for path, link in named:
        key = repr(link), path.endswith("edge_network")
        if link is not None and key not in seen and not plugins.is_custom(link.name):
            seen.add(key)
            yield path, link


def _check_neighbours(edges: Sequence[Edge]) -> None:
    """Neighbours exist and agree: what one edge asks another, that one must be able to answer."""
    neighbours = {edge.name: edge.neighbours for edge in edges}
    for index, edge in enumerate(edges):
        for place, other in enumerate(edge.neighbours or ()):
            path = f"edges[{index}].neighbours[{place}]"
            if other not in neighbours:
                raise SettingError(path, _unknown_edge(other, neighbours))
            if other == edge.name:
                raise SettingError(path, f"{other} is no neighbour of itself")
            others = neighbours[other]
            if others is not None and edge.name not in others:
                text = f"{other} does not have {edge.name} among its own neighbours"
                raise SettingError(path, text)
        check_unique(f"edges[{index}].neighbours", edge.neighbours or ())


def _check_origin(scenario: Scenario) -> None:
    if scenario.origin is None:
        return
    latitude_deg, longitude_deg, _ = scenario.origin
    if abs(latitude_deg) > 90 or abs(longitude_deg) > 180:
        text = "must be [latitude, longitude, altitude] in degrees, degrees and metres"
        raise SettingError("origin", text)


def _sequence(scenario: Scenario) -> str | None:
    """The sequence whose recordings the cars replay, each its own; ``None`` where they are of none.

    Raises ``SettingError`` where the recordings would lose their common clock.
    """
    if scenario.perception.name != USUAL_TRACE.name:
        return None
    main = scenario.perception.parameters.get("trace", USUAL_TRACE.parameters["trace"])
    traces = [car.route.trace or main for car in scenario.cars]
    if len(set(traces)) < 2:
        return None
    from genie_sim.data.trace import sequence_of

    sequences = {}
    for trace in dict.fromkeys(traces):
        with suppress(UserError):  # told below with its setting, or when it is read
            sequences[trace] = sequence_of(files.find(files.TRACE, trace))
    named = [sequence for sequence in sequences.values() if sequence is not None]
    if len(named) == len(set(named)):
        return None
    for index, (car, trace) in enumerate(zip(scenario.cars, traces, strict=True)):
        place = f"cars[{index}].route"
        if sequences.get(trace) != named[0] or trace in traces[:index]:
            text = f"the cars drive together in {named[0]}: each needs a recording of it, its own"
            raise SettingError(f"{place}.trace", text)
        if replace(car.route, trace=None) != replace(scenario.cars[0].route, trace=None):
            text = f"the recordings of {named[0]} are on one clock: all routes must be alike"
            raise SettingError(place, f"{text} but for 'trace'")
    if scenario.start_jitter_ns:
        text = f"the recordings of {named[0]} are on one clock: must be 0 s"
        raise SettingError("start_jitter", text)
    return named[0]


def _check_traces(scenario: Scenario) -> None:
    """The traces that are named exist. What a source of the user's own calls a trace is its own
    business.
    """
    if plugins.is_custom(scenario.perception.name):
        return
    traces = {
        f"cars[{index}].route.trace": car.route.trace
        for index, car in enumerate(scenario.cars)
        if car.route.trace
    }
    if "trace" in scenario.perception.parameters:
        traces["perception.trace"] = scenario.perception.parameters["trace"]
    for path, trace in traces.items():
        with _wrong(path):
            files.find(files.TRACE, trace)


def _check_model(
    scenario: Scenario, index: int, entry: MethodEntry, profile: DeviceProfile
) -> None:
    """The device runs the method's model, and answers before a request expires."""
    settings = _under(scenario, index, entry)
    where = f"methods[{index}]." if entry.settings.keys() & {"model", "genie"} else ""
    with _wrong(f"{where}model"):
        median_ns = profile.median_ns(settings.model)
    expiry_ns = settings.genie.request_expiry_ns
    if expiry_ns is None or expiry_ns > median_ns:
        return
    if plugins.is_custom(entry.method.name) or not method_class(entry).baseline:
        takes, expiry = units.duration_text(median_ns), units.duration_text(expiry_ns)
        text = (
            f"{expiry} is over before {settings.model} answers on {profile.name} ({takes}): "
            "lengthen it, or null"
        )
        raise SettingError(f"{where}genie.request_expiry", text)


def _under(scenario: Scenario, index: int, entry: MethodEntry) -> MethodSettings:
    """The settings of the method at this index; errors have its path."""
    try:
        return scenario.under(entry)
    except SettingError as error:
        raise error.below(index).below("methods") from error


def _devices(scenario: Scenario) -> dict[str, str]:
    """Every device, and the path where it is named first."""
    named = [(car.device, f"cars[{index}].device") for index, car in enumerate(scenario.cars)]
    named += [(edge.device, f"edges[{index}].device") for index, edge in enumerate(scenario.edges)]
    if scenario.fleet is not None:
        named += [(device, "fleet.devices") for device in scenario.fleet.devices]
        named.append((scenario.fleet.edge_device, "fleet.edge_device"))
    first = dict(reversed(named))
    return {device: first[device] for device, _ in named}


@contextmanager
def _wrong(path: str) -> Iterator[None]:
    """What is raised within is wrong with the setting at ``path``."""
    try:
        yield
    except UserError as error:
        raise SettingError(path, str(error)) from error


def _unknown_edge(name: str, edges: Collection[str]) -> str:
    return unknown("edge", name, edges) if edges else f"unknown edge {name!r}; there are no edges"
