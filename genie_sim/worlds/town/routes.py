"""How a car drives through the town on its way (``commuting``): in the right-hand lane, with stops
at junctions.

A course is a list of pieces, each with a constant curvature and a constant acceleration, so that
the place at any time is one formula.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.worlds.scene.frames import Motions
from genie_sim.worlds.scene.keys import LIGHT, crossing_key
from genie_sim.worlds.town.commuting import Commuting, Node
from genie_sim.worlds.town.rules import JUNCTION_M, LANE_M, TownRules

Pose = tuple[float, float, float]  # east, north [m], heading [rad]

# assumed: through right and left turns, and where the right has way
RIGHT_MPS, LEFT_MPS, CAREFUL_MPS = 3.0, 4.0, 5.5
# assumed: at a stop sign, and at least at a light for which a car braked, if green by then or not
STOP_S = 2.0
GREEN_S, CYCLE_S = 28.0, 60.0  # assumed: of a traffic light


class Phase(NamedTuple):
    """Some time [s] of a drive with a constant acceleration [m/s2], and the speed [m/s] at its
    beginning.
    """

    seconds: float
    speed_mps: float
    acceleration_mps2: float

    @property
    def way_m(self) -> float:
        return self.seconds * (self.speed_mps + 0.5 * self.acceleration_mps2 * self.seconds)


class Piece(NamedTuple):
    """Part of a course: when it begins [s] and where, cosine and sine of the heading there, how it
    bends [1/m], positive to the left, and how the car drives from then on.
    """

    begin_s: float
    pose: Pose
    cos: float
    sin: float
    curvature_per_m: float
    phase: Phase


class PiecewiseCourse:
    """Where a car is at each time (``scene.frames.Course``), by pieces."""

    def __init__(self) -> None:
        self._begins_s: list[float] = []
        self._pieces: list[Piece] = []

    def follow(
        self, begin_s: float, pose: Pose, curvature_per_m: float, phases: Sequence[Phase]
    ) -> float:
        """Goes on along a straight or an arc, phase after phase. Returns when it is at its end [s].

        Parameters
        ----------
        begin_s : when it is at the beginning
        pose : there
        curvature_per_m : of the way, positive to the left
        phases : how the car drives
        """
        gone_m = 0.0
        for phase in phases:
            here = _along(pose, curvature_per_m, gone_m)
            c, s = math.cos(here[2]), math.sin(here[2])
            self._begins_s.append(begin_s)
            self._pieces.append(Piece(begin_s, here, c, s, curvature_per_m, phase))
            begin_s += phase.seconds
            gone_m += phase.way_m
        return begin_s

    def at(self, t_s: Array) -> Motions:
        motions = [self._at(moment_s) for moment_s in t_s.tolist()]
        return Motions._make(np.array(motions).reshape(-1, 6).T)

    def _at(self, t_s: float) -> tuple[float, ...]:
        """The motion at one time. Sines are not numpy's, whose last bit is another one on other
        processors.
        """
        number = max(bisect_right(self._begins_s, t_s) - 1, 0)
        begin_s, pose, c, s, curvature_per_m, phase = self._pieces[number]
        passed_s = t_s - begin_s
        way_m = passed_s * (phase.speed_mps + 0.5 * phase.acceleration_mps2 * passed_s)
        speed_mps = phase.speed_mps + phase.acceleration_mps2 * passed_s
        if curvature_per_m == 0.0:  # mostly; its sine and cosine are known
            east_m, north_m, heading_rad = pose
            return east_m + way_m * c, north_m + way_m * s, heading_rad, c, s, speed_mps
        pose = _along(pose, curvature_per_m, way_m)
        return *pose, math.cos(pose[2]), math.sin(pose[2]), speed_mps


def green_at(node: Node, northbound: bool, t_s: float) -> float:
    """When a light at a junction is green for those who drive along one axis: now, or the time [s]
    it turns so.
    """
    offset_s = LIGHT.share(crossing_key(*node)) * CYCLE_S + (CYCLE_S / 2 if northbound else 0.0)
    phase_s = (t_s + offset_s) % CYCLE_S
    return t_s if phase_s < GREEN_S else t_s + CYCLE_S - phase_s


class Crossing(NamedTuple):
    """The junction at the end of a leg, for a car that comes along it and goes on to another.

    ``turn`` is 1 to the left, 0 straight on, -1 to the right; ``through_mps`` is the highest speed
    across it. Who comes has a light, a stop sign, or neither.
    """

    node: Node
    northbound: bool
    turn: int
    through_mps: float
    has_light: bool
    has_stop_sign: bool

    @property
    def curvature_per_m(self) -> float:
        return self.turn / (JUNCTION_M + self.turn * LANE_M)

    @property
    def length_m(self) -> float:
        """Of the way across it: straight, or a quarter of a circle."""
        return abs(math.pi / 2 / self.curvature_per_m) if self.turn else 2 * JUNCTION_M


def drive(
    commuting: Commuting, random: np.random.Generator, begin_s: float, end_s: float
) -> PiecewiseCourse:
    """The course of one car from ``begin_s`` on; it knows its place at least until ``end_s``.

    A leg is a straight from one junction to the next, and the way across that one.
    """
    course, rules = PiecewiseCourse(), commuting.rules
    nodes = commuting.trip(random)
    start, end = next(nodes), next(nodes)
    t_s, speed_mps = begin_s, commuting.limit_mps(start, end)
    # The first leg starts anywhere from which a stop at its end is still possible.
    straight_m = rules.block_m - 2 * JUNCTION_M
    room_m = straight_m - speed_mps**2 / (2 * rules.braking_mps2) - 1.0
    skipped_m = float(random.random()) * max(0.0, room_m)
    while t_s <= end_s:
        beyond = next(nodes)
        crossing = _crossing(commuting, start, end, beyond)
        pose, length_m = _entry(rules, start, end, skipped_m), straight_m - skipped_m
        limit_mps = commuting.limit_mps(start, end)
        through_mps = crossing.through_mps
        phases, end_mps = _phases(rules, length_m, limit_mps, ends_mps=(speed_mps, through_mps))
        arrival_s = t_s + math.fsum(phase.seconds for phase in phases)
        free_s = arrival_s
        if crossing.has_light:
            free_s = green_at(crossing.node, crossing.northbound, arrival_s)
        stops = crossing.has_stop_sign or free_s > arrival_s
        if stops:
            phases, end_mps = _phases(rules, length_m, limit_mps, ends_mps=(speed_mps, 0.0))
        t_s = course.follow(t_s, pose, 0.0, phases)
        pose = _along(pose, 0.0, length_m)
        if stops:
            waits_s = max(STOP_S, free_s - t_s)
            if crossing.has_light and t_s + waits_s - free_s >= GREEN_S:  # it braked for too long
                waits_s = green_at(crossing.node, crossing.northbound, t_s + waits_s) - t_s
            t_s = course.follow(t_s, pose, 0.0, [Phase(waits_s, 0.0, 0.0)])
        phases, speed_mps = _phases(
            rules, crossing.length_m, through_mps, ends_mps=(end_mps, through_mps)
        )
        t_s = course.follow(t_s, pose, crossing.curvature_per_m, phases)
        start, end, skipped_m = end, beyond, 0.0
    return course


def _direction(start: Node, end: Node) -> Node:
    """One step from a junction towards its neighbour."""
    return end[0] - start[0], end[1] - start[1]


def _crossing(commuting: Commuting, start: Node, end: Node, beyond: Node) -> Crossing:
    """How a car that comes from ``start`` passes ``end`` on its way to ``beyond``."""
    rules = commuting.rules
    (i, j), (next_i, next_j) = _direction(start, end), _direction(end, beyond)
    turn = i * next_j - j * next_i
    northbound = i == 0
    streets = rules.main(end[0]), rules.main(end[1])
    on_main, crosses_main = streets if northbound else streets[::-1]
    through_mps = min(commuting.limit_mps(start, end), commuting.limit_mps(end, beyond))
    if turn:
        through_mps = min(through_mps, LEFT_MPS if turn > 0 else RIGHT_MPS)
    elif not on_main and not crosses_main:
        through_mps = min(through_mps, CAREFUL_MPS)
    return Crossing(
        node=end,
        northbound=northbound,
        turn=turn,
        through_mps=through_mps,
        has_light=on_main and crosses_main,
        has_stop_sign=crosses_main and not on_main,
    )


def _entry(rules: TownRules, start: Node, end: Node, skipped_m: float) -> Pose:
    """Where the straight of a leg begins, or ``skipped_m`` later: in the right-hand lane."""
    ahead_m = JUNCTION_M + skipped_m
    i, j = _direction(start, end)
    east_m = start[0] * rules.block_m + i * ahead_m + j * LANE_M
    north_m = start[1] * rules.block_m + j * ahead_m - i * LANE_M
    return east_m, north_m, math.atan2(j, i)


def _phases(
    rules: TownRules, length_m: float, limit_mps: float, *, ends_mps: tuple[float, float]
) -> tuple[list[Phase], float]:
    """The phases of a way: faster, evenly, slower; braking begins at the peak. Together they are as
    long as the way. And the speed at its end: the wanted one, or what is reached until there.

    From 3 to 4 m/s on 50 m under a limit of 14 m/s, by 1.5 and 2 m/s2: a peak of 9.9 m/s, 29.6 m
    after the beginning and 20.4 m before the end.

    Parameters
    ----------
    rules : of the town: how a car accelerates and brakes
    length_m : of the way, on which the car can brake from the first speed to the last: a block is
        as long (``TownRules``), and nobody drives on to a junction faster than through it
    limit_mps : the speed limit; neither end is above it
    ends_mps : the speed at the beginning, and the one that is wanted at the end
    """
    first, wanted = ends_mps
    a, b = rules.acceleration_mps2, rules.braking_mps2
    last = min(wanted, math.sqrt(first**2 + 2 * a * length_m))
    reachable = (2 * a * b * length_m + b * first**2 + a * last**2) / (a + b)
    peak = max(first, last, min(limit_mps, math.sqrt(reachable)))
    faster_m, slower_m = (peak**2 - first**2) / (2 * a), (peak**2 - last**2) / (2 * b)
    even_m = max(0.0, length_m - faster_m - slower_m)
    phases = [
        Phase((peak - first) / a, first, a),
        Phase(even_m / peak, peak, 0.0),
        Phase((peak - last) / b, peak, -b),
    ]
    return [phase for phase in phases if phase.seconds > 0], last


def _along(pose: Pose, curvature_per_m: float, way_m: float) -> Pose:
    """So far along a straight or an arc."""
    east_m, north_m, heading_rad = pose
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    if curvature_per_m == 0.0:
        return east_m + way_m * c, north_m + way_m * s, heading_rad
    after_rad = heading_rad + curvature_per_m * way_m
    return (
        east_m + (math.sin(after_rad) - s) / curvature_per_m,
        north_m - (math.cos(after_rad) - c) / curvature_per_m,
        after_rad,
    )
