"""From a scenario to what is simulated: plain values for the world, and the methods that run in it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from genie_sim import plugins
from genie_sim.core import genies
from genie_sim.core.caches.features import feature_of
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.freshness.measure import measured
from genie_sim.errors import UserError, as_user_error
from genie_sim.messages import Header, Look
from genie_sim.methods import METHODS, MUST_HAVE
from genie_sim.perception.sources import Drive, Frames
from genie_sim.plugins import Choice
from genie_sim.scenario.faults import check_faults, timed
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.parts import Car
from genie_sim.scenario.profiles import DeviceProfile, KeyTime
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.encoding import Codec
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.link_models import LINK_MODELS, LinkModel
from genie_sim.sim.service import Device, HopTime, ServiceTime
from genie_sim.sim.setup import CameraSetup, CarSetup, EdgeSetup, Setup
from genie_sim.sim.station import Method

MEASURED_FRAMES = 600  # at most, of one camera, that a detector's laws are measured on


@dataclass(frozen=True)
class Prepared:
    """A scenario with everything it names: its open frame source, devices by name, and each car's drive by its name.

    ``expanded`` is the scenario with every car and edge of its fleet; ``encoded`` what the drives are after their
    pictures were sent, by encoding and car.
    """

    scenario: Scenario
    expanded: Scenario
    devices: Mapping[str, DeviceProfile]
    frames: Frames
    drives: Mapping[str, Drive]
    encoded: Mapping[tuple[str, str], Any]

    @cached_property
    def faults(self) -> Sequence[TimedFault]:
        """What goes wrong under every method. Raises ``UserError``."""
        return [timed(entry, place) for place, entry in enumerate(self.expanded.faults)]

    @cached_property
    def links(self) -> dict[str, LinkModel]:
        """One model for all links that are the same, as they are asked for: a fleet has one, and very many cars."""
        return {}

    @cached_property
    def laws(self) -> DetectorLaws:
        """The detectors' laws, measured on what one camera of the first car sees."""
        car = self.expanded.cars[0]
        recording = self.expanded.cameras_of(car)[0].recording
        frames = self.drives[car.name].frames[recording][:MEASURED_FRAMES]
        looks = (
            Look(
                Header(one.stamp_ns, recording, car.name),
                one.pose,
                one.horizontal_fov_rad,
                one.detections,
            )
            for one in frames
        )
        return measured(looks)


def method(entry: MethodEntry) -> Method:
    """The method of an entry. Raises ``UserError``."""
    made: Method = plugins.make("method", entry.method, METHODS, MUST_HAVE)
    return made


def setup(prepared: Prepared, entry: MethodEntry) -> Setup:
    """The scenario under one method's settings."""
    scenario = prepared.expanded.under(entry)
    devices = {
        name: device(one, scenario.model, scenario.spread) for name, one in prepared.devices.items()
    }
    # The detectors' laws, for maps and consumers that weigh evidence, are measured where somebody wants them.
    measures = scenario.consumer == "tracker" or scenario.genie.object_map.freshness.parameters.get(
        "measured"
    )
    return Setup(
        seed=scenario.seed,
        cars=[_car(prepared, scenario, devices, car) for car in scenario.cars],
        edges=[
            EdgeSetup(edge.name, devices[edge.device], edge.neighbours) for edge in scenario.edges
        ],
        edge_network=link_model(scenario.edge_network),
        genie=scenario.genie,
        queue_length=scenario.queue_length,
        consumer=scenario.consumer,
        laws=prepared.laws if measures else ASSUMED,
        faults=prepared.faults,
        codec=_codec(prepared, scenario),
    )


def _codec(prepared: Prepared, scenario: Scenario) -> Codec | None:
    """How pictures are sent; ``None``: as they are."""
    encoding = scenario.image_encoding
    if encoding == "raw":
        return None
    drives = {car: drive for (how, car), drive in prepared.encoded.items() if how == encoding}
    return Codec(
        encoding,
        {
            car: {
                (one.digest, one.stamp_ns): one
                for frames in drive.frames.values()
                for one in frames
            }
            for car, drive in drives.items()
        },
    )


def device(profile: DeviceProfile, model: str, spread: str = "default") -> Device:
    """What the simulator needs of a device's profile. Raises ``UserError`` where the model does not run there."""
    hop, genie = profile.hop, profile.genie_time
    return Device(
        profile.name,
        profile.cores.value,
        HopTime(hop.small.value, hop.per_megabyte.value),
        ServiceTime(genie.median.value, genie.spread.loc, genie.spread.sigma),
        detector_time(profile, model, spread),
        {name: _key_time(profile, one, model) for name, one in profile.keys.items()},
        profile.codec.value,
    )


def _key_time(
    profile: DeviceProfile, key: KeyTime, model: str
) -> tuple[Literal["cpu", "accelerator"], int]:
    if key.of_detection is None:
        assert key.median_ns is not None
        return "cpu", key.median_ns
    return "accelerator", round(key.of_detection * profile.median_ns(model))


def detector_time(profile: DeviceProfile, model: str, spread: str = "default") -> ServiceTime:
    """The law of one detection of ``model``. Raises ``UserError`` where it is unknown or does not fit into memory."""
    median_ns = profile.median_ns(model)
    law = getattr(profile.spreads, spread)
    return ServiceTime(median_ns, law.loc, law.sigma, profile.models[model].quantiles_ns)


def link_model(choice: Choice) -> LinkModel:
    """The model of a link. Raises ``UserError``."""
    made: LinkModel = plugins.make("link model", choice, LINK_MODELS, ("channel",))
    return made


def _car(
    prepared: Prepared, scenario: Scenario, devices: Mapping[str, Device], car: Car
) -> CarSetup:
    frames, route = prepared.drives[car.name].frames, car.route
    cameras = [
        CameraSetup(camera.name, frames[camera.recording], camera.phase_ns, camera.size_bytes)
        for camera in scenario.cameras_of(car)
    ]
    return CarSetup(
        name=car.name,
        device=devices[car.device],
        edge=car.edge,
        link=None if car.link is None else _link(prepared, car.link),
        cameras=cameras,
        sees=car.cameras is not False,
        genie=car.genie,
        window_ns=route.window_ns,
        start_ns=scenario.start_ns(car),
        laps=route.laps,
        pause_ns=route.pause_ns,
    )


def _link(prepared: Prepared, choice: Choice) -> LinkModel:
    key = repr(choice)
    if key not in prepared.links:
        prepared.links[key] = link_model(choice)
    return prepared.links[key]


def method_facts(scenario: Scenario) -> list[dict[str, Any]]:
    """Of each method, in order: its name, what figures call it, and whether others are compared with it."""
    facts = []
    for index, entry in enumerate(scenario.methods):
        with as_user_error(f"{scenario.name}: methods[{index}]", UserError):
            made = method(entry)
        title = made.title if entry.title is None else entry.title
        usual = entry.title is not None or entry.name in (
            entry.method.name,
            entry.method.name.rpartition(":")[2],
        )
        facts.append(
            {
                "name": entry.name,
                "title": title if usual else entry.name,
                "baseline": bool(made.baseline),
            }
        )
    return facts


def check_faults_of(scenario: Scenario) -> None:
    """Raises ``UserError`` for a fault that befalls what is not there; a fleet's cars are known only now."""
    edges = [edge.name for edge in scenario.edges]
    for field, text in check_faults(
        scenario.faults, {car.name: car.edge for car in scenario.cars}, edges, own=True
    ):
        raise UserError(f"{scenario.name}: {field}: {text}")


def check_features(scenario: Scenario, drives: Mapping[str, Drive]) -> None:
    """Raises ``UserError`` where a method needs a feature that a car's frames do not have."""
    for index, entry in enumerate(scenario.methods):
        name = getattr(method(entry), "feature", None)
        if name is None:
            continue
        for car in scenario.cars:
            drive = drives[car.name]
            frame = drive.frames[scenario.cameras_of(car)[0].recording][0]
            if feature_of(frame, name) is None:
                where = f"{scenario.name}: methods[{index}].feature"
                known = ", ".join(getattr(frame, "features", {})) or "none"
                raise UserError(
                    f"{where}: the frames of {drive.name} have no feature {name!r}, but {known}: {entry.name} cannot "
                    "run on them; 'genie-sim perceive' makes features"
                )


def own_plugins(scenario: Scenario) -> list[tuple[str, str]]:
    """The classes of the user's own that a scenario names, each once: the kind of plug-in, and the name."""
    links = {repr(car.link): car.link for car in scenario.cars if car.link is not None}
    chosen = [
        ("frame source", scenario.perception.name),
        ("detector", str(scenario.perception.parameters.get("detector"))),
        *(("method", entry.method.name) for entry in scenario.methods),
        *(("fault", entry.fault.name) for entry in scenario.faults),
    ]
    for each in (scenario, *map(scenario.under, scenario.methods)):
        links[repr(each.edge_network)] = each.edge_network
        chosen += genies.chosen_plugins(each.genie)
    if scenario.fleet is not None:
        links["fleet"] = scenario.fleet.link
    chosen += [("link model", link.name) for link in links.values()]
    return [one for one in dict.fromkeys(chosen) if plugins.is_own(one[1])]


def plugin_digests(scenario: Scenario) -> dict[str, str]:
    """sha256 of the module of each class of the user's own that the scenario names: its code decides the outcome."""
    return {
        f"{what} {name}": plugins.code_digest(what, name) for what, name in own_plugins(scenario)
    }
