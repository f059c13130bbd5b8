"""What an all-knowing cache would replay: an answer that anybody got, and that is right for this very frame."""

import math
from collections.abc import Sequence

from genie_sim.core.caches.cache import SAME_F1
from genie_sim.core.matching import SAME_M, Placed, f1, placed
from genie_sim.messages import Detection, Detections

Cell = tuple[str, int, int]


class KnownAnswers:
    """All answers so far; ``right`` finds one for a frame of which the detector's own answer is known."""

    def __init__(self) -> None:
        self._answers: list[tuple[Detections, list[Placed]]] = []
        self._in_cell: dict[Cell, list[int]] = {}
        self._empty: Detections | None = None

    def __len__(self) -> int:
        return len(self._answers)

    def add(self, answer: Detections) -> None:
        """Somebody got this answer."""
        objects = placed(answer.objects)
        if not objects:
            self._empty = answer
            return
        for cell in {_cell(one) for one in objects}:
            self._in_cell.setdefault(cell, []).append(len(self._answers))
        self._answers.append((answer, objects))

    def right(self, detected: Sequence[Detection]) -> Detections | None:
        """The newest answer whose objects are the ``detected`` ones, F1 at least 0.8; ``None`` where there is none.

        It must share an object with them, so only answers with one in reach are compared.
        """
        wanted = placed(detected)
        if not wanted:
            return self._empty
        shared: dict[int, int] = {}
        for one in wanted:
            label, column, row = _cell(one)
            around = [(label, column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            for number in {number for cell in around for number in self._in_cell.get(cell, ())}:
                shared[number] = shared.get(number, 0) + 1
        for number in sorted(shared, reverse=True):
            answer, objects = self._answers[number]
            if 2 * shared[number] >= SAME_F1 * (len(wanted) + len(objects)) and f1(objects, wanted) >= SAME_F1:
                return answer
        return None


def _cell(one: Placed) -> Cell:
    label, east_m, north_m = one
    return label, math.floor(east_m / SAME_M), math.floor(north_m / SAME_M)
