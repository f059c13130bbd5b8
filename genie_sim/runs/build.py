"""From a scenario to what is simulated: the set-up of a world, and the methods that run in it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal

from genie_sim.base import plugins
from genie_sim.base.contracts import checked
from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.plugins import Choice
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.messages import Encoding, Frame
from genie_sim.data.source import Drive, Frames
from genie_sim.runs.own_classes import LINK_MODEL_METHODS, MEDIUM_METHODS, checked_method
from genie_sim.scenario.faults import timed
from genie_sim.scenario.methods import METHOD, MethodEntry
from genie_sim.scenario.power import INTERFACES, OF_LINKS, OF_MODELS
from genie_sim.scenario.profiles import DeviceProfile, KeyTime
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.encoding import ImageCodec
from genie_sim.sim.interface import Interface
from genie_sim.sim.link_models import LinkModel, Medium
from genie_sim.sim.link_models.presets import LINK, LINKS
from genie_sim.sim.method import Method
from genie_sim.sim.places import DrivenPlace, Place, RecordedPlace
from genie_sim.sim.service import Device, HopTime, ServiceTime
from genie_sim.sim.settings import Car
from genie_sim.sim.setup import Setup
from genie_sim.sim.topology import ALL_SHARE, NEAREST


@dataclass(frozen=True)
class Prepared:
    """A scenario with every car and edge of its fleet, and everything it names: its open frame
    source, devices by name, and each car's drive by its name.

    ``encoded`` is what the drives are after their pictures were sent, by encoding and car; ``laws``
    are those of the detector that looked at the drives, measured on other drives, or the assumed
    ones;
    ``facts`` are plain data, everything that decides the outcome of a run, with the scenario as it
    is written.
    """

    scenario: Scenario
    devices: Mapping[str, DeviceProfile]
    frames: Frames
    drives: Mapping[str, Drive]
    encoded: Mapping[tuple[str, str], Any]
    facts: Mapping[str, Any]
    laws: DetectorLaws


def looked_at(frames: Frames) -> tuple[set[str], set[str]]:
    """The detectors that looked at the drives of a frame source, as far as it tells, and these
    drives.
    """
    traces = [about for about in frames.provenance().values() if "detector" in about]
    return (
        {str(about["detector"]) for about in traces},
        {str(about.get("drive")) for about in traces},
    )


def method(entry: MethodEntry) -> Method:
    """The method of an entry. Raises ``UserError``."""
    own: Method = METHOD.make(entry.method)
    owner = plugins.own_label("method", entry.method.name)
    if owner is not None:
        own = checked_method(own, owner)
    return own


def setup(prepared: Prepared, entry: MethodEntry) -> Setup:
    """The scenario under one method's settings. Its link models and faults are new objects, which
    no other method shares: classes of the user's own may keep state in them.
    """
    scenario = prepared.scenario
    settings = scenario.method_settings[entry.name]
    cars = [
        replace(car, route=replace(car.route, start_ns=scenario.start_ns(car)))
        for car in scenario.cars
    ]
    devices = {
        name: device(profile, settings.model, settings.spread)
        for name, profile in prepared.devices.items()
    }
    freshness = settings.genie.object_map.freshness
    # One model for all equal links: a fleet has one, and very many cars.
    choices = {repr(car.link): car.link for car in scenario.cars if car.link is not None}
    models = {key: link_model(choice) for key, choice in choices.items()}
    return Setup(
        seed=scenario.seed,
        settings=settings,
        cars=cars,
        edges=scenario.edges,
        cameras=scenario.cameras,
        frames={car.name: prepared.drives[car.name].frames for car in scenario.cars},
        devices=devices,
        links={car.name: models[repr(car.link)] for car in scenario.cars if car.link is not None},
        edge_network=link_model(settings.edge_network),
        laws=ASSUMED if freshness.parameters.get("measured") is False else prepared.laws,
        faults=[timed(fault, index) for index, fault in enumerate(scenario.faults)],
        codec=_codec(prepared, settings.image_encoding),
        interfaces=_interfaces(scenario),
        warm_up_ns=scenario.warm_up_ns,
        places={car.name: _place(scenario, car, prepared.drives[car.name]) for car in cars},
    )


def _interfaces(scenario: Scenario) -> dict[str, Interface]:
    """The network interface of each car with an edge, where its kind is known."""
    interfaces = {}
    for car in scenario.cars:
        if car.link is None:
            continue
        name = _interface_of(car.link) if scenario.interface == "auto" else scenario.interface
        if name is not None:
            interfaces[car.name] = Interface(name, INTERFACES[name].tail_time_ns)
    return interfaces


def _interface_of(link: Choice) -> str | None:
    """The interface for a link: that of its model, or of the named link with its rates."""
    rates = ("rate_up_bps", "rate_down_bps")
    for name, interface in OF_LINKS.items():
        preset = LINKS[name]
        if link.name == preset.name and all(
            link.parameters[rate] == preset.parameters[rate] for rate in rates
        ):
            return interface
    return OF_MODELS.get(link.name)


def _place(scenario: Scenario, car: Car, drive: Drive) -> Place:
    """Where a car is at any time; ``car`` is one whose start is drawn."""
    if drive.position is not None:
        return DrivenPlace(drive.position, car.route.start_ns, drive.duration_ns)
    return RecordedPlace(car.route, drive.frames[scenario.cameras_of(car)[0].recording])


def _codec(prepared: Prepared, encoding: Encoding) -> ImageCodec | None:
    """How pictures are sent; ``None``: as they are."""
    if encoding == "raw":
        return None
    recorded: dict[str, dict[tuple[str, int], Frame]] = {}
    for (name, car), drive in prepared.encoded.items():
        if name == encoding:
            frames = chain.from_iterable(drive.frames.values())
            recorded[car] = {(frame.digest, frame.stamp_ns): frame for frame in frames}
    return ImageCodec(encoding, recorded)


def device(profile: DeviceProfile, model: str, spread: str = "default") -> Device:
    """What the simulator needs of a device's profile. Raises ``UserError`` where the model does not
    run there.
    """
    hop, genie = profile.hop, profile.genie_time
    return Device(
        name=profile.name,
        cores=profile.cores.value,
        hop=HopTime(hop.small.value_ns, hop.per_megabyte.value_ns),
        message_time=ServiceTime(genie.median.value_ns, genie.spread.loc, genie.spread.sigma),
        detector_time=detector_time(profile, model, spread),
        keys={name: _key_time(profile, key, model) for name, key in profile.keys.items()},
        codec_factor=profile.codec.value,
        batch_fixed=profile.models[model].batch.fixed,
    )


def _key_time(
    profile: DeviceProfile, key: KeyTime, model: str
) -> tuple[Literal["cpu", "accelerator"], int]:
    if key.of_detection is None:
        assert key.median_ns is not None
        return "cpu", key.median_ns
    return "accelerator", round(key.of_detection * profile.median_ns(model))


def detector_time(profile: DeviceProfile, model: str, spread: str = "default") -> ServiceTime:
    """The law of one detection of ``model``. Raises ``UserError`` where it is unknown or does not
    fit into memory.
    """
    median_ns = profile.median_ns(model)
    law = getattr(profile.spreads, spread)
    return ServiceTime(median_ns, law.loc, law.sigma)


def link_model(choice: Choice) -> LinkModel | Medium:
    """The model of a link. Raises ``UserError``."""
    own = LINK.make(choice)
    owner = plugins.own_label("link model", choice.name)
    methods = MEDIUM_METHODS if hasattr(own, "radio") else LINK_MODEL_METHODS
    model: LinkModel | Medium = checked(own, owner, methods)
    return model


def link_digests(scenario: Scenario) -> dict[str, str]:
    """Digests of the recordings that the links of a scenario replay."""
    digests: dict[str, str] = {}
    for _, link in scenario.links():
        digests |= getattr(LINK.make(link), "digests", dict)()
    return digests


def method_facts(scenario: Scenario) -> list[dict[str, Any]]:
    """Of each method, in order: its name, what figures call it, and whether others are compared
    with it.
    """
    facts = []
    for index, entry in enumerate(scenario.methods):
        with as_user_error(f"{scenario.name}: methods[{index}]", UserError):
            instance = method(entry)
        title = instance.title if entry.title is None else entry.title
        usual = entry.title is not None or entry.name in (
            entry.method.name,
            entry.method.name.rpartition(":")[2],
        )
        facts.append(
            {
                "name": entry.name,
                "title": title if usual else entry.name,
                "baseline": bool(instance.baseline),
            }
        )
    return facts


def notes(scenario: Scenario) -> list[str]:
    """What a reader of a run's results should know beforehand, a sentence each."""
    silent = [
        entry.title or entry.name
        for entry in scenario.methods
        if (looks := scenario.asked[entry.name].genie.looks) is not None
        and looks.told == "auto"
        and looks.edge == "beside"
        and not scenario.is_one_world
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
