"""How a car drives through the town: from destination to destination, in the right-hand lane, with
stops at junctions.

A drive is a list of pieces, each with a constant curvature and a constant acceleration, so that the
place at any time is one formula.
"""

import functools
import math
from bisect import bisect_right
from collections.abc import Iterator
from itertools import accumulate

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from genie_sim.worlds.scene.noise import LIGHT, mix
from genie_sim.worlds.town.rules import JUNCTION_M, LANE_M, TownRules

Node = tuple[int, int]  # the crossing of the i-th street from the west and the j-th from the south

Place = tuple[float, float, float]  # east, north [m], heading [rad]

# assumed: through right and left turns, and where the right has way
RIGHT_MPS, LEFT_MPS, CAREFUL_MPS = 3.0, 4.0, 5.5
STOP_S = 2.0  # assumed: at a stop sign
GREEN_S, CYCLE_S = 28.0, 60.0  # assumed: of a traffic light


class Course:
    """Where a car is at each time: pieces (east, north, heading, curvature [1/m], speed,
    acceleration).
    """

    __slots__ = ("_begin_s", "_pieces")

    def __init__(self) -> None:
        self._begin_s: list[float] = []
        self._pieces: list[tuple[float, float, float, float, float, float, float, float]] = []

    def add(
        self,
        begin_s: float,
        place: Place,
        speed: float,
        *,
        acceleration: float = 0.0,
        curvature: float = 0.0,
    ) -> None:
        """Adds a piece that begins at a time and a place, behind the pieces before it.

        Parameters
        ----------
        begin_s : when it begins [s]
        place : where
        speed : at first [m/s]
        acceleration : of the whole piece [m/s2]
        curvature : of the whole piece [1/m], positive to the left
        """
        east_m, north_m, heading = place
        self._begin_s.append(begin_s)
        turn = math.cos(heading), math.sin(heading)
        self._pieces.append((east_m, north_m, heading, *turn, curvature, speed, acceleration))

    def at(self, t_s: float) -> tuple[float, float, float, float, float, float]:
        """East, north [m], heading [rad], its cosine and sine, and speed [m/s]."""
        i = bisect_right(self._begin_s, t_s) - 1
        if i < 0:
            i = 0
        east_m, north_m, heading, c, s, curvature, speed, acceleration = self._pieces[i]
        dt = t_s - self._begin_s[i]
        way_m = dt * (speed + 0.5 * acceleration * dt)
        speed += acceleration * dt
        if curvature == 0.0:
            return east_m + way_m * c, north_m + way_m * s, heading, c, s, speed
        heading += curvature * way_m
        c2, s2 = math.cos(heading), math.sin(heading)
        return east_m + (s2 - s) / curvature, north_m - (c2 - c) / curvature, heading, c2, s2, speed


class Commuting:
    """Who goes where: popular destinations, and the quickest way to each from every junction."""

    def __init__(self, rules: TownRules, random: np.random.Generator) -> None:
        self.rules = rules
        self._east, self._north = rules.blocks
        self._nodes = [(i, j) for i in range(self._east + 1) for j in range(self._north + 1)]
        count = min(rules.destinations, len(self._nodes))
        order = random.permutation(len(self._nodes)).tolist()
        self._destinations: list[Node] = [self._nodes[k] for k in order[:count]]
        weights = [(k + 1) ** -rules.popularity for k in range(count)]
        self._shares = [share / math.fsum(weights) for share in accumulate(weights)]
        self._away = functools.cache(self._seconds_to)

    def destination(self, draw: float) -> Node:
        """The destination that a number in [0, 1) stands for."""
        return self._destinations[
            min(bisect_right(self._shares, draw), len(self._destinations) - 1)
        ]

    def neighbours(self, node: Node) -> Iterator[Node]:
        for way_i, way_j in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            i, j = node[0] + way_i, node[1] + way_j
            if 0 <= i <= self._east and 0 <= j <= self._north:
                yield i, j

    def limit_mps(self, a: Node, b: Node) -> float:
        return self.rules.limit_mps(a[1] if a[1] == b[1] else a[0])

    def after(self, before: Node | None, node: Node, destination: Node) -> Node:
        """The next junction on the quickest way; straight on rather than a turn that gains nothing,
        never back.
        """
        away_s = self._away(destination)
        straight_on = before and (2 * node[0] - before[0], 2 * node[1] - before[1])

        def cost(neighbour: Node) -> float:
            cost_s = self.rules.block_m / self.limit_mps(node, neighbour) + away_s[neighbour]
            return cost_s if neighbour == straight_on or before is None else cost_s + 1e-3

        return min(
            (neighbour for neighbour in self.neighbours(node) if neighbour != before),
            key=cost,
            default=node,
        )

    def _seconds_to(self, destination: Node) -> dict[Node, float]:
        """Seconds from every junction to a destination."""
        numbers = {node: number for number, node in enumerate(self._nodes)}
        seconds = dijkstra(self._seconds, indices=numbers[destination]).tolist()
        return dict(zip(self._nodes, seconds, strict=True))

    @functools.cached_property
    def _seconds(self) -> csr_array:
        """From each junction to its neighbours."""
        numbers = {node: number for number, node in enumerate(self._nodes)}
        legs = [(a, b) for a in self._nodes for b in self.neighbours(a)]
        seconds = [self.rules.block_m / self.limit_mps(a, b) for a, b in legs]
        rows, columns = np.array([[numbers[a], numbers[b]] for a, b in legs]).T
        return csr_array((seconds, (rows, columns)), shape=(len(numbers), len(numbers)))

    def trip(self, random: np.random.Generator) -> Iterator[Node]:
        """The junctions that a car passes, without end: it starts anywhere on the way to its first
        destination.
        """
        draws = random.random(3).tolist()
        node = (int(draws[0] * (self._east + 1)), int(draws[1] * (self._north + 1)))
        destination = self.destination(draws[2])
        while destination == node:
            destination = (
                self.destination(float(random.random()))
                if len(self._destinations) > 1
                else self._other(node)
            )
        way, before = [node], None
        while node != destination:
            before, node = node, self.after(before, node, destination)
            way.append(node)
        first = int(float(random.random()) * (len(way) - 1))
        yield from way[first:]
        while True:
            destination = self.destination(float(random.random()))
            if destination == node:
                destination = self._other(node)
            for _ in range(4 * (self._east + self._north + 2)):
                if node == destination:
                    break
                before, node = node, self.after(before, node, destination)
                yield node

    def _other(self, node: Node) -> Node:
        mirrored = (self._east - node[0], self._north - node[1])
        return mirrored if mirrored != node else (0, 0)


def green_at(node: Node, northbound: bool, t_s: float) -> float:
    """When a light at a junction is green for those who drive along one axis: now, or the time [s]
    it turns so.
    """
    offset_s = LIGHT.share(mix(node[0] << 20 | node[1])) * CYCLE_S + (
        CYCLE_S / 2 if northbound else 0.0
    )
    phase_s = (t_s + offset_s) % CYCLE_S
    return t_s if phase_s < GREEN_S else t_s + CYCLE_S - phase_s


def drive(
    commuting: Commuting, random: np.random.Generator, begin_s: float, end_s: float
) -> Course:
    """The course of one car from ``begin_s`` on; it knows its place at least until ``end_s``."""
    course, rules = Course(), commuting.rules
    nodes = commuting.trip(random)
    leg_start, leg_end = next(nodes), next(nodes)
    straight_m = rules.block_m - 2 * JUNCTION_M
    t_s, speed = begin_s, commuting.limit_mps(leg_start, leg_end)
    # The first leg starts anywhere from which a stop at its end is still possible.
    offset_m = float(random.random()) * max(
        0.0, straight_m - speed**2 / (2 * rules.braking_mps2) - 1.0
    )
    while t_s <= end_s:
        beyond = next(nodes)
        limit = commuting.limit_mps(leg_start, leg_end)
        way = (leg_end[0] - leg_start[0], leg_end[1] - leg_start[1])
        next_way = (beyond[0] - leg_end[0], beyond[1] - leg_end[1])
        turn = way[0] * next_way[1] - way[1] * next_way[0]  # 1 left, -1 right
        through = min(limit, commuting.limit_mps(leg_end, beyond))
        crossing = rules.main(leg_end[0]), rules.main(leg_end[1])
        main, other_main = crossing if way[0] == 0 else crossing[::-1]
        if turn:
            through = LEFT_MPS if turn > 0 else RIGHT_MPS
        elif not main and not other_main:
            through = min(through, CAREFUL_MPS)
        place = _entry(rules, leg_start, way, offset_m)
        length_m = straight_m - offset_m
        wait_until_s: float | None = 0.0 if other_main else None
        if main and other_main:
            unhindered = _phases(rules, length_m, first=speed, last=through, limit=limit)
            arrival_s = t_s + math.fsum(seconds for seconds, _, _ in unhindered)
            green_s = green_at(leg_end, way[0] == 0, arrival_s)
            wait_until_s = green_s if green_s > arrival_s else None
        gone_m, begin = 0.0, place
        last = through if wait_until_s is None else 0.0
        phases = _phases(rules, length_m, first=speed, last=last, limit=limit)
        for seconds, at_first, acceleration in phases:
            course.add(t_s, _along(begin, 0.0, gone_m), at_first, acceleration=acceleration)
            t_s += seconds
            gone_m += seconds * (at_first + 0.5 * acceleration * seconds)
        place, speed = _along(begin, 0.0, length_m), through
        if wait_until_s is not None:
            course.add(t_s, place, 0.0)
            t_s, speed = max(t_s + STOP_S, wait_until_s), 0.0
        t_s, speed = _cross_junction(
            course, place, turn, rules.acceleration_mps2, t_s=t_s, speed=speed, through=through
        )
        leg_start, leg_end, offset_m = leg_end, beyond, 0.0
    return course


def _entry(rules: TownRules, leg_start: Node, way: Node, offset_m: float) -> Place:
    """Where the straight part of a leg begins, or ``offset_m`` later: in the right-hand lane."""
    ahead_m = JUNCTION_M + offset_m
    east_m = leg_start[0] * rules.block_m + way[0] * ahead_m + way[1] * LANE_M
    north_m = leg_start[1] * rules.block_m + way[1] * ahead_m - way[0] * LANE_M
    return east_m, north_m, math.atan2(way[1], way[0])


def _phases(
    rules: TownRules, length_m: float, *, first: float, last: float, limit: float
) -> list[tuple[float, float, float]]:
    """Of a straight part: seconds, speed at first and acceleration of each phase; braking begins at
    the peak.

    Parameters
    ----------
    rules : of the town: how a car accelerates and brakes
    length_m : of the straight part
    first, last : speed at its two ends [m/s]
    limit : the speed limit [m/s]
    """
    a, b = rules.acceleration_mps2, rules.braking_mps2
    reachable = (2 * a * b * length_m + b * first**2 + a * last**2) / (a + b)
    peak = max(first, last, min(limit, math.sqrt(reachable)))
    faster_m, slower_m = (peak**2 - first**2) / (2 * a), (peak**2 - last**2) / (2 * b)
    even_m = max(0.0, length_m - faster_m - slower_m)
    phases = [
        ((peak - first) / a, first, a),
        (even_m / peak, peak, 0.0),
        ((peak - last) / b, peak, -b),
    ]
    return [phase for phase in phases if phase[0] > 0]


def _cross_junction(
    course: Course,
    place: Place,
    turn: int,
    acceleration: float,
    *,
    t_s: float,
    speed: float,
    through: float,
) -> tuple[float, float]:
    """Adds the way across a junction, straight or a quarter of a circle. Returns time [s] and speed
    [m/s] at its end.

    Parameters
    ----------
    course : to which the way is added
    place : where it begins
    turn : 1 to the left, 0 straight on, -1 to the right
    acceleration : up to the speed ``through`` [m/s2]
    t_s : when it begins
    speed : at its beginning [m/s]
    through : the highest speed across the junction [m/s]
    """
    radius_m = JUNCTION_M + turn * LANE_M
    length_m = radius_m * math.pi / 2 if turn else 2 * JUNCTION_M
    curvature = turn / radius_m
    gone_m = 0.0
    if speed < through:
        reached = min(through, math.sqrt(speed**2 + 2 * acceleration * length_m))
        course.add(t_s, place, speed, acceleration=acceleration, curvature=curvature)
        gone_m = (reached**2 - speed**2) / (2 * acceleration)
        t_s += (reached - speed) / acceleration
        speed = reached
    if gone_m < length_m - 1e-9:
        course.add(t_s, _along(place, curvature, gone_m), speed, curvature=curvature)
        t_s += (length_m - gone_m) / speed
    return t_s, speed


def _along(place: Place, curvature: float, way_m: float) -> Place:
    east_m, north_m, heading = place
    if curvature == 0.0:
        return east_m + way_m * math.cos(heading), north_m + way_m * math.sin(heading), heading
    after = heading + curvature * way_m
    return (
        east_m + (math.sin(after) - math.sin(heading)) / curvature,
        north_m - (math.cos(after) - math.cos(heading)) / curvature,
        after,
    )
