"""What must hold in a scenario beyond each setting by itself.

``check`` tells everything that can be known from the settings and the files that they name. The
rest is told when a run is prepared: ``check_own_plugins`` once the user's code may run,
``check_driven`` once each car has its drive.
"""

import logging
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise

from genie_sim.base import files, plugins
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.features import feature_of
from genie_sim.base.setting_errors import SettingError, check_unique, join
from genie_sim.base.settings import own_arguments
from genie_sim.base.units import NS_PER_S, duration_text, frame_rate_text
from genie_sim.data.frame_source import Drive
from genie_sim.scenario.faults import check_faults
from genie_sim.scenario.methods import METHOD, MethodEntry
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.frame_rate import recorded_rate
from genie_sim.sim.link_model import LINK
from genie_sim.sim.settings import EDGES, Car, MethodSettings, Route

log = logging.getLogger(__name__)

# The longest time that a scenario may simulate. The frames of one car over that time fill a
# computer's memory; more is almost certainly a unit error and would be noticed only after hours.
MAX_DAYS = 30
DAY_NS = 24 * 3600 * NS_PER_S
SAME_RATE = 1e-6  # times as many pictures as were recorded are as many


def check(scenario: Scenario) -> None:
    """Raises ``SettingError`` unless the settings fit together, and to the files that they name."""
    check_unique("methods", [entry.name for entry in scenario.methods], ".name")
    check_unique("record", scenario.record)
    check_unique("metrics", scenario.metrics)
    if "held_objects" in scenario.record and "held" not in scenario.record:
        raise SettingError("record", "'held_objects' needs 'held' too")
    check_unique("cameras", [camera.name for camera in scenario.cameras], ".name")
    check_unique("edges", [edge.name for edge in scenario.edges], ".name")
    _check_cars_or_fleet(scenario)
    _check_cars(scenario)
    _check_neighbours(scenario)
    _check_links(scenario)
    if scenario.fleet is None:
        for path, text in _faults(scenario):
            raise SettingError(path, text)
    if scenario.origin is not None:
        latitude_deg, longitude_deg, _ = scenario.origin
        if abs(latitude_deg) > 90 or abs(longitude_deg) > 180:
            text = "must be [latitude, longitude, altitude] in degrees, degrees and metres"
            raise SettingError("origin", text)
    for index, entry in enumerate(scenario.methods):
        _check_serving(scenario, index, entry)
    _check_traces(scenario)
    for profile in scenario.profiles.values():
        for index, entry in enumerate(scenario.methods):
            _check_model(scenario, index, entry, profile)


def _faults(scenario: Scenario, own: bool = False) -> Iterator[tuple[str, str]]:
    """What is wrong with the faults: (path, text)."""
    edge_of = {car.name: car.edge for car in scenario.cars}
    edges = [edge.name for edge in scenario.edges]
    return check_faults(scenario.faults, edge_of, edges, own=own)


def _check_cars_or_fleet(scenario: Scenario) -> None:
    """Somebody drives: cars of their own, or a fleet; whether its town fits is told once that is
    open.
    """
    source = scenario.source
    if scenario.fleet is None and not scenario.cars:
        raise SettingError("cars", "must not be empty")
    if scenario.fleet is not None:
        for key in ("cars", "edges"):
            if getattr(scenario, key):
                raise SettingError(key, "a fleet brings its own; leave them out, or 'fleet'")
    if source is not None and source.is_map:
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
    for settings in scenario.method_settings.values():
        if settings.genie.similarity.name != "pose_grid":
            text = "a car without cameras has only its position: similarity 'pose_grid'"
            raise SettingError(f"cars[{index}].cameras", text)


def _check_neighbours(scenario: Scenario) -> None:
    """Neighbours exist and agree: what one edge asks another, that one must be able to answer."""
    neighbours = {edge.name: edge.neighbours for edge in scenario.edges}
    for index, edge in enumerate(scenario.edges):
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


def _check_links(scenario: Scenario, own: bool = False) -> None:
    """Edges have places where a link model needs them, and one that needs cars is not between
    edges. ``own``: those of the user's own, whose code runs only where a scenario does.
    """
    for link in scenario.links():
        if plugins.is_own(link.choice.name) != own:
            continue
        model, name = LINK.make(link.choice), link.choice.name
        if hasattr(model, "check"):
            with blamed_on(link.path):
                model.check()
        if link.between_edges:
            if getattr(model, "needs_cars", False):
                text = f"link model {name!r} needs cars, and there are none between edges"
                raise SettingError(link.path, text)
        elif getattr(model, "needs_sites", False):
            for place, edge in enumerate(scenario.edges):
                if edge.at_m is None:
                    text = f"missing; link model {name!r} needs it"
                    raise SettingError(f"edges[{place}].at", text)


def _check_serving(scenario: Scenario, index: int, entry: MethodEntry) -> None:
    """As many pictures as a batch takes can wait."""
    settings = scenario.method_settings[entry.name]
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


def _check_traces(scenario: Scenario) -> None:
    """The traces that are named exist. What a source of the user's own calls a trace is its own
    business.
    """
    if plugins.is_own(scenario.perception.name):
        return
    traces = {
        f"cars[{index}].route.trace": car.route.trace
        for index, car in enumerate(scenario.cars)
        if car.route.trace
    }
    if "trace" in scenario.perception.parameters:
        traces["perception.trace"] = scenario.perception.parameters["trace"]
    for path, trace in traces.items():
        with blamed_on(path):
            files.find(files.TRACE, trace)


def _check_model(
    scenario: Scenario, index: int, entry: MethodEntry, profile: DeviceProfile
) -> None:
    """The device runs the method's model, and answers before a request expires."""
    settings = scenario.method_settings[entry.name]
    where = f"methods[{index}]." if entry.settings.keys() & {"model", "genie"} else ""
    with blamed_on(f"{where}model"):
        try:
            median_ns = profile.median_ns(settings.model)
        except UserError as error:
            if settings.model != MethodSettings.model:
                raise
            raise UserError(f"by default {settings.model!r}: {error}") from error
    expiry_ns = settings.genie.request_expiry_ns
    if expiry_ns is None or expiry_ns > median_ns:
        return
    if plugins.is_own(entry.method.name) or not METHOD.resolve(entry.method.name).baseline:
        takes, expiry = duration_text(median_ns), duration_text(expiry_ns)
        text = (
            f"{expiry} is over before {settings.model} answers on {profile.name} ({takes}): "
            "lengthen it, or null"
        )
        raise SettingError(f"{where}genie.request_expiry", text)


@contextmanager
def blamed_on(path: str) -> Iterator[None]:
    """What is raised within is wrong with the setting at ``path``."""
    try:
        yield
    except UserError as error:
        raise SettingError(path, str(error)) from error


def _unknown_edge(name: str, edges: Collection[str]) -> str:
    return unknown("edge", name, edges) if edges else f"unknown edge {name!r}; there are no edges"


def check_own_plugins(scenario: Scenario) -> None:
    """Raises ``UserError`` where a class of the user's own does not take the settings that the
    scenario gives it, or a link model does not fit. Imports the classes.
    """
    for path, mark, choice, name_alone in scenario.own_plugins():
        if name_alone:
            continue
        cls = mark.resolve(choice.name)
        try:
            own_arguments(cls, choice)
        except SettingError as error:
            field = join(path, error.field)
            raise scenario.error_at(field, error.message) from error
    try:
        _check_links(scenario, own=True)
    except SettingError as error:
        raise scenario.error_at(error.field, error.message) from error


def check_time_on_map(scenario: Scenario, duration_ns: int) -> None:
    """Raises ``UserError`` if a car would drive for too long on a map that knows where all are for
    so long.
    """
    routes = {f"cars[{index}].route": car.route for index, car in enumerate(scenario.cars)}
    for path, route in (routes or {"perception.duration": Route()}).items():
        check_time(scenario, path, route, duration_ns)


def check_time(scenario: Scenario, path: str, route: Route, recorded_ns: int) -> None:
    """Raises ``UserError`` if a car on this route, at ``path``, through a drive so long would take
    frames for too long.
    """
    begin_ns, end_ns = route.window_ns or (0, recorded_ns)
    cameras = [camera for car in scenario.cars for camera in scenario.cameras_of(car)]
    phase_ns = max(camera.phase_ns for camera in cameras or scenario.cameras)
    late_ns = route.start_ns + scenario.start_jitter_ns + phase_ns
    total_ns = late_ns + route.laps * (end_ns - begin_ns) + (route.laps - 1) * route.pause_ns
    if total_ns > MAX_DAYS * DAY_NS:
        text = f"ends after {total_ns / DAY_NS:,.1f} days; at most {MAX_DAYS} are simulated"
        raise scenario.error_at(path, text)


def check_driven(
    scenario: Scenario, drives: Mapping[str, Drive], features: Mapping[str, str | None]
) -> None:
    """Checks a scenario with every car and edge of its fleet.

    Parameters
    ----------
    scenario : Scenario
        The scenario.
    drives : mapping
        Each car's drive, by the name of the car.
    features : mapping
        What each method compares frames by, if it does, by the name of its entry.

    Raises
    ------
    UserError
        Where cameras take nothing, a fault has no target, or frames lack a method's feature.
    """
    # All cars of a fleet have the same cameras and the same map.
    for index, car in enumerate(scenario.cars[:1] if scenario.fleet else scenario.cars):
        _check_route(scenario, index, car, drives[car.name])
    for path, text in _faults(scenario, own=True):
        raise scenario.error_at(path, text)
    for index, entry in enumerate(scenario.methods):
        name = features[entry.name]
        if name is None:
            continue
        for car in scenario.cars:
            drive = drives[car.name]
            frame = drive.frames[scenario.cameras_of(car)[0].recording][0]
            if feature_of(frame, name) is None:
                known = ", ".join(getattr(frame, "features", {})) or "none"
                text = (
                    f"the frames of {drive.name} have no feature {name!r}, but {known}: "
                    f"{entry.name} cannot run on them; 'genie-sim perceive' makes features"
                )
                raise scenario.error_at(f"methods[{index}].feature", text)


def _check_route(scenario: Scenario, index: int, car: Car, drive: Drive) -> None:
    """The car's cameras are recorded on its drive, and its window is a part of it."""
    route, cameras = car.route, scenario.cameras_of(car)
    own = f"cars[{index}]." if isinstance(car.cameras, tuple) else ""
    for number, camera in enumerate(cameras):
        path = f"{own}cameras[{number}]"
        if camera.recording not in drive.frames:
            text = unknown("recording", camera.recording, drive.frames)
            text = f"{text} ({car.name} drives {drive.name})"
            raise scenario.error_at(f"{path}.recording", text)
        recorded = recorded_rate(drive.frames[camera.recording])
        if camera.rate is not None and camera.rate > recorded * (1 + SAME_RATE):
            text = (
                f"{frame_rate_text(camera.rate)} is more than was recorded: {recorded:.4g} Hz on "
                f"{drive.name}"
            )
            raise scenario.error_at(f"{path}.rate", text)
    recordings = [drive.frames[camera.recording] for camera in cameras]
    recorded_ns = max(frames[-1].stamp_ns - frames[0].stamp_ns for frames in recordings)
    check_time(scenario, f"cars[{index}].route", route, recorded_ns)
    if route.window_ns is None:
        return
    begin_ns, end_ns = route.window_ns
    path = f"cars[{index}].route.window"
    stamps_ns = [frame.stamp_ns for frames in recordings for frame in frames]
    if not any(begin_ns <= stamp_ns < end_ns for stamp_ns in stamps_ns):
        first_s, last_s = min(stamps_ns) / NS_PER_S, max(stamps_ns) / NS_PER_S
        text = (
            f"no camera takes a frame in it; {drive.name} has frames from {first_s:g} s to "
            f"{last_s:g} s"
        )
        raise scenario.error_at(path, text)
    period_ns = max(
        (
            later.stamp_ns - frame.stamp_ns
            for frames in recordings
            for frame, later in pairwise(frames)
        ),
        default=0,
    )
    if end_ns > max(stamps_ns) + max(period_ns, 1) and scenario.sequence is None:
        end_s, last_s = end_ns / NS_PER_S, max(stamps_ns) / NS_PER_S
        text = f"ends at {end_s:g} s, after the last frame of {drive.name} at {last_s:g} s"
        raise scenario.error_at(path, text)
