"""Since when consumers hold objects."""

from collections import deque
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.messages import Detections
from genie_sim.recording.joins import Array, parts
from genie_sim.recording.objects import Objects, Sight

NOT_YET_NS = 2**62


class Given(NamedTuple):
    """An answer in a consumer's hands: how many scenes of the window were before, the number of its
    car, and the answer.
    """

    scenes: int
    car: int
    answer: Detections


class FirstSeen:
    """When an object of a label was first in an answer at exactly this place, for as long as it is
    held there ever since.
    """

    def __init__(self) -> None:
        self._sights: dict[Sight, int] = {}
        self._seen_ns: dict[int, dict[int, int]] = {}  # by car and code of the sight

    def seen_ns(
        self,
        objects: Objects,
        given: Sequence[Given],
        held: Iterable[tuple[int, int, list[int]]],
    ) -> Array:
        """Returns the stamp [ns] of each object that is held, ``NOT_YET_NS`` if no answer has had
        it since it was last not held.

        ``given`` are the answers of a window, ``held`` its scenes: the index, the number of the
        car, and codes of what is held there (``Objects.sights``). Both are in order.
        """
        self._recode(objects)
        number, counts = objects.numbers([of.answer.objects for of in given])
        shown = parts(objects.columns().sight[number], counts)
        answers = deque(zip(given, shown, strict=True))
        result: list[int] = []
        for scene, car, sights in held:
            while answers and answers[0][0].scenes <= scene:
                self._note(*answers.popleft())
            seen_ns = self._seen_ns.get(car, {})
            stamps_ns = [seen_ns.get(sight, NOT_YET_NS) for sight in sights]
            self._seen_ns[car] = {
                sight: stamp_ns
                for sight, stamp_ns in zip(sights, stamps_ns, strict=True)
                if stamp_ns != NOT_YET_NS
            }
            result += stamps_ns
        while answers:
            self._note(*answers.popleft())
        return np.array(result, dtype=np.int64)

    def _note(self, given: Given, sights: Sequence[int]) -> None:
        seen_ns = self._seen_ns.setdefault(given.car, {})
        stamp_ns = given.answer.header.stamp_ns
        for sight in sights:
            seen_ns.setdefault(sight, stamp_ns)

    def _recode(self, objects: Objects) -> None:
        """Takes over new codes if the objects have forgotten theirs."""
        if objects.sights is not self._sights:
            names = {code: sight for sight, code in self._sights.items()}
            for car, seen_ns in self._seen_ns.items():
                self._seen_ns[car] = {
                    objects.sight(*names[code]): stamp_ns for code, stamp_ns in seen_ns.items()
                }
            self._sights = objects.sights
