"""A bound, not a method: a cache that knows which answers are right, has those of all cars at once,
and takes no time.
"""

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial

from genie_sim.base.matching import SAME_M, Placed, f1, placed
from genie_sim.core.messages import (
    Detection,
    Detections,
    Effect,
    Image,
    ImageLookup,
    Message,
    Publish,
)
from genie_sim.methods.similarity_cache import SAME_F1
from genie_sim.sim.method import (
    LOCAL,
    REMOTE,
    REMOTE_UPLINK,
    Costs,
    HostConfig,
    HostContext,
    LocalAndRemote,
    Method,
)

Cell = tuple[str, int, int]  # class, and east and north in multiples of SAME_M


class AnswerHistory:
    """All answers so far; ``right`` finds one for a frame if the detector's own answer is given."""

    def __init__(self) -> None:
        self._answers: list[tuple[Detections, list[Placed]]] = []
        self._in_cell: dict[Cell, list[int]] = {}
        self._empty: Detections | None = None

    def __len__(self) -> int:
        return len(self._answers)

    def add(self, answer: Detections) -> None:
        """One more answer that a car got."""
        objects = placed(answer.objects)
        if not objects:
            self._empty = answer
            return
        for cell in {_cell(item) for item in objects}:
            self._in_cell.setdefault(cell, []).append(len(self._answers))
        self._answers.append((answer, objects))

    def right(self, detections: Sequence[Detection]) -> Detections | None:
        """The newest answer whose objects match the ``detections``, F1 at least 0.8; ``None`` if
        there is none.

        It must share an object with them, so only answers with one in reach are compared.
        """
        places = placed(detections)
        if not places:
            return self._empty
        common: Counter[int] = Counter()  # objects that may be the same, by the answer's number
        for item in places:
            common.update(self._answers_around(item))
        for number in sorted(common, reverse=True):
            answer, objects = self._answers[number]
            highest_f1 = 2 * common[number] / (len(places) + len(objects))
            if highest_f1 >= SAME_F1 and f1(objects, places) >= SAME_F1:
                return answer
        return None

    def _answers_around(self, item: Placed) -> set[int]:
        """The numbers of the answers with an object of this class in this cell or beside it."""
        label, column, row = _cell(item)
        numbers: set[int] = set()
        for other_column in (column - 1, column, column + 1):
            for other_row in (row - 1, row, row + 1):
                numbers.update(self._in_cell.get((label, other_column, other_row), ()))
        return numbers


def _cell(item: Placed) -> Cell:
    label, east_m, north_m = item
    return label, math.floor(east_m / SAME_M), math.floor(north_m / SAME_M)


class Oracle(Method):
    """A bound: each car at once has every answer that any car got, and replays only those that are
    right.
    """

    title = "oracle (bound)"

    def __init__(self) -> None:
        self._history = AnswerHistory()

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        return HostConfig(
            detector=True,
            interceptor=partial(OracleInterceptor, f"{host.name}/oracle", self._history),
            uplink=REMOTE_UPLINK if host.has_edge else None,
            costs=Costs(is_free=True),
        )


class OracleInterceptor(LocalAndRemote):
    """Replays a right answer if there is one; else asks both detectors, and the first answer
    counts.
    """

    def __init__(self, name: str, history: AnswerHistory, *topics: tuple[str, ...]) -> None:
        super().__init__(name, *topics)
        self._history = history

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic != self._images:
            assert isinstance(message, Detections)
            self._history.add(message)
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        right = self._history.right(message.content.detections)
        outcome = "miss" if right is None else "hit"
        lookup = ImageLookup(message.header, outcome, "client", len(self._history))
        if right is None:
            return [
                lookup,
                *(Publish(self._images + suffix, message) for suffix in (LOCAL, REMOTE)),
            ]
        return [lookup, Publish(self._objects, right.credited("cache", self.name, message.header))]
