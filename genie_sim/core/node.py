"""Algorithm 1: the Genie that stands in front of a ROS node.

A Genie is a pure function of the messages that it gets: a message in, a list of effects out. It has
no clock, no thread and no middleware; SimPy and real ROS are adapters around this class.

The topics of an encapsulated node that subscribes to T and publishes P:

============  ===============================  ====================
topic         what arrives                     what leaves
============  ===============================  ====================
``T``         requests of clients
``T-local``                                    misses, for the node
``T-remote``  requests of neighbouring Genies  misses, for others
``P``                                          answers for clients
``P-local``   answers of the node
``P-remote``  answers of other Genies          answers for them
============  ===============================  ====================

On a car ``-remote`` leads to its edge, where the car is a client; between edges it is a broadcast.

What is here is what a Genie does by default. Other readings of the paper stand in ``readings``;
docs/explanation/print.md tells where the default leaves the print.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

from genie_sim.core.maps import EnhancedAnswer, LookupCounts, Map, Viewer, as_change, object_lookups
from genie_sim.core.message_cache import (
    Answers,
    MessageCache,
    PendingIndex,
    PendingRequest,
    Requester,
)
from genie_sim.core.messages import (
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
from genie_sim.core.readings import DEFAULT_READINGS, Readings
from genie_sim.core.rules import GenieRules


class Request(Message, Protocol):
    """A message that a client sends. ``pose`` is where its camera stood, ``None`` where that is
    unknown.
    """

    @property
    def pose(self) -> CameraPose | None: ...

    @property
    def horizontal_fov_rad(self) -> float: ...


@dataclass(slots=True)
class Arrival:
    """What arrives on one of a Genie's topics. Of requests the last two mean nothing."""

    topic: str  # the encapsulated node's own, without a suffix
    is_request: bool
    is_remote: bool  # from another Genie; else from a client, or from the encapsulated node
    is_learned: bool  # the map learns from it, and the cache stores it
    is_broadcast: bool  # it goes to all other Genies


class GenieNode:
    """One Genie, in front of a node that subscribes to T_S and publishes T_P.

    Parameters
    ----------
    name : str
        The Genie's name; what is before the first ``/`` names its host.
    subscribed, published : sequence of str
        The encapsulated node's own topics, T_S and T_P.
    rules : GenieRules
        The settings, as ``genies.make_genie`` has adapted them to the Genie's role.
    key : callable
        Gives a request its similarity key.
    new_cache : callable
        Makes the empty message cache of one topic.
    pending : PendingIndex
        The requests that wait for answers; none at first.
    object_map : Map
        The map of Algorithm 2, empty at first.
    map_answer : callable, optional
        Makes an answer out of a header and map objects; ``None`` for a node whose answers hold no
        objects.
    readings : Readings
        What the paper leaves open and is not decided as by default.
    suffixes : tuple of str
        What is affixed to the topics of the node and of other Genies (Section III-C).
    names_changes : bool
        Whether facts about the object map name the objects that changed.
    """

    def __init__(
        self,
        name: str,
        subscribed: Sequence[str],
        published: Sequence[str],
        rules: GenieRules,
        *,
        key: Callable[[Any], Hashable],
        new_cache: Callable[[], MessageCache],
        pending: PendingIndex,
        object_map: Map,
        map_answer: Callable[[Header, tuple[Detection, ...]], Answer] | None = None,
        readings: Readings = DEFAULT_READINGS,
        suffixes: tuple[str, str] = ("-local", "-remote"),
        names_changes: bool = True,
    ) -> None:
        self.name = name
        self.rules = rules
        self.object_map = object_map
        # origins of this host's frames: real ROS names Genies, SimPy hosts
        self._own_origins = (name, name.partition("/")[0])
        self._key = key
        self._new_cache = new_cache
        self._pending = pending
        self._map_answer = map_answer if rules.miss_policy == "immediate" else None
        self._readings = readings
        self._local, self._remote = suffixes
        self._names_changes = names_changes
        self._subscribed, self._published = tuple(subscribed), tuple(published)
        self._caches: dict[str, MessageCache] = {}  # H_DB: a hashmap for each topic of requests
        self._arrivals: dict[str, Arrival] = {}  # by topic, with its suffix
        for topics, suffix, is_request in (
            (self._subscribed, "", True),
            (self._subscribed, self._remote, True),
            (self._published, self._local, False),
            (self._published, self._remote, False),
        ):
            for topic in topics:
                is_remote = suffix == self._remote
                arrival = Arrival(
                    topic,
                    is_request,
                    is_remote,
                    is_learned=not is_remote or readings.learns_from_others,
                    is_broadcast=not is_remote and rules.share_answers == "broadcast",
                )
                # of a topic in both lists, what comes with the remote suffix is a request
                self._arrivals.setdefault(topic + suffix, arrival)

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return tuple(self._arrivals)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        to_node = tuple(topic + self._local for topic in self._subscribed)
        to_others = tuple(topic + self._remote for topic in self._subscribed)
        answers_to_others = tuple(topic + self._remote for topic in self._published)
        return (*to_node, *to_others, *self._published, *answers_to_others)

    def on_message(
        self, topic: str, message: Any, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """Algorithm 1, OnMessageArrival(M, T): the effects of a message.

        Parameters
        ----------
        topic : str
            The topic T that the message came on, with its suffix.
        message : Request or Answer
            The message M.
        now_ns : int
            Time of the Genie's clock [ns].
        sender : str, optional
            The neighbour that a reply goes to. ``None`` where the middleware does not tell: then it
            goes to all of them.
        """
        effects = self._time_passes(now_ns)
        arrival = self._arrivals[topic]
        if not arrival.is_request:
            return effects + self._on_answer(arrival, message, now_ns)  # lines 7 to 11
        cache = self._caches.get(arrival.topic)
        if cache is None:  # no request came on this topic before
            cache = self._caches[arrival.topic] = self._new_cache()  # lines 5 and 6
        key = self._key(message)
        requester = Requester(message.header, neighbour=arrival.is_remote, name=sender)
        answers = cache.get(key, now_ns)
        if answers is None:
            return effects + self._on_miss(arrival.topic, message, key, requester, now_ns)
        if len(answers) < len(self._published):  # the node may still answer on other topics
            pending = self._pending.by_key(arrival.topic, key)
            if pending is not None:
                pending.requesters.append(replace(requester, served=frozenset(answers)))
        return effects + self._on_hit(message, requester, answers, now_ns)

    def _on_answer(self, arrival: Arrival, message: Answer, now_ns: int) -> list[Effect]:
        """Lines 7 to 11: the message is an answer, to a pending request if that is here."""
        effects: list[Effect] = []
        pending = self._pending.by_header(message.header)  # line 7
        enhanced = self._learn(arrival, message, pending, now_ns)  # line 9
        if enhanced.lookups is not None:
            effects.append(self._object_lookups(message.header, "sighting", enhanced.lookups))
        if pending is not None:  # line 8
            if arrival.is_learned:
                self._store(arrival.topic, enhanced.answer, pending, now_ns)  # line 10
            effects += self._release(arrival, enhanced, pending)
        if arrival.is_broadcast:
            to_neighbours = self._readings.part_for_neighbours(enhanced)
            effects.append(Publish(arrival.topic + self._remote, to_neighbours))
        return effects  # line 11

    def _on_miss(
        self, topic: str, message: Request, key: Hashable, requester: Requester, now_ns: int
    ) -> list[Effect]:
        """Lines 12 to 15: no stored answer. The node is given the requests of clients, and of equal
        ones only the first. Neighbours get hits only, unless a reading has theirs run, too. A
        client gets what the map shows until the answer comes.
        """
        header = message.header
        if self._pending.by_header(header) is not None:
            return []  # this very request came before, over another way
        is_run = not requester.neighbour or self._readings.runs_neighbours_misses
        equal = self._pending.joinable(topic, key) if is_run else None
        if equal is not None and equal.serves(header):
            return []  # likewise, and waits with an equal one
        effects: list[Effect] = []
        viewer = _viewer(message)
        if equal is not None:
            equal.requesters.append(requester)
            effects.append(self._image_lookup(requester, "coalesced"))
        else:
            effects.append(self._image_lookup(requester, "miss"))
            if is_run:
                effects.append(Publish(topic + self._local, message))  # line 13
                if self.rules.share_requests:
                    effects.append(Publish(topic + self._remote, message))  # line 14
            # One that is not run is noted, too: its neighbour's answer is stored under its key.
            expiry_ns = self.rules.request_expiry_ns
            pending = PendingRequest(
                topic,
                key,
                deadline_ns=None if expiry_ns is None else now_ns + expiry_ns,
                forwarded=is_run,
                requesters=[requester] if is_run else [],
                answered=set(),
                viewer=viewer,
            )
            self._pending.open(header, pending)  # line 15
        if viewer is not None and not requester.neighbour:
            effects += self._map_answers(viewer, now_ns)
        return effects

    def _on_hit(
        self, message: Request, requester: Requester, answers: Answers, now_ns: int
    ) -> list[Effect]:
        """Lines 16 to 19: the stored answers go to whoever asked."""
        viewer = _viewer(message)
        effects: list[Effect] = [self._image_lookup(requester, "hit")]
        for answer_topic, stored in answers.items():  # line 17
            boosted = self.object_map.enhanced_cache_boost_data(  # line 18
                stored, message.header, viewer, now_ns
            )
            replay_header = self._readings.replay_header(message.header, stored.header)
            if boosted.lookups is not None:
                effects.append(self._object_lookups(replay_header, "boost", boosted.lookups))
            reply = boosted.to_clients
            if requester.neighbour:
                reply = self._readings.part_for_neighbours(boosted)
            replay = reply.served("cache", self.name, replay_header)
            effects.append(self._publication(answer_topic, replay, requester))  # line 19
        return effects

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return self._pending.next_deadline_ns

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Expires requests that were not answered in time (dropped by the node or by a link)."""
        return list(_unanswered(self._pending.expire(now_ns)))

    def on_void(self) -> list[Observation]:
        """Records of what is lost when a fault wipes this Genie's state: unanswered client requests
        and map objects. It is not called again after that.
        """
        lost: list[Observation] = [*_unanswered(self._pending)]
        if self._names_changes and len(self.object_map):
            lost.append(Forgotten(tuple(map(as_change, self.object_map))))
        return lost

    def cache_entries(self) -> int:
        """How many requests the message cache holds answers to."""
        entries = 0
        for cache in self._caches.values():
            entries += len(cache)
        return entries

    def _time_passes(self, now_ns: int) -> list[Effect]:
        """Forgets the objects of the map and the pending requests whose time is over."""
        effects: list[Effect] = []
        forgotten = self.object_map.forget(now_ns)
        if forgotten and self._names_changes:
            effects.append(Forgotten(tuple(map(as_change, forgotten))))
        deadline_ns = self._pending.next_deadline_ns
        if deadline_ns is not None and deadline_ns <= now_ns:
            effects += self.on_deadline(now_ns)
        return effects

    def _learn(
        self, arrival: Arrival, answer: Answer, pending: PendingRequest | None, now_ns: int
    ) -> EnhancedAnswer:
        """Line 9: the object map learns from the answer."""
        if not arrival.is_learned:
            return EnhancedAnswer.of_one(answer)
        return self.object_map.enhanced_cache_new_data(
            answer,
            None if pending is None else pending.viewer,
            now_ns,
            own=not arrival.is_remote,
            names_changes=self._names_changes,
            leaves=arrival.is_broadcast or pending is not None,
        )

    def _store(self, topic: str, answer: Answer, pending: PendingRequest, now_ns: int) -> None:
        """Line 10: the answer becomes the value of its request's key."""
        cache = self._caches[pending.topic]
        if answer.look is not None:  # what is answered from a cache is no look
            answer = answer.with_look(None, None)
        if topic in pending.answered:
            stored = (cache.peek(pending.key, now_ns) or {}).get(topic)
            if stored is not None:
                answer = self._readings.second_answer(stored, answer)
                if answer is stored:
                    return
        cache.put(pending.key, topic, answer, now_ns)

    def _release(
        self, arrival: Arrival, enhanced: EnhancedAnswer, pending: PendingRequest
    ) -> list[Publish]:
        """The first answer to a request goes to everyone who waits for it, under the header of each
        one's own request.
        """
        topic, header = arrival.topic, enhanced.answer.header
        released: list[Publish] = []
        if topic in pending.answered:
            return released
        pending.answered.add(topic)
        if len(pending.answered) == len(self._published):
            self._pending.close(pending)
        for requester in pending.requesters:
            if topic in requester.served:
                continue
            if requester.neighbour:
                if arrival.is_broadcast and requester.header == header:
                    continue  # the broadcast reaches it
                reply = self._readings.part_for_neighbours(enhanced)
            elif not self._readings.answers_misses:
                continue
            elif not arrival.is_remote and requester.header.origin in self._own_origins:
                reply = self._readings.part_for_own_host(enhanced)
            else:
                reply = enhanced.to_clients
            if requester.header != header:
                reply = reply.restamped(requester.header)
            released.append(self._publication(topic, reply, requester))
        return released

    def _map_answers(self, viewer: Viewer, now_ns: int) -> list[Publish]:
        """What a client gets at once although its request missed: the map's confident objects in
        view.
        """
        if self._map_answer is None:
            return []
        objects, valid_ns = self.object_map.visible(viewer, self.rules.view_range_m, now_ns)
        answer = self._map_answer(viewer.header, objects)
        if valid_ns is not None:
            answer = answer.with_look(None, valid_ns)
        return [Publish(topic, answer.served("map", self.name)) for topic in self._published]

    def _publication(self, topic: str, answer: Answer, requester: Requester) -> Publish:
        """The answer on the topic on which the requester listens."""
        if requester.neighbour:
            return Publish(topic + self._remote, answer, to=requester.name)
        return Publish(topic, answer)

    def _image_lookup(self, requester: Requester, outcome: str) -> ImageLookup:
        role = "neighbour" if requester.neighbour else "client"
        return ImageLookup(requester.header, outcome, role, self.cache_entries())

    def _object_lookups(self, header: Header, kind: str, counts: LookupCounts) -> ObjectLookups:
        return object_lookups(header, kind, counts, len(self.object_map))


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
