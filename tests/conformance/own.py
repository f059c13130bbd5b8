"""Plug-ins of a user's own, for the tests: a street to drive, a cache, a crash, a radio. None is
registered.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import ClassVar

import simpy

from genie_sim.base import seeds
from genie_sim.core.eviction import LRU
from genie_sim.core.messages import CameraPose, Detection, Publish
from genie_sim.core.messages import ImageLookup as Lookup
from genie_sim.core.similarity import PoseGrid
from genie_sim.data.frame_source import Drive, Drives, FrameSource
from genie_sim.faults.outage import Outage
from genie_sim.sim.link_model import TimedTransmitter, Transmitter
from genie_sim.sim.method import IMAGES, OBJECTS, HostConfig, Interceptor, UplinkTopics


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
class Street(FrameSource, Drives):
    """A frame source: a straight street with a parked car every 8 m, two cameras ten times a
    second.
    """

    seconds: float = 2.0
    speed_mps: float = 5.0

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
class StreetDrive(Drive):
    """The street, as every car sees it."""

    frames: dict

    name = "street"


class Again:
    """A method: the car sends every picture to its edge, and gives the latest answer of each camera
    at once.
    """

    title = "again and again"
    baseline = False

    def __init__(self, every: int = 1):
        self.every = every

    def on_car(self, host):
        return HostConfig(
            interceptor=lambda *_: Latest(host, self.every),
            uplink=UplinkTopics(IMAGES + "-up", OBJECTS + "-up"),
        )

    def on_edge(self, host):
        return HostConfig(detector=True)


class Wired(Again):
    """A method whose parts a test chooses."""

    title = "wired"
    car = HostConfig()
    edge = HostConfig(detector=True)

    def on_car(self, host):
        return self.car

    def on_edge(self, host):
        edge = type(self).edge
        return edge(host) if callable(edge) else edge


class Latest(Interceptor):
    """Keeps the newest answer of each camera; a coin of its own says which pictures are given
    it.
    """

    def __init__(self, host, every):
        self.name = f"{host.name}/again"
        self.rng = seeds.stream(*host.draws.args, "again")  # the seed and the host
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
                Publish(OBJECTS, held.restamped(message.header).credited("cache", self.name)),
            ]
        return [looked_up, Publish(IMAGES + "-up", message)]


def nameless(node, host, every):
    """Makes a node whose name does not begin with its host."""
    node.name = "again"


def strikes_twice(fault, network):
    """A fault that waits after its end."""
    yield
    yield network.clock.timeout(1)


@dataclass(frozen=True)
class Crash(Outage):
    """A fault: an edge server restarts; its links are down until then, and all that it knew is
    gone.
    """

    @property
    def dropped_by(self):
        return "crash"

    def strike(self, network):
        where = f"{self.target}:{self.dropped_by}"
        network.cut(self.target, self.dropped_by)
        network.void(self.target, where)
        yield
        network.void(self.target, where)
        network.restore(self.target, self.dropped_by)


@dataclass(frozen=True)
class Blackout:
    """A fault of one instant, by hand: it takes away what one host works on."""

    target: str

    dropped_by = "blackout"

    def strike(self, network):
        graph = network.graphs.get(self.target)
        if graph is not None:
            for node in graph.nodes:
                node.void(f"{self.target}:blackout")
        yield


@dataclass(frozen=True)
class Radio:
    """A link model: a slot every ``slot_ms``, ``slot_bytes`` in each, every ``fails``-th message is
    lost (0: none).
    """

    slot_ms: float
    slot_bytes: int = 20_000
    fails: int = 0

    def __post_init__(self):
        if self.slot_ms <= 0:
            raise ValueError(f"slot_ms: must be more than zero, but is {self.slot_ms:g}")

    def transmitter(self, network, ends):
        return RadioTransmitter(self, network, ends)


class RadioTransmitter(TimedTransmitter):
    def __init__(self, radio, network, ends):
        super().__init__(network, ends)
        self.radio, self.count = radio, 0

    def occupied_ns(self, size_bytes, now_ns):
        slot_ns = round(self.radio.slot_ms * 1e6)
        until_next_ns = -now_ns % slot_ns
        return until_next_ns + -(-size_bytes // self.radio.slot_bytes) * slot_ns

    def delay_ns(self, size_bytes, now_ns):
        self.count += 1
        if self.radio.fails and self.count % self.radio.fails == 0:
            return None
        return int(self.random.integers(1_000_000))


class NoTransmitter:
    """A link model that makes nothing."""

    def transmitter(self, network, ends):
        return None


@dataclass
class OneAtATime:
    """A medium: of all its links one sends at a time, first come, first served."""

    rate_bps: int

    def __post_init__(self):
        self.medium = None

    def transmitter(self, network, ends):
        self.medium = self.medium or simpy.Resource(network.clock)
        return Turn(self, network, ends)


class Turn(Transmitter):
    """One link of the medium."""

    def __init__(self, turns, network, ends):
        super().__init__(network, ends)
        self.turns = turns

    def transmit(self, size_bytes):
        return self.clock.process(self.sends(size_bytes))

    def sends(self, size_bytes):
        with self.turns.medium.request() as turn:
            yield turn
            yield self.clock.timeout(-(-size_bytes * 8 * 10**9 // self.turns.rate_bps))

    def delay_ns(self, size_bytes, now_ns):
        return 1_000_000


class CountingRadio(Radio):
    """A link model with state: every ``fails``-th message over any of its links is lost."""

    def transmitter(self, network, ends):
        if not hasattr(self, "shared"):
            object.__setattr__(self, "shared", {"sent": 0})
        return CountingTransmitter(self, network, ends)


class CountingTransmitter(RadioTransmitter):
    def delay_ns(self, size_bytes, now_ns):
        shared = self.radio.shared
        shared["sent"] += 1
        if self.radio.fails and shared["sent"] % self.radio.fails == 0:
            return None
        return int(self.random.integers(1_000_000))


# State that outlives a method: what the conformance tests have to catch.


class LeakyMethod(Again):
    """Its answers stay in the class."""

    answers: ClassVar[dict] = {}

    def on_car(self, host):
        def make(*_):
            node = Latest(host, self.every)
            node.newest = self.answers
            return node

        return HostConfig(interceptor=make, uplink=UplinkTopics(IMAGES + "-up", OBJECTS + "-up"))


class LeakyFault(Blackout):
    """Only every second one happens."""

    begun: ClassVar = itertools.count()

    def strike(self, network):
        if next(self.begun) % 2:
            yield from super().strike(network)
        else:
            yield


class LeakyRadio(Radio):
    """All senders of the process count together."""

    shared: ClassVar[dict] = {"sent": 0}

    def transmitter(self, network, ends):
        return CountingTransmitter(self, network, ends)


class LeakyStreet(Street):
    """A detector that finds nothing after the first pictures that it is shown."""

    def _frame(self, camera, number):
        return LeakyFrame(super()._frame(camera, number))


class LeakyFrame:
    shown: ClassVar = itertools.count()

    def __init__(self, frame):
        self.frame = frame

    def __getattr__(self, name):
        return getattr(self.frame, name)

    @property
    def detections(self):
        return self.frame.detections if next(self.shown) < 400 else ()


class LeakySimilarity(PoseGrid):
    """After some pictures, all others are the same one."""

    keys: ClassVar = itertools.count()

    def key(self, image):
        return super().key(image) if next(self.keys) < 50 else "the same"


class OwnSimilarity(PoseGrid):
    """As the package's."""


class OwnEviction(LRU):
    """As the package's."""


@dataclass(frozen=True)
class Beside:
    """Processes beside the simulated ones."""

    target: str


class Idles(Beside):
    """It waits again and again, for ever."""

    def strike(self, network):
        while True:
            yield network.clock.timeout(7_000_000)


class Floods(Beside):
    """More background traffic than its link can carry, for ever."""

    def strike(self, network):
        while True:
            network.links[self.target].load("flood", 100_000)
            yield network.clock.timeout(5_000_000)


class Nowhere(Beside):
    """It takes down what is not there."""

    def strike(self, network):
        yield network.clock.timeout(5)
        network.cut("edge99", "nowhere")


class Yields(Beside):
    """It yields what is no event."""

    def strike(self, network):
        yield network.clock.timeout(5)
        yield 3


class Fraction(Beside):
    """It waits for half a nanosecond."""

    def strike(self, network):
        yield network.clock.timeout(1.5)


class Raises(Beside):
    """It fails."""

    def strike(self, network):
        yield network.clock.timeout(5)
        raise KeyError("lost")


class Returns(Beside):
    """It is no process."""

    def strike(self, network):
        return 3
