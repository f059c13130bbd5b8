"""Items that stay where they are, found by place: the nearest, all at a place, all in a sector."""

from collections.abc import Iterable, Iterator
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from genie_sim.base.grid import Area, Cell, Grid, area_around

Item = TypeVar("Item")
# Side of the cells for what is within reach. An item is in 2.3 cells of this size, and in 4 of half
# of it.
CELL_REACHES = 4.0
MARGIN = 1.01  # of the reach with which these cells list an item: room for rounding


class PlaceIndex(Generic[Item]):
    """Items of some kinds by their places on the ground plane, in metres.

    Parameters
    ----------
    cell_m : float
        Side of the square cells in whose order a sector's items come.
    reach_m : float
        An item is at every place that is at most so far away.
    """

    def __init__(self, cell_m: float, reach_m: float) -> None:
        self._reach_m, self._reach2_m2 = MARGIN * reach_m, reach_m**2
        self._grid: Grid[tuple[float, float, Item]] = Grid(cell_m)
        self._places: dict[Cell, npt.NDArray[np.float64]] = {}  # (n, 2): of the items in a cell
        # Every cell lists the items within reach of it, so that a look-up reads one cell.
        self._within_reach: Grid[tuple[float, float, str, Item]] = Grid(CELL_REACHES * reach_m)

    def __iter__(self) -> Iterator[Item]:
        return (item for _, _, item in self._grid)

    def add(self, item: Item, kind: str, east_m: float, north_m: float) -> None:
        """Puts an item at a place."""
        cell = self._grid.cell(east_m, north_m)
        self._grid.add(cell, (east_m, north_m, item))
        if cell in self._places:
            self._places[cell] = np.concatenate((self._places[cell], [(east_m, north_m)]))
        for cell in self._cells(east_m, north_m):
            self._within_reach.add(cell, (east_m, north_m, kind, item))

    def remove(self, item: Item, kind: str, east_m: float, north_m: float) -> None:
        """Takes an item from its place. Raises KeyError or ValueError if it is not there."""
        cell = self._grid.cell(east_m, north_m)
        self._grid.remove(cell, (east_m, north_m, item))
        self._places.pop(cell, None)
        for cell in self._cells(east_m, north_m):
            self._within_reach.remove(cell, (east_m, north_m, kind, item))

    def nearest(self, kind: str | None, east_m: float, north_m: float) -> Item | None:
        """The nearest item of a kind (``None``: of any) at a place, of equally near ones the one
        that was added first.
        """
        nearest, nearest2_m2 = None, self._reach2_m2
        for there_east_m, there_north_m, kind_there, item in self._within_reach.at(east_m, north_m):
            if kind_there == kind or kind is None:
                away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
                distance2_m2 = away_east_m * away_east_m + away_north_m * away_north_m
                if distance2_m2 < nearest2_m2 or (nearest is None and distance2_m2 == nearest2_m2):
                    nearest, nearest2_m2 = item, distance2_m2
        return nearest

    def at(self, east_m: float, north_m: float) -> list[Item]:
        """All items at a place, in the order in which they were added."""
        items = []
        for there_east_m, there_north_m, _, item in self._within_reach.at(east_m, north_m):
            away_east_m, away_north_m = there_east_m - east_m, there_north_m - north_m
            if away_east_m * away_east_m + away_north_m * away_north_m <= self._reach2_m2:
                items.append(item)
        return items

    def in_sector(
        self,
        box: Area,
        tip: tuple[float, float],
        ahead: tuple[float, float],
        min_cosine: float,
        range_m: float,
    ) -> list[Item]:
        """All items in a sector, cell by cell, and in each in the order in which they were added.

        Parameters
        ----------
        box : Area
            An upright rectangle around it.
        tip : tuple of float
            East and north of its tip [m].
        ahead : tuple of float
            East and north of its axis, a direction of length 1.
        min_cosine : float
            Cosine of the angle from its axis to its border.
        range_m : float
            How far it reaches from its tip.
        """
        items: list[tuple[float, float, Item]] = []
        places = []
        for cell, in_cell in self._grid.occupied(box):
            if cell not in self._places:
                self._places[cell] = np.array([place for *place, _ in in_cell], np.float64)
            items += in_cell
            places.append(self._places[cell])
        if not places:
            return []
        away_east_m, away_north_m = (np.concatenate(places) - tip).T
        ahead_m = away_east_m * ahead[0] + away_north_m * ahead[1]
        distance_m = np.hypot(away_east_m, away_north_m)
        is_inside = (distance_m <= range_m) & (ahead_m >= min_cosine * distance_m)
        return [items[index][2] for index in is_inside.nonzero()[0].tolist()]

    def _cells(self, east_m: float, north_m: float) -> Iterable[Cell]:
        return self._within_reach.cells(area_around(east_m, north_m, self._reach_m))
