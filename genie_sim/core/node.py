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
What the paper leaves open is decided where it matters, by the settings of ``GenieRules``;
docs/explanation/departures.md lists where the default departs from the paper. Comments name the
lines of Algorithm 1 as the paper numbers them, which gives lines with ``end`` no number.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from genie_sim.core.message_cache import (
    Answers,
    MessageCache,
    PendingIndex,
    PendingRequest,
    Requester,
)
from genie_sim.core.messages import (
    Answer,
    Detection,
    Effect,
    Expired,
    Forgotten,
    Header,
    ImageLookup,
    MapChange,
    Observation,
    Publish,
    Request,
)
from genie_sim.core.object_map import ObjectMap
from genie_sim.core.rules import GenieRules
from genie_sim.core.similarity import KeyIndex

SUFFIXES = "-local", "-remote"  # towards the node, and towards other Genies
MakeAnswer = Callable[[Header, tuple[Detection, ...]], Answer]


class Arrival(NamedTuple):
    """What arrives on one of a Genie's topics."""

    topic: str  # the encapsulated node's own, without a suffix
    is_request: bool
    is_remote: bool  # from another Genie; else from a client, or from the encapsulated node


class GenieNode:
    """One Genie, in front of a node that subscribes to T_S and publishes T_P.

    Parameters
    ----------
    name : str
        The Genie's name; what is before the first ``/`` names its host.
    inputs, outputs : sequence of str
        The encapsulated node's own topics: T_S, to which it subscribes, and T_P.
    rules : GenieRules
        The settings, as they are in the Genie's role (``core.genies``).
    key : callable
        Gives a request its similarity key.
    new_keys : callable
        Makes an empty index of keys that says which pending requests are equal.
    new_cache : callable
        Makes the empty message cache of one topic.
    object_map : ObjectMap or None
        The map of Algorithm 2, empty at first; ``None``: a message cache alone.
    make_answer : callable, optional
        Makes an answer out of a header and map objects; ``None`` for a node whose answers hold no
        objects.
    suffixes : tuple of str
        What is affixed to the topics of the node and of other Genies (Section III-C).
    names_changes : bool
        Whether observations of the object map name the objects that changed.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        rules: GenieRules,
        *,
        key: Callable[[Any], Hashable],
        new_keys: Callable[[], KeyIndex],
        new_cache: Callable[[], MessageCache],
        object_map: ObjectMap | None,
        make_answer: MakeAnswer | None = None,
        suffixes: tuple[str, str] = SUFFIXES,
        names_changes: bool = True,
    ) -> None:
        self.name = name
        self.rules = rules
        self.object_map = object_map
        # origins of this host's frames: real ROS names Genies, SimPy hosts
        self._own_origins = (name, name.partition("/")[0])
        self._key = key
        self._new_cache = new_cache
        self._pending = PendingIndex(rules.header_identity, new_keys)
        self._make_answer = make_answer if rules.miss_policy == "immediate" else None
        self._local, self._remote = suffixes
        self._names_changes = names_changes
        self._inputs, self._outputs = tuple(inputs), tuple(outputs)
        self._caches: dict[str, MessageCache] = {}  # H_DB: a hashmap for each topic of requests
        # requests come on T and T-remote, answers on P-local and P-remote
        requests = {
            topic + suffix: Arrival(topic, True, suffix == self._remote)
            for suffix in ("", self._remote)
            for topic in self._inputs
        }
        answers = {
            topic + suffix: Arrival(topic, False, suffix == self._remote)
            for suffix in suffixes
            for topic in self._outputs
        }
        # by topic, with its suffix; of a topic in both lists, requests win
        self._arrivals = {**requests, **answers, **requests}

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that this Genie listens to."""
        return tuple(self._arrivals)

    def publications(self) -> tuple[str, ...]:
        """Every topic that this Genie may publish on."""
        miss_topics = self._inputs
        if self.rules.pending_index == "per_topic":  # there answers are taken for requests
            miss_topics += tuple(topic for topic, of in self._arrivals.items() if not of.is_request)
        return (
            *(topic + suffix for topic in miss_topics for suffix in (self._local, self._remote)),
            *self._outputs,
            *(topic + self._remote for topic in self._outputs),
        )

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
        name, is_request, is_remote = self._arrivals[topic]
        if not is_request and self.rules.pending_index == "per_topic":
            return effects + self._on_unrecognised(topic, message)
        if not is_request:
            return effects + self._on_answer(name, message, is_remote, now_ns)  # lines 7 to 11
        cache = self._caches.get(name)
        if cache is None:
            cache = self._caches[name] = self._new_cache()  # lines 5 and 6
        key = self._key(message)
        requester = Requester(message.header, neighbour=is_remote, name=sender)
        answers = cache.get(key, now_ns)  # lines 12 and 17
        if answers is None:
            return effects + self._on_miss(name, message, requester, key=key, now_ns=now_ns)
        if len(answers) < len(self._outputs):  # the node may still answer on other topics
            pending = self._pending.by_key(name, key)
            if pending is not None:
                pending.requesters.append(replace(requester, answered_topics=frozenset(answers)))
        return effects + self._on_hit(message, requester, answers)

    def _on_answer(self, topic: str, message: Answer, is_remote: bool, now_ns: int) -> list[Effect]:
        """Lines 7 to 11: the message is an answer, to a pending request if that is here. Line 9
        comes before the test of line 8: what nobody here has asked for feeds the map, too.

        The cache stores all of its objects, with the map's confidences. Clients get those that are
        confident (C_T), clients on this host all with ``fresh_objects: all``; other Genies get the
        confident ones, or all with ``share_filter: all``.
        """
        rules, effects = self.rules, list[Effect]()
        is_learned = not is_remote or rules.car_learns == "all"
        is_broadcast = not is_remote and rules.share_answers == "broadcast"
        pending = self._pending.by_header(message.header)  # line 7
        answer = confident = message
        if is_learned and self.object_map is not None:
            answer, lookups = self.object_map.enhanced_cache_new_data(  # line 9
                message, now_ns, self._names_changes
            )
            confident = self.object_map.confident(answer)
            if lookups is not None:
                effects.append(lookups)
        for_others = answer if rules.share_filter == "all" else confident
        if pending is not None:  # line 8
            if is_learned:
                self._caches[pending.topic].put(pending.key, topic, answer, now_ns)  # line 10
            is_for_all = rules.fresh_objects == "all" and not is_remote
            effects += self._release(
                topic,
                pending,
                for_clients=confident,
                for_own_host=answer if is_for_all else confident,
                for_others=for_others,
                broadcast=message.header if is_broadcast else None,
            )
        if is_broadcast:
            effects.append(Publish(topic + self._remote, for_others))
        return effects  # line 11

    def _on_miss(
        self, topic: str, message: Request, requester: Requester, *, key: Hashable, now_ns: int
    ) -> list[Effect]:
        """Lines 12 to 15: no stored answer. The node is given the requests of clients, and of equal
        ones only the first. Neighbours get hits only, unless ``neighbour_miss`` has theirs run,
        too. A client gets what the map shows until the answer comes.
        """
        header, rules, pending_requests = message.header, self.rules, self._pending
        is_run = not requester.neighbour or rules.neighbour_miss == "process"
        equal = None
        if is_run and rules.same_key_pending == "coalesce":
            equal = pending_requests.joinable(topic, key)
        earlier = pending_requests.by_header(header)
        if (equal and equal.has_requester(header)) or (
            earlier and (earlier.requesters or requester.neighbour)
        ):
            return []  # this very request came before, over another way
        effects = [self._image_lookup(requester, "coalesced" if equal else "miss")]
        if equal is not None:
            equal.requesters.append(requester)
        else:
            if is_run:
                effects.append(Publish(topic + self._local, message))  # line 13
                if rules.share_requests:
                    effects.append(Publish(topic + self._remote, message))  # line 14
            # One that is not run is noted, too: its neighbour's answer is stored under its key.
            expiry_ns = rules.request_expiry_ns
            deadline_ns = None if expiry_ns is None else now_ns + expiry_ns
            waiting = [requester] if is_run else []
            pending = PendingRequest(
                topic, key, deadline_ns, is_forwarded=is_run, requesters=waiting
            )
            effects += _unanswered(pending_requests.open(header, pending))  # line 15
        if not requester.neighbour:
            effects += self._map_answers(message)
        return effects

    def _on_hit(self, message: Request, requester: Requester, answers: Answers) -> list[Effect]:
        """Lines 16 to 19: the stored answers go to whoever asked."""
        objects, rules = self.object_map, self.rules
        effects: list[Effect] = [self._image_lookup(requester, "hit")]
        for topic, answer in answers.items():
            header = answer.header if rules.replay_stamp == "stored" else message.header
            reply = answer
            if objects is not None:
                reply, lookups = objects.enhanced_cache_boost_data(answer, header)  # line 18
                if lookups is not None:
                    effects.append(lookups)
                if not requester.neighbour or rules.share_filter == "confident":
                    reply = objects.confident(reply)
            replay = reply.credited("cache", self.name, header)
            effects.append(self._publication(topic, replay, requester))  # line 19
        return effects

    def _on_unrecognised(self, topic: str, message: Answer) -> list[Effect]:
        """``pending_index: per_topic``, the letter of line 7: a header is looked up among the
        requests on the message's own topic. An answer comes on another one, so it is never found,
        is taken for a request that misses, and is published as one (lines 12 to 14).
        """
        confident = message if self.object_map is None else self.object_map.confident(message)
        for_others = message if self.rules.share_filter == "all" else confident
        return [Publish(topic + self._local, confident), Publish(topic + self._remote, for_others)]

    def next_deadline_ns(self) -> int | None:
        """When ``on_deadline`` wants to be called, if no message comes before."""
        return self._pending.next_deadline_ns

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """Expires requests that were not answered in time (dropped by the node or by a link)."""
        return list(_unanswered(self._pending.expire(now_ns)))

    def on_memory_lost(self) -> list[Observation]:
        """Records of what is lost when a fault wipes this Genie's state: unanswered client requests
        and map objects. It is not called again after that.
        """
        observations: list[Observation] = [*_unanswered(self._pending)]
        if self._names_changes and self.object_map:
            observations.append(Forgotten(tuple(map(MapChange.of, self.object_map))))
        return observations

    def cache_entries(self) -> int:
        """How many requests the message cache holds answers to."""
        entries = 0
        for cache in self._caches.values():
            entries += len(cache)
        return entries

    def _time_passes(self, now_ns: int) -> list[Effect]:
        """Forgets the objects of the map and the pending requests whose time is over."""
        effects: list[Effect] = []
        objects = self.object_map.forget(now_ns) if self.object_map is not None else ()
        if objects and self._names_changes:
            effects.append(Forgotten(tuple(map(MapChange.of, objects))))
        deadline_ns = self._pending.next_deadline_ns
        if deadline_ns is not None and deadline_ns <= now_ns:
            effects += self.on_deadline(now_ns)
        return effects

    def _release(
        self,
        topic: str,
        pending: PendingRequest,
        *,
        for_clients: Answer,
        for_own_host: Answer,
        for_others: Answer,
        broadcast: Header | None,
    ) -> list[Publish]:
        """The first answer to a request goes to everyone who waits for it, under the header of each
        one's own request; not to the neighbour that the ``broadcast`` reaches.
        """
        replies: list[Publish] = []
        if topic in pending.answered_topics:
            return replies
        pending.answered_topics.add(topic)
        if len(pending.answered_topics) == len(self._outputs):
            self._pending.close(pending)
        for requester in pending.requesters:
            if topic in requester.answered_topics:
                continue
            if requester.neighbour:
                if requester.header == broadcast:
                    continue
                reply = for_others
            elif self.rules.miss_policy == "hits_only":
                continue
            else:
                is_own = requester.header.origin in self._own_origins
                reply = for_own_host if is_own else for_clients
            if requester.header != reply.header:
                reply = reply.restamped(requester.header)
            replies.append(self._publication(topic, reply, requester))
        return replies

    def _map_answers(self, request: Request) -> list[Publish]:
        """What a client gets at once although its request missed: the map's confident objects in
        view.
        """
        if self._make_answer is None or self.object_map is None or request.pose is None:
            return []
        in_view = self.object_map.in_view(
            request.pose, request.horizontal_fov_rad, self.rules.view_range_m
        )
        objects = tuple([entry.as_detection() for entry in in_view])
        answer = self._make_answer(request.header, objects)
        return [Publish(topic, answer.credited("map", self.name)) for topic in self._outputs]

    def _publication(self, topic: str, answer: Answer, requester: Requester) -> Publish:
        """The answer on the topic on which the requester listens."""
        if requester.neighbour:
            return Publish(topic + self._remote, answer, to=requester.name)
        return Publish(topic, answer)

    def _image_lookup(self, requester: Requester, outcome: str) -> Effect:
        role = "neighbour" if requester.neighbour else "client"
        return ImageLookup(requester.header, outcome, role, self.cache_entries())


def _unanswered(requests: Iterable[PendingRequest]) -> Iterator[Expired]:
    """The clients' requests among these that nobody has answered."""
    for pending in requests:
        if not pending.answered_topics:
            for requester in pending.requesters:
                if not requester.neighbour and not requester.answered_topics:
                    yield Expired(requester.header)
