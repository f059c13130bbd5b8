"""A bound, not a method: a cache that knows which answers are right, has everybody's at once, and takes no time."""

import math
from collections.abc import Sequence
from functools import partial

from genie_sim.core.caches.cache import SAME_F1
from genie_sim.core.matching import SAME_M, Placed, f1, placed
from genie_sim.messages import Detection, Detections, Effect, Image, ImageLookup, Message, Publish
from genie_sim.methods.genie import REMOTE, UPLINK
from genie_sim.methods.similarity import LOCAL, TwoWays
from genie_sim.sim.station import Method, Place, Station

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
            if (
                2 * shared[number] >= SAME_F1 * (len(wanted) + len(objects))
                and f1(objects, wanted) >= SAME_F1
            ):
                return answer
        return None


def _cell(one: Placed) -> Cell:
    label, east_m, north_m = one
    return label, math.floor(east_m / SAME_M), math.floor(north_m / SAME_M)


class Oracle(Method):
    """A bound: each car at once has every answer that any car got, and replays only those that are right."""

    title = "oracle (bound)"

    def __init__(self) -> None:
        self._known = KnownAnswers()

    def on_car(self, place: Place) -> Station | None:
        if not place.sees:
            return None
        node = partial(AllKnowing, f"{place.name}/oracle", self._known)
        return Station(
            detector=True, interceptor=node, uplink=UPLINK if place.joined else None, free=True
        )


class AllKnowing(TwoWays):
    """Replays a right answer, or takes the first of both detectors: with the draws that they have, the faster way."""

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if topic != self._images:
            assert isinstance(message, Detections)
            self._known.add(message)
            return [Publish(self._objects, message)]
        assert isinstance(message, Image)
        right = self._known.right(message.content.detections)
        lookup = ImageLookup(
            message.header, "miss" if right is None else "hit", "client", len(self._known)
        )
        if right is not None:
            again = right.served("cache", self.name, message.header)
            return [lookup, Publish(self._objects, again)]
        return [lookup, *(Publish(self._images + suffix, message) for suffix in (LOCAL, REMOTE))]
