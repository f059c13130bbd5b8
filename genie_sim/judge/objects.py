"""The objects of many answers, as columns."""

from array import array
from collections.abc import Sequence
from itertools import chain
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import class_of
from genie_sim.base.spans import rows_of_spans
from genie_sim.core.messages import Detection
from genie_sim.judge.joins import Array
from genie_sim.record.columns import Codes

MAX_KEPT = 100_000  # objects and lists of them, at the begin of a window
_label = attrgetter("label")
_location = attrgetter("location")
_motion = attrgetter("motion")


class ShownColumns(NamedTuple):
    """One row per object: codes of its label and of its class, where it is [m], and of a track its
    velocity [m/s].
    """

    label: Array
    class_: Array
    east_m: Array
    north_m: Array
    velocity_east_mps: Array
    velocity_north_mps: Array

    def rows(self, selection: Array) -> "ShownColumns":
        """Those of a mask or of indices."""
        return ShownColumns(*(column[selection] for column in self))


_NONE = ShownColumns(*(np.zeros(0, dtype=code) for code in "qqdddd"))


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
    """Numbers the objects that answers show: those of a list one after the other, once however
    often the list is shown.

    ``labels`` are codes of labels and classes, ``classes`` gives both for a label, ``cars`` are the
    numbers of cars.
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
        self._count = 0
        # by the list's identity: the number of its first object, and how many there are
        self._of_lists: dict[int, tuple[int, int]] = {}
        self._kept: list[Sequence[Detection]] = []  # whose identities must not be given to others
        self._parts = [_NONE]

    def numbers(self, shown: Sequence[Sequence[Detection]]) -> tuple[Array, Array]:
        """The numbers of those objects of some lists that have a place, list by list, and how many
        there are in each list.
        """
        known = self._of_lists
        new = {id(objects): objects for objects in shown if id(objects) not in known}
        if new:
            self._add(list(new.values()))
        spans = array("q", chain.from_iterable([known[id(objects)] for objects in shown]))
        first, counts = np.frombuffer(spans, dtype=np.int64).reshape(-1, 2).T
        return rows_of_spans(first, counts)[0], counts

    def columns(self) -> ShownColumns:
        """All that have been numbered."""
        if len(self._parts) > 1:
            self._parts = [ShownColumns(*map(np.concatenate, zip(*self._parts, strict=True)))]
        return self._parts[0]

    def _add(self, lists: Sequence[Sequence[Detection]]) -> None:
        """Numbers the objects of new lists."""
        self._kept += lists
        objects = list(chain.from_iterable(lists))
        placed = [item for item in objects if item.location is not None]
        counts = [len(of_list) for of_list in lists]
        if len(placed) < len(objects):
            counts = [sum(item.location is not None for item in of_list) for of_list in lists]
        for of_list, count in zip(lists, counts, strict=True):
            self._of_lists[id(of_list)] = self._count, count
            self._count += count
        classes = self.classes
        codes = array("q", chain.from_iterable([classes[label] for label in map(_label, placed)]))
        places = array("d", chain.from_iterable(map(_location, placed)))
        velocities_mps = np.zeros((len(placed), 2))
        motions = list(map(_motion, placed))
        if any(motions):
            for place, motion in enumerate(motions):
                if motion is not None:
                    velocities_mps[place] = motion.velocity_mps
        self._parts.append(
            ShownColumns(
                *np.frombuffer(codes, dtype=np.int64).reshape(-1, 2).T,
                *np.frombuffer(places).reshape(-1, 3).T[:2],
                *velocities_mps.T,
            )
        )
