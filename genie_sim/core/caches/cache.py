"""What similarity caches share: a message cache whose keys are vectors, and the node around it."""

import functools
import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

from genie_sim.core.caches.nearest import NONE, Key, Nearest
from genie_sim.core.eviction import Eviction
from genie_sim.core.maps import Map
from genie_sim.core.matching import Placed, f1, placed
from genie_sim.core.message_cache import Answers, MessageCache, PendingIndex
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity, GenieRules
from genie_sim.core.similarity import Exact, KeyIndex
from genie_sim.messages import Answer, CameraPose, Detection

Replay = Literal["world", "camera"]
ORIGIN = CameraPose(0.0, 0.0, 0.0, 0.0)
SAME_F1 = 0.8  # assumed: from here on two answers are the same


class SimilarityCache(MessageCache):
    """Answers by the vectors of their pictures. A subclass may say which stored answer is replayed: ``choose``.

    ``replay``: its objects stand where they were in the ``world``, or as they did before the ``camera``, which the
    requester's pose then places. Up to ``reach`` a request may wait for the answer to another.
    """

    reach = NONE

    def __init__(self, eviction: Eviction, capacity: Capacity | None, replay: Replay) -> None:
        self.keys = Nearest()
        super().__init__(self.keys, eviction, capacity)
        self._replay = replay
        self._held: dict[Hashable, Objects] = {}

    def get(self, key: Hashable, now_ns: int) -> Answers | None:
        assert isinstance(key, Key)
        held = self.choose(key, now_ns)
        if held is None:
            return None
        self._eviction.used(held, now_ns)
        answers = self._answers[held]
        if self._replay == "world":
            return answers
        return {topic: moved(answer, held.pose, key.pose) for topic, answer in answers.items()}

    def choose(self, key: Key, now_ns: int) -> Key | None:
        """The stored key whose answers are replayed: the nearest up to ``reach`` away; ``None`` on a miss."""
        nearest = self.near(key, 1, now_ns, self.reach)
        return nearest[0][1] if nearest else None

    def near(
        self, key: Key, count: int, now_ns: int, radius: float = math.inf
    ) -> list[tuple[float, Key]]:
        """The nearest keys whose time is not over, as ``Nearest.near``."""
        found = self.keys.near(key, count, radius)
        expires_ns = self._eviction.expires_ns
        old = [
            one for _, one in found if (end_ns := expires_ns(one)) is not None and end_ns <= now_ns
        ]
        for one in old:
            self._remove(one)
        return self.near(key, count, now_ns, radius) if old else found

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        if key not in self._answers:
            assert isinstance(key, Key)
            self.learn(key, answer, now_ns)
        self._held.pop(key, None)
        super().put(key, topic, answer, now_ns)

    def learn(self, key: Key, answer: Answer, now_ns: int) -> None:
        """The first answer to a request is known, and about to be stored."""

    def seen(self, answers: Iterable[Answer], pose: CameraPose) -> "Objects":
        """The objects of answers to a request from ``pose``, in places that are comparable between requests."""
        there = ORIGIN if self._replay == "world" else pose
        return objects(
            tuple(
                placed(one for each in answers for one in moved(each, there, ORIGIN).objects or ())
            )
        )

    def held(self, key: Key) -> "Objects":
        """The same of the stored answers of a key."""
        found = self._held.get(key)
        if found is None:
            found = self._held[key] = self.seen(self._answers[key].values(), key.pose)
        return found

    def _remove(self, key: Hashable) -> None:
        super()._remove(key)
        self._held.pop(key, None)


class Objects:
    """What is in an answer; equal to itself only, so that a comparison made before is quickly found again."""

    __slots__ = ("placed",)

    def __init__(self, found: Sequence[Placed]) -> None:
        self.placed = found


objects = functools.lru_cache(maxsize=4096)(Objects)  # of the same places the same


@functools.lru_cache(maxsize=4096)
def same(one: Objects, other: Objects) -> bool:
    """Whether two answers are taken for the same."""
    return f1(one.placed, other.placed) >= SAME_F1


def moved(answer: Answer, there: CameraPose, here: CameraPose) -> Answer:
    """The answer with every object as far ahead and aside of ``here`` as it was of ``there``."""
    if there == here or answer.objects is None:
        return answer
    turn = here.heading_rad - there.heading_rad
    c, s = math.cos(turn), math.sin(turn)

    def place(one: Detection) -> Detection:
        if one.location is None:
            return one
        east_m, north_m, up_m = one.location
        east_m, north_m, up_m = east_m - there.east_m, north_m - there.north_m, up_m - there.up_m
        at = (
            here.east_m + c * east_m - s * north_m,
            here.north_m + s * east_m + c * north_m,
            here.up_m + up_m,
        )
        return Detection(one.label, one.score, one.box, at, one.confidence, one.method, one.motion)

    return answer.with_objects([place(one) for one in answer.objects])


def stores_nothing() -> MessageCache:
    """A message cache without room."""
    return MessageCache(Exact().index(), Eviction(), Capacity(entries=0))


def cache_node(
    rules: GenieRules,
    name: str,
    subscribed: tuple[str, ...],
    published: tuple[str, ...],
    *,
    key: Callable[[Any], Hashable],
    new_cache: Callable[[], MessageCache],
    pending: Callable[[], KeyIndex],
    **changes: Any,
) -> GenieNode:
    """A node that takes over a detector's topics with a cache alone: requests wait for the first answer, misses go to
    the detector and up, equal ones coalesce (``pending`` says which are equal). ``changes`` are other rules."""
    usual: dict[str, Any] = {
        "share_answers": "on_request",
        "miss_policy": "blocking",
        "pending_index": "across_topics",
    }
    usual["car_learns"] = "all"
    mine = replace(rules, **(usual | changes))
    waiting = PendingIndex(lambda header: header, pending)
    return GenieNode(name, subscribed, published, mine, key, new_cache, waiting, Map())
