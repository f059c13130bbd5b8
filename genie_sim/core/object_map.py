"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every sighting."""

import bisect
import heapq
import itertools
import math
from collections.abc import Iterator, Sequence
from types import MappingProxyType
from typing import Any

from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.freshness.never import Never
from genie_sim.core.maps import Boosted, Learned, Map, Viewer
from genie_sim.core.rules import ObjectMapRules, Percentile
from genie_sim.core.tracking import PARKED_NS
from genie_sim.core.view import rectangle
from genie_sim.messages import (
    Answer,
    CameraPose,
    Detection,
    Header,
    Location,
    MapChange,
    ObjectLookups,
)

RANGE_60 = 0.30 + 0.60 * (
    1.0 - 0.30
)  # 60 % of the way up the range of scores that the detector reports
EMPIRICAL_PERCENT = 60.0
CELL_GATES = 2.0
REACH_GATES = 1.01  # how far around an object the cells list it: a gate, and room for rounding
ORIGIN_NS = (
    1_000_000_000  # with ``confidence_source: origins``, a car's word counts again after so long
)
ROW = 2.0**26  # cells from one row to the next: no row of cells on earth has as many
Origins = dict[str, int]
NOBODY: Any = MappingProxyType({})  # what nobody keeps: most objects of a fleet's maps
Cell = float  # the number of a cell: a whole number, counted east in rows that are counted north


class StoredObject:
    """An object of the map. The location is that of the first sighting. ``origins`` belong to the freshness policy,
    ``spoke_ns`` tells when each car spoke of it; ``detection`` is the object as it is asked for, once it has been."""

    __slots__ = (
        "confidence", "detection", "east_m", "first_ns", "label", "location", "north_m", "origins", "score", "seen_ns",
        "sightings", "spoke_ns",
    )  # fmt: skip

    def __init__(
        self, seen: Detection, location: Location, now_ns: int, origins: Origins, spoke_ns: Origins
    ) -> None:
        self.label, self.location, self.score, self.confidence = (
            seen.label,
            location,
            seen.score,
            seen.confidence,
        )
        self.east_m, self.north_m, _ = location
        self.first_ns = self.seen_ns = now_ns
        self.sightings = 1
        self.origins, self.spoke_ns = origins, spoke_ns
        self.detection: Detection | None = None

    @property
    def parked(self) -> bool:
        """Whether it has been seen at its place for a second."""
        return self.seen_ns - self.first_ns >= PARKED_NS

    def as_detection(self) -> Detection:
        self.detection = Detection(
            self.label, self.score, None, self.location, self.confidence, "map"
        )
        return self.detection


class ObjectMap(Map):
    """Location -> objects, in metres of one east-north-up frame; keys use the ground plane.

    Every square cell lists the objects within a gate of it, so one cell answers what is at a location. A second grid of
    ``view_cell_m`` serves the question what is in view. Neither decides what is found.
    """

    def __init__(
        self,
        rules: ObjectMapRules,
        view_cell_m: float = 50.0,
        confidence_rule: ConfidenceRule | None = None,
        freshness: Never | None = None,
    ) -> None:
        self._rules = rules
        self._freshness = Never() if freshness is None else freshness
        self._always_serves = getattr(type(self._freshness), "serves", None) is Never.serves
        self._notes = getattr(type(self._freshness), "seen", None) is not Never.seen
        self._knows_origins = (
            self._notes or not self._always_serves
        )  # else no policy has a say about who saw what
        self._origins = rules.confidence_source == "origins"
        self._boosts: dict[int, tuple[Answer, Boosted]] = {}  # by the identity of the stored answer
        self._boosted_changes = 0  # of the map, when they were made
        self._boosted = CONFIDENCE_RULES[rules.rule] if confidence_rule is None else confidence_rule
        self._rate = rules.rate
        self._any_class = rules.one_per_location
        self._exact = rules.location_key == "exact"
        self._cell_m, self._reach_m = CELL_GATES * rules.gate_m, REACH_GATES * rules.gate_m
        self._gate2 = 0.0 if self._exact else rules.gate_m**2
        self._cells: dict[Any, list[StoredObject]] = {}  # by location if exact, else by cell
        self._view_cell_m = view_cell_m
        self._view_cells: dict[Cell, list[StoredObject]] = {}
        self._count = 0
        self._ranked: list[float] = []  # what C_T is a percentile of, in order
        self._of_stored = isinstance(rules.threshold, Percentile)
        self._of_scores = rules.threshold == "empirical"
        self.threshold = fixed_threshold(rules.threshold)  # C_T
        self.changes = 0  # counts on whenever anything here becomes different
        self._to_forget: list[
            tuple[int, int, StoredObject]
        ] = []  # a heap: when to look at it, a number of its own
        self._numbers = itertools.count()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return (stored for cell in self._view_cells.values() for stored in cell)

    def forget(self, now_ns: int) -> list[StoredObject]:
        """Removes and returns the objects whose time is over by the freshness policy."""
        forgotten = []
        waiting = self._to_forget
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, stored = waiting[0]
            expires_ns = self._freshness.expires_ns(stored)
            if expires_ns is None:
                heapq.heappop(waiting)
                continue
            if expires_ns > due_ns:  # it has been seen since
                heapq.heapreplace(waiting, (expires_ns, next(self._numbers), stored))
                continue
            heapq.heappop(waiting)
            forgotten.append(stored)
            self._remove(stored)
        return forgotten

    def _remove(self, stored: StoredObject) -> None:
        self.changes += 1
        self._count -= 1
        for cell in self._cells_within_reach(stored.location):
            _remove(self._cells, cell, stored)
        _remove(self._view_cells, self._view_cell(stored.location), stored)
        if self._of_stored:
            self._rank(stored.confidence, None)

    def _rank(self, old: float | None, new: float | None) -> None:
        """Sets C_T, a percentile by nearest rank, when a value becomes another, comes (``old`` is ``None``) or goes."""
        ranked, threshold = self._ranked, self._rules.threshold
        if old is not None:
            del ranked[bisect.bisect_left(ranked, old)]
        if new is not None:
            bisect.insort(ranked, new)
        percent = threshold.percentile if isinstance(threshold, Percentile) else EMPIRICAL_PERCENT
        self.threshold = ranked[math.ceil(percent * len(ranked) / 100) - 1] if ranked else 1.0

    def sight(
        self, seen: Detection, now_ns: int = 0, header: Header | None = None
    ) -> tuple[float | None, StoredObject]:
        """Lines 3 to 7: boosts the stored object that ``seen`` shows, or adds it. ``header`` is that of the frame that
        a detector saw it in, ``None`` if the object comes out of a map or cache.

        Returns the confidence before (``None`` for a new object) and the stored object.
        """
        location = seen.location
        assert location is not None
        self.changes += 1
        stored = self.match(seen.label, location)
        if stored is not None:
            before = stored.confidence
            if not self._origins or self._speaks(stored, header):
                stored.confidence = self._boosted(before, seen.confidence, self._rate)
                stored.detection = None
                if self._of_stored:
                    self._rank(before, stored.confidence)
            stored.seen_ns = now_ns
            stored.sightings += 1
            if self._notes and header is not None:
                self._freshness.seen(stored, seen.score, header)
            return before, stored
        origins, spoke_ns = {} if self._knows_origins else NOBODY, {} if self._origins else NOBODY
        stored = StoredObject(seen, location, now_ns, origins, spoke_ns)
        if header is not None:
            if self._origins:
                stored.spoke_ns[header.origin] = header.stamp_ns
            self._freshness.seen(stored, seen.score, header)
        if (expires_ns := self._freshness.expires_ns(stored)) is not None:
            heapq.heappush(self._to_forget, (expires_ns, next(self._numbers), stored))
        for cell in self._cells_within_reach(location):
            self._cells.setdefault(cell, []).append(stored)
        self._view_cells.setdefault(self._view_cell(location), []).append(stored)
        if self._of_stored or self._of_scores:
            self._rank(None, seen.confidence if self._of_stored else seen.score)
        self._count += 1
        return None, stored

    def _speaks(self, stored: StoredObject, header: Header | None) -> bool:
        """Whether a sighting is more than an echo: the detector's own, of a car that was not counted for a second."""
        if header is None:
            return False
        last_ns = stored.spoke_ns.get(header.origin)
        if last_ns is not None and header.stamp_ns - last_ns < ORIGIN_NS:
            return False
        stored.spoke_ns[header.origin] = header.stamp_ns
        return True

    def learn(
        self,
        answer: Answer,
        viewer: Viewer | None,
        now_ns: int,
        own: bool,
        tells_changes: bool,
        leaves: bool = True,
    ) -> Learned:
        """EnhancedCacheNewData: every object of an answer is a sighting. See ``maps.Map``."""
        if answer.objects is None:
            return Learned(answer, answer, answer, None)
        threshold, detected = self.threshold, answer.source == "detector"
        header = answer.header if detected else None
        objects: list[Detection] = []
        known: list[StoredObject | None] = []
        changes: list[MapChange] = []
        requests = hits = updates = 0
        boost, sight = 0.0, self.sight
        stored: StoredObject | None
        for seen in answer.objects:
            stored = None
            if seen.location is not None:
                requests += 1
                before, stored = sight(seen, now_ns, None if seen.method == "map" else header)
                if before is not None:
                    hits += before >= threshold
                    updates += 1
                    boost += stored.confidence - before
                    if leaves:
                        seen = seen.with_confidence(stored.confidence)
                if tells_changes:
                    changes.append((stored.label, stored.location, stored.confidence))
            if leaves:
                objects.append(seen)
                known.append(stored)
        facts = ObjectLookups(
            answer.header, "sighting", requests, hits, updates, boost, len(self), tuple(changes)
        )
        if not leaves:
            return Learned(answer, answer, answer, facts)
        answer = answer.with_objects(objects)
        to_clients = to_neighbours = self._confident(answer, known, answer.header.origin, now_ns)
        if not self._always_serves:
            to_neighbours = self._confident(answer, known, "", now_ns)
        return Learned(answer, to_clients, to_neighbours, facts)

    def _confident(
        self, answer: Answer, known: Sequence[StoredObject | None], to: str, now_ns: int
    ) -> Answer:
        """The answer without what must not leave a Genie: the objects below C_T (Section III-D), and those that the
        freshness policy keeps back."""
        threshold, objects = self.threshold, answer.objects or ()
        if self._always_serves:
            confident = [seen for seen in objects if seen.confidence >= threshold]
            return answer if len(confident) == len(objects) else answer.with_objects(confident)
        serves = self._freshness.serves
        return answer.with_objects(
            [
                seen
                for seen, stored in zip(objects, known, strict=True)
                if seen.confidence >= threshold and (stored is None or serves(stored, to, now_ns))
            ]
        )

    def boost(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> Boosted | None:
        """EnhancedCacheBoostData: adds the stored objects at the answer's locations, each once, and leaves out what is
        below C_T. As long as the map stays as it is, so does what it makes of an answer."""
        if answer.objects is None:
            return None
        if not self._always_serves:
            return self._boost(answer, header.origin, now_ns)
        if self._boosted_changes != self.changes:
            self._boosts.clear()
            self._boosted_changes = self.changes
        held = self._boosts.get(id(answer))
        if held is None:
            held = self._boosts[id(answer)] = answer, self._boost(answer, header.origin, now_ns)
        return held[1]

    def _boost(self, answer: Answer, to: str, now_ns: int) -> Boosted:
        objects: list[Detection] = []
        known: list[StoredObject | None] = []
        requests = hits = 0
        threshold = self.threshold
        others: list[StoredObject] = []
        for held in answer.objects or ():  # a list of its own: the stored answer stays as it is
            stored = None
            if held.location is not None:
                requests += 1
                around = self.at(held.location)
                there = [one for one in around if one.confidence >= threshold]
                is_it = len(around) == 1 and around[0].label == held.label  # mostly
                stored = around[0] if is_it else self.match(held.label, held.location)
                if stored is not None:
                    held = held.with_confidence(stored.confidence)
                hits += bool(there)
                others += there
            objects.append(held)
            known.append(stored)
        included = {id(one) for one in known if one is not None}
        for one in others:
            if id(one) not in included:
                included.add(id(one))
                objects.append(one.detection or one.as_detection())
                known.append(one)
        answer = answer.with_objects(objects)
        return Boosted(answer, self._confident(answer, known, to, now_ns), requests, hits)

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        """The confident objects in view. See ``maps.Map``."""
        found = self.in_view(viewer.pose, viewer.horizontal_fov_rad, range_m)
        if not self._always_serves:
            found = [
                one for one in found if self._freshness.serves(one, viewer.header.origin, now_ns)
            ]
        return tuple(one.detection or one.as_detection() for one in found), None

    def match(self, label: str, location: Location) -> StoredObject | None:
        """The stored object that a sighting of class ``label`` at ``location`` shows: the nearest that fits."""
        east_m, north_m, _ = location
        any_class = self._any_class
        best, best2 = None, self._gate2
        cell = location if self._exact else east_m // self._cell_m + north_m // self._cell_m * ROW
        for one in self._cells.get(cell, ()):
            if one.label == label or any_class:
                away_east_m, away_north_m = one.east_m - east_m, one.north_m - north_m
                distance2 = away_east_m * away_east_m + away_north_m * away_north_m
                if distance2 < best2 or (best is None and distance2 == best2):
                    best, best2 = one, distance2
        return best

    def at(self, location: Location) -> list[StoredObject]:
        """``OBJECT_MAP[location]``: every stored object, of any class, that counts as being there."""
        east_m, north_m, _ = location
        found = []
        cell = location if self._exact else east_m // self._cell_m + north_m // self._cell_m * ROW
        for one in self._cells.get(cell, ()):
            away_east_m, away_north_m = one.east_m - east_m, one.north_m - north_m
            if away_east_m * away_east_m + away_north_m * away_north_m <= self._gate2:
                found.append(one)
        return found

    def in_view(
        self, pose: CameraPose, horizontal_fov_rad: float, range_m: float
    ) -> list[StoredObject]:
        """The objects with C >= C_T inside a camera's horizontal field of view, up to ``range_m`` away."""
        threshold, range2 = self.threshold, range_m**2
        east_m, north_m, _, heading_rad = pose
        ahead_east, ahead_north = math.cos(heading_rad), math.sin(heading_rad)
        half_rad = min(horizontal_fov_rad / 2, math.pi)
        least_ahead = (
            math.cos(half_rad) if half_rad < math.pi else -math.inf
        )  # per metre of distance
        behind_m = (
            0.0 if least_ahead >= 0.0 else -math.inf
        )  # what is less far ahead is not in view, however near
        found, sqrt = [], math.sqrt
        west, east, south, north = rectangle(pose, half_rad, range_m)
        for cell in _cells((west, east), (south, north), self._view_cell_m):
            for stored in self._view_cells.get(cell, ()):
                if stored.confidence < threshold:
                    continue
                away_east_m, away_north_m = stored.east_m - east_m, stored.north_m - north_m
                ahead_m = away_east_m * ahead_east + away_north_m * ahead_north
                if ahead_m >= behind_m:
                    distance2 = away_east_m * away_east_m + away_north_m * away_north_m
                    if distance2 <= range2 and ahead_m >= least_ahead * sqrt(distance2):
                        found.append(stored)
        return found

    def _view_cell(self, location: Location) -> Cell:
        return location[0] // self._view_cell_m + location[1] // self._view_cell_m * ROW

    def _cells_within_reach(self, location: Location) -> list[Any]:
        if self._exact:
            return [location]
        reach_m = self._reach_m
        east_m, north_m, _ = location
        return _cells(
            (east_m - reach_m, east_m + reach_m),
            (north_m - reach_m, north_m + reach_m),
            self._cell_m,
        )


def fixed_threshold(threshold: float | str | Percentile) -> float:
    """C_T as a number; 1 for a percentile, which there is none of yet."""
    if isinstance(threshold, str):
        return RANGE_60 if threshold == "range_60" else 1.0
    return 1.0 if isinstance(threshold, Percentile) else threshold


def _cells(easts: tuple[float, float], norths: tuple[float, float], side_m: float) -> list[Cell]:
    """The cells of an upright rectangle, west to east."""
    rows = _from_to(norths[0] // side_m, norths[1] // side_m)
    return [i + j * ROW for i in _from_to(easts[0] // side_m, easts[1] // side_m) for j in rows]


def _from_to(first: float, last: float) -> Sequence[float]:
    """The whole numbers from one to another; mostly there are one or two, for which no range is made."""
    if first == last:
        return (first,)
    return (first, last) if first + 1 == last else range(int(first), int(last) + 1)


def _remove(cells: dict[Any, list[StoredObject]], cell: Any, stored: StoredObject) -> None:
    """Takes an object out of a cell's list, and a list that is empty then out of the grid."""
    held = cells[cell]
    held.remove(stored)  # looks for the very object: none equals another
    if not held:
        del cells[cell]
