"""Since when consumers hold objects."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.core.messages import Detections
from genie_sim.judge.joins import Array, turns
from genie_sim.judge.objects import Objects

NOT_YET_NS = 2**62


class Given(NamedTuple):
    """An answer in a consumer's hands: how many scenes of the window were before, the number of its
    car, and the answer.
    """

    scenes: int
    car: int
    answer: Detections


class _HeldSince(NamedTuple):
    """Since when [ns] the consumers of some cars hold objects: of a label at a place, east, north
    and up [m]. ``turn`` is the first scene of the car in the window at which this counts.
    """

    car: Array
    label: Array
    east_m: Array
    north_m: Array
    up_m: Array
    turn: Array
    stamp_ns: Array

    def rows(self, selection: Array) -> "_HeldSince":
        """Those of a mask or of indices."""
        return _HeldSince(*(column[selection] for column in self))


class FirstSeen:
    """When an object of a label was first in an answer at exactly this place, for as long as it is
    held there ever since.
    """

    def __init__(self) -> None:
        # before the window
        self._known = _HeldSince(*(np.zeros(0, dtype=code) for code in "qqdddqq"))

    def seen_ns(
        self,
        objects: Objects,
        given: Sequence[Given],
        *,
        scenes: tuple[Array, Array],
        held: tuple[Array, Array],
    ) -> Array:
        """Returns the stamp [ns] of each object that is held, ``NOT_YET_NS`` if no answer has had
        it since it was last not held.

        ``given`` are the answers of a window, in order; ``scenes`` the indices of its scenes and
        the numbers of their cars; ``held`` are the objects: which of these scenes, scene by scene,
        and the object's number.
        """
        index, car = scenes
        of_scene, number = held
        turn = turns(car)
        told = self._told(objects, given, index, car)
        known = objects.columns()
        used, row = np.unique(number, return_inverse=True)
        sights = [
            np.concatenate([getattr(told, name), getattr(known, name)[used]])
            for name in ("label", "east_m", "north_m", "up_m")
        ]
        codes, count = _codes(sights)
        told_sight, sight = codes[: len(told.car)], codes[len(told.car) :][row]
        # A number for each sight of each car, and in it one for each scene and for what comes after
        # the last one, with a gap behind.
        scenes_of = np.bincount(car, minlength=int(told.car.max(initial=-1)) + 1)
        steps = int(scenes_of.max(initial=0)) + 2
        told_key = (told.car * count + told_sight) * steps + told.turn
        told_key, first = np.unique(told_key, return_index=True)
        told, told_sight = told.rows(first), told_sight[first]
        held_key = (car[of_scene] * count + sight) * steps + turn[of_scene]
        held_key, of_key, row = np.unique(held_key, return_index=True, return_inverse=True)
        place = np.searchsorted(told_key, held_key)
        is_told = np.append(told_key, -1)[place] == held_key
        stamp_ns = np.where(is_told, np.append(told.stamp_ns, NOT_YET_NS)[place], NOT_YET_NS)
        # While it is held without a break, what was told first counts from then on.
        at = np.arange(len(held_key))
        is_begin = np.diff(held_key, prepend=-2) != 1
        if len(at):
            told_at = np.where(is_told, at, len(at))
            since = np.minimum.reduceat(told_at, np.flatnonzero(is_begin))
            since = since[np.cumsum(is_begin) - 1]
            stamp_ns = np.append(stamp_ns, NOT_YET_NS)[np.where(at >= since, since, len(at))]
        result: Array = stamp_ns[row]

        of_scene, number = of_scene[of_key], number[of_key]
        is_last = turn[of_scene] == scenes_of[car[of_scene]] - 1
        stays = np.flatnonzero(is_last & (stamp_ns != NOT_YET_NS))
        pending = np.flatnonzero(told.turn == scenes_of[told.car])
        keys = np.append(held_key[stays] // steps, told_key[pending] // steps)
        still = known.rows(number[stays])
        held_on = _HeldSince(
            car=car[of_scene[stays]],
            label=still.label,
            east_m=still.east_m,
            north_m=still.north_m,
            up_m=still.up_m,
            turn=turn[of_scene[stays]],
            stamp_ns=stamp_ns[stays],
        )
        both = zip(held_on, told.rows(pending), strict=True)
        _, first = np.unique(keys, return_index=True)
        self._known = _HeldSince(*map(np.concatenate, both)).rows(first)
        self._known.turn[:] = 0
        return result

    def _told(
        self, objects: Objects, given: Sequence[Given], index: Array, car: Array
    ) -> _HeldSince:
        """What is known from before the window, and what its answers show, in their order."""
        number, counts = objects.numbers([of.answer.objects for of in given])
        rows = [(of.scenes, of.car, of.answer.header.stamp_ns) for of in given]
        before, of_car, stamp_ns = np.array(rows, dtype=np.int64).reshape(-1, 3).T
        most = int(max(index.max(initial=0), before.max(initial=0))) + 1
        keys = np.sort(car * most + index)
        turn = np.searchsorted(keys, of_car * most + before) - np.searchsorted(keys, of_car * most)
        shown = objects.columns().rows(number)
        answers = _HeldSince(
            car=np.repeat(of_car, counts),
            label=shown.label,
            east_m=shown.east_m,
            north_m=shown.north_m,
            up_m=shown.up_m,
            turn=np.repeat(turn, counts),
            stamp_ns=np.repeat(stamp_ns, counts),
        )
        return _HeldSince(*map(np.concatenate, zip(self._known, answers, strict=True)))


def _codes(columns: Sequence[Array]) -> tuple[Array, int]:
    """A number for each different row of some columns, row by row, and how many there are."""
    order = np.lexsort(columns)
    is_other = np.zeros(len(order), dtype=bool)
    is_other[:1] = True
    for column in columns:
        in_order = column[order]
        is_other[1:] |= in_order[1:] != in_order[:-1]
    codes = np.empty(len(order), dtype=np.int64)
    codes[order] = np.cumsum(is_other) - 1
    return codes, int(np.count_nonzero(is_other))
