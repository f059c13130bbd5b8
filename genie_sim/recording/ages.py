"""Since when consumers hold objects."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.messages import Detections
from genie_sim.recording.joins import Array
from genie_sim.recording.objects import Objects, Sight

NOT_YET_NS = 2**62


class Given(NamedTuple):
    """An answer in a consumer's hands: the number of its car, how many of the car's instants were
    before, and the answer.
    """

    car: int
    turn: int
    answer: Detections


class Sights(NamedTuple):
    """Labels at places: the number of the car, the turn and the code (``Objects.sights``)."""

    car: Array
    turn: Array
    code: Array


class FirstSeen:
    """When an object of a label was first in an answer at exactly this place, for as long as it is
    held there ever since.
    """

    def __init__(self) -> None:
        self._seen_ns: dict[int, dict[Sight, int]] = {}  # of each car, at the end of a window

    def seen_ns(
        self, objects: Objects, given: Sequence[Given], held: Sights, turns: Mapping[int, int]
    ) -> Array:
        """Returns the stamp [ns] of each object that is held, ``NOT_YET_NS`` if no answer has had
        it since it was last not held.

        ``given`` are the answers of a window in their order, ``turns`` says how many instants of
        each car are in it.
        """
        answered, stamps_ns = self._answered(objects, given, turns)
        sights, turn_count = len(objects.sights), max(turns.values(), default=0) + 2
        answer_keys, held_keys = (
            (of.car * sights + of.code) * turn_count + of.turn for of in (answered, held)
        )
        order = np.argsort(answer_keys, kind="stable")
        answer_keys, first_ns = answer_keys[order], np.append(stamps_ns[order], NOT_YET_NS)
        keys, rows, inverse = np.unique(held_keys, return_index=True, return_inverse=True)
        # A sight is held from the begin of a run of turns on; its first answer since then counts.
        begins = np.where(np.diff(keys, prepend=-2) == 1, 0, keys)
        places = np.searchsorted(answer_keys, np.maximum.accumulate(begins))
        is_known = np.append(answer_keys, keys.max(initial=0) + 1)[places] <= keys
        seen_ns = np.where(is_known, first_ns[places], NOT_YET_NS)

        names: list[Sight] = list(objects.sights)
        last = np.array([turns.get(car, 0) for car in range(max(turns, default=-1) + 1)])
        still = is_known & (held.turn[rows] == last[held.car[rows]] - 1)
        for car, code, stamp_ns in zip(
            held.car[rows[still]].tolist(),
            held.code[rows[still]].tolist(),
            seen_ns[still].tolist(),
            strict=True,
        ):
            self._seen_ns.setdefault(car, {})[names[code]] = stamp_ns
        for car, turn, code, stamp_ns in zip(
            *(column.tolist() for column in (*answered, stamps_ns)), strict=True
        ):
            if turn == turns.get(car, 0):
                self._seen_ns.setdefault(car, {}).setdefault(names[code], stamp_ns)
        return seen_ns[inverse]

    def _answered(
        self, objects: Objects, given: Sequence[Given], turns: Mapping[int, int]
    ) -> tuple[Sights, Array]:
        """What answers show, and their stamps [ns]: first those before this window."""
        earlier = [
            (car, 0, objects.sights[sight], stamp_ns)
            for car in {*turns, *(answer.car for answer in given)}
            for sight, stamp_ns in self._seen_ns.pop(car, {}).items()
        ]
        number, counts = objects.numbers([of.answer.objects for of in given])
        rows = np.array([(of.car, of.turn, of.answer.header.stamp_ns) for of in given], np.int64)
        car, turn, stamp_ns = np.repeat(rows.reshape(-1, 3), counts, axis=0).T
        columns = car, turn, objects.columns().sight[number], stamp_ns
        joined = np.concatenate(
            [np.array(earlier, dtype=np.int64).reshape(-1, 4), np.stack(columns, axis=1)]
        )
        return Sights(*joined.T[:3]), joined.T[3]
