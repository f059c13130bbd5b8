"""What similarity caches share: a message cache whose keys are vectors, and its method."""

import functools
import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

from genie_sim.base.errors import UserError
from genie_sim.base.matching import Placed, f1, placed
from genie_sim.core.eviction import Eviction
from genie_sim.core.message_cache import Answers, MessageCache
from genie_sim.core.messages import Answer, CameraPose
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import Capacity, GenieRules
from genie_sim.core.similarity import Exact
from genie_sim.methods.nearest import NO_RADIUS, FeatureKey, Nearest, key_of
from genie_sim.sim.method import REMOTE_UPLINK, Costs, HostConfig, HostContext, Method

Replay = Literal["world", "camera"]
ORIGIN = CameraPose(0.0, 0.0, 0.0, 0.0)
SAME_F1 = 0.8  # assumed: from here on two answers are the same


class SimilarityCache(MessageCache):
    """Answers by the vectors of their pictures. A subclass may say which stored answer is replayed:
    ``choose``.

    ``replay``: its objects stand where they were in the ``world``, or as they did before the
    ``camera``, which the requester's pose then places. Up to ``reach`` a request may wait for the
    answer to another.
    """

    reach = NO_RADIUS

    def __init__(self, eviction: Eviction, capacity: Capacity | None, replay: Replay) -> None:
        self.keys = Nearest()
        super().__init__(self.keys, eviction, capacity)
        self._replay = replay
        self._stored_objects: dict[Hashable, AnswerObjects] = {}

    def get(self, key: Hashable, now_ns: int) -> Answers | None:
        assert isinstance(key, FeatureKey)
        match = self.choose(key, now_ns)
        if match is None:
            return None
        self.eviction.used(match, now_ns)
        answers = self.answers[match]
        if self._replay == "world":
            return answers
        return {topic: moved(answer, match.pose, key.pose) for topic, answer in answers.items()}

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        """The stored key whose answers are replayed: the nearest up to ``reach`` away; ``None`` on
        a miss.
        """
        nearest = self.near(key, 1, now_ns, self.reach)
        return nearest[0][1] if nearest else None

    def near(
        self, key: FeatureKey, count: int, now_ns: int, radius: float = math.inf
    ) -> list[tuple[float, FeatureKey]]:
        """The nearest keys whose time is not over, as ``Nearest.near``."""
        while True:
            neighbours = self.keys.near(key, count, radius)
            overdue = [neighbour for _, neighbour in neighbours if self._is_over(neighbour, now_ns)]
            if not overdue:
                return neighbours
            for neighbour in overdue:
                self.remove(neighbour)

    def _is_over(self, key: FeatureKey, now_ns: int) -> bool:
        expires_ns = self.eviction.expires_ns(key)
        return expires_ns is not None and expires_ns <= now_ns

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        if key not in self.answers:
            assert isinstance(key, FeatureKey)
            self.learn(key, answer, now_ns)
        self._stored_objects.pop(key, None)
        super().put(key, topic, answer, now_ns)

    def learn(self, key: FeatureKey, answer: Answer, now_ns: int) -> None:
        """The first answer to a request is known, and about to be stored."""

    def objects_of(self, answers: Iterable[Answer], pose: CameraPose) -> "AnswerObjects":
        """The objects of answers to a request from ``pose``, in places that are comparable between
        requests.
        """
        viewpoint = ORIGIN if self._replay == "world" else pose
        places: list[Placed] = []
        for answer in answers:
            places += placed(moved(answer, viewpoint, ORIGIN).objects or ())
        return answer_objects(tuple(places))

    def stored_objects(self, key: FeatureKey) -> "AnswerObjects":
        """The same of the stored answers of a key."""
        objects = self._stored_objects.get(key)
        if objects is None:
            objects = self.objects_of(self.answers[key].values(), key.pose)
            self._stored_objects[key] = objects
        return objects

    def remove(self, key: Hashable) -> None:
        super().remove(key)
        self._stored_objects.pop(key, None)


class AnswerObjects:
    """The objects of an answer; equal to itself only, so that results of comparisons can be
    cached.
    """

    __slots__ = ("placed",)

    def __init__(self, places: Sequence[Placed]) -> None:
        self.placed = places


# of the same places the same instance
answer_objects = functools.lru_cache(maxsize=4096)(AnswerObjects)


@functools.lru_cache(maxsize=4096)
def are_same(objects: AnswerObjects, more: AnswerObjects) -> bool:
    """Whether two answers are taken for the same."""
    return f1(objects.placed, more.placed) >= SAME_F1


def moved(answer: Answer, old: CameraPose, new: CameraPose) -> Answer:
    """The answer with every object as far ahead and aside of pose ``new`` as it was of ``old``."""
    if old == new or answer.objects is None:
        return answer
    objects = [
        item if item.location is None else item.with_location(old.carried(item.location, new))
        for item in answer.objects
    ]
    return answer.with_objects(objects)


def stores_nothing() -> MessageCache:
    """A message cache without room."""
    return MessageCache(Exact().index(), Eviction(), Capacity(entries=0))


def check_neighbour(host: HostContext, edge: str, setting: str) -> None:
    """Raises ``UserError`` unless a host can ask an edge, which ``setting`` names."""
    if edge not in host.neighbours:
        raise UserError(
            f"{setting}: {host.name} is no neighbour of {edge}, and can ask it nothing; "
            "edge_neighbours says with how many edges each is connected"
        )


def cache_rules(rules: GenieRules, *, share_requests: bool) -> GenieRules:
    """The settings of a node with a cache alone, on cars and edges alike: an answer goes to those
    who asked for it, when it is there, and all answers are stored. Misses go to the detector, and
    to ``-remote`` if ``share_requests``. Of a Genie's settings the expiry of requests alone counts.
    """
    return GenieRules(
        miss_policy="blocking",
        share_answers="on_request",
        share_requests=share_requests,
        request_expiry_ns=rules.request_expiry_ns,
    )


@dataclass(frozen=True, kw_only=True)
class SimilarityCaching(Method):
    """A cache before every detector, on cars and edges alike; cars upload what they miss, edges
    share nothing. A subclass makes the caches: ``cache``.
    """

    title = "similarity cache"

    feature: str = "hsv"
    """The images' vectors. The car computes them and sends them along with the image."""

    replay: Replay = "camera"
    """Where the objects of a replayed answer are: where they were in the `world`, or as they were
    before the `camera`, which the requester's pose then places."""

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        """An empty cache for a host."""
        raise NotImplementedError

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None  # there are no images to compare
        if host.genie is None:
            return HostConfig(detector=True)
        return HostConfig(
            detector=True,
            interceptor=partial(
                self._node, host, host.genie.capacity_on_car, forwards_misses=host.has_edge
            ),
            uplink=REMOTE_UPLINK if host.has_edge else None,
            costs=Costs(key=self.feature),
        )

    def on_edge(self, host: HostContext) -> HostConfig:
        if not host.gets_images:
            return HostConfig()
        node = partial(self._node, host, host.rules.capacity, forwards_misses=False)
        return HostConfig(detector=True, interceptor=node)

    def _node(
        self,
        host: HostContext,
        capacity: Capacity | None,
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
        *,
        forwards_misses: bool,
    ) -> GenieNode:
        """A node with a new cache; ``forwards_misses``: they go to ``-remote``, too."""
        cache = self.cache(host, capacity)
        return GenieNode(
            f"{host.name}/cache",
            inputs,
            outputs,
            cache_rules(host.rules, share_requests=forwards_misses),
            key=key_of(self.feature),
            new_keys=lambda: Nearest(lambda: cache.reach),
            new_cache=lambda: cache,
            object_map=None,
        )
