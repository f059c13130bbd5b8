"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every
sighting.
"""

import heapq
import itertools
from collections.abc import Iterator, Sequence
from types import MappingProxyType
from typing import Any

from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.freshness.never import Never
from genie_sim.core.locations import Locations, SameLocation, WithinGate
from genie_sim.core.maps import EnhancedAnswer, LookupCounts, Map, Viewer, counts_again
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.stored_object import StoredObject
from genie_sim.core.thresholds import threshold_of
from genie_sim.core.view import ViewSector
from genie_sim.grid import Grid
from genie_sim.messages import Answer, CameraPose, Detection, Header, Location, MapChange

# What an object notes of the cars that saw it where no setting asks for it, as for most objects of
# a fleet's maps.
NO_NOTES: Any = MappingProxyType({})


class ObjectMap(Map):
    """Location -> objects, in metres of one east-north-up frame.

    Parameters
    ----------
    rules : ObjectMapRules
        The settings.
    view_cell_m : float
        Side of the cells that speed up the question what is in view [m]; does not change results.
    confidence_rule : callable, optional
        How a sighting changes a confidence (line 5), in the place of the one that ``rules`` names.
    freshness : Never, optional
        When an object is forgotten and who may have it; by default nothing is forgotten.
    """

    def __init__(
        self,
        rules: ObjectMapRules,
        view_cell_m: float = 50.0,
        confidence_rule: ConfidenceRule | None = None,
        freshness: Never | None = None,
    ) -> None:
        self._freshness = Never() if freshness is None else freshness
        self._boosted_confidence = confidence_rule or CONFIDENCE_RULES[rules.rule]
        self._rate = rules.rate  # lambda
        self._threshold = threshold_of(rules.threshold)
        self._locations: Locations = (
            SameLocation() if rules.location_key == "exact" else WithinGate(rules.gate_m)
        )
        self._any_class = rules.one_per_location
        self._counts_origins = rules.confidence_source == "origins"
        self._view_grid: Grid[StoredObject] = Grid(view_cell_m)
        self._count = 0
        self._numbers = itertools.count()  # of objects
        # a heap: when to look at the object, and a tie-breaker
        self._to_forget: list[tuple[int, int, StoredObject]] = []
        self._ties = itertools.count()
        # of stored answers, by identity: what EnhancedCacheBoostData made of them; holds as long as
        # the map does not change
        self._boosted: dict[int, tuple[Answer, EnhancedAnswer]] = {}

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return iter(self._view_grid)

    @property
    def threshold(self) -> float:
        return self._threshold.value

    def enhanced_cache_new_data(
        self,
        answer: Answer,
        viewer: Viewer | None,
        now_ns: int,
        *,
        own: bool,
        names_changes: bool,
        leaves: bool = True,
    ) -> EnhancedAnswer:
        """Algorithm 2, EnhancedCacheNewData: every object of an answer is a sighting. See
        ``maps.Map``.
        """
        if answer.objects is None:  # line 2
            return EnhancedAnswer(answer, answer, answer)
        threshold = self.threshold
        header = answer.header if answer.source == "detector" else None
        looked_at = answer.seen_in or answer.header
        objects: list[Detection] = []
        stored_objects: list[StoredObject | None] = []  # that ``objects`` show
        changes: list[MapChange] = []
        requests = hits = updates = 0
        boost_sum = 0.0
        for seen in answer.objects:  # line 3
            stored = None
            if seen.location is not None:
                requests += 1
                frame = None if seen.method == "map" else header
                before, stored = self.sight(seen, now_ns, frame)  # lines 4 to 7
                stored.look(seen.seen_in if seen.method == "map" else looked_at)
                if before is not None:
                    hits += before >= threshold
                    updates += 1
                    boost_sum += stored.confidence - before
                    if leaves:
                        seen = seen.with_confidence(stored.confidence)
                if names_changes:
                    changes.append(
                        MapChange(stored.number, stored.label, stored.location, stored.confidence)
                    )
            if leaves:
                objects.append(seen)
                stored_objects.append(stored)
        counts = LookupCounts(requests, hits, updates, boost_sum, changes=tuple(changes))
        if not leaves:
            return EnhancedAnswer(answer, answer, answer, counts)
        answer = answer.with_objects(objects)
        to_clients = to_neighbours = self._confident_part(
            answer, stored_objects, answer.header.origin, now_ns
        )
        if self._freshness.keeps_back:
            to_neighbours = self._confident_part(answer, stored_objects, "", now_ns)
        return EnhancedAnswer(answer, to_clients, to_neighbours, counts)

    def sight(
        self, seen: Detection, now_ns: int = 0, header: Header | None = None
    ) -> tuple[float | None, StoredObject]:
        """Lines 4 to 7 of Algorithm 2: boosts the stored object that ``seen`` shows, or adds it.

        ``header`` is that of the frame in which a detector saw it, ``None`` if the object comes out
        of a map or cache. Returns the confidence before (``None`` for a new object) and the stored
        object.
        """
        assert seen.location is not None
        self._boosted.clear()
        # line 4
        stored = self._locations.nearest(None if self._any_class else seen.label, seen.location)
        if stored is None:
            return None, self._add(seen, seen.location, now_ns, header)  # line 7
        before = stored.confidence
        if not self._counts_origins or (
            header is not None and counts_again(stored.counted_ns, header)
        ):
            # line 5
            stored.confidence = self._boosted_confidence(before, seen.confidence, self._rate)
            self._threshold.changed(before, stored.confidence)
        stored.seen_ns = now_ns
        stored.sightings += 1
        if header is not None and self._freshness.notes_sightings:
            self._freshness.seen(stored, seen.score, header)
        return before, stored

    def enhanced_cache_boost_data(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> EnhancedAnswer:
        """Algorithm 2, EnhancedCacheBoostData: adds the stored objects at the answer's locations,
        each once, and leaves out what is below C_T.
        """
        if answer.objects is None:  # line 9
            return EnhancedAnswer(answer, answer, answer)
        if not self._freshness.keeps_back:
            remembered = self._boosted.get(id(answer))
            if remembered is not None:
                return remembered[1]
        objects: list[Detection] = []
        stored_objects: list[StoredObject | None] = []  # that ``objects`` show
        others: list[StoredObject] = []
        requests = hits = 0
        threshold = self.threshold
        for detection in answer.objects:  # line 10
            stored = None
            if detection.location is not None:
                requests += 1
                at_location = self._locations.at(detection.location)  # line 11
                # line 12
                confident = [other for other in at_location if other.confidence >= threshold]
                hits += bool(confident)
                others += confident  # line 13; added below, lest line 10 iterates over them
                if len(at_location) == 1 and at_location[0].label == detection.label:
                    stored = at_location[0]  # as nearly always
                else:
                    stored = self.match(detection.label, detection.location)
                if stored is not None:
                    detection = detection.with_confidence(stored.confidence)
            objects.append(detection)
            stored_objects.append(stored)
        included = {stored.number for stored in stored_objects if stored is not None}
        for other in others:
            if other.number not in included:
                included.add(other.number)
                objects.append(other.as_detection())
                stored_objects.append(other)
        boosted = answer.with_objects(objects)
        part = self._confident_part(boosted, stored_objects, header.origin, now_ns)
        result = EnhancedAnswer(boosted, part, part, LookupCounts(requests, hits))
        if not self._freshness.keeps_back:
            self._boosted[id(answer)] = answer, result
        return result

    def _confident_part(
        self, answer: Answer, stored_objects: Sequence[StoredObject | None], to: str, now_ns: int
    ) -> Answer:
        """The answer without what must not leave a Genie: the objects below C_T (Section III-D),
        and those that the freshness policy keeps back from the car ``to`` (from other Genies:
        ``""``).
        """
        threshold, objects = self.threshold, answer.objects or ()
        if not self._freshness.keeps_back:
            confident = [detection for detection in objects if detection.confidence >= threshold]
            return answer if len(confident) == len(objects) else answer.with_objects(confident)
        serves = self._freshness.serves
        return answer.with_objects(
            [
                detection
                for detection, stored in zip(objects, stored_objects, strict=True)
                if detection.confidence >= threshold
                and (stored is None or serves(stored, to, now_ns))
            ]
        )

    def forget(self, now_ns: int) -> list[StoredObject]:
        """Removes and returns the objects whose time is over by the freshness policy."""
        forgotten = []
        waiting = self._to_forget
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, stored = waiting[0]
            expires_ns = self._freshness.expires_ns(stored)
            if expires_ns is None:
                heapq.heappop(waiting)
            elif expires_ns > due_ns:  # it has been seen since
                heapq.heapreplace(waiting, (expires_ns, next(self._ties), stored))
            else:
                heapq.heappop(waiting)
                forgotten.append(stored)
                self._remove(stored)
        return forgotten

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        """The confident objects in view. See ``maps.Map``."""
        objects = self.in_view(viewer.pose, viewer.horizontal_fov_rad, range_m)
        if self._freshness.keeps_back:
            serves, car = self._freshness.serves, viewer.header.origin
            objects = [stored for stored in objects if serves(stored, car, now_ns)]
        return tuple([stored.as_detection() for stored in objects]), None

    def match(self, label: str, location: Location) -> StoredObject | None:
        """The stored object that a sighting of class ``label`` at ``location`` shows: the nearest
        that fits.
        """
        return self._locations.nearest(None if self._any_class else label, location)

    def at(self, location: Location) -> list[StoredObject]:
        """``OBJECT_MAP[location]``: every stored object, of any class, at a location."""
        return self._locations.at(location)

    def in_view(
        self, pose: CameraPose, horizontal_fov_rad: float, range_m: float
    ) -> list[StoredObject]:
        """The objects with C >= C_T inside a camera's horizontal field of view, up to ``range_m``
        away.
        """
        threshold = self.threshold
        sector = ViewSector(pose, horizontal_fov_rad, range_m)
        nearby = self._view_grid.inside(*sector.box())
        return sector.inside([stored for stored in nearby if stored.confidence >= threshold])

    def _add(
        self, seen: Detection, location: Location, now_ns: int, header: Header | None
    ) -> StoredObject:
        policy = self._freshness
        stored = StoredObject(
            next(self._numbers),
            seen,
            location,
            now_ns,
            origins={} if policy.keeps_back or policy.notes_sightings else NO_NOTES,
            counted_ns={} if self._counts_origins else NO_NOTES,
        )
        if header is not None:
            if self._counts_origins:
                stored.counted_ns[header.origin] = header.stamp_ns
            policy.seen(stored, seen.score, header)
        expires_ns = policy.expires_ns(stored)
        if expires_ns is not None:
            heapq.heappush(self._to_forget, (expires_ns, next(self._ties), stored))
        self._locations.add(stored)
        self._view_grid.add(self._view_grid.cell(stored.east_m, stored.north_m), stored)
        self._threshold.added(stored.score, stored.confidence)
        self._count += 1
        return stored

    def _remove(self, stored: StoredObject) -> None:
        self._boosted.clear()
        self._locations.remove(stored)
        self._view_grid.remove(self._view_grid.cell(stored.east_m, stored.north_m), stored)
        self._threshold.removed(stored.confidence)
        self._count -= 1
