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

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from genie_sim.core.message_cache import Answers, Asker, MessageCache, PendingIndex, Waiting
from genie_sim.core.object_map import ObjectMap, StoredObject
from genie_sim.messages import (
    Answer,
    CameraPose,
    Detection,
    Detections,
    Effect,
    Expired,
    Forgotten,
    Header,
    ImageLookup,
    MapChange,
    Message,
    ObjectLookups,
    Observe,
    Publish,
)


@dataclass(frozen=True, slots=True)
class GenieRules:
    """How the paper's Algorithm 1 is read; the defaults are the readings under which it works.

    ``pending_index``: an answer is found by its header ``across_topics``, or only ``per_topic`` as printed, where it
    can never match because it comes on another topic than its request. ``header_identity``: ``stamp_frame_origin`` or
    ``stamp``. ``same_key_pending``: a request equal to one under way may ``coalesce`` with it, or is run again
    (``forward``). ``replay_stamp``: a replayed answer carries the header of the ``request`` or the ``stored`` one.
    ``second_answer``: a later answer to the same request may ``overwrite`` the first, leave it (``first_wins``) or add
    its objects (``merge``). ``neighbour_miss``: a neighbour's request that is not in the cache is ignored
    (``ignore``) or run and broadcast (``process``). ``share_answers``: the own node's answers go to all
    (``broadcast``) or to whoever asked (``on_request``). ``share_requests``: misses are published on ``-remote``.
    ``request_expiry_ns``: after this time an unanswered request is forgotten, ``None`` for never. ``miss_policy``: a
    client whose request misses gets the map's objects in view at once and the detection later (``immediate``), the
    first detection (``blocking``) or nothing (``hits_only``). ``view_range_m`` limits what is in view.
    ``fresh_objects``: only ``confident`` objects reach clients, or ``all`` of the node's own fresh answer.
    """

    pending_index: str = "across_topics"
    header_identity: str = "stamp_frame_origin"
    same_key_pending: str = "coalesce"
    replay_stamp: str = "request"
    second_answer: str = "overwrite"
    neighbour_miss: str = "ignore"
    share_answers: str = "broadcast"
    share_requests: bool = True
    request_expiry_ns: int | None = 2_000_000_000
    miss_policy: str = "immediate"
    view_range_m: float = 50.0
    fresh_objects: str = "confident"


class Request(Message, Protocol):
    """A message that a client sends. ``pose`` is where its camera stood, ``None`` where that is unknown."""

    @property
    def pose(self) -> CameraPose | None: ...

    @property
    def horizontal_fov_rad(self) -> float: ...


class _Boosted(NamedTuple):
    """What the object map makes of a stored answer: the objects that leave, and the look-ups it took."""

    answer: Answer
    objects: tuple[Detection, ...]
    requests: int
    hits: int


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
        object_map: ObjectMap,
        map_answer: Callable[[Header, Sequence[Detection]], Answer] | None = None,
        suffixes: tuple[str, str] = ("-local", "-remote"),
        tells_changes: bool = True,
    ) -> None:
        self.name = name
        self.rules = rules
        self.object_map = object_map
        self._key = key
        self._new_cache = new_cache
        self._pending = pending
        self._map_answer = map_answer
        self._local, self._remote = suffixes
        self._tells_changes = tells_changes
        self._boosted: dict[int, _Boosted] = {}  # by the identity of the stored answer
        self._boosted_changes = 0  # of the map, when they were made
        self._published = tuple(published)
        self._databases: dict[str, MessageCache] = {}  # H_DB
        self._requests = tuple(subscribed)
        self._neighbour_requests = {topic + self._remote: topic for topic in subscribed}
        self._own_answers = {topic + self._local: topic for topic in published}
        self._remote_answers = {topic + self._remote: topic for topic in published}

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return (*self._requests, *self._neighbour_requests, *self._own_answers, *self._remote_answers)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        to_node = tuple(topic + self._local for topic in self._requests)
        topics = (*to_node, *self._neighbour_requests, *self._published, *self._remote_answers)
        if self.rules.pending_index == "across_topics":
            return topics
        unknown = (*self._own_answers, *self._remote_answers)
        return (*topics, *(topic + suffix for topic in unknown for suffix in (self._local, self._remote)))

    def on_message(self, topic: str, message: Message, now_ns: int, sender: str | None = None) -> list[Effect]:
        """Algorithm 1, OnMessageArrival. ``sender`` names the neighbour that a reply goes to, ``None`` where the
        middleware does not tell: then it goes to all of them."""
        before: list[Effect] = []
        forgotten = self.object_map.forget(now_ns)
        if forgotten and self._tells_changes:
            before.append(Observe(Forgotten(tuple(map(_as_change, forgotten)))))
        deadline_ns = self._pending.next_deadline_ns
        if deadline_ns is not None and deadline_ns <= now_ns:
            before += self.on_deadline(now_ns)
        return before + self._on_arrival(topic, message, now_ns, sender)

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return self._pending.next_deadline_ns

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Forgets the requests that nobody answered in time: the node dropped them, or the link did."""
        return [
            Observe(Expired(asker.header))
            for waiting in self._pending.expire(now_ns)
            if not waiting.answered
            for asker in waiting.askers
            if not asker.neighbour and not asker.served
        ]

    def cache_entries(self) -> int:
        """How many requests the message cache holds answers to."""
        return sum(len(database) for database in self._databases.values())

    def _on_arrival(self, topic: str, message: Any, now_ns: int, sender: str | None) -> list[Effect]:
        if topic in self._requests:
            return self._on_request(topic, message, Asker(message.header, False, sender), now_ns)
        if topic in self._neighbour_requests:
            wanted = self._neighbour_requests[topic]
            return self._on_request(wanted, message, Asker(message.header, True, sender), now_ns)
        if self.rules.pending_index == "per_topic":
            return self._on_unknown(topic, message)
        if topic in self._own_answers:
            return self._on_answer(self._own_answers[topic], message, now_ns, own=True)
        return self._on_answer(self._remote_answers[topic], message, now_ns, own=False)

    def _on_request(self, topic: str, request: Request, asker: Asker, now_ns: int) -> list[Effect]:
        database = self._databases.get(topic)
        if database is None:
            database = self._databases[topic] = self._new_cache()  # line 6: a hashmap for a never-seen topic
        key = self._key(request)
        answers = database.get(key, now_ns)
        if answers is None:
            return self._on_miss(topic, request, key, asker, now_ns)
        if len(answers) < len(self._published):  # the node may still be about to answer on its other topics
            under_way = self._pending.by_key(topic, key)
            if under_way is not None:
                under_way.askers.append(asker._replace(served=frozenset(answers)))
        return [self._looked_up(asker, "hit"), *self._replay(answers, asker)]  # line 16: cache hit

    def _on_miss(self, topic: str, request: Request, key: Hashable, asker: Asker, now_ns: int) -> list[Effect]:
        if self._pending.by_header(asker.header) is not None:
            return []  # this very request came before, over another way
        expiry_ns = self.rules.request_expiry_ns
        deadline_ns = None if expiry_ns is None else now_ns + expiry_ns
        if asker.neighbour and self.rules.neighbour_miss == "ignore":
            self._pending.open(asker.header, Waiting(topic, key, deadline_ns, forwarded=False))
            return [self._looked_up(asker, "miss")]
        under_way = self._pending.by_key(topic, key) if self.rules.same_key_pending == "coalesce" else None
        if under_way is not None and not under_way.answered:
            if any(one.header == asker.header for one in under_way.askers):
                return []
            under_way.askers.append(asker)
            return [self._looked_up(asker, "coalesced"), *self._meanwhile(request, asker)]
        # line 12: cache miss
        effects: list[Effect] = [self._looked_up(asker, "miss")]
        effects.append(Publish(topic + self._local, request))
        if self.rules.share_requests:
            effects.append(Publish(topic + self._remote, request))
        self._pending.open(asker.header, Waiting(topic, key, deadline_ns, forwarded=True, askers=[asker]))
        return effects + self._meanwhile(request, asker)

    def _meanwhile(self, request: Request, asker: Asker) -> list[Effect]:
        """What a client gets at once although its request missed: the map's confident objects in view.

        Without a pose there is no view, and no answer.
        """
        if asker.neighbour or self._map_answer is None or self.rules.miss_policy != "immediate":
            return []
        if request.pose is None:
            return []
        stored = self.object_map.in_view(request.pose, request.horizontal_fov_rad, self.rules.view_range_m)
        answer = self._map_answer(request.header, [one.as_detection() for one in stored])
        return [Publish(topic, answer.served("map", self.name)) for topic in self._published]

    def _replay(self, answers: Answers, asker: Asker) -> list[Effect]:
        """Lines 17 to 19: the stored answers go to the sender, with what the map knows about their locations."""
        effects: list[Effect] = []
        for topic, stored in answers.items():
            answer = stored if self.rules.replay_stamp == "stored" else stored.restamped(asker.header)
            answer = answer.served("cache", self.name)
            boosted = self._boost_data(stored)
            if boosted is not None:
                _, objects, requests, hits = boosted
                answer = answer.with_objects(objects)
                lookups = ObjectLookups(answer.header, "boost", requests, hits, 0, 0.0, len(self.object_map))
                effects.append(Observe(lookups))
            effects.append(self._deliver(topic, answer, asker))
        return effects

    def _on_answer(self, topic: str, answer: Answer, now_ns: int, *, own: bool) -> list[Effect]:
        """Lines 8 to 11, and delivery to everyone who waits. ``own``: the encapsulated node's answer."""
        answer, effects = self._new_data(answer, now_ns)  # line 9
        waiting = self._pending.by_header(answer.header)
        broadcast = own and self.rules.share_answers == "broadcast"
        if waiting is None and not broadcast:
            return effects
        confident = self._confident(answer)
        if waiting is not None:
            self._store(topic, waiting, answer, now_ns)  # line 10
            if topic not in waiting.answered:
                waiting.answered.add(topic)
                if len(waiting.answered) == len(self._published):
                    self._pending.close(waiting)
                to_clients = answer if own and self.rules.fresh_objects == "all" else confident
                effects += self._release(topic, waiting, to_clients, confident, own)
        if broadcast:
            effects.append(Publish(topic + self._remote, confident))
        return effects

    def _store(self, topic: str, waiting: Waiting, answer: Answer, now_ns: int) -> None:
        database = self._databases[waiting.topic]
        if topic in waiting.answered and self.rules.second_answer != "overwrite":
            held = (database.get(waiting.key, now_ns) or {}).get(topic)
            if held is not None and self.rules.second_answer == "first_wins":
                return
            if held is not None and held.objects is not None and answer.objects is not None:
                known = {(one.label, one.location) for one in held.objects}
                added = [one for one in answer.objects if (one.label, one.location) not in known]
                answer = held.with_objects([*held.objects, *added])
        database.put(waiting.key, topic, answer, now_ns)

    def _release(
        self, topic: str, waiting: Waiting, to_clients: Answer, to_neighbours: Answer, own: bool
    ) -> list[Effect]:
        """The first answer goes to everyone who waits for it, under each one's own header."""
        effects: list[Effect] = []
        broadcast = own and self.rules.share_answers == "broadcast"
        for asker in waiting.askers:
            hits_only = not asker.neighbour and self.rules.miss_policy == "hits_only"
            told_anyway = asker.neighbour and broadcast and asker.header == to_neighbours.header
            if topic in asker.served or hits_only or told_anyway:
                continue
            answer = to_neighbours if asker.neighbour else to_clients
            mine = answer if asker.header == answer.header else answer.restamped(asker.header)
            effects.append(self._deliver(topic, mine, asker))
        return effects

    def _deliver(self, topic: str, answer: Answer, asker: Asker) -> Publish:
        if asker.neighbour:
            return Publish(topic + self._remote, answer, to=asker.name)
        return Publish(topic, answer)

    def _confident(self, answer: Answer) -> Answer:
        """The answer without the objects below C_T: those never leave a Genie (Section III-D)."""
        if answer.objects is None:
            return answer
        threshold = self.object_map.threshold
        return answer.with_objects([one for one in answer.objects if one.confidence >= threshold])

    def _new_data(self, answer: Answer, now_ns: int) -> tuple[Answer, list[Effect]]:
        """Algorithm 2, EnhancedCacheNewData: every object of an answer is a sighting."""
        if answer.objects is None:
            return answer, []
        threshold = self.object_map.threshold
        objects: list[Detection] = []
        changes: list[MapChange] = []
        requests = hits = updates = 0
        boost = 0.0
        for seen in answer.objects:
            if seen.location is None:
                objects.append(seen)
                continue
            requests += 1
            before, stored = self.object_map.sight(seen, now_ns)
            if before is not None:
                hits += before >= threshold
                updates += 1
                boost += stored.confidence - before
                seen = seen.with_confidence(stored.confidence)
            objects.append(seen)
            if self._tells_changes:
                changes.append(_as_change(stored))
        stored_objects = len(self.object_map)
        facts = ObjectLookups(answer.header, "sighting", requests, hits, updates, boost, stored_objects, tuple(changes))
        return answer.with_objects(objects), [Observe(facts)]

    def _boost_data(self, answer: Answer) -> _Boosted | None:
        """Algorithm 2, EnhancedCacheBoostData: adds the stored objects at the answer's locations, each once, and leaves
        out what is below C_T. As long as the map stays as it is, so does what it makes of an answer."""
        if answer.objects is None:
            return None
        if self._boosted_changes != self.object_map.changes:
            self._boosted.clear()
            self._boosted_changes = self.object_map.changes
        boosted = self._boosted.get(id(answer))
        if boosted is None:
            boosted = self._boosted[id(answer)] = self._boost(answer, answer.objects)
        return boosted

    def _boost(self, answer: Answer, held_objects: Sequence[Detection]) -> _Boosted:
        threshold = self.object_map.threshold
        objects: list[Detection] = []
        included: set[int] = set()
        requests = hits = 0
        others = []
        for held in held_objects:  # a list of its own: the stored answer stays as it is
            if held.location is None:
                objects.append(held)
                continue
            requests += 1
            there = [one for one in self.object_map.at(held.location) if one.confidence >= threshold]
            stored = self.object_map.match(held.label, held.location)
            if stored is not None:
                included.add(id(stored))
                held = held.with_confidence(stored.confidence)
            objects.append(held)
            hits += bool(there)
            others += there
        for one in others:
            if id(one) not in included:
                included.add(id(one))
                objects.append(one.as_detection())
        return _Boosted(answer, tuple(one for one in objects if one.confidence >= threshold), requests, hits)

    def _on_unknown(self, topic: str, answer: Answer) -> list[Effect]:
        """An answer under the literal index: no request on its topic has its header, so it is taken for a request."""
        answer = self._confident(answer)
        return [Publish(topic + self._local, answer), Publish(topic + self._remote, answer)]

    def _looked_up(self, asker: Asker, outcome: str) -> Observe:
        who = "neighbour" if asker.neighbour else "client"
        return Observe(ImageLookup(asker.header, outcome, who, self.cache_entries()))


def _as_change(stored: StoredObject) -> MapChange:
    return MapChange(stored.label, stored.location, stored.confidence)


def detections_of_map(header: Header, objects: Sequence[Detection]) -> Detections:
    """The ``map_answer`` of object detectors."""
    return Detections(header, tuple(objects))
