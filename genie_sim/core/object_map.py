"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every
sighting.
"""

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush, heapreplace

from genie_sim.base.place_index import PlaceIndex
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.freshness.never import Never
from genie_sim.core.locations import SameLocation
from genie_sim.core.maps import EnhancedAnswer, LookupCounts, Map, Viewer, counts_again
from genie_sim.core.messages import Answer, CameraPose, Detection, Header, Location, MapChange
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.stored_object import StoredObject
from genie_sim.core.thresholds import threshold_of
from genie_sim.core.view import ViewSector


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
        self._keeps_back = self._freshness.keeps_back
        self._notes_sightings = self._freshness.notes_sightings
        self._forgets = self._freshness.forgets
        self._boosted_confidence = confidence_rule or CONFIDENCE_RULES[rules.rule]
        self._rate = rules.rate  # lambda
        self._threshold = threshold_of(rules.threshold)
        self._ranks_confidences = self._threshold.ranks_confidences
        self._places: PlaceIndex[StoredObject] = PlaceIndex(view_cell_m, rules.gate_m)
        self._same_location = SameLocation() if rules.location_key == "exact" else None
        self._any_class = rules.one_per_location
        self._counts_origins = rules.confidence_source == "origins"
        self._count = 0
        self._next_number = 0  # of an object
        # a heap: when to look at the object, and a tie-breaker
        self._to_forget: list[tuple[int, int, StoredObject]] = []
        self._next_tie = 0
        # of stored answers, by identity: what EnhancedCacheBoostData made of them; holds as long as
        # the map does not change
        self._boosted: dict[int, tuple[Answer, EnhancedAnswer]] = {}

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return iter(self._places)

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
            return EnhancedAnswer.of_one(answer)
        return self._learn(answer, now_ns, names_changes, leaves)

    def _learn(
        self, answer: Answer, now_ns: int, names_changes: bool, leaves: bool
    ) -> EnhancedAnswer:
        """Lines 3 to 7 of Algorithm 2, and what of the answer goes where."""
        threshold = self._threshold.value
        header = answer.header if answer.source == "detector" else None
        looked_at = answer.seen_in or answer.header
        objects: list[Detection] = []
        stored_objects: list[StoredObject | None] = []  # that ``objects`` show
        changes: list[MapChange] = []
        requests = hits = updates = 0
        boost_sum = 0.0
        for seen in answer.objects or ():  # line 3
            stored = None
            if seen.location is not None:
                requests += 1
                is_of_map = seen.method == "map"
                # lines 4 to 7
                before, stored = self.sight(seen, now_ns, None if is_of_map else header)
                stored.look(seen.seen_in if is_of_map else looked_at)
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
            return EnhancedAnswer.of_one(answer, counts)
        answer = answer.with_objects(objects)
        to_clients = to_neighbours = self._confident_part(
            answer, stored_objects, answer.header.origin, now_ns
        )
        if self._keeps_back:
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
        if self._boosted:
            self._boosted.clear()
        # line 4
        stored = self.match(seen.label, seen.location)
        if stored is None:
            return None, self._add(seen, seen.location, now_ns, header)  # line 7
        before = stored.confidence
        if not self._counts_origins or (
            header is not None and counts_again(stored.counted_ns, header)
        ):
            # line 5
            stored.boost(self._boosted_confidence(before, seen.confidence, self._rate))
            if self._ranks_confidences:
                self._threshold.changed(before, stored.confidence)
        stored.seen_ns = now_ns
        stored.sightings += 1
        if self._notes_sightings and header is not None:
            self._freshness.seen(stored, seen.score, header)
        return before, stored

    def enhanced_cache_boost_data(
        self, answer: Answer, header: Header, viewer: Viewer | None, now_ns: int
    ) -> EnhancedAnswer:
        """Algorithm 2, EnhancedCacheBoostData: adds the stored objects at the answer's locations,
        each once, and leaves out what is below C_T.
        """
        if answer.objects is None:  # line 9
            return EnhancedAnswer.of_one(answer)
        if not self._keeps_back:
            remembered = self._boosted.get(id(answer))
            if remembered is not None:
                return remembered[1]
        objects: list[Detection] = []
        stored_objects: list[StoredObject | None] = []  # that ``objects`` show
        others: list[StoredObject] = []
        requests = hits = 0
        threshold, any_class = self._threshold.value, self._any_class
        for detection in answer.objects:  # line 10
            stored = None
            if detection.location is not None:
                requests += 1
                candidates, is_hit = 0, False
                for other in self.at(detection.location):  # line 11
                    if other.confidence >= threshold:  # line 12
                        is_hit = True
                        others.append(other)  # line 13; added below, lest line 10 iterates over it
                    if any_class or other.label == detection.label:
                        candidates += 1
                        stored = other
                hits += is_hit
                if candidates > 1:  # the nearest
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
        if not self._keeps_back:
            self._boosted[id(answer)] = answer, result
        return result

    def _confident_part(
        self, answer: Answer, stored_objects: Sequence[StoredObject | None], to: str, now_ns: int
    ) -> Answer:
        """The answer without what must not leave a Genie: the objects below C_T (Section III-D),
        and those that the freshness policy keeps back from the car ``to`` (from other Genies:
        ``""``).
        """
        threshold, objects = self._threshold.value, answer.objects or ()
        keeps_back = self._keeps_back
        confident = []
        for place, detection in enumerate(objects):
            if detection.confidence < threshold:
                continue
            stored = stored_objects[place] if keeps_back else None
            if stored is None or self._freshness.serves(stored, to, now_ns):
                confident.append(detection)
        return answer if len(confident) == len(objects) else answer.with_objects(confident)

    def forget(self, now_ns: int) -> list[StoredObject]:
        """Removes and returns the objects whose time is over by the freshness policy."""
        forgotten = []
        waiting = self._to_forget
        while waiting and waiting[0][0] <= now_ns:
            due_ns, _, stored = waiting[0]
            expires_ns = self._freshness.expires_ns(stored)
            if expires_ns is None:
                heappop(waiting)
            elif expires_ns > due_ns:  # it has been seen since
                heapreplace(waiting, (expires_ns, self._next_tie, stored))
                self._next_tie += 1
            else:
                heappop(waiting)
                forgotten.append(stored)
                self._remove(stored)
        return forgotten

    def visible(
        self, viewer: Viewer, range_m: float, now_ns: int
    ) -> tuple[tuple[Detection, ...], int | None]:
        """The confident objects in view. See ``maps.Map``."""
        keeps_back = self._keeps_back
        car = viewer.header.origin
        objects = self.in_view(viewer.pose, viewer.horizontal_fov_rad, range_m)
        if keeps_back:
            objects = [stored for stored in objects if self._freshness.serves(stored, car, now_ns)]
        return tuple([stored.as_detection() for stored in objects]), None

    def match(self, label: str, location: Location) -> StoredObject | None:
        """The stored object that a sighting of class ``label`` at ``location`` shows: the nearest
        that fits.
        """
        kind = None if self._any_class else label
        if self._same_location is not None:
            return self._same_location.nearest(kind, location)
        return self._places.nearest(kind, location[0], location[1])

    def at(self, location: Location) -> list[StoredObject]:
        """``OBJECT_MAP[location]``: every stored object, of any class, at a location."""
        if self._same_location is not None:
            return self._same_location.at(location)
        return self._places.at(location[0], location[1])

    def in_view(
        self, pose: CameraPose, horizontal_fov_rad: float, range_m: float
    ) -> list[StoredObject]:
        """The objects with C >= C_T inside a camera's horizontal field of view, up to ``range_m``
        away.
        """
        threshold = self._threshold.value
        sector = ViewSector(pose, horizontal_fov_rad, range_m)
        in_sector = self._places.in_sector(
            sector.box(), pose[:2], sector.ahead, sector.min_cosine, range_m
        )
        return [stored for stored in in_sector if stored.confidence >= threshold]

    def _add(
        self, seen: Detection, location: Location, now_ns: int, header: Header | None
    ) -> StoredObject:
        policy = self._freshness
        stored = StoredObject(self._next_number, seen, location, now_ns)
        self._next_number += 1
        if self._keeps_back or self._notes_sightings:
            stored.origins = {}
        if self._counts_origins:
            stored.counted_ns = {} if header is None else {header.origin: header.stamp_ns}
        if header is not None and self._notes_sightings:
            policy.seen(stored, seen.score, header)
        expires_ns = policy.expires_ns(stored) if self._forgets else None
        if expires_ns is not None:
            heappush(self._to_forget, (expires_ns, self._next_tie, stored))
            self._next_tie += 1
        self._places.add(stored, stored.label, location[0], location[1])
        if self._same_location is not None:
            self._same_location.add(stored)
        if self._ranks_confidences:
            self._threshold.added(stored.score, stored.confidence)
        self._count += 1
        return stored

    def _remove(self, stored: StoredObject) -> None:
        self._boosted.clear()
        self._places.remove(stored, stored.label, stored.location[0], stored.location[1])
        if self._same_location is not None:
            self._same_location.remove(stored)
        if self._ranks_confidences:
            self._threshold.removed(stored.confidence)
        self._count -= 1
