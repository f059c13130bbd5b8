"""``OBJECT_MAP[location]``: which stored objects count as being at a location."""

from collections.abc import Iterable
from typing import Protocol

from genie_sim.core.stored_object import StoredObject
from genie_sim.grid import Cell, Grid
from genie_sim.messages import Location

# Side of a cell. An object is in 2.3 cells of this size, and in 4 of half of it.
CELL_GATES = 4.0
REACH_GATES = 1.01  # how far around an object the cells list it: a gate, and room for rounding


class Locations(Protocol):
    """The objects of a map by location. ``label`` is ``None`` where every class will do."""

    def add(self, stored: StoredObject) -> None: ...

    def remove(self, stored: StoredObject) -> None: ...

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        """The nearest object of a class at a location, of equally near ones the older."""

    def at(self, location: Location) -> list[StoredObject]:
        """Every object, of any class, at a location."""


class WithinGate:
    """``location_key: gate``: an object is at every location within ``gate_m`` of its own, on the
    ground plane. The default.

    Every cell of the grid lists the objects within a gate of it, so that a look-up reads one cell.
    """

    def __init__(self, gate_m: float) -> None:
        self._grid: Grid[StoredObject] = Grid(CELL_GATES * gate_m)
        self._reach_m = REACH_GATES * gate_m
        self._gate2_m2 = gate_m**2

    def add(self, stored: StoredObject) -> None:
        for cell in self._cells(stored):
            self._grid.add(cell, stored)

    def remove(self, stored: StoredObject) -> None:
        for cell in self._cells(stored):
            self._grid.remove(cell, stored)

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        east_m, north_m, _ = location
        nearest, nearest2_m2 = None, self._gate2_m2
        for stored in self._grid.at(east_m, north_m):
            if stored.label == label or label is None:
                away_east_m, away_north_m = stored.east_m - east_m, stored.north_m - north_m
                distance2_m2 = away_east_m * away_east_m + away_north_m * away_north_m
                if distance2_m2 < nearest2_m2 or (nearest is None and distance2_m2 == nearest2_m2):
                    nearest, nearest2_m2 = stored, distance2_m2
        return nearest

    def at(self, location: Location) -> list[StoredObject]:
        east_m, north_m, _ = location
        objects = []
        for stored in self._grid.at(east_m, north_m):
            away_east_m, away_north_m = stored.east_m - east_m, stored.north_m - north_m
            if away_east_m * away_east_m + away_north_m * away_north_m <= self._gate2_m2:
                objects.append(stored)
        return objects

    def _cells(self, stored: StoredObject) -> Iterable[Cell]:
        reach_m = self._reach_m
        return self._grid.cells(
            stored.east_m - reach_m,
            stored.east_m + reach_m,
            stored.north_m - reach_m,
            stored.north_m + reach_m,
        )


class SameLocation:
    """``location_key: exact``: an object is at a location with its very coordinates, as printed."""

    def __init__(self) -> None:
        self._objects: dict[Location, list[StoredObject]] = {}

    def add(self, stored: StoredObject) -> None:
        self._objects.setdefault(stored.location, []).append(stored)

    def remove(self, stored: StoredObject) -> None:
        self._objects[stored.location].remove(stored)

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        for stored in self._objects.get(location, ()):
            if label is None or stored.label == label:
                return stored
        return None

    def at(self, location: Location) -> list[StoredObject]:
        return list(self._objects.get(location, ()))
