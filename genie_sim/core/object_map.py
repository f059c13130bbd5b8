"""Algorithm 2: the map from absolute locations to objects, whose confidence grows with every
sighting.
"""

from collections import OrderedDict
from collections.abc import Iterator

from genie_sim.base.place_index import PlaceIndex
from genie_sim.core.confidence import CONFIDENCE_RULES, ConfidenceRule
from genie_sim.core.messages import (
    Answer,
    CameraPose,
    Detection,
    Header,
    Location,
    MapChange,
    ObjectLookups,
)
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.stored_object import StoredObject
from genie_sim.core.thresholds import threshold_of
from genie_sim.core.view import ViewSector


class ObjectMap:
    """Location -> objects, in metres of one east-north-up frame.

    Parameters
    ----------
    rules : ObjectMapRules
        The settings.
    view_cell_m : float
        Side of the cells that speed up the question what is in view [m]; does not change results.
    confidence_rule : callable, optional
        How a sighting changes a confidence (line 5), in the place of the one that ``rules`` names.
    """

    def __init__(
        self,
        rules: ObjectMapRules,
        view_cell_m: float = 50.0,
        confidence_rule: ConfidenceRule | None = None,
    ) -> None:
        self._boosted_confidence = confidence_rule or CONFIDENCE_RULES[rules.rule]
        self._rate = rules.rate  # lambda
        self._threshold = threshold_of(rules.threshold)
        self._places: PlaceIndex[StoredObject] = PlaceIndex(view_cell_m, rules.gate_m)
        self._same_location = SameLocation() if rules.location_key == "exact" else None
        self._any_class = rules.one_per_location
        self._count = 0
        self._next_number = 0  # of an object
        self._forget_after_ns = rules.forget_after_ns
        # where objects are forgotten: when each was seen last, the longest ago first
        self._last_ns: OrderedDict[StoredObject, int] = OrderedDict()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[StoredObject]:
        return iter(self._places)

    @property
    def threshold(self) -> float:
        """C_T."""
        return self._threshold.value

    def enhanced_cache_new_data(
        self, answer: Answer, now_ns: int, names_changes: bool
    ) -> tuple[Answer, ObjectLookups | None]:
        """Lines 1 to 7: every object of an answer is a sighting. Returns the answer with the map's
        confidences. ``now_ns`` is the time of the Genie's clock [ns].
        """
        if answer.objects is None:  # line 2
            return answer, None
        looked_in = answer.seen_in or answer.header
        objects: list[Detection] = []
        changes: list[MapChange] = []
        lookups = ObjectLookups(answer.header, "sighting")
        threshold = self.threshold
        for sighting in answer.objects:  # line 3
            if sighting.location is not None:
                from_map = sighting.placed_by == "map"
                before, entry = self.sight(sighting, now_ns)  # lines 4 to 7
                entry.note_frame(sighting.seen_in if from_map else looked_in)
                lookups.requests += 1
                if before is not None:
                    lookups.hits += before >= threshold
                    lookups.updates += 1
                    lookups.boost_sum += entry.confidence - before
                    sighting = sighting.with_confidence(entry.confidence)
                if names_changes:
                    changes.append(MapChange.of(entry))
            objects.append(sighting)
        lookups.changes, lookups.objects = tuple(changes), len(self)
        return answer.with_objects(objects), lookups

    def sight(self, sighting: Detection, now_ns: int = 0) -> tuple[float | None, StoredObject]:
        """Lines 4 to 7: boosts the stored object that a sighting shows, or adds it. Returns the
        confidence before (``None`` for a new object) and the stored object.
        """
        assert sighting.location is not None
        entry = self.match(sighting.label, sighting.location)  # line 4
        if entry is None:
            return None, self._add(sighting, sighting.location, now_ns)  # line 7
        if self._forget_after_ns is not None:
            self._last_ns[entry] = now_ns
            self._last_ns.move_to_end(entry)
        before = entry.confidence
        after = self._boosted_confidence(before, sighting.confidence, self._rate)  # line 5
        entry.set_confidence(after)
        self._threshold.changed(before, after)
        return before, entry

    def enhanced_cache_boost_data(
        self, answer: Answer, header: Header
    ) -> tuple[Answer, ObjectLookups | None]:
        """Lines 8 to 13: adds the confident stored objects at the locations of a stored answer,
        each once. ``header`` is that of the request.
        """
        if answer.objects is None:  # line 9
            return answer, None
        objects: list[Detection] = []
        additions: list[StoredObject] = []
        numbers: set[int] = set()
        lookups = ObjectLookups(header, "boost", objects=len(self))
        for detection in answer.objects:  # line 10
            if detection.location is not None:
                confident = [
                    entry
                    for entry in self.at(detection.location)  # line 11
                    if entry.confidence >= self.threshold  # line 12
                ]
                additions += confident  # line 13; added below, lest line 10 iterates over them
                lookups.requests += 1
                lookups.hits += bool(confident)
                itself = self.match(detection.label, detection.location)
                if itself is not None:
                    numbers.add(itself.number)
                    detection = detection.with_confidence(itself.confidence)
            objects.append(detection)
        for entry in additions:
            if entry.number not in numbers:
                numbers.add(entry.number)
                objects.append(entry.as_detection())
        return answer.with_objects(objects), lookups

    def confident(self, answer: Answer) -> Answer:
        """The answer without the objects below C_T, which must not leave a Genie (Section
        III-D).
        """
        threshold, objects = self.threshold, answer.objects or ()
        confident = [item for item in objects if item.confidence >= threshold]
        return answer if len(confident) == len(objects) else answer.with_objects(confident)

    def forget(self, now_ns: int) -> list[StoredObject]:
        """Removes and returns the objects that nobody has seen for ``forget_after``."""
        entries: list[StoredObject] = []
        while self._last_ns and self._forget_after_ns is not None:
            entry, last_ns = next(iter(self._last_ns.items()))
            if last_ns + self._forget_after_ns > now_ns:
                break
            entries.append(entry)
            self._remove(entry)
        return entries

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
        sector = ViewSector(pose, horizontal_fov_rad, range_m)
        in_sector = self._places.in_sector(
            sector.box(), pose[:2], sector.ahead, sector.min_cosine, range_m
        )
        threshold = self.threshold
        return [entry for entry in in_sector if entry.confidence >= threshold]

    def _add(self, sighting: Detection, location: Location, now_ns: int) -> StoredObject:
        entry = StoredObject(self._next_number, sighting, location)
        if self._forget_after_ns is not None:
            self._last_ns[entry] = now_ns
        self._count += 1
        self._next_number += 1
        self._places.add(entry, entry.label, location[0], location[1])
        if self._same_location is not None:
            self._same_location.add(entry)
        self._threshold.added(entry.confidence)
        return entry

    def _remove(self, entry: StoredObject) -> None:
        del self._last_ns[entry]
        self._places.remove(entry, entry.label, entry.location[0], entry.location[1])
        if self._same_location is not None:
            self._same_location.remove(entry)
        self._threshold.removed(entry.confidence)
        self._count -= 1


class SameLocation:
    """``location_key: exact``: the objects of a map by their very coordinates, as printed, and not
    within a gate of them.
    """

    def __init__(self) -> None:
        self._objects: dict[Location, list[StoredObject]] = {}

    def add(self, entry: StoredObject) -> None:
        self._objects.setdefault(entry.location, []).append(entry)

    def remove(self, entry: StoredObject) -> None:
        self._objects[entry.location].remove(entry)

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        """The oldest object of a class (``None``: of any) at a location."""
        for entry in self._objects.get(location, ()):
            if label is None or entry.label == label:
                return entry
        return None

    def at(self, location: Location) -> list[StoredObject]:
        """Every object, of any class, at a location."""
        return list(self._objects.get(location, ()))
