"""Prepares a run: opens what the scenario names, and gives every car its drive."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from genie_sim.base import plugins
from genie_sim.base.errors import UserError
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.data import detector_laws
from genie_sim.data.source import Drive, Frames, FrameSource
from genie_sim.record import provenance
from genie_sim.runs import build, own_classes
from genie_sim.runs.build import Prepared
from genie_sim.runs.fleet import expanded
from genie_sim.scenario import checks
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario
from genie_sim.version import VERSION


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
        from genie_sim.analysis.registry import custom_metrics

        custom_metrics(scenario.metrics)
    source: FrameSource = FRAME_SOURCE.make(scenario.perception)
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        own_classes.check_base(source, owner, FrameSource)
    if source.is_map:
        checks.check_time_on_map(scenario, source.duration_ns)
    frames = source.open(scenario.seed, scenario.origin, progress)
    if owner is not None:
        frames = own_classes.checked_frames(frames, owner)
    return prepare_with_frames(scenario, frames, devices)


def prepare_with_frames(
    scenario: Scenario, frames: Frames, devices: Mapping[str, DeviceProfile] | None = None
) -> Prepared:
    """``prepare`` with a frame source that is open. Raises ``UserError``."""
    full = scenario
    if scenario.fleet is not None:
        full, drives = expanded(scenario, scenario.fleet, frames)
    else:
        drives = {
            car.name: frames.drive(car.name, car.route.trace, scenario.start_ns(car))
            for car in scenario.cars
        }
    if scenario.sequence is not None:
        full = _on_one_clock(full, drives)
    owner = plugins.own_label("frame source", scenario.perception.name)
    if owner is not None:
        for drive in drives.values():
            own_classes.check_drive(drive, owner)
        frames.provenance()  # checked now, not after the simulation
    features = {
        entry.name: getattr(build.method(entry), "feature", None) for entry in scenario.methods
    }
    checks.check_driven(full, drives, features)
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
        facts=facts(scenario, used, frames, encoded),
        laws=detector_laws.detector_laws(*build.looked_at(frames)),
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
        for car in scenario.cars:
            if encoding != "raw" and car.edge is not None:
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
            **build.link_digests(scenario),
            **{f"{encoding} of {car}": drive.digest for (encoding, car), drive in encoded.items()},
        },
        "plugins": build.plugin_digests(scenario),
        "methods": build.method_facts(scenario),
    }
    if any(getattr(build.method(entry), "feature", None) for entry in scenario.methods):
        known = frames.provenance()
        features = {
            name: dict(about["features"]) for name, about in known.items() if "features" in about
        }
        if features:
            found["features"] = features
    laws = detector_laws.facts(*build.looked_at(frames))
    if laws is not None:
        found["laws"] = laws
    if scenario.fleet is not None:
        from genie_sim.worlds.town.source import TownDrives

        if not isinstance(frames, TownDrives):  # the borders of a town follow from its settings
            extent_m = [float(border_m) for border_m in frames.extent_m or ()]
            found["map"] = {"extent_m": extent_m}
    return found
