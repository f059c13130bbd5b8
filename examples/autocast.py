"""AutoCast: cars broadcast what others cannot see, the most useful for its bytes first.

After H. Qiu, P. Huang, N. Asavisanu, X. Liu, K. Psounis, R. Govindan: AutoCast: Scalable
Infrastructure-less Cooperative Perception for Distributed Collaborative Driving. MobiSys 2022,
arXiv 2112.14947. Cars tell where they are and what they see. An object is worth, to each other car
that does not see it, as much as it is relevant: how near the two will come to each other. In every
interval a car sends the objects with the most value for their bytes, within a budget. The bytes are
those of an object's points in a scan. ``order: random`` is their "agnostic" schedule.

What differs: there, one schedule is computed for all cars of a cluster, and one sends after the
other. Here each car has a budget of its own, and leaves out what another has just sent. What a car
does not say that it sees, it cannot see; there, this is computed from what hides what. Trajectories
are straight lines; there, they are planned. Receivers get objects; there, points, to detect in.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal, NamedTuple

from cpm import OLD_NS, Listening, Objects, Told, away_m, moved, nearest, seen_since
from sidelink import Sidelink, connect

from genie_sim.extend import (
    NS_PER_MS,
    NS_PER_S,
    Bounds,
    CameraPose,
    Detection,
    Header,
    HostConfig,
    HostContext,
    Image,
    Method,
    Network,
    kind_of,
)

TOPIC = "/autocast"
BEACON_BYTES, SEEN_BYTES = 121, 12  # a car, and each object that it sees. Assumed
# Velodyne's HDL-64E at 10 Hz: the angles between its points; three 2-byte numbers a point, assumed
ACROSS_RAD, UP_RAD, POINT_BYTES = math.radians(0.18), math.radians(0.4), 6
HIGH_M, NEAREST_M = 1.5, 5.0  # an object; nearer ones have no more points. Assumed
AHEAD_S, REACH_M = 3.0, 50.0  # how far trajectories go, and what is too far to matter. Assumed
LATELY_NS = NS_PER_S  # so long a car that was heard counts


@dataclass(frozen=True, eq=False)
class Cast(Told):
    """The objects that a car sends, after its beacon: where it is, how fast, and what it sees
    now.
    """

    pose: CameraPose
    velocity_mps: tuple[float, float]
    sees: Objects


class Offer(NamedTuple):
    """An object that a car could send."""

    key: tuple[str, int]
    value: float
    size_bytes: int


def points_bytes(item: Detection, distance_m: float) -> int:
    """The bytes of an object's points in a scan from so far."""
    distance_m = max(distance_m, NEAREST_M)
    across = 2 * kind_of(item.label).half_width_m / distance_m / ACROSS_RAD
    return math.ceil(across) * math.ceil(HIGH_M / distance_m / UP_RAD) * POINT_BYTES


def relevance(item: Detection, cast: Cast) -> float:
    """From 1, if an object and a car are going to meet, to 0, if they stay out of reach."""
    assert item.location is not None and item.motion is not None
    east_m, north_m = item.location[0] - cast.pose.east_m, item.location[1] - cast.pose.north_m
    east_mps, north_mps = (
        of_item - of_car
        for of_item, of_car in zip(item.motion.velocity_mps, cast.velocity_mps, strict=True)
    )
    speed2 = east_mps * east_mps + north_mps * north_mps
    soonest_s = -(east_m * east_mps + north_m * north_mps) / speed2 if speed2 else 0.0
    nearest_s = min(max(soonest_s, 0.0), AHEAD_S)
    nearest_m = math.hypot(east_m + nearest_s * east_mps, north_m + nearest_s * north_mps)
    return max(0.0, 1.0 - nearest_m / REACH_M)


def value(item: Detection, others: Iterable[Cast]) -> float:
    """What an object is worth to all cars that do not see it."""
    return sum(relevance(item, other) for other in others if nearest(item, other.sees) is None)


def schedule(offers: Iterable[Offer], budget_bytes: int) -> list[Offer]:
    """Those that are worth something and fit into the budget, the most value for bytes first."""
    sent, left_bytes = [], budget_bytes
    for offer in sorted(offers, key=lambda offer: -offer.value / offer.size_bytes):
        if offer.value > 0 and offer.size_bytes <= left_bytes:
            sent.append(offer)
            left_bytes -= offer.size_bytes
    return sent


class Caster(Listening):
    """A car that tells what it sees, and sends what others do not."""

    def __init__(self, host: HostContext, method: "AutoCast", *topics: tuple[str, ...]) -> None:
        super().__init__(host, TOPIC, method.every_ns, *topics)
        self._budget_bytes, self._order = method.budget_bytes, method.order
        self._draws = host.draws("autocast")
        self._others: dict[str, tuple[Cast, int]] = {}  # by car: what it told last, and when
        self._last: dict[str, Image] = {}  # by camera: the frame with which this car told last

    def hear(self, told: Told, now_ns: int) -> None:
        super().hear(told, now_ns)
        assert isinstance(told, Cast)
        self._others[told.header.origin] = told, now_ns

    def tell(self, frame: Image, now_ns: int) -> Cast:
        own = seen_since(self.own(now_ns), now_ns - OLD_NS)
        sees, heard = moved(own, now_ns), self._heard.objects(now_ns, 2 * self._every_ns)
        others = [cast for cast, told_ns in self._others.values() if now_ns - told_ns <= LATELY_NS]
        offers = []
        for key, item in sees.items():
            if nearest(item, heard) is None:
                size_bytes = points_bytes(item, away_m(item, frame.pose))
                worth = value(item, others)
                if self._order == "random":  # the bytes make no difference
                    worth = self._draws.uniform(f"{frame.header} {key[1]}") * size_bytes
                offers.append(Offer(key, worth, size_bytes))
        sent = schedule(offers, self._budget_bytes)
        objects = {offer.key: own[offer.key] for offer in sent}
        size_bytes = BEACON_BYTES + SEEN_BYTES * len(sees) + sum(offer.size_bytes for offer in sent)
        header = Header(frame.header.stamp_ns, TOPIC, frame.header.origin)
        velocity_mps = self._velocity_mps(frame)
        return Cast(
            header, size_bytes, objects, pose=frame.pose, velocity_mps=velocity_mps, sees=sees
        )

    def _velocity_mps(self, frame: Image) -> tuple[float, float]:
        """How the car has moved since it told last."""
        last = self._last.get(frame.header.frame_id, frame)
        self._last[frame.header.frame_id] = frame
        seconds = (frame.header.stamp_ns - last.header.stamp_ns) * 1e-9
        if not seconds:
            return 0.0, 0.0
        (east_m, north_m), (before_east_m, before_north_m) = frame.pose[:2], last.pose[:2]
        return (east_m - before_east_m) / seconds, (north_m - before_north_m) / seconds


class AutoCast(Method):
    """Cars detect on board, and send each other what the others cannot see."""

    title = "AutoCast"

    def __init__(
        self,
        every_ns: Annotated[int, Bounds(above=0)] = 100 * NS_PER_MS,
        budget_bytes: Annotated[int, Bounds(minimum=0)] = 3_000,
        order: Literal["value", "random"] = "value",
        range_m: Annotated[float, Bounds(above=0)] = 300.0,
    ) -> None:
        """``budget``: the bytes of objects that a car sends in every interval (``every``).
        ``range``: how far it is heard.
        """
        self.range_m = range_m
        self.every_ns, self.budget_bytes, self.order = every_ns, budget_bytes, order

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        return HostConfig(detector=True, interceptor=partial(Caster, host, self))

    def on_edge(self, host: HostContext) -> HostConfig:
        return HostConfig()

    def wire(self, network: Network) -> None:
        connect(network, network.cars, (TOPIC,), Sidelink(range_m=self.range_m))
