"""The database of Algorithm 1 for one topic: stored answers, and the requests that still wait for
theirs.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from genie_sim.base.contracts import class_name, whole
from genie_sim.base.errors import UserError, short_repr
from genie_sim.core.eviction import Eviction
from genie_sim.core.messages import Answer, Header
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import KeyIndex

Answers = dict[str, Answer]  # by the topic they were published on
MAX_WITHOUT_DEADLINE = 10_000  # so many such requests wait at most


class MessageCache:
    """Key of a request -> its answers, within a capacity in entries, in bytes, or without limit
    (``None``).

    A subclass reads ``answers``, by stored key, and tells the ``eviction`` what it uses; it takes a
    key out with ``remove``.
    """

    def __init__(
        self, index: KeyIndex, eviction: Eviction, capacity: Capacity | None = None
    ) -> None:
        self._index = index
        self.eviction = eviction
        self._capacity = capacity
        self.answers: dict[Hashable, Answers] = {}
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self.answers)

    def get(self, key: Hashable, now_ns: int) -> Answers | None:
        """The answers to an equal request, ``None`` on a miss. It is a use."""
        stored_key = self._expire_and_find(key, now_ns)
        if stored_key is None:
            return None
        self.eviction.used(stored_key, now_ns)
        return self.answers[stored_key]

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        """Stores ``answer`` for ``topic``, over an older one; what no longer fits goes by the
        eviction policy.

        An answer larger than the whole capacity is not stored.
        """
        size_bytes = answer.size_bytes
        if self._capacity is not None and not self._capacity.holds(0, size_bytes):
            return
        stored_key = self._expire_and_find(key, now_ns)
        if stored_key is None:
            while self.answers and not self._fits(1, size_bytes):
                self._evict()
            stored_key = key
            self._index.add(stored_key)
            self.answers[stored_key] = {}
        answers = self.answers[stored_key]
        old = answers.get(topic)
        answers[topic] = answer
        self.size_bytes += size_bytes - (old.size_bytes if old is not None else 0)
        self.eviction.stored(stored_key, now_ns)
        while not self._fits(0, 0):  # an answer grew
            self._evict()

    def _expire_and_find(self, key: Hashable, now_ns: int) -> Hashable | None:
        """The stored key that equals ``key``; equal ones whose time is over are removed."""
        stored_key = self._index.find(key)
        while stored_key is not None:
            expires_ns = self.eviction.expires_ns(stored_key)
            if expires_ns is None or now_ns < whole(self.eviction, "expires_ns()", expires_ns):
                break
            self.remove(stored_key)
            stored_key = self._index.find(key)
        return stored_key

    def _fits(self, entries: int, size_bytes: int) -> bool:
        capacity = self._capacity
        return capacity is None or capacity.holds(
            len(self.answers) + entries, self.size_bytes + size_bytes
        )

    def _evict(self) -> None:
        """The eviction policy's victim goes. Raises UserError where a policy of the user's own
        names a key that is not stored.
        """
        key = self.eviction.victim()
        if key not in self.answers:
            text = f"victim() is {short_repr(key)}, but must be a key that is stored"
            raise UserError(f"eviction {class_name(self.eviction)}: {text}")
        self.remove(key)

    def remove(self, key: Hashable) -> None:
        """A stored key goes, with its answers."""
        self.size_bytes -= sum(answer.size_bytes for answer in self.answers.pop(key).values())
        self._index.discard(key)
        self.eviction.removed(key)


@dataclass(slots=True)
class Requester:
    """Who wants the answer to a request: a client of ours, or a neighbour (``name``, if the
    middleware tells it).

    ``answered_topics`` are those on which the cache has already answered.
    """

    header: Header
    neighbour: bool
    name: str | None
    answered_topics: frozenset[str] = frozenset()


@dataclass(slots=True)
class PendingRequest:
    """A request that was opened and has not expired; ``is_forwarded`` as long as a node of ours
    works on it.
    """

    topic: str
    key: Hashable
    deadline_ns: int | None
    is_forwarded: bool
    requesters: list[Requester]
    answered_topics: set[str] = field(default_factory=set)  # on which an answer came

    def has_requester(self, header: Header) -> bool:
        """Whether the request with this header waits for the answer."""
        return any(requester.header == header for requester in self.requesters)


class PendingIndex:
    """Header of a request -> the request that waits, and key -> the request that an equal one can
    join.
    """

    def __init__(
        self,
        identity: Literal["stamp_frame_origin", "stamp"],
        new_keys: Callable[[], KeyIndex],
    ) -> None:
        """``identity``: what of a header tells requests apart."""
        self._by_stamp = identity == "stamp"
        self._new_keys = new_keys
        self._by_header: OrderedDict[Hashable, PendingRequest] = OrderedDict()  # by deadline
        self._keys: dict[str, KeyIndex] = {}
        self._open: dict[tuple[str, Hashable], PendingRequest] = {}

    def __len__(self) -> int:
        return len(self._by_header)

    def __iter__(self) -> Iterator[PendingRequest]:
        return iter(self._by_header.values())

    @property
    def next_deadline_ns(self) -> int | None:
        """When the oldest request expires, ``None`` for never."""
        oldest = next(iter(self._by_header.values()), None)
        return None if oldest is None else oldest.deadline_ns

    def by_header(self, header: Header) -> PendingRequest | None:
        """The request that an answer with this header belongs to."""
        return self._by_header.get(header.stamp_ns if self._by_stamp else header)

    def by_key(self, topic: str, key: Hashable) -> PendingRequest | None:
        """The request that our node already works on for an equal message."""
        keys = self._keys.get(topic)
        pending_key = None if keys is None else keys.find(key)
        return None if pending_key is None else self._open.get((topic, pending_key))

    def joinable(self, topic: str, key: Hashable) -> PendingRequest | None:
        """The request whose answer a request with an equal message can wait for."""
        pending = self.by_key(topic, key)
        return None if pending is None or pending.answered_topics else pending

    def open(self, header: Header, pending: PendingRequest) -> list[PendingRequest]:
        """A request waits from now on, in the place of one of this header. Deadlines must not
        decrease from call to call. Returns those that it pushes out: of requests without a deadline
        the oldest.
        """
        identity = header.stamp_ns if self._by_stamp else header
        self._by_header[identity] = pending
        self._by_header.move_to_end(identity)
        if pending.is_forwarded:
            self._keys.setdefault(pending.topic, self._new_keys()).add(pending.key)
            self._open[pending.topic, pending.key] = pending
        if pending.deadline_ns is None and len(self._by_header) > MAX_WITHOUT_DEADLINE:
            return [self._remove_oldest()]
        return []

    def expire(self, now_ns: int) -> list[PendingRequest]:
        """Removes and returns the requests whose deadline has come."""
        overdue = []
        while (deadline_ns := self.next_deadline_ns) is not None and deadline_ns <= now_ns:
            overdue.append(self._remove_oldest())
        return overdue

    def close(self, pending: PendingRequest) -> None:
        """Nobody needs to join this request any more; a second answer still finds it."""
        if pending.is_forwarded:
            pending.is_forwarded = False
            if self._open.get((pending.topic, pending.key)) is pending:
                del self._open[pending.topic, pending.key]
                self._keys[pending.topic].discard(pending.key)

    def _remove_oldest(self) -> PendingRequest:
        _, pending = self._by_header.popitem(last=False)
        self.close(pending)
        return pending
