"""The distinct objects of many answers, as columns."""

from array import array
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.classes import class_of
from genie_sim.messages import Detection, Location
from genie_sim.recording.joins import Array
from genie_sim.recording.packed_rows import packed

UNKNOWN = -1
MAX_KEPT = 20_000  # distinct objects and lists of them, at the begin of a window

Sight = tuple[str, Location]  # an object's label and place


class Codes(dict[Any, int]):
    """A number for each key, in the order in which they are first asked for."""

    def __missing__(self, key: Any) -> int:
        self[key] = code = len(self)
        return code


class ShownColumns(NamedTuple):
    """One row per label and place, and one per track: codes of its label, of its class and of its
    label together with its place, where it is [m], and of a track its velocity [m/s] and the car
    and the time [ns] that saw it last (``UNKNOWN`` if it is no track).
    """

    label: Array
    class_: Array
    sight: Array
    east_m: Array
    north_m: Array
    velocity_east_mps: Array
    velocity_north_mps: Array
    seen_by: Array
    seen_ns: Array

    def rows(self, selection: Array) -> "ShownColumns":
        """Those of a mask or of indices."""
        return ShownColumns(*(column[selection] for column in self))


_TYPECODES = "qqqddddqq"
_NO_TRACK = 0.0, 0.0, UNKNOWN, UNKNOWN


class _Classes(dict[str, tuple[int, int]]):
    """Of each label its code and that of its class."""

    def __init__(self, labels: Codes) -> None:
        super().__init__()
        self._labels = labels

    def __missing__(self, label: str) -> tuple[int, int]:
        codes = self._labels[label], self._labels[class_of(label)]
        self[label] = codes
        return codes


class Objects:
    """Numbers the objects that answers show; those of one label at one place have one number, but
    for tracks.

    ``labels`` are codes of labels and classes, ``classes`` gives both for a label, ``cars`` are the
    numbers of cars, ``sights`` codes of labels at places.
    """

    def __init__(self) -> None:
        self.labels: Codes = Codes()
        self.cars: Codes = Codes()
        self.classes = _Classes(self.labels)
        self._begin()

    def begin_window(self) -> None:
        """Forgets the objects, which may not be shown any more, if they are many."""
        if self._count + len(self._kept) > MAX_KEPT:
            self._begin()

    def _begin(self) -> None:
        self.sights: dict[Sight, int] = {}
        self._count = 0
        self._of_lists: dict[int, bytes] = {}  # by the list's identity
        self._kept: list[Sequence[Detection]] = []  # whose identities must not be given to others
        self._new: list[Any] = []  # of rows that are not in the columns yet, row by row
        self._columns = ShownColumns(*(np.zeros(0, dtype=code) for code in _TYPECODES))

    def numbers(self, shown: Sequence[Sequence[Detection]]) -> tuple[Array, Array]:
        """The numbers of those objects of some lists that have a place, list by list, and how many
        there are in each list.
        """
        of_lists = [self._of_list(objects) for objects in shown]
        counts = np.array([len(numbers) for numbers in of_lists], dtype=np.int64)
        return np.frombuffer(b"".join(of_lists), dtype=np.int64), counts // np.int64().nbytes

    @property
    def count(self) -> int:
        """How many have been numbered."""
        return self._count

    def columns(self) -> ShownColumns:
        """All that have been numbered."""
        if self._new:
            parts = []
            for place, (column, code) in enumerate(zip(self._columns, _TYPECODES, strict=True)):
                new = packed(self._new, place, len(_TYPECODES), code)
                parts.append(np.append(column, np.frombuffer(new, dtype=code)))
            self._columns = ShownColumns(*parts)
            self._new.clear()
        return self._columns

    def sight(self, label: str, location: Location) -> int:
        """The code of a label at a place."""
        code = self.sights.get((label, location))
        if code is None:
            self.sights[label, location] = code = self._count
            self._add(label, location, code, _NO_TRACK)
        return code

    def _of_list(self, objects: Sequence[Detection]) -> bytes:
        """The numbers of the objects of a list, as the bytes of an array."""
        known = self._of_lists.get(id(objects))
        if known is not None:
            return known
        sights = self.sights
        numbers = []
        for detection in objects:
            label, location, motion = detection.label, detection.location, detection.motion
            if location is None:
                continue
            number = sights.get((label, location))
            if number is None:
                number = self.sight(label, location)
            if motion is not None:
                seen_by = self.cars[motion.seen.origin]
                track = (*motion.velocity_mps, seen_by, motion.seen.stamp_ns)
                number = self._add(label, location, number, track)
            numbers.append(number)
        of_list = array("q", numbers).tobytes()
        self._kept.append(objects)
        self._of_lists[id(objects)] = of_list
        return of_list

    def _add(
        self, label: str, location: Location, sight: int, track: tuple[float, float, int, int]
    ) -> int:
        """Adds a row; returns its number."""
        self._new += (*self.classes[label], sight, location[0], location[1], *track)
        self._count += 1
        return self._count - 1
