"""A fleet expanded: the cells of its town, every car with its drive, and when it changes from edge to edge."""

import math
from collections.abc import Callable, Iterator
from itertools import accumulate

from genie_sim.perception.sources import Drive, Frames
from genie_sim.plugins import Choice
from genie_sim.scenario.faults import FaultEntry
from genie_sim.scenario.fleet import Fleet
from genie_sim.scenario.parts import Car, Edge, Route
from genie_sim.scenario.scenario import Scenario
from genie_sim.town.source import InTown
from genie_sim.town.town import Drive as TownDrive
from genie_sim.units import NS_PER_MS

# How often a car looks which edge is nearest. As long as another cell must be the better one before a hand-over within
# LTE or 5G begins, commonly 480 ms [S: 5g6gacademy.com, 5G handover procedure, time to trigger of event A3].
CHECK_NS = 480 * NS_PER_MS
GOLDEN = (math.sqrt(5) - 1) / 2


class Cells:
    """A grid of equal cells over a town that begins at (0, 0), as many of about ``cell_m`` as fit it best."""

    def __init__(self, size_m: tuple[float, float], cell_m: float) -> None:
        self.columns, self.rows = (max(1, round(length_m / cell_m)) for length_m in size_m)
        self._width_m, self._height_m = size_m[0] / self.columns, size_m[1] / self.rows

    def __len__(self) -> int:
        return self.columns * self.rows

    def name(self, cell: int) -> str:
        row, column = divmod(cell, self.columns)
        digits = len(str(max(self.columns, self.rows) - 1))
        return f"edge_{column:0{digits}d}_{row:0{digits}d}"

    def at(self, east_m: float, north_m: float) -> int:
        """The cell whose middle is nearest; outside the town the nearest of its rim."""
        column = min(max(int(east_m // self._width_m), 0), self.columns - 1)
        row = min(max(int(north_m // self._height_m), 0), self.rows - 1)
        return row * self.columns + column

    def distance_m(self, cell: int, east_m: float, north_m: float) -> float:
        """To the middle of a cell."""
        row, column = divmod(cell, self.columns)
        return math.hypot(
            east_m - (column + 0.5) * self._width_m, north_m - (row + 0.5) * self._height_m
        )

    def neighbours(self, cell: int) -> list[int]:
        """The cells that share a border with this one, at most four: over a corner hardly a car changes."""
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
        """The cell that a car is in at first and each that it is handed over to: (since when [ns], cell).

        ``position`` gives east and north [m] at a time [ns]; while a hand-over takes its ``gap_ns`` no other begins.
        """
        here = self.at(*position(0))
        found = [(0, here)]
        free_ns = 0
        for t_ns in range(0, duration_ns, CHECK_NS):
            if t_ns < free_ns:
                continue
            east_m, north_m = position(t_ns)
            nearest = self.at(east_m, north_m)
            if nearest == here:
                continue
            if (
                self.distance_m(here, east_m, north_m) - self.distance_m(nearest, east_m, north_m)
                > hysteresis_m
            ):
                here = nearest
                free_ns = t_ns + gap_ns
                found.append((t_ns, here))
        return found


def expanded(
    scenario: Scenario, fleet: Fleet, source: InTown, frames: Frames
) -> tuple[Scenario, dict[str, Drive]]:
    """The scenario with the fleet's cars and edges and its hand-overs, and the drive of each car.

    Nothing is validated: a fleet makes no mistakes of spelling, and 10,000 cars would take their time.
    """
    blocks, block_m = source.town.blocks, source.town.block_m
    cells = Cells((blocks[0] * block_m, blocks[1] * block_m), fleet.cell_m)
    names = [cells.name(cell) for cell in range(len(cells))]
    edges = tuple(
        Edge.model_construct(
            name=names[cell],
            device=fleet.edge_device,
            neighbours=tuple(names[other] for other in cells.neighbours(cell)),
        )
        for cell in range(len(cells))
    )
    cars: list[Car] = []
    drives: dict[str, Drive] = {}
    hand_overs = list(scenario.faults)
    usual = Car.model_construct(
        name="", device="", link=fleet.link, route=Route(), cameras=True, genie=True
    )
    for number, device in enumerate(device_of_each(fleet), 1):
        name = f"car{number}"
        car = usual.model_copy(update={"name": name, "device": device})
        start_ns = scenario.start_ns(car)
        mine = frames.drive(name, None, start_ns)
        assert isinstance(mine, TownDrive), "a fleet drives in a town"
        drives[name] = mine
        passed = cells.passed(
            mine.position, source.duration_ns, fleet.hysteresis_m, fleet.hand_over_gap_ns
        )
        (_, first), *others = passed
        hand_overs += [
            _hand_over(name, names[cell], start_ns + since_ns, fleet) for since_ns, cell in others
        ]
        cars.append(car.model_copy(update={"edge": names[first]}))
    return scenario.model_copy(
        update={"cars": tuple(cars), "edges": edges, "faults": tuple(hand_overs)}
    ), drives


def _hand_over(car: str, edge: str, begin_ns: int, fleet: Fleet) -> FaultEntry:
    fault = Choice("hand_over", {"target": car, "edge": edge, "gap_ns": fleet.hand_over_gap_ns})
    return FaultEntry.model_construct(fault=fault, begin_ns=begin_ns)


def device_of_each(fleet: Fleet) -> Iterator[str]:
    """The device of one car after the other, each as often as its share says: multiples of the golden ratio spread
    evenly over the shares, so that one more car changes no other's device."""
    names, ends = list(fleet.devices), list(accumulate(fleet.devices.values()))
    for number in range(fleet.cars):
        place = number * GOLDEN % 1.0
        yield next((name for name, end in zip(names, ends, strict=True) if place < end), names[-1])
