"""The distinct objects of many answers, as columns."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from genie_sim.classes import class_of
from genie_sim.messages import Detection, Location
from genie_sim.recording.joins import Array

UNKNOWN = -1


class Codes(dict[Any, int]):
    """A number for each key, in the order in which they are first asked for."""

    def __missing__(self, key: Any) -> int:
        self[key] = code = len(self)
        return code


class ObjectColumns(NamedTuple):
    """One row per distinct object that has a place: codes of its label, of its class and of the two
    together with its place, where it is [m], and of a track its velocity [m/s] and the car and the
    time [ns] that saw it last (``UNKNOWN`` if it is no track).
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

    def rows(self, selection: Array) -> "ObjectColumns":
        """Those of a mask or of indices."""
        return ObjectColumns(*(column[selection] for column in self))


_KINDS = [np.int64] * 3 + [np.float64] * 4 + [np.int64] * 2


class Objects:
    """Numbers the objects that answers show; one that several answers share has one number.

    ``labels`` are the codes of labels and classes, ``cars`` the numbers of cars.
    """

    def __init__(self, labels: Codes, cars: Codes) -> None:
        self.labels = labels
        self._cars = cars
        self.sights: Codes = Codes()  # of label and place
        self._numbers: dict[int, int] = {}  # by the object's identity
        self._of_lists: dict[int, list[int]] = {}  # by the list's identity
        self._kept: list[object] = []  # whose identities must not be given to others
        self._rows: list[tuple[Any, ...]] = []

    def numbers(self, objects: Sequence[Detection]) -> list[int]:
        """The numbers of those that have a place, in their order."""
        known = self._of_lists.get(id(objects))
        if known is not None:
            return known
        numbers = []
        for detection in objects:
            number = self._numbers.get(id(detection))
            if number is None:
                number = self._add(detection)
            if number != UNKNOWN:
                numbers.append(number)
        self._kept.append(objects)
        self._of_lists[id(objects)] = numbers
        return numbers

    def columns(self) -> ObjectColumns:
        """All that have been numbered."""
        columns = list(zip(*self._rows, strict=True)) or [()] * len(_KINDS)
        return ObjectColumns(
            *(np.array(column, dtype=kind) for column, kind in zip(columns, _KINDS, strict=True))
        )

    def _add(self, detection: Detection) -> int:
        self._kept.append(detection)
        if detection.location is None:
            self._numbers[id(detection)] = UNKNOWN
            return UNKNOWN
        self._numbers[id(detection)] = number = len(self._rows)
        labels, label, motion = self.labels, detection.label, detection.motion
        sight: tuple[str, Location] = (label, detection.location)
        seen_by, seen_ns, velocity_mps = UNKNOWN, UNKNOWN, (0.0, 0.0)
        if motion is not None:
            seen_by, seen_ns = self._cars[motion.seen.origin], motion.seen.stamp_ns
            velocity_mps = motion.velocity_mps
        codes = labels[label], labels[class_of(label)], self.sights[sight]
        places = *detection.location[:2], *velocity_mps
        self._rows.append((*codes, *places, seen_by, seen_ns))
        return number
