"""Prepares a run: opens what the scenario names, and gives every car its drive."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from genie_sim.base import plugins
from genie_sim.base.contracts import BOOLEAN, TEXT, require
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.data import detector_laws
from genie_sim.data.source import Drive, Frames, FrameSource
from genie_sim.record import provenance
from genie_sim.runs import own_classes
from genie_sim.runs.fleet import expanded
from genie_sim.scenario import checks
from genie_sim.scenario.methods import METHOD, MethodEntry
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario
from genie_sim.sim.link_model import LINK
from genie_sim.sim.method import Method
from genie_sim.sim.topology import ALL_SHARE, NEAREST
from genie_sim.tracks.laws import DetectorLaws
from genie_sim.version import VERSION


@dataclass(frozen=True)
class Prepared:
    """A scenario with everything it names.

    Parameters
    ----------
    scenario : Scenario
        With every car and edge of its fleet.
    devices : mapping
        The profiles of the devices in use, by name.
    frames : Frames
        The frame source, open.
    drives : mapping
        Each car's drive, by the car's name.
    encoded : mapping
        What the drives are after their pictures were sent, by encoding and car.
    facts : mapping
        Everything that decides the outcome of a run, as plain data, with the scenario as it is
        written.
    laws : DetectorLaws
        Of the detector that looked at the drives, measured on other drives, or the assumed ones.
    """

    scenario: Scenario
    devices: Mapping[str, DeviceProfile]
    frames: Frames
    drives: Mapping[str, Drive]
    encoded: Mapping[tuple[str, str], Any]
    facts: Mapping[str, Any]
    laws: DetectorLaws


def prepare(
    scenario: Scenario,
    progress: Progress | None = None,
    devices: Mapping[str, DeviceProfile] | None = None,
) -> Prepared:
    """Opens the frame source and gives every car its drive, all in one world. ``devices`` replace
    the profiles that the scenario read. Raises ``UserError``.
    """
    checks.check_own_plugins(scenario)
    if scenario.metrics:
        from genie_sim.analysis.registry import own_metrics

        own_metrics(scenario.metrics)
    source: FrameSource = FRAME_SOURCE.make(scenario.perception)
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        own_classes.check_base(source, owner, FrameSource)
    if source.is_map:
        checks.check_time_on_map(scenario, source.duration_ns)
    frames = source.open(scenario.seed, scenario.origin, progress)
    return prepare_with_frames(scenario, frames, devices)


def prepare_with_frames(
    scenario: Scenario, frames: Frames, devices: Mapping[str, DeviceProfile] | None = None
) -> Prepared:
    """``prepare`` with a frame source that is open. Raises ``UserError``."""
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        own_classes.check_frames(frames, owner)
    full = scenario  # with every car and edge, each with the part of its drive that it replays
    if scenario.fleet is not None:
        full, drives = expanded(scenario, scenario.fleet, frames)
    else:
        drives = {
            car.name: frames.drive(car.name, car.route.trace, scenario.start_ns(car))
            for car in scenario.cars
        }
    if owner is not None:
        for drive in drives.values():
            own_classes.check_drive(drive, owner)
    if scenario.sequence is not None:
        full = _on_one_clock(full, drives)
    methods = new_methods(scenario)
    checks.check_driven(full, drives, features_of(methods))
    encoded = _encoded_drives(full, frames)
    profiles = scenario.profiles if devices is None else devices
    names = [car.device for car in full.cars] + [edge.device for edge in full.edges]
    used = {name: profiles[name] for name in dict.fromkeys(names)}
    return Prepared(
        scenario=full,
        devices=used,
        frames=frames,
        drives=drives,
        encoded=encoded,
        facts=facts(scenario, methods, devices=used, frames=frames, encoded=encoded),
        laws=detector_laws.detector_laws(*looked_at(frames)),
    )


def _on_one_clock(scenario: Scenario, drives: Mapping[str, Drive]) -> Scenario:
    """Every car replays its recording from the beginning of the sequence to the end, so that what
    was recorded at one time is replayed at one time.
    """
    last_ns = max(
        frames[-1].stamp_ns for drive in drives.values() for frames in drive.frames.values()
    )
    cars = tuple(
        car
        if car.route.window_ns is not None
        else replace(car, route=replace(car.route, window_ns=(0, last_ns + 1)))
        for car in scenario.cars
    )
    return replace(scenario, cars=cars)


def _encoded_drives(scenario: Scenario, frames: Frames) -> dict[tuple[str, str], Any]:
    """What the drives of cars with an edge are after their pictures were sent, by encoding and car.
    Raises ``UserError``.
    """
    encoded: dict[tuple[str, str], Any] = {}
    encodings = [settings.image_encoding for settings in scenario.method_settings.values()]
    for encoding in dict.fromkeys(encodings):
        if encoding == "raw":
            continue
        for car in scenario.cars:
            if car.edge is not None:
                sent = frames.encoded(car.name, encoding)
                if sent is None:
                    raise UserError(
                        f"{scenario.name}: image_encoding: source {scenario.perception.name!r} has "
                        "no pictures to encode: leave it 'raw', and give 'cameras' a 'size'"
                    )
                encoded[encoding, car.name] = sent
    return encoded


def facts(
    scenario: Scenario,
    methods: Mapping[str, Method],
    *,
    devices: Mapping[str, DeviceProfile],
    frames: Frames,
    encoded: Mapping[tuple[str, str], Any],
) -> dict[str, Any]:
    """Everything that decides the outcome of a run: the scenario as it is written, and what was
    found where it says.
    """
    found = {
        "format": provenance.RESULT_FORMAT,
        "genie_sim": VERSION,
        "scenario": plain_data(scenario),
        "devices": {name: plain_data(device) for name, device in devices.items()},
        "traces": {
            **frames.digests(),
            **link_digests(scenario),
            **{f"{encoding} of {car}": drive.digest for (encoding, car), drive in encoded.items()},
        },
        "plugins": plugin_digests(scenario),
        "methods": method_facts(scenario, methods),
    }
    if any(features_of(methods).values()):
        features = {
            name: dict(about["features"])
            for name, about in frames.provenance().items()
            if "features" in about
        }
        if features:
            found["features"] = features
    laws = detector_laws.facts(*looked_at(frames))
    if laws is not None:
        found["laws"] = laws
    return found


def looked_at(frames: Frames) -> tuple[set[str], set[str]]:
    """The detectors that looked at the drives of a frame source, as far as it tells, and these
    drives.
    """
    traces = [about for about in frames.provenance().values() if "detector" in about]
    return (
        {str(about["detector"]) for about in traces},
        {str(about.get("drive")) for about in traces},
    )


def features_of(methods: Mapping[str, Method]) -> dict[str, str | None]:
    """What each method compares frames by; ``None`` for one that does not."""
    return {name: getattr(method, "feature", None) for name, method in methods.items()}


def link_digests(scenario: Scenario) -> dict[str, str]:
    """Digests of the recordings that the links of a scenario replay."""
    digests: dict[str, str] = {}
    for _, link in scenario.links():
        digests |= getattr(LINK.make(link), "digests", dict)()
    return digests


def new_method(entry: MethodEntry) -> Method:
    """The method of an entry, for one world: it may keep state. Raises ``UserError``."""
    method: Method = METHOD.make(entry.method)
    owner = plugins.own_label("method", entry.method.name)
    if owner is not None:
        require(owner, "title", method.title, TEXT)
        require(owner, "baseline", method.baseline, BOOLEAN)
    return method


def new_methods(scenario: Scenario) -> dict[str, Method]:
    """The method of each entry, by its name, to ask what it is. Raises ``UserError``."""
    methods = {}
    for index, entry in enumerate(scenario.methods):
        with as_user_error(f"{scenario.name}: methods[{index}]", UserError):
            methods[entry.name] = new_method(entry)
    return methods


def method_facts(scenario: Scenario, methods: Mapping[str, Method]) -> list[dict[str, Any]]:
    """Of each method, in order: its name, what figures call it, and whether others are compared
    with it.
    """
    found = []
    for entry in scenario.methods:
        method, title = methods[entry.name], entry.title
        if title is None:
            own_names = (entry.method.name, entry.method.name.rpartition(":")[2])
            title = method.title if entry.name in own_names else entry.name
        found.append({"name": entry.name, "title": title, "baseline": bool(method.baseline)})
    return found


def notes(scenario: Scenario) -> list[str]:
    """What a reader of a run's results should know beforehand, a sentence each."""
    silent = [
        entry.title or entry.name
        for entry in scenario.methods
        if entry.method.parameters.get("told") == "auto" and not scenario.is_one_world
    ]
    said = []
    if silent:
        why = "cars replay recordings at different times, so what one sees is not there for others"
        said.append(f"{', '.join(silent)}: edges tell cars nothing, because {why}.")
    unnamed = sum(edge.neighbours is None for edge in scenario.edges)
    if unnamed and len(scenario.edges) > ALL_SHARE and scenario.edge_neighbours is None:
        said.append(
            f"Of {len(scenario.edges)} edges each shares with the {NEAREST} nearest; "
            "edge_neighbours says with how many."
        )
    return said


def plugin_names(scenario: Scenario) -> dict[str, tuple[str, str]]:
    """The kind and the name of each class of the user's own, by both in one text."""
    return {
        f"{mark.what} {choice.name}": (mark.what, choice.name)
        for _, mark, choice, _ in scenario.own_plugins()
    }


def plugin_digests(scenario: Scenario) -> dict[str, str]:
    """sha256 of the module of each class of the user's own that the scenario names: its code
    decides the outcome.
    """
    return {
        title: plugins.code_digest(what, name)
        for title, (what, name) in plugin_names(scenario).items()
    }
