"""Algorithm 1: the Genie that stands in front of a ROS node, and Algorithm 2 where it calls upon it.

A Genie is a pure function of what it has been told: a message in, a list of effects out. It has no clock, no thread
and no middleware; SimPy and real ROS are adapters around this class.

The topics of an encapsulated node that subscribes to T and publishes P:

==================  =========================================================  =====================
topic               what arrives                                               what leaves
==================  =========================================================  =====================
``T``               requests of clients
``T-local``                                                                    misses, for the node
``T-remote``        requests of neighbouring Genies                            misses, for the others
``P``                                                                          answers for clients
``P-local``         answers of the node
``P-remote``        answers of other Genies                                    answers for them
==================  =========================================================  =====================

On a car ``-remote`` leads to its edge, where the car is a client; between edges it is a broadcast.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Protocol

from genie_sim.core.maps import Learned, Map, Viewer, as_change
from genie_sim.core.message_cache import (
    Answers,
    MessageCache,
    PendingIndex,
    PendingRequest,
    Requester,
)
from genie_sim.core.rules import GenieRules
from genie_sim.messages import (
    Answer,
    CameraPose,
    Detection,
    Effect,
    Expired,
    Forgotten,
    Header,
    ImageLookup,
    Message,
    ObjectLookups,
    Observation,
    Publish,
)


class Request(Message, Protocol):
    """A message that a client sends. ``pose`` is where its camera stood, ``None`` where that is unknown."""

    @property
    def pose(self) -> CameraPose | None: ...

    @property
    def horizontal_fov_rad(self) -> float: ...


class GenieNode:
    """One Genie. ``subscribed`` and ``published`` are the encapsulated node's own topics, T_S and T_P.

    What depends on the middleware is injected: ``key`` gives a request its similarity key, ``new_cache`` makes the
    message cache of one topic, ``pending`` is empty at first, ``map_answer`` makes an answer out of map
    objects (``None`` for nodes whose answers hold no objects), ``suffixes`` are what is affixed to topics (Section
    III-C). ``tells_changes``: whether facts about the object map name the objects that changed.
    """

    def __init__(
        self,
        name: str,
        subscribed: Sequence[str],
        published: Sequence[str],
        rules: GenieRules,
        key: Callable[[Any], Hashable],
        new_cache: Callable[[], MessageCache],
        pending: PendingIndex,
        object_map: Map,
        map_answer: Callable[[Header, tuple[Detection, ...]], Answer] | None = None,
        suffixes: tuple[str, str] = ("-local", "-remote"),
        tells_changes: bool = True,
    ) -> None:
        self.name = name
        self._own = (
            name,
            name.partition("/")[0],
        )  # origins of this host's frames: real ROS names Genies, SimPy hosts
        self.rules = rules
        self._shares_all = rules.share_filter == "all"
        self.object_map = object_map
        self._key = key
        self._new_cache = new_cache
        self._pending = pending
        self._map_answer = map_answer
        self._local, self._remote = suffixes
        self._tells_changes = tells_changes
        self._subscribed, self._published = tuple(subscribed), tuple(published)
        self._databases: dict[str, MessageCache] = {}  # H_DB
        # Of each topic that something arrives on: the node's own one, whether requests do, and whether of its own side.
        self._arrivals: dict[str, tuple[str, bool, bool]] = {
            topic: (topic, True, True) for topic in subscribed
        }
        for about, suffix, request in (
            *((topic, self._remote, True) for topic in subscribed),
            *((topic, self._local, False) for topic in published),
            *((topic, self._remote, False) for topic in published),
        ):
            self._arrivals.setdefault(about + suffix, (about, request, suffix == self._local))

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return tuple(self._arrivals)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        to_node = tuple(topic + self._local for topic in self._subscribed)
        to_others = tuple(topic + self._remote for topic in self._subscribed)
        answers = tuple(topic + self._remote for topic in self._published)
        topics = (*to_node, *to_others, *self._published, *answers)
        if self.rules.pending_index == "across_topics":
            return topics
        unknown = [topic for topic, (_, request, _) in self._arrivals.items() if not request]
        return (
            *topics,
            *(topic + suffix for topic in unknown for suffix in (self._local, self._remote)),
        )

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """Algorithm 1, OnMessageArrival. ``sender`` names the neighbour that a reply goes to, ``None`` where the
        middleware does not tell: then it goes to all of them."""
        before: list[Effect] = []
        forgotten = self.object_map.forget(now_ns)
        if forgotten and self._tells_changes:
            before.append(Forgotten(tuple(map(as_change, forgotten))))
        deadline_ns = self._pending.next_deadline_ns
        if deadline_ns is not None and deadline_ns <= now_ns:
            before += self.on_deadline(now_ns)
        about, request, own = self._arrivals[topic]
        effects: list[Effect]
        if request:
            effects = self._on_request(
                about, message, Requester(message.header, not own, sender), now_ns
            )
        elif self.rules.pending_index == "per_topic":
            effects = self._on_unknown(topic, message)
        else:
            effects = self._on_answer(about, message, now_ns, own=own)
        return before + effects if before else effects

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return self._pending.next_deadline_ns

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Forgets the requests that nobody answered in time: the node dropped them, or the link did."""
        return [*_unanswered(self._pending.expire(now_ns))]

    def on_void(self) -> list[Observation]:
        """What goes with its state when a fault takes that: its clients' requests without an answer, and the objects of
        its map. It is not called again after that."""
        lost: list[Observation] = [*_unanswered(self._pending)]
        if self._tells_changes and len(self.object_map):
            lost.append(Forgotten(tuple(map(as_change, self.object_map))))
        return lost

    def cache_entries(self) -> int:
        """How many requests the message cache holds answers to."""
        return sum(map(len, self._databases.values()))

    def _on_request(
        self, topic: str, request: Request, requester: Requester, now_ns: int
    ) -> list[Effect]:
        database = self._databases.get(topic)
        if database is None:
            database = self._databases[topic] = (
                self._new_cache()
            )  # line 6: a hashmap for a never-seen topic
        key = self._key(request)
        answers = database.get(key, now_ns)
        if answers is None:
            return self._on_miss(topic, request, key, requester, now_ns)
        if len(answers) < len(
            self._published
        ):  # the node may still be about to answer on its other topics
            pending = self._pending.by_key(topic, key)
            if pending is not None:
                pending.requesters.append(replace(requester, served=frozenset(answers)))
        # line 16: cache hit
        return [
            self._looked_up(requester, "hit"),
            *self._replay(answers, requester, request, now_ns),
        ]

    def _on_miss(
        self, topic: str, request: Request, key: Hashable, requester: Requester, now_ns: int
    ) -> list[Effect]:
        if self._pending.by_header(requester.header) is not None:
            return []  # this very request came before, over another way
        expiry_ns = self.rules.request_expiry_ns
        deadline_ns = None if expiry_ns is None else now_ns + expiry_ns
        viewer = _viewer(request)
        if requester.neighbour and self.rules.neighbour_miss == "ignore":
            opened = PendingRequest(topic, key, deadline_ns, False, viewer=viewer)
            self._pending.open(requester.header, opened)
            return [self._looked_up(requester, "miss")]
        pending = (
            self._pending.by_key(topic, key) if self.rules.same_key_pending == "coalesce" else None
        )
        if pending is not None and not pending.answered:
            if any(one.header == requester.header for one in pending.requesters):
                return []
            pending.requesters.append(requester)
            return [
                self._looked_up(requester, "coalesced"),
                *self._meanwhile(viewer, requester, now_ns),
            ]
        # line 12: cache miss
        effects: list[Effect] = [self._looked_up(requester, "miss")]
        effects.append(Publish(topic + self._local, request))
        if self.rules.share_requests:
            effects.append(Publish(topic + self._remote, request))
        opened = PendingRequest(topic, key, deadline_ns, True, [requester], viewer=viewer)
        self._pending.open(requester.header, opened)
        return effects + self._meanwhile(viewer, requester, now_ns)

    def _meanwhile(self, viewer: Viewer | None, requester: Requester, now_ns: int) -> list[Effect]:
        """What a client gets at once although its request missed: the map's confident objects in view.

        Without a pose there is no view, and no answer.
        """
        if (
            viewer is None
            or requester.neighbour
            or self._map_answer is None
            or self.rules.miss_policy != "immediate"
        ):
            return []
        objects, valid_ns = self.object_map.visible(viewer, self.rules.view_range_m, now_ns)
        answer = self._map_answer(viewer.header, objects)
        if valid_ns is not None:
            answer = answer.with_look(None, valid_ns)
        return [Publish(topic, answer.served("map", self.name)) for topic in self._published]

    def _replay(
        self, answers: Answers, requester: Requester, request: Request, now_ns: int
    ) -> list[Effect]:
        """Lines 17 to 19: the stored answers go to the sender, with what the map knows about their locations."""
        effects: list[Effect] = []
        viewer, restamps = _viewer(request), self.rules.replay_stamp != "stored"
        for topic, answer in answers.items():
            boosted = self.object_map.boost(answer, requester.header, viewer, now_ns)
            if boosted is not None:
                answer = (
                    boosted.answer
                    if requester.neighbour and self._shares_all
                    else boosted.to_clients
                )
                counts = boosted.requests, boosted.hits, 0, 0.0, len(self.object_map)
                header = requester.header if restamps else answer.header
                effects.append(ObjectLookups(header, "boost", *counts))
            answer = answer.served("cache", self.name, requester.header if restamps else None)
            effects.append(self._deliver(topic, answer, requester))
        return effects

    def _on_answer(self, topic: str, answer: Answer, now_ns: int, *, own: bool) -> list[Effect]:
        """Lines 8 to 11, and delivery to everyone who waits. ``own``: the encapsulated node's answer."""
        pending = self._pending.by_header(answer.header)
        learns = own or self.rules.car_learns == "all"
        viewer = None if pending is None else pending.viewer
        broadcast = own and self.rules.share_answers == "broadcast"
        learned = Learned(answer, answer, answer, None)
        if learns:
            leaves = broadcast or pending is not None
            learned = self.object_map.learn(
                answer, viewer, now_ns, own, self._tells_changes, leaves
            )  # line 9
        answer = learned.answer
        to_neighbours = answer if self._shares_all else learned.to_neighbours
        effects: list[Effect] = [] if learned.lookups is None else [learned.lookups]
        if pending is not None:
            if learns:
                self._store(topic, pending, answer, now_ns)  # line 10
            if topic not in pending.answered:
                pending.answered.add(topic)
                if len(pending.answered) == len(self._published):
                    self._pending.close(pending)
                to_host = (
                    answer if own and self.rules.fresh_objects == "all" else learned.to_clients
                )
                effects += self._release(
                    topic, pending, to_host, learned.to_clients, to_neighbours, own
                )
        if broadcast:
            effects.append(Publish(topic + self._remote, to_neighbours))
        return effects

    def _store(self, topic: str, pending: PendingRequest, answer: Answer, now_ns: int) -> None:
        database = self._databases[pending.topic]
        if answer.look is not None:  # what is answered from a cache is no look
            answer = answer.with_look(None, None)
        if topic in pending.answered and self.rules.second_answer != "overwrite":
            held = (database.get(pending.key, now_ns) or {}).get(topic)
            if held is not None and self.rules.second_answer == "first_wins":
                return
            if held is not None and held.objects is not None and answer.objects is not None:
                known = {(one.label, one.location) for one in held.objects}
                added = [one for one in answer.objects if (one.label, one.location) not in known]
                answer = held.with_objects([*held.objects, *added])
        database.put(pending.key, topic, answer, now_ns)

    def _release(
        self,
        topic: str,
        pending: PendingRequest,
        to_host: Answer,
        to_others: Answer,
        to_neighbours: Answer,
        own: bool,
    ) -> list[Effect]:
        """The first answer goes to everyone who waits for it, under each one's own header: ``to_host`` to clients on
        this host, ``to_others`` to those behind a link."""
        effects: list[Effect] = []
        broadcast = own and self.rules.share_answers == "broadcast"
        for requester in pending.requesters:
            hits_only = not requester.neighbour and self.rules.miss_policy == "hits_only"
            covered_by_broadcast = (
                requester.neighbour and broadcast and requester.header == to_host.header
            )
            if topic in requester.served or hits_only or covered_by_broadcast:
                continue
            to_client = to_host if requester.header.origin in self._own else to_others
            answer = to_neighbours if requester.neighbour else to_client
            mine = (
                answer if requester.header == answer.header else answer.restamped(requester.header)
            )
            effects.append(self._deliver(topic, mine, requester))
        return effects

    def _deliver(self, topic: str, answer: Answer, requester: Requester) -> Publish:
        if requester.neighbour:
            return Publish(topic + self._remote, answer, to=requester.name)
        return Publish(topic, answer)

    def _on_unknown(self, topic: str, answer: Answer) -> list[Effect]:
        """An answer under the literal index: no request on its topic has its header, so it is taken for a request."""
        to_neighbours = answer
        if answer.objects is not None:
            threshold = self.object_map.threshold
            answer = answer.with_objects(
                [one for one in answer.objects if one.confidence >= threshold]
            )
        if not self._shares_all:
            to_neighbours = answer
        return [Publish(topic + self._local, answer), Publish(topic + self._remote, to_neighbours)]

    def _looked_up(self, requester: Requester, outcome: str) -> ImageLookup:
        who = "neighbour" if requester.neighbour else "client"
        return ImageLookup(requester.header, outcome, who, self.cache_entries())


def _unanswered(requests: Iterable[PendingRequest]) -> Iterator[Expired]:
    """The clients' requests among these that nobody has answered."""
    for pending in requests:
        if not pending.answered:
            for requester in pending.requesters:
                if not requester.neighbour and not requester.served:
                    yield Expired(requester.header)


def _viewer(request: Request) -> Viewer | None:
    """From where a request was made; ``None`` where its pose is unknown."""
    if request.pose is None:
        return None
    return Viewer(request.header, request.pose, request.horizontal_fov_rad)
