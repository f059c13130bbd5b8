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
        lookups = ObjectLookups(answer.header, "sighting", 0, 0, 0, 0.0, 0)
        threshold = self.threshold
        for sighting in answer.objects:  # line 3
            if sighting.location is not None:
                from_map = sighting.placed_by == "map"
                before, stored = self.sight(sighting, now_ns)  # lines 4 to 7
                stored.note_frame(sighting.seen_in if from_map else looked_in)
                lookups.requests += 1
                if before is not None:
                    lookups.hits += before >= threshold
                    lookups.updates += 1
                    lookups.boost_sum += stored.confidence - before
                    sighting = sighting.with_confidence(stored.confidence)
                if names_changes:
                    changes.append(MapChange.of(stored))
            objects.append(sighting)
        lookups.changes, lookups.objects = tuple(changes), len(self)
        return answer.with_objects(objects), lookups

    def sight(self, sighting: Detection, now_ns: int = 0) -> tuple[float | None, StoredObject]:
        """Lines 4 to 7: boosts the stored object that ``seen`` shows, or adds it. Returns the
        confidence before (``None`` for a new object) and the stored object.
        """
        assert sighting.location is not None
        stored = self.match(sighting.label, sighting.location)  # line 4
        if stored is None:
            return None, self._add(sighting, sighting.location, now_ns)  # line 7
        if self._forget_after_ns is not None:
            self._last_ns[stored] = now_ns
            self._last_ns.move_to_end(stored)
        before = stored.confidence
        after = self._boosted_confidence(before, sighting.confidence, self._rate)  # line 5
        stored.set_confidence(after)
        self._threshold.changed(before, after)
        return before, stored

    def enhanced_cache_boost_data(
        self, answer: Answer, header: Header
    ) -> tuple[Answer, ObjectLookups | None]:
        """Lines 8 to 13: adds the confident stored objects at the locations of a stored answer,
        each once. ``header`` is that of the request.
        """
        if answer.objects is None:  # line 9
            return answer, None
        objects: list[Detection] = []
        others: list[StoredObject] = []
        shown: set[int] = set()
        lookups = ObjectLookups(header, "boost", 0, 0, 0, 0.0, len(self))
        for detection in answer.objects:  # line 10
            if detection.location is not None:
                confident = [
                    stored
                    for stored in self.at(detection.location)  # line 11
                    if stored.confidence >= self.threshold  # line 12
                ]
                others += confident  # line 13; added below, lest line 10 iterates over them
                lookups.requests += 1
                lookups.hits += bool(confident)
                itself = self.match(detection.label, detection.location)
                if itself is not None:
                    shown.add(itself.number)
                    detection = detection.with_confidence(itself.confidence)
            objects.append(detection)
        for stored in others:
            if stored.number not in shown:
                shown.add(stored.number)
                objects.append(stored.as_detection())
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
        forgotten: list[StoredObject] = []
        while self._last_ns and self._forget_after_ns is not None:
            stored, last_ns = next(iter(self._last_ns.items()))
            if last_ns + self._forget_after_ns > now_ns:
                break
            forgotten.append(stored)
            self._remove(stored)
        return forgotten

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
        return [stored for stored in in_sector if stored.confidence >= threshold]

    def _add(self, sighting: Detection, location: Location, now_ns: int) -> StoredObject:
        stored = StoredObject(self._next_number, sighting, location)
        if self._forget_after_ns is not None:
            self._last_ns[stored] = now_ns
        self._count += 1
        self._next_number += 1
        self._places.add(stored, stored.label, location[0], location[1])
        if self._same_location is not None:
            self._same_location.add(stored)
        self._threshold.added(stored.confidence)
        return stored

    def _remove(self, stored: StoredObject) -> None:
        del self._last_ns[stored]
        self._places.remove(stored, stored.label, stored.location[0], stored.location[1])
        if self._same_location is not None:
            self._same_location.remove(stored)
        self._threshold.removed(stored.confidence)
        self._count -= 1


class SameLocation:
    """``location_key: exact``: the objects of a map by their very coordinates, as printed, and not
    within a gate of them.
    """

    def __init__(self) -> None:
        self._objects: dict[Location, list[StoredObject]] = {}

    def add(self, stored: StoredObject) -> None:
        self._objects.setdefault(stored.location, []).append(stored)

    def remove(self, stored: StoredObject) -> None:
        self._objects[stored.location].remove(stored)

    def nearest(self, label: str | None, location: Location) -> StoredObject | None:
        """The oldest object of a class (``None``: of any) at a location."""
        for stored in self._objects.get(location, ()):
            if label is None or stored.label == label:
                return stored
        return None

    def at(self, location: Location) -> list[StoredObject]:
        """Every object, of any class, at a location."""
        return list(self._objects.get(location, ()))
