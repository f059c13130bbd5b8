"""Square cells of the ground plane: a spatial hash for look-ups by place, and a map's cells."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Generic, TypeVar

Item = TypeVar("Item")
# The number of a cell, a whole number: columns count eastwards, rows northwards. The Earth has
# fewer columns of 2 m than ROW, so no two cells of it share a number.
Cell = float
ROW = 2.0**26
MAX_CELLS_WALKED = 64
Area = tuple[float, float, float, float]  # west, south, east and north border [m]


def area_around(east_m: float, north_m: float, reach_m: float) -> Area:
    """The square that reaches so far from a place to each side."""
    return east_m - reach_m, north_m - reach_m, east_m + reach_m, north_m + reach_m


def widened(area: Area, by_m: float) -> Area:
    """An area with so much more on each side."""
    west_m, south_m, east_m, north_m = area
    return west_m - by_m, south_m - by_m, east_m + by_m, north_m + by_m


class Grid(Generic[Item]):
    """Items in square cells of ``side_m``. The caller decides in which cells an item belongs: in
    the one at its place, or in all within some reach of it.
    """

    def __init__(self, side_m: float) -> None:
        self.side_m = side_m
        self._cells: dict[Cell, list[Item]] = {}

    def __iter__(self) -> Iterator[Item]:
        """All items, once for each cell that they are in."""
        return itertools.chain.from_iterable(self._cells.values())

    def cell(self, east_m: float, north_m: float) -> Cell:
        """The cell at a place."""
        return east_m // self.side_m + north_m // self.side_m * ROW

    def cells(self, area: Area) -> Iterable[Cell]:
        """All cells of an area, column by column."""
        (west_m, south_m, east_m, north_m), side_m = area, self.side_m
        columns = _from_to(west_m // side_m, east_m // side_m)
        rows = _from_to(south_m // side_m, north_m // side_m)
        return [column + row * ROW for column in columns for row in rows]

    def add(self, cell: Cell, item: Item) -> None:
        """Puts an item into a cell, behind those that are there."""
        items = self._cells.get(cell)
        if items is None:
            self._cells[cell] = [item]
        else:
            items.append(item)

    def remove(self, cell: Cell, item: Item) -> None:
        """Takes an item out of a cell in which it is."""
        items = self._cells[cell]
        items.remove(item)
        if not items:
            del self._cells[cell]

    def at(self, east_m: float, north_m: float) -> Sequence[Item]:
        """The items of the cell at a place, in the order in which they were added."""
        return self._cells.get(east_m // self.side_m + north_m // self.side_m * ROW, ())

    def inside(self, area: Area) -> Iterator[Item]:
        """The items of all cells that an area touches, column by column."""
        return itertools.chain.from_iterable(items for _, items in self.occupied(area))

    def occupied(self, area: Area) -> Iterator[tuple[Cell, Sequence[Item]]]:
        """All cells that an area touches and in which there are items, column by column.

        Takes time in proportion to the cells of the area or, if these are many, to the occupied
        cells of the grid.
        """
        (west_m, south_m, east_m, north_m), side_m = area, self.side_m
        occupied = self._cells
        columns = west_m // side_m, east_m // side_m
        rows = south_m // side_m, north_m // side_m
        count = (columns[1] - columns[0] + 1.0) * (rows[1] - rows[0] + 1.0)
        cells: Iterable[Cell]
        if count <= max(MAX_CELLS_WALKED, len(occupied)):
            cells = self.cells(area)
        else:
            cells = _between(occupied, columns, rows)
        return ((cell, occupied[cell]) for cell in cells if cell in occupied)


def cell_counts(extent_m: Area, cell_m: float) -> tuple[int, int]:
    """Columns and rows of about square cells on a map: as many of about ``cell_m`` as fit it
    best.
    """
    west_m, south_m, east_m, north_m = extent_m
    return max(1, round((east_m - west_m) / cell_m)), max(1, round((north_m - south_m) / cell_m))


def _from_to(first: float, last: float) -> Sequence[float]:
    """The whole numbers from ``first`` to ``last``; the usual one or two without a range."""
    if first == last:
        return (first,)
    return (first, last) if first + 1 == last else range(int(first), int(last) + 1)


def _between(
    cells: Iterable[Cell], columns: tuple[float, float], rows: tuple[float, float]
) -> list[Cell]:
    """Those of the cells that lie between two columns and two rows, column by column."""
    places = []
    for cell in cells:
        row = (cell + ROW / 2) // ROW
        column = cell - row * ROW
        if columns[0] <= column <= columns[1] and rows[0] <= row <= rows[1]:
            places.append((column, row, cell))
    places.sort()
    return [cell for _, _, cell in places]
