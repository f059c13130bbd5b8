"""Tracks: objects that move with a nearly constant velocity, each with a Kalman filter of its own.

Both the map of the recommended Genie and the consumer that tracks are made of these.
"""

import functools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

from genie_sim.base.classes import MOVING_MPS, PERSONS, VEHICLES
from genie_sim.base.grid import Grid
from genie_sim.core.messages import Detection, Header

COAST_NS = 1_000_000_000  # assumed: so long a place is predicted after it was last seen
PARKED_NS = 1_000_000_000  # assumed: slower than MOVING_MPS for this long counts as parked
# Assumed: the standard deviation of a detected place, and the range from which on it grows in
# proportion to the range.
SIGMA_M, SIGMA_RANGE_M = 0.5, 20.0
# A sighting this near to a predicted place is always the object's; nearer tracks are one object: as
# the gate of the paper's map.
NEAR_M = 1.0


class Motion(NamedTuple):
    """What a map of tracks knows besides an object's place (``Detection.motion``).

    Parameters
    ----------
    velocity_mps : tuple of float
        East and north, in metres a second.
    sigma_m : float
        How uncertain the place is: a standard deviation in metres.
    existence : float
        How likely the object exists, from 0 to 1.
    seen_in : Header
        The newest frame in which a detector found it.
    """

    velocity_mps: tuple[float, float]
    sigma_m: float
    existence: float
    seen_in: Header


class MotionClass(NamedTuple):
    """How one group of classes moves: usual highest speed, standard deviation of the acceleration
    [m/s2], the farthest that a sighting may be from the predicted place (of car, bicycle and person
    Autoware's pruning distances), and half of the width that hides others; all others assumed.
    """

    group: str
    v_max_mps: float
    acceleration_mps2: float
    gate_m: float
    half_width_m: float


VEHICLE = MotionClass(
    "vehicle", v_max_mps=17.0, acceleration_mps2=2.0, gate_m=5.0, half_width_m=1.0
)
CYCLE = MotionClass("bicycle", v_max_mps=8.0, acceleration_mps2=1.5, gate_m=3.0, half_width_m=0.4)
PERSON = MotionClass("person", v_max_mps=3.0, acceleration_mps2=1.0, gate_m=2.0, half_width_m=0.3)
FIXED_OBJECT = MotionClass("", v_max_mps=0.0, acceleration_mps2=0.0, gate_m=2.0, half_width_m=0.2)
KINDS = dict.fromkeys((*VEHICLES, "train"), VEHICLE) | dict.fromkeys(PERSONS, PERSON)
KINDS |= {"bicycle": CYCLE, "motorcycle": CYCLE}
# lights, signs and street furniture
FIXED = ("traffic light", "stop sign", "fire hydrant", "bench", "parking meter", "potted plant")
KINDS |= {label: FIXED_OBJECT._replace(group=label) for label in FIXED}


@functools.cache
def kind_of(label: str) -> MotionClass:
    """How a class moves. Car, truck and bus are one group: detectors confuse them. An unknown class
    moves as persons do, in a group of its own. Each group is one object, which ``is`` compares.
    """
    return KINDS[label] if label in KINDS else PERSON._replace(group=label)


@dataclass(slots=True, eq=False)
class Track:
    """An object that moves: place and velocity at ``stamp_ns``, with one covariance for both axes.

    ``variance`` are those of place [m2], of place and velocity together, and of velocity [(m/s)2].
    ``existence`` is the probability that the object is there, at ``checked_ns``, when the last look
    at it was weighed. Each field has one writer: ``update``, ``ExistenceFilter`` or ``TrackMap``.
    """

    number: int
    kind: MotionClass
    label: str
    score: float
    east_m: float
    north_m: float
    up_m: float
    stamp_ns: int
    seen_in: Header
    variance: tuple[float, float, float]
    velocity_mps: tuple[float, float] = (0.0, 0.0)
    sightings: int = 1
    slow_since_ns: int | None = None
    seen_by_ns: dict[str, int] = field(default_factory=dict)  # newest stamp of each car's sightings
    range_m: float = 0.0  # from the camera of the last sighting
    # ExistenceFilter
    existence: float = 1.0
    checked_ns: int = 0
    log_survival: float = 0.0  # of the probability, per second that nobody looks
    # TrackMap
    grid: "Grid[Track] | None" = None  # that it is in
    cell: float = 0.0  # of that grid
    due_ns: int | None = None  # when its time may be over

    @property
    def seen_ns(self) -> int:
        """The stamp of the newest frame in which it was found."""
        return self.seen_in.stamp_ns

    @property
    def moving(self) -> bool:
        east, north = self.velocity_mps
        return east * east + north * north >= MOVING_MPS * MOVING_MPS

    @property
    def parked(self) -> bool:
        return self.slow_since_ns is not None and self.stamp_ns - self.slow_since_ns >= PARKED_NS

    @property
    def confidence(self) -> float:
        """As the log tells of it: how likely it exists."""
        return self.existence

    @property
    def location(self) -> tuple[float, float, float]:
        return self.east_m, self.north_m, self.up_m

    def place(self, now_ns: int) -> tuple[float, float]:
        """Where it is at another time: predicted for at most ``COAST_NS`` ahead, or back."""
        dt_ns = now_ns - self.stamp_ns
        if dt_ns > COAST_NS or dt_ns < -COAST_NS:
            dt_ns = COAST_NS if dt_ns > 0 else -COAST_NS
        (ve, vn), dt_s = self.velocity_mps, dt_ns * 1e-9
        return self.east_m + ve * dt_s, self.north_m + vn * dt_s

    def sigma_m(self, now_ns: int) -> float:
        """How uncertain its place is at a time, along each axis: a standard deviation."""
        return math.sqrt(self._predicted(abs(now_ns - self.stamp_ns) * 1e-9)[0])

    def update(self, sighting: Detection, range_m: float, header: Header) -> None:
        """A sighting so far from the camera, in the frame with this header. A late one moves
        nothing.
        """
        stamp_ns, sigma_m = header.stamp_ns, sigma_of(range_m)
        self.sightings += 1
        self.range_m = range_m
        self.seen_by_ns[header.origin] = max(stamp_ns, self.seen_by_ns.get(header.origin, stamp_ns))
        if stamp_ns > self.seen_in.stamp_ns:
            self.seen_in = header
        if stamp_ns < self.stamp_ns or sighting.location is None:
            return
        dt_ns = stamp_ns - self.stamp_ns
        dt_s = dt_ns * 1e-9
        east_m, north_m = self.place(stamp_ns)
        p, c, v = self._predicted(dt_s)
        total = p + sigma_m * sigma_m
        gain, speed_gain = p / total, c / total
        off_east_m, off_north_m = sighting.location[0] - east_m, sighting.location[1] - north_m
        self.east_m, self.north_m = east_m + gain * off_east_m, north_m + gain * off_north_m
        self.up_m = sighting.location[2]
        ve, vn = (
            self.velocity_mps[0] + speed_gain * off_east_m,
            self.velocity_mps[1] + speed_gain * off_north_m,
        )
        most = 2.0 * self.kind.v_max_mps
        if (speed := math.hypot(ve, vn)) > most:
            ve, vn = ve * most / speed, vn * most / speed
        self.velocity_mps = ve, vn
        self.variance = (1.0 - gain) * p, (1.0 - gain) * c, v - speed_gain * c
        self.stamp_ns = stamp_ns
        if self.moving:
            self.slow_since_ns = None
        elif self.slow_since_ns is None:
            self.slow_since_ns = stamp_ns

    def as_detection(self, now_ns: int, existence: float) -> Detection:
        """The object at its predicted place, as likely to exist as that."""
        east_m, north_m = self.place(now_ns)
        motion = Motion(self.velocity_mps, self.sigma_m(now_ns), existence, self.seen_in)
        place = (east_m, north_m, self.up_m)
        return Detection(
            self.label,
            self.score,
            box=None,
            location=place,
            confidence=existence,
            placed_by="map",
            motion=motion,
            seen_in=self.seen_in,
        )

    def _predicted(self, dt_s: float) -> tuple[float, float, float]:
        """The covariance after a time: white acceleration, constant over each step."""
        p, c, v = self.variance
        q = self.kind.acceleration_mps2**2 * dt_s * dt_s
        return (
            p + 2.0 * c * dt_s + v * dt_s * dt_s + q * dt_s * dt_s / 4.0,
            c + v * dt_s + q * dt_s / 2.0,
            v + q,
        )


def sigma_of(range_m: float) -> float:
    """How uncertain the place of a detection is that far from its camera."""
    return SIGMA_M * max(1.0, range_m / SIGMA_RANGE_M)
