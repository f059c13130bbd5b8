"""A fleet expanded: the cells of its map, every car with its drive, and when it changes from edge
to edge.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import accumulate

from genie_sim.base.errors import as_user_error
from genie_sim.base.grid import Area, cell_counts
from genie_sim.base.plugins import Choice
from genie_sim.base.units import NS_PER_MS
from genie_sim.data.frame_source import Drive, Drives
from genie_sim.scenario.faults import FaultEntry
from genie_sim.scenario.fleet import MAX_EDGES, Fleet
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.settings import Car, Edge, Route

# How often a car looks which edge is nearest. As long as another cell must be the better one before
# a hand-over within LTE or 5G begins, commonly 480 ms [S: 5g6gacademy.com, 5G handover procedure,
# time to trigger of event A3].
CHECK_NS = 480 * NS_PER_MS
GOLDEN = (math.sqrt(5) - 1) / 2


class Cells:
    """A grid of equal cells over a map, as many of about ``cell_m`` as fit it best."""

    def __init__(self, extent_m: Area, cell_m: float) -> None:
        self._west_m, self._south_m, east_m, north_m = extent_m
        size_m = east_m - self._west_m, north_m - self._south_m
        self.columns, self.rows = cell_counts(extent_m, cell_m)
        self._width_m, self._height_m = size_m[0] / self.columns, size_m[1] / self.rows

    def __len__(self) -> int:
        return self.columns * self.rows

    def name(self, cell: int) -> str:
        row, column = divmod(cell, self.columns)
        digits = len(str(max(self.columns, self.rows) - 1))
        return f"edge_{column:0{digits}d}_{row:0{digits}d}"

    def at(self, east_m: float, north_m: float) -> int:
        """The cell whose middle is nearest; outside the map the nearest of its rim."""
        column = min(max(int((east_m - self._west_m) // self._width_m), 0), self.columns - 1)
        row = min(max(int((north_m - self._south_m) // self._height_m), 0), self.rows - 1)
        return row * self.columns + column

    def middle(self, cell: int) -> tuple[float, float]:
        """East and north of the middle of a cell [m]."""
        row, column = divmod(cell, self.columns)
        return (
            self._west_m + (column + 0.5) * self._width_m,
            self._south_m + (row + 0.5) * self._height_m,
        )

    def distance_m(self, cell: int, east_m: float, north_m: float) -> float:
        """To the middle of a cell."""
        middle_east_m, middle_north_m = self.middle(cell)
        return math.hypot(east_m - middle_east_m, north_m - middle_north_m)

    def neighbours(self, cell: int) -> list[int]:
        """The cells that share a border with this one, at most four: over a corner hardly a car
        changes.
        """
        row, column = divmod(cell, self.columns)
        beside = ((row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column))
        return [
            r * self.columns + c for r, c in beside if 0 <= r < self.rows and 0 <= c < self.columns
        ]

    def passed(
        self,
        position: Callable[[int], tuple[float, float]],
        duration_ns: int,
        hysteresis_m: float,
        gap_ns: int,
    ) -> list[tuple[int, int]]:
        """The cell that a car is in at first and each that it is handed over to: (since when [ns],
        cell).

        Parameters
        ----------
        position : callable
            Gives east and north [m] at a time [ns].
        duration_ns : int
            How long the car drives.
        hysteresis_m : float
            By how much the middle of another cell must be nearer.
        gap_ns : int
            How long a hand-over takes; no other begins in that time.
        """
        cell = self.at(*position(0))
        cells = [(0, cell)]
        free_ns = 0
        for t_ns in range(0, duration_ns, CHECK_NS):
            if t_ns < free_ns:
                continue
            east_m, north_m = position(t_ns)
            nearest = self.at(east_m, north_m)
            if nearest == cell:
                continue
            gain_m = self.distance_m(cell, east_m, north_m)
            gain_m -= self.distance_m(nearest, east_m, north_m)
            if gain_m > hysteresis_m:
                cell = nearest
                free_ns = t_ns + gap_ns
                cells.append((t_ns, cell))
        return cells


def with_fleet(
    scenario: Scenario, fleet: Fleet, frames: Drives
) -> tuple[Scenario, dict[str, Drive]]:
    """The scenario with the fleet's cars and edges and its hand-overs, and the drive of each car.

    Raises ``UserError`` for a source that is no map, and for a car that is nowhere.
    """
    if frames.extent_m is None:
        raise scenario.error_at("fleet", "needs a town to drive in: 'perception: {source: town}'")
    starts_ns = frames.starts_ns()
    if starts_ns is None:
        if fleet.cars is None:
            raise scenario.error_at("fleet.cars", "missing")
        starts_ns = {f"car{number}": 0 for number in range(1, fleet.cars + 1)}
    elif fleet.cars is not None:
        text = f"{scenario.perception.name} has {len(starts_ns):,} cars of its own: leave it out"
        raise scenario.error_at("fleet.cars", text)
    west_m, south_m, east_m, north_m = frames.extent_m
    if not (west_m < east_m and south_m < north_m):
        raise scenario.error_at("fleet", f"the map has no extent: {frames.extent_m} [m]")
    cells = Cells(frames.extent_m, fleet.cell_m)
    if cells.columns * cells.rows > MAX_EDGES:  # `len` ends at 2^63
        text = f"makes more than {MAX_EDGES:,} edges of this map"
        raise scenario.error_at("fleet.cell", text)
    names = [cells.name(cell) for cell in range(len(cells))]
    edges = tuple(
        Edge(
            name=names[cell],
            device=fleet.edge_device,
            neighbours=tuple(names[other] for other in cells.neighbours(cell)),
            at_m=cells.middle(cell),
        )
        for cell in range(len(cells))
    )
    cars: list[Car] = []
    drives: dict[str, Drive] = {}
    hand_overs = list(scenario.faults)
    devices = device_of_each(fleet.devices, len(starts_ns))
    for (name, route_ns), device in zip(starts_ns.items(), devices, strict=True):
        route = Route(start_ns=route_ns)
        start_ns = scenario.start_ns(Car(name, device, route=route))
        drive = frames.drive(name, None, start_ns)
        if drive.position is None:
            text = f"the drive of {name} has no position at any time"
            raise scenario.error_at("fleet", text)
        drives[name] = drive
        with as_user_error(
            f"{scenario.name}: {name} is at no place of the map", ValueError, OverflowError
        ):
            (_, first), *others = cells.passed(
                drive.position, drive.duration_ns, fleet.hysteresis_m, fleet.hand_over_gap_ns
            )
        hand_overs += [
            _hand_over(name, names[cell], start_ns + since_ns, fleet) for since_ns, cell in others
        ]
        cars.append(Car(name, device, edge=names[first], link=fleet.link, route=route))
    whole = replace(scenario, cars=tuple(cars), edges=edges, faults=tuple(hand_overs))
    return whole, drives


def _hand_over(car: str, edge: str, begin_ns: int, fleet: Fleet) -> FaultEntry:
    fault = Choice("hand_over", {"target": car, "edge": edge, "gap_ns": fleet.hand_over_gap_ns})
    return FaultEntry(fault=fault, begin_ns=begin_ns)


def device_of_each(shares: Mapping[str, float], cars: int) -> Iterator[str]:
    """The device of one car after the other, each as often as its share says: multiples of the
    golden ratio spread evenly over the shares, so that one more car changes no other's device.
    """
    names, ends = list(shares), list(accumulate(shares.values()))
    for number in range(cars):
        place = number * GOLDEN % 1.0
        yield next((name for name, end in zip(names, ends, strict=True) if place < end), names[-1])
