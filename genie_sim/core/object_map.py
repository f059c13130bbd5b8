"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every sighting."""

from __future__ import annotations

import bisect
import heapq
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.rules import ObjectMapRules
from genie_sim.messages import CameraPose, Detection, Location

RANGE_60 = 0.30 + 0.60 * (1.0 - 0.30)  # 60 % of the way up the range of scores that the detector reports
CELL_GATES = 4.0  # width of a cell, in gates
REACH_GATES = 1.01  # how far around an object the cells list it: a gate, and room for rounding
WIDE_RAD = math.radians(60.0)  # half of a view that is looked for in a whole circle
ROW = 2.0**26  # cells from one row to the next: no row of cells on earth has as many
Cell = float  # the number of a cell: a whole number, counted east in rows that are counted north


@dataclass(slots=True)
class StoredObject:
    """An object of the map. The location is that of the first sighting."""

    label: str
    location: Location
    score: float
    confidence: float
    seen_ns: int
    sightings: int = 1
    _detection: Detection | None = None

    def as_detection(self) -> Detection:
        detection = self._detection
        if detection is None or detection.confidence != self.confidence:  # most are asked for often
            detection = Detection(self.label, self.score, None, self.location, self.confidence, "map")
            self._detection = detection
        return detection


class ObjectMap:
    """Location -> objects, in metres of one east-north-up frame; keys use the ground plane.

    Every square cell lists the objects within a gate of it, so one cell answers what is at a location. A second grid of
    ``view_cell_m`` serves the question what is in view. Neither decides what is found.
    """

    def __init__(
        self, rules: ObjectMapRules, view_cell_m: float = 50.0, confidence_rule: ConfidenceRule | None = None
    ) -> None:
        self._rules = rules
        self._boosted = CONFIDENCE_RULES[rules.rule] if confidence_rule is None else confidence_rule
        self._exact = rules.location_key == "exact"
        self._cell_m = CELL_GATES * rules.gate_m
        self._gate2 = 0.0 if self._exact else rules.gate_m**2
        self._cells: dict[Any, list[StoredObject]] = {}  # by location if exact, else by cell
        self._view_cell_m = view_cell_m
        self._view_cells: dict[Cell, list[StoredObject]] = {}
        self._first_scores: list[float] = []
        self._count = 0
        self.changes = 0  # counts on whenever anything here becomes different
        self._to_forget: list[tuple[int, int, StoredObject]] = []  # a heap: when to look at it, a number of its own
        self._numbers = itertools.count()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return (stored for cell in self._view_cells.values() for stored in cell)

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

    def forget(self, now_ns: int) -> list[StoredObject]:
        """Removes and returns the objects that nobody has seen for the rules' ``forget_ns``."""
        forgotten = []
        waiting, forget_ns = self._to_forget, self._rules.forget_ns
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, stored = waiting[0]
            assert forget_ns is not None
            if stored.seen_ns + forget_ns > due_ns:  # it has been seen since
                heapq.heapreplace(waiting, (stored.seen_ns + forget_ns, next(self._numbers), stored))
                continue
            heapq.heappop(waiting)
            forgotten.append(stored)
            self.changes += 1
            self._count -= 1
            for cell in self._cells_within_reach(stored.location):
                _remove(self._cells, cell, stored)
            _remove(self._view_cells, self._view_cell(stored.location), stored)
        return forgotten

    def sight(self, seen: Detection, now_ns: int = 0) -> tuple[float | None, StoredObject]:
        """Lines 3 to 7: boosts the stored object that ``seen`` shows, or adds it.

        Returns the confidence before (``None`` for a new object) and the stored object.
        """
        assert seen.location is not None
        self.changes += 1
        rules = self._rules
        stored = self.match(seen.label, seen.location)
        if stored is not None:
            before = stored.confidence
            stored.confidence = self._boosted(before, seen.confidence, rules.rate)
            stored.seen_ns = now_ns
            stored.sightings += 1
            return before, stored
        stored = StoredObject(seen.label, seen.location, seen.score, seen.confidence, now_ns)
        if rules.forget_ns is not None:
            heapq.heappush(self._to_forget, (now_ns + rules.forget_ns, next(self._numbers), stored))
        for cell in self._cells_within_reach(seen.location):
            self._cells.setdefault(cell, []).append(stored)
        self._view_cells.setdefault(self._view_cell(seen.location), []).append(stored)
        if rules.threshold == "empirical":
            bisect.insort(self._first_scores, seen.score)
        self._count += 1
        return None, stored

    def match(self, label: str, location: Location) -> StoredObject | None:
        """The stored object that a sighting of class ``label`` at ``location`` shows: the nearest that fits."""
        east_m, north_m, _ = location
        any_class = self._rules.one_per_location
        best, best2 = None, self._gate2
        for one in self._cells.get(self._cell(location), ()):
            if any_class or one.label == label:
                away_east_m, away_north_m = one.location[0] - east_m, one.location[1] - north_m
                distance2 = away_east_m * away_east_m + away_north_m * away_north_m
                if distance2 < best2 or (best is None and distance2 == best2):
                    best, best2 = one, distance2
        return best

    def at(self, location: Location) -> list[StoredObject]:
        """``OBJECT_MAP[location]``: every stored object, of any class, that counts as being there."""
        east_m, north_m, _ = location
        found = []
        for one in self._cells.get(self._cell(location), ()):
            away_east_m, away_north_m = one.location[0] - east_m, one.location[1] - north_m
            if away_east_m * away_east_m + away_north_m * away_north_m <= self._gate2:
                found.append(one)
        return found

    def in_view(self, pose: CameraPose, horizontal_fov_rad: float, range_m: float) -> list[StoredObject]:
        """The objects with C >= C_T inside a camera's horizontal field of view, up to ``range_m`` away."""
        threshold, range2 = self.threshold, range_m**2
        east_m, north_m, _, heading_rad = pose
        ahead_east, ahead_north = math.cos(heading_rad), math.sin(heading_rad)
        half_rad = min(horizontal_fov_rad / 2, math.pi)
        least_ahead = math.cos(half_rad) if half_rad < math.pi else -math.inf  # per metre of distance
        found = []
        for cell in self._cells_in_view(pose, half_rad, range_m):
            for stored in self._view_cells.get(cell, ()):
                if stored.confidence < threshold:
                    continue
                away_east_m, away_north_m = stored.location[0] - east_m, stored.location[1] - north_m
                distance2 = away_east_m * away_east_m + away_north_m * away_north_m
                if distance2 <= range2:
                    ahead_m = away_east_m * ahead_east + away_north_m * ahead_north
                    if ahead_m >= least_ahead * math.sqrt(distance2):
                        found.append(stored)
        return found

    def _cell(self, location: Location) -> Any:
        """The cell that lists what may be at a location: the location itself if it has to be equal."""
        if self._exact:
            return location
        return location[0] // self._cell_m + location[1] // self._cell_m * ROW

    def _view_cell(self, location: Location) -> Cell:
        return location[0] // self._view_cell_m + location[1] // self._view_cell_m * ROW

    def _cells_within_reach(self, location: Location) -> list[Any]:
        if self._exact:
            return [location]
        reach_m = REACH_GATES * self._rules.gate_m
        east_m, north_m, _ = location
        return _cells((east_m - reach_m, east_m + reach_m), (north_m - reach_m, north_m + reach_m), self._cell_m)

    def _cells_in_view(self, pose: CameraPose, half_rad: float, range_m: float) -> list[Cell]:
        """The cells of the upright rectangle around the kite that touches a circle sector's arc at its ends and middle;
        around the whole circle if the sector is wide."""
        east_m, north_m, _, heading_rad = pose
        if half_rad > WIDE_RAD:
            west, east, south, north = -range_m, range_m, -range_m, range_m
        else:
            left, right, tip_m = heading_rad + half_rad, heading_rad - half_rad, range_m / math.cos(half_rad)
            easts = 0.0, range_m * math.cos(left), range_m * math.cos(right), tip_m * math.cos(heading_rad)
            norths = 0.0, range_m * math.sin(left), range_m * math.sin(right), tip_m * math.sin(heading_rad)
            west, east, south, north = min(easts), max(easts), min(norths), max(norths)
        return _cells((east_m + west, east_m + east), (north_m + south, north_m + north), self._view_cell_m)


def _cells(easts: tuple[float, float], norths: tuple[float, float], side_m: float) -> list[Cell]:
    """The cells of an upright rectangle, west to east."""
    west, east, south, north = easts[0] // side_m, easts[1] // side_m, norths[0] // side_m, norths[1] // side_m
    if west == east and south == north:  # mostly, where the rectangle is small
        return [west + south * ROW]
    rows = range(int(south), int(north) + 1)
    return [i + j * ROW for i in range(int(west), int(east) + 1) for j in rows]


def _remove(cells: dict[Any, list[StoredObject]], cell: Any, stored: StoredObject) -> None:
    """Takes an object out of a cell's list, and a list that is empty then out of the grid."""
    held = cells[cell]
    del held[next(place for place, one in enumerate(held) if one is stored)]  # what goes is mostly among the first
    if not held:
        del cells[cell]
