"""Plug-ins of a user's own, for the tests: a street to drive, a cache, a crash, a radio. None is registered."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from genie_sim.faults.outage import Outage
from genie_sim.messages import CameraPose, Detection, Publish
from genie_sim.messages import ImageLookup as Lookup
from genie_sim.sim.station import IMAGES, OBJECTS, Interceptor, Station, Uplink


@dataclass(frozen=True)
class StreetFrame:
    """What one picture of the street shows."""

    stamp_ns: int
    pose: CameraPose
    digest: str
    dhash: int
    detections: tuple[Detection, ...]
    size_bytes: int = 1_397_297
    horizontal_fov_rad: float = math.radians(81.4)
    features: dict = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Street:
    """A frame source: a straight street with a parked car every 8 m, two cameras ten times a second."""

    seconds: float = 2.0
    speed_mps: float = 5.0

    seeded = False

    def open(self, seed, origin, progress=None):
        return self

    def drive(self, car, trace, start_ns):
        return StreetDrive({name: self._frames(name) for name in ("left", "right")})

    def digests(self):
        return {"street": f"{self.seconds} {self.speed_mps}"}

    def provenance(self):
        return {"street": {"made_by": "tests"}}

    def _frames(self, camera):
        return [self._frame(camera, number) for number in range(round(10 * self.seconds))]

    def _frame(self, camera, number):
        east_m = number * self.speed_mps / 10
        ahead = [8.0 * place for place in range(20) if 4.0 < 8.0 * place - east_m < 40.0]
        found = tuple(
            Detection("car", 0.8, (0.0, 0.0, 9.0, 9.0), (x, 4.0, 0.8), 0.8, "scan") for x in ahead
        )
        pose = CameraPose(east_m, 0.5 * (camera == "right"), 1.6, 0.0)
        features = {"hsv": bytes([round(east_m * 5), *[0] * 63])}  # 0.02 a metre
        return StreetFrame(
            number * 100_000_000, pose, f"{camera} {number}", number, found, features=features
        )


@dataclass(frozen=True)
class StreetDrive:
    """The street, as every car sees it."""

    frames: dict

    name = "street"


class Again:
    """A method: the car sends every picture to its edge, and gives the latest answer of each camera at once."""

    title = "again and again"
    baseline = False

    def __init__(self, every: int = 1):
        self.every = every

    def on_car(self, place):
        return Station(
            interceptor=lambda *_: Latest(place, self.every),
            uplink=Uplink(IMAGES + "-up", OBJECTS + "-up"),
        )

    def on_edge(self, place):
        return Station(detector=True)


class Latest(Interceptor):
    """Keeps the newest answer of each camera; a coin of its own says which pictures are given it."""

    def __init__(self, place, every):
        self.name = f"{place.name}/again"
        self.rng = place.stream("again")
        self.every = every
        self.newest = {}

    def subscriptions(self):
        return IMAGES, OBJECTS + "-up"

    def publications(self):
        return OBJECTS, IMAGES + "-up"

    def on_message(self, topic, message, now_ns, sender=None):
        if topic == OBJECTS + "-up":
            self.newest[message.header.frame_id] = message
            return [Publish(OBJECTS, message)]
        held = self.newest.get(message.header.frame_id)
        hit = held is not None and bool(self.rng.integers(self.every) == 0)
        looked_up = Lookup(message.header, "hit" if hit else "miss", "client", len(self.newest))
        if hit:
            return [
                looked_up,
                Publish(OBJECTS, held.restamped(message.header).served("cache", self.name)),
            ]
        return [looked_up, Publish(IMAGES + "-up", message)]


@dataclass(frozen=True)
class Crash(Outage):
    """A fault: an edge server restarts; its links are down until then, and all that it knew is gone."""

    @property
    def dropped_by(self):
        return "crash"

    def begin(self, world):
        super().begin(world)
        world.void(self.target, f"{self.target}:{self.dropped_by}")

    def end(self, world):
        world.void(self.target, f"{self.target}:{self.dropped_by}")
        super().end(world)


@dataclass(frozen=True)
class Blackout:
    """A fault of one instant, by hand: it takes away what one host works on."""

    target: str

    dropped_by = "blackout"

    def begin(self, world):
        if self.target in world.hosts:
            host, graph = world.hosts[self.target]
            for node in graph.nodes:
                node.void(f"{self.target}:blackout")
            host.accelerator.void()
            host.cpu.void()

    def end(self, world):
        pass


@dataclass(frozen=True)
class Radio:
    """A link model: a slot every ``slot_ms``, ``slot_bytes`` in each, every ``fails``-th message is lost (0: none)."""

    slot_ms: float
    slot_bytes: int = 20_000
    fails: int = 0

    def __post_init__(self):
        if self.slot_ms <= 0:
            raise ValueError(f"slot_ms: must be more than zero, but is {self.slot_ms:g}")

    def channel(self, up, rng):
        return RadioChannel(self, rng)


class RadioChannel:
    def __init__(self, radio, rng):
        self.radio, self.rng, self.sent = radio, rng, 0

    def occupied_ns(self, size_bytes, now_ns):
        slot_ns = round(self.radio.slot_ms * 1e6)
        until_next_ns = -now_ns % slot_ns
        return until_next_ns + -(-size_bytes // self.radio.slot_bytes) * slot_ns

    def delay_ns(self, size_bytes, now_ns):
        self.sent += 1
        if self.radio.fails and self.sent % self.radio.fails == 0:
            return None
        return int(self.rng.integers(1_000_000))
