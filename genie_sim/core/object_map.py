"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every sighting."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from genie_sim.core.confidence import ConfidenceRule
from genie_sim.messages import CameraPose, Detection, Location

RANGE_60 = 0.30 + 0.60 * (1.0 - 0.30)  # 60 % of the way up the range of scores that the detector reports
MOST_CELLS_REACHED = 20  # to either side; of a gate that reaches further only cells that hold something are looked at


@dataclass(slots=True)
class StoredObject:
    """An object of the map. The location is that of the first sighting."""

    label: str
    location: Location
    score: float
    confidence: float
    sightings: int = 1

    def as_detection(self) -> Detection:
        return Detection(self.label, self.score, None, self.location, self.confidence, "map")


@dataclass(frozen=True, slots=True)
class ObjectMapRules:
    """How the paper's object map is read.

    ``location_key``: ``grid`` (cells of ``cell_m``; the nearest object of the class within ``gate_m``, in the cell or
    in as many neighbouring cells as the gate reaches into), ``gate`` (the same, with cells of ``gate_m``), ``exact``
    (equal coordinates).
    ``one_per_location``: any object at a location blocks a second (lines 4 and 7 as printed), classes not told apart.
    ``threshold``: C_T as a number, ``range_60`` or ``empirical`` (60th percentile of the first scores seen so far).
    """

    rule: ConfidenceRule
    rate: float = 0.1
    location_key: str = "grid"
    cell_m: float = 1.0
    gate_m: float = 1.0
    one_per_location: bool = False
    threshold: float | str = 0.60


class ObjectMap:
    """Location -> objects, in metres of one east-north-up frame; keys use the ground plane."""

    def __init__(self, rules: ObjectMapRules, view_cell_m: float = 50.0) -> None:
        self._rules = rules
        self._exact = rules.location_key == "exact"
        self._cell_m = rules.gate_m if rules.location_key == "gate" else rules.cell_m
        self._gate2 = 0.0 if self._exact else rules.gate_m**2
        self._reach = math.ceil(rules.gate_m / self._cell_m)  # cells to either side that the gate may touch
        self._cells: dict[Any, list[StoredObject]] = {}  # by location if exact, else by cell
        self._view_cell_m = view_cell_m
        self._view_cells: dict[tuple[int, int], list[StoredObject]] = {}
        self._first_scores: list[float] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return (stored for cell in self._cells.values() for stored in cell)

    @property
    def threshold(self) -> float:
        """C_T, from which on an object may leave the Genie."""
        threshold = self._rules.threshold
        if not isinstance(threshold, str):
            return threshold
        if threshold == "range_60":
            return RANGE_60
        scores = self._first_scores
        return scores[math.ceil(0.6 * len(scores)) - 1] if scores else 1.0

    def sight(self, seen: Detection) -> tuple[float | None, StoredObject]:
        """Lines 3 to 7: boosts the stored object that ``seen`` shows, or adds it.

        Returns the confidence before (``None`` for a new object) and the stored object.
        """
        assert seen.location is not None
        stored = self.match(seen.label, seen.location)
        if stored is not None:
            before = stored.confidence
            stored.confidence = self._rules.rule(before, seen.confidence, self._rules.rate)
            stored.sightings += 1
            return before, stored
        stored = StoredObject(seen.label, seen.location, seen.score, seen.confidence)
        self._cells.setdefault(self._key(seen.location), []).append(stored)
        self._view_cells.setdefault(self._view_key(seen.location), []).append(stored)
        if self._rules.threshold == "empirical":
            bisect.insort(self._first_scores, seen.score)
        self._count += 1
        return None, stored

    def match(self, label: str, location: Location) -> StoredObject | None:
        """The stored object that a sighting of class ``label`` at ``location`` shows: the nearest that fits."""
        best, best2 = None, math.inf
        any_class = self._rules.one_per_location
        for distance2, stored in self._around(location):
            if distance2 < best2 and (any_class or stored.label == label):
                best, best2 = stored, distance2
        return best

    def at(self, location: Location) -> list[StoredObject]:
        """``OBJECT_MAP[location]``: every stored object, of any class, that counts as being there."""
        return [stored for _, stored in self._around(location)]

    def in_view(self, pose: CameraPose, horizontal_fov_rad: float, range_m: float) -> list[StoredObject]:
        """The objects with C >= C_T inside a camera's horizontal field of view, up to ``range_m`` away."""
        threshold = self.threshold
        half = horizontal_fov_rad / 2
        found = []
        reach = math.ceil(range_m / self._view_cell_m)
        east_cell, north_cell = self._view_key((pose.east_m, pose.north_m, pose.up_m))
        for i in range(east_cell - reach, east_cell + reach + 1):
            for j in range(north_cell - reach, north_cell + reach + 1):
                for stored in self._view_cells.get((i, j), ()):
                    if stored.confidence < threshold:
                        continue
                    east_m, north_m = stored.location[0] - pose.east_m, stored.location[1] - pose.north_m
                    if math.hypot(east_m, north_m) > range_m:
                        continue
                    bearing = math.atan2(north_m, east_m) - pose.heading_rad
                    if abs(math.remainder(bearing, 2 * math.pi)) <= half:
                        found.append(stored)
        return found

    def _around(self, location: Location) -> Iterator[tuple[float, StoredObject]]:
        """The objects that count as being at ``location``, each with its squared distance in the ground plane."""
        if self._exact:
            for stored in self._cells.get(location, ()):
                yield 0.0, stored
            return
        for cell in self._near(*self._grid_cell(location)):
            for stored in self._cells.get(cell, ()):
                distance2 = (stored.location[0] - location[0]) ** 2 + (stored.location[1] - location[1]) ** 2
                if distance2 <= self._gate2:
                    yield distance2, stored

    def _near(self, east_cell: int, north_cell: int) -> Iterator[tuple[int, int]]:
        """The cells that the gate may touch, west to east; of a gate over very many cells those that hold something."""
        reach = self._reach
        if reach <= MOST_CELLS_REACHED:
            for i in range(east_cell - reach, east_cell + reach + 1):
                for j in range(north_cell - reach, north_cell + reach + 1):
                    yield i, j
            return
        for i, j in sorted(self._cells):
            if abs(i - east_cell) <= reach and abs(j - north_cell) <= reach:
                yield i, j

    def _key(self, location: Location) -> tuple[float, ...]:
        return location if self._exact else self._grid_cell(location)

    def _grid_cell(self, location: Location) -> tuple[int, int]:
        return math.floor(location[0] / self._cell_m), math.floor(location[1] / self._cell_m)

    def _view_key(self, location: Location) -> tuple[int, int]:
        return math.floor(location[0] / self._view_cell_m), math.floor(location[1] / self._view_cell_m)
