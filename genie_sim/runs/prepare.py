"""Prepares a run: opens what the scenario names, and gives every car its drive."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from genie_sim.base import plugins
from genie_sim.base.progress import Progress
from genie_sim.base.settings import plain_data
from genie_sim.data.detectors import detector_laws
from genie_sim.data.frame_source import Drive, Drives, EncodedDrive, FrameSource
from genie_sim.record import provenance
from genie_sim.runs import own_classes
from genie_sim.runs.fleet import with_fleet
from genie_sim.runs.own_classes import FramesOrigin
from genie_sim.scenario import checks
from genie_sim.scenario.methods import features_of
from genie_sim.scenario.profiles import DeviceProfile
from genie_sim.scenario.scenario import FRAME_SOURCE, Scenario
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
    frames : Drives
        The frame source, open.
    drives : mapping
        Each car's drive, by the car's name.
    encoded : mapping
        What the drives are after their pictures were sent, by encoding and car.
    origin : FramesOrigin
        Where the frames come from.
    facts : mapping
        Everything that decides the outcome of a run, as plain data, with the scenario as it is
        written.
    laws : DetectorLaws
        Of the detector that looked at the drives, measured on other drives, or the assumed ones.
    """

    scenario: Scenario
    devices: Mapping[str, DeviceProfile]
    frames: Drives
    drives: Mapping[str, Drive]
    encoded: Mapping[tuple[str, str], EncodedDrive]
    origin: FramesOrigin
    facts: Mapping[str, Any]
    laws: DetectorLaws


def prepare(
    scenario: Scenario,
    progress: Progress | None = None,
    frames: Drives | None = None,
) -> Prepared:
    """Asks the scenario, then opens its frame source and gives every car its drive, all in one
    world, and looks whether these fit to it.

    ``frames`` are those of a source that is open. Raises ``UserError``.
    """
    with own_classes.own_code_named(scenario):
        checks.check_own_plugins(scenario)
        methods = scenario.new_methods()
        features = features_of(methods)
        starts_ns = {car.name: scenario.start_ns(car) for car in scenario.cars}
        owner = plugins.own_label("frame source", scenario.perception.name)
        if scenario.metrics:
            from genie_sim.analysis.metrics import own_metrics

            own_metrics(scenario.metrics)
        source: FrameSource = FRAME_SOURCE.make(scenario.perception)
        if owner is not None:
            own_classes.check_base(source, owner, FrameSource)
        if source.is_map:
            checks.check_time_on_map(scenario, source.duration_ns)
        if frames is None:
            frames = source.open(scenario.seed, scenario.origin, progress)
        if owner is not None:
            own_classes.check_base(frames, f"{owner}: what open() returns", Drives)
        full = scenario  # with every car and edge, each with the part of its drive that it replays
        if scenario.fleet is not None:
            full, drives = with_fleet(scenario, scenario.fleet, frames)
        else:
            drives = {
                car.name: frames.drive(car.name, car.route.trace, starts_ns[car.name])
                for car in scenario.cars
            }
        if owner is not None:
            for drive in drives.values():
                own_classes.check_drive(drive, owner)
        if scenario.sequence is not None:
            full = _on_one_clock(full, drives)
        origin = own_classes.origin_of(frames, scenario.perception.name)
        laws = detector_laws.laws_of(*detector_laws.looked_at(origin.provenance))
        encoded = _encoded_drives(full, frames)
        names = [car.device for car in full.cars] + [edge.device for edge in full.edges]
        used = {name: scenario.profiles[name] for name in dict.fromkeys(names)}
        known = facts(
            scenario, methods, devices=used, frames=frames, encoded=encoded, origin=origin
        )
        checks.check_driven(full, drives, features)
        return Prepared(
            scenario=full,
            devices=used,
            frames=frames,
            drives=drives,
            encoded=encoded,
            origin=origin,
            facts=known,
            laws=laws,
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


def _encoded_drives(scenario: Scenario, frames: Drives) -> dict[tuple[str, str], EncodedDrive]:
    """What the drives of cars with an edge are after their pictures were sent, by encoding and car.
    Raises ``UserError``.
    """
    encoded: dict[tuple[str, str], EncodedDrive] = {}
    encodings = [settings.image_encoding for settings in scenario.method_settings.values()]
    for encoding in dict.fromkeys(encodings):
        if encoding == "raw":
            continue
        for car in scenario.cars:
            if car.edge is not None:
                sent = frames.encoded(car.name, encoding)
                if sent is None:
                    text = (
                        f"source {scenario.perception.name!r} has no pictures to encode: leave it "
                        "'raw', and give 'cameras' a 'size'"
                    )
                    raise scenario.error_at("image_encoding", text)
                encoded[encoding, car.name] = sent
    return encoded


def facts(
    scenario: Scenario,
    methods: Mapping[str, Method],
    *,
    devices: Mapping[str, DeviceProfile],
    frames: Drives,
    encoded: Mapping[tuple[str, str], EncodedDrive],
    origin: FramesOrigin,
) -> dict[str, Any]:
    """Everything that decides the outcome of a run: the scenario as it is written, and what was
    found where it says.
    """
    digests, about = origin
    looked_at = detector_laws.facts(*detector_laws.looked_at(about))
    decisive = {
        "format": provenance.RESULT_FORMAT,
        "genie_sim": VERSION,
        "scenario": plain_data(scenario),
        "devices": {name: plain_data(device) for name, device in devices.items()},
        "traces": {
            **digests,
            **scenario.link_digests(),
            **{f"{encoding} of {car}": drive.digest for (encoding, car), drive in encoded.items()},
        },
        "plugins": scenario.own_code_digests(),
        "methods": [entry.facts(methods[entry.name]) for entry in scenario.methods],
    }
    features = {name: dict(of["features"]) for name, of in about.items() if "features" in of}
    if features and any(features_of(methods).values()):
        decisive["features"] = features
    if looked_at is not None:
        decisive["laws"] = looked_at
    return decisive


def notes(scenario: Scenario) -> list[str]:
    """What a reader of a run's results should know beforehand, a sentence each."""
    silent = [
        entry.title or entry.name
        for entry in scenario.methods
        if entry.method.parameters.get("sharing") == "auto" and not scenario.is_one_world
    ]
    said = []
    if silent:
        why = "cars replay recordings at different times, so what one sees is not there for others"
        said.append(f"{', '.join(silent)}: edges share nothing with cars, because {why}.")
    unnamed = sum(edge.neighbours is None for edge in scenario.edges)
    if unnamed and len(scenario.edges) > ALL_SHARE and scenario.edge_neighbours is None:
        said.append(
            f"Of {len(scenario.edges)} edges each shares with the {NEAREST} nearest; "
            "edge_neighbours says with how many."
        )
    return said


class SharedFrames:
    """Frames that do not hang on the seed, opened once for all runs that ask their source for the
    same drives.
    """

    def __init__(self) -> None:
        self.frames: dict[str, Drives] = {}

    def prepare(self, scenario: Scenario) -> Prepared:
        """As ``prepare`` alone."""
        drives = scenario.fleet or [(car.name, car.route.trace) for car in scenario.cars]
        # traces are looked for in the current folder, too
        asked = repr((Path.cwd(), scenario.perception, scenario.origin, drives))
        prepared = prepare(scenario, frames=self.frames.get(asked))
        if not prepared.frames.seeded:
            self.frames[asked] = prepared.frames
        return prepared
