"""Since when consumers hold objects."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.messages import Detections
from genie_sim.recording.joins import Array, turns
from genie_sim.recording.objects import Objects, Sight

NOT_YET_NS = 2**62


class Given(NamedTuple):
    """An answer in a consumer's hands: how many scenes of the window were before, the number of its
    car, and the answer.
    """

    scenes: int
    car: int
    answer: Detections


class _Stamps(NamedTuple):
    """Since when [ns] the consumers of some cars hold some sights; ``turn`` is the first scene of
    the car in the window at which this counts.
    """

    car: Array
    sight: Array
    turn: Array
    stamp_ns: Array

    def rows(self, selection: Array) -> "_Stamps":
        """Those of a mask or of indices."""
        return _Stamps(*(column[selection] for column in self))


class FirstSeen:
    """When an object of a label was first in an answer at exactly this place, for as long as it is
    held there ever since.
    """

    def __init__(self) -> None:
        self._sights: dict[Sight, int] = {}
        self._known = _Stamps(*np.zeros((4, 0), dtype=np.int64))  # before the window

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
        and codes of sights (``Objects.sights``).
        """
        self._recode(objects)
        index, car = scenes
        of_scene, sight = held
        turn = turns(car)
        told = self._told(objects, given, index, car)
        # A number for each sight of each car, and in it one for each scene and for what comes after
        # the last one, with a gap behind.
        last = np.bincount(car, minlength=int(told.car.max(initial=-1)) + 1)
        steps, codes = int(last.max(initial=0)) + 2, objects.count
        told_key = (told.car * codes + told.sight) * steps + told.turn
        told_key, first = np.unique(told_key, return_index=True)
        told = told.rows(first)
        held_key = (car[of_scene] * codes + sight) * steps + turn[of_scene]
        held_key, row = np.unique(held_key, return_inverse=True)
        place = np.searchsorted(told_key, held_key)
        is_told = np.append(told_key, -1)[place] == held_key
        stamp_ns = np.where(is_told, np.append(told.stamp_ns, NOT_YET_NS)[place], NOT_YET_NS)
        # While it is held without a break, what was told first counts from then on.
        at = np.arange(len(held_key))
        is_begin = np.diff(held_key, prepend=-2) != 1
        begins = np.flatnonzero(is_begin)
        if len(at):
            first = np.minimum.reduceat(np.where(is_told, at, len(at)), begins)
            first = first[np.cumsum(is_begin) - 1]
            stamp_ns = np.append(stamp_ns, NOT_YET_NS)[np.where(at >= first, first, len(at))]
        result: Array = stamp_ns[row]

        of_car, held_turn = held_key // (codes * steps), held_key % steps
        stays = (held_turn == last[of_car] - 1) & (stamp_ns != NOT_YET_NS)
        columns = of_car, held_key // steps % codes, held_turn, stamp_ns
        known = _Stamps(*(column[stays] for column in columns))
        pending = told.rows(told.turn == last[told.car])
        known = _Stamps(*map(np.concatenate, zip(known, pending, strict=True)))
        _, first = np.unique(known.car * codes + known.sight, return_index=True)
        self._known = known.rows(first)._replace(turn=np.zeros(len(first), dtype=np.int64))
        return result

    def _told(
        self, objects: Objects, given: Sequence[Given], index: Array, car: Array
    ) -> _Stamps:
        """What is known from before the window, and what its answers show, in their order."""
        number, counts = objects.numbers([of.answer.objects for of in given])
        rows = [(of.scenes, of.car, of.answer.header.stamp_ns) for of in given]
        before, of_car, stamp_ns = np.array(rows, dtype=np.int64).reshape(-1, 3).T
        most = int(max(index.max(initial=0), before.max(initial=0))) + 1
        keys = np.sort(car * most + index)
        turn = np.searchsorted(keys, of_car * most + before) - np.searchsorted(keys, of_car * most)
        answers = _Stamps(
            np.repeat(of_car, counts),
            objects.columns().sight[number],
            np.repeat(turn, counts),
            np.repeat(stamp_ns, counts),
        )
        return _Stamps(*map(np.concatenate, zip(self._known, answers, strict=True)))

    def _recode(self, objects: Objects) -> None:
        """Takes over new codes if the objects have forgotten theirs."""
        if objects.sights is not self._sights:
            names = {code: sight for sight, code in self._sights.items()}
            codes, row = np.unique(self._known.sight, return_inverse=True)
            new = [objects.sight(*names[code]) for code in codes.tolist()]
            self._known = self._known._replace(sight=np.array(new, dtype=np.int64)[row])
            self._sights = objects.sights
