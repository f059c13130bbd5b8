"""From a prepared scenario to what is simulated: the set-up of a world under one method."""

from dataclasses import replace
from itertools import chain
from typing import Literal

from genie_sim.base.plugins import Choice
from genie_sim.core.messages import Encoding, Frame
from genie_sim.data.frame_source import Drive
from genie_sim.links.presets import LINKS
from genie_sim.runs.prepare import Prepared
from genie_sim.scenario.faults import timed
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.power import INTERFACES, OF_LINKS, OF_MODELS
from genie_sim.scenario.profiles import DeviceProfile, KeyTime
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.device import Device, HopTime, ServiceTime
from genie_sim.sim.encoding import ImageCodec
from genie_sim.sim.interface import NetworkInterface
from genie_sim.sim.link_model import LINK, LinkModel
from genie_sim.sim.places import DrivenPlace, Place, RecordedPlace
from genie_sim.sim.settings import Car
from genie_sim.sim.setup import Setup


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
    # One model for all equal links: a fleet has one, and very many cars.
    links = {car.name: car.link for car in scenario.cars if car.link is not None}
    choices = {repr(choice): choice for choice in links.values()}
    models: dict[str, LinkModel] = {key: LINK.make(choice) for key, choice in choices.items()}
    return Setup(
        seed=scenario.seed,
        settings=settings,
        cars=cars,
        edges=scenario.edges,
        cameras=scenario.cameras,
        frames={car.name: prepared.drives[car.name].frames for car in scenario.cars},
        devices=devices,
        links={car: models[repr(choice)] for car, choice in links.items()},
        edge_network=LINK.make(settings.edge_network),
        laws=prepared.laws,
        faults=timed(scenario.faults),
        codec=_codec(prepared, settings.image_encoding),
        interfaces=_interfaces(scenario),
        warm_up_ns=scenario.warm_up_ns,
        is_one_world=scenario.is_one_world,
        places={car.name: _place(scenario, car, prepared.drives[car.name]) for car in cars},
    )


def _interfaces(scenario: Scenario) -> dict[str, NetworkInterface]:
    """The network interface of each car with an edge, where its kind is known."""
    interfaces = {}
    for car in scenario.cars:
        if car.link is None:
            continue
        name = _interface_of(car.link) if scenario.interface == "auto" else scenario.interface
        if name is not None:
            interfaces[car.name] = NetworkInterface(name, INTERFACES[name].tail_time_ns)
    return interfaces


def _interface_of(link: Choice) -> str | None:
    """The interface for a link: of its model, or of the named link with its rates and overhead."""
    telling = ("rate_up_bps", "rate_down_bps", "overhead_bytes")
    for name, interface in OF_LINKS.items():
        preset = LINKS[name]
        if link.name == preset.name and all(
            link.parameters[key] == preset.parameters[key] for key in telling
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
    hop, genie = profile.hop, profile.genie
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
