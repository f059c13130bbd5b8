"""The database of Algorithm 1 for one topic: stored answers, and the requests that still wait for theirs."""

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field

from genie_sim.core.eviction import Eviction
from genie_sim.core.maps import Viewer
from genie_sim.core.rules import Capacity
from genie_sim.core.similarity import KeyIndex
from genie_sim.messages import Answer, Header

Answers = dict[str, Answer]  # by the topic they were published on


class MessageCache:
    """Key of a request -> its answers, within a capacity in entries, in bytes, or without limit (``None``)."""

    def __init__(
        self, index: KeyIndex, eviction: Eviction, capacity: Capacity | None = None
    ) -> None:
        self._index = index
        self._eviction = eviction
        self._capacity = capacity
        self._answers: dict[Hashable, Answers] = {}
        self.size_bytes = 0

    def __len__(self) -> int:
        return len(self._answers)

    def get(self, key: Hashable, now_ns: int) -> Answers | None:
        """The answers to an equal request, ``None`` on a miss. Counts as a use."""
        held = self._find(key, now_ns)
        if held is None:
            return None
        self._eviction.used(held, now_ns)
        return self._answers[held]

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        """Stores ``answer`` for ``topic``, over an older one; what no longer fits goes by the eviction policy.

        An answer larger than the whole capacity is not stored.
        """
        size_bytes = answer.size_bytes
        if self._capacity is not None and not self._capacity.holds(0, size_bytes):
            return
        held = self._find(key, now_ns)
        if held is None:
            while self._answers and not self._fits(1, size_bytes):
                self._remove(self._eviction.victim())
            held = key
            self._index.add(held)
            self._answers[held] = {}
        answers = self._answers[held]
        old = answers.get(topic)
        answers[topic] = answer
        self.size_bytes += size_bytes - (old.size_bytes if old is not None else 0)
        self._eviction.stored(held, now_ns)
        while not self._fits(0, 0):  # an answer grew
            self._remove(self._eviction.victim())

    def _find(self, key: Hashable, now_ns: int) -> Hashable | None:
        """The held key that equals ``key``; those whose time is over go on the way."""
        held = self._index.find(key)
        while held is not None:
            expires_ns = self._eviction.expires_ns(held)
            if expires_ns is None or now_ns < expires_ns:
                break
            self._remove(held)
            held = self._index.find(key)
        return held

    def _fits(self, entries: int, size_bytes: int) -> bool:
        capacity = self._capacity
        return capacity is None or capacity.holds(
            len(self._answers) + entries, self.size_bytes + size_bytes
        )

    def _remove(self, key: Hashable) -> None:
        self.size_bytes -= sum(answer.size_bytes for answer in self._answers.pop(key).values())
        self._index.discard(key)
        self._eviction.removed(key)


@dataclass(slots=True)
class Requester:
    """Who wants the answer to a request: a client of ours, or a neighbour (``name``, if the middleware tells it).

    ``served`` are the topics on which the cache has already answered.
    """

    header: Header
    neighbour: bool
    name: str | None
    served: frozenset[str] = frozenset()


@dataclass(slots=True)
class PendingRequest:
    """A request that was opened and has not expired; ``forwarded`` as long as a node of ours works on it. ``viewer`` is
    from where it was made, ``None`` where that is unknown."""

    topic: str
    key: Hashable
    deadline_ns: int | None
    forwarded: bool
    requesters: list[Requester] = field(default_factory=list)
    answered: set[str] = field(default_factory=set)  # the topics on which an answer came
    viewer: Viewer | None = None


class PendingIndex:
    """Header of a request -> the request that waits, and key -> the request that an equal one can join."""

    def __init__(
        self, identity: Callable[[Header], Hashable] | None, new_keys: Callable[[], KeyIndex]
    ) -> None:
        """``identity``: what of a header counts, ``None`` for all of it."""
        self._identity = identity
        self._new_keys = new_keys
        self._by_header: dict[Hashable, PendingRequest] = {}
        self._waiting: deque[tuple[Hashable, PendingRequest]] = deque()  # the same by deadline
        self._keys: dict[str, KeyIndex] = {}
        self._open: dict[tuple[str, Hashable], PendingRequest] = {}
        self.next_deadline_ns: int | None = None  # when the oldest request expires

    def __len__(self) -> int:
        return len(self._by_header)

    def __iter__(self) -> Iterator[PendingRequest]:
        return iter(self._by_header.values())

    def by_header(self, header: Header) -> PendingRequest | None:
        """The request that an answer with this header belongs to."""
        return self._by_header.get(header if self._identity is None else self._identity(header))

    def by_key(self, topic: str, key: Hashable) -> PendingRequest | None:
        """The request that our node already works on for an equal message."""
        keys = self._keys.get(topic)
        held = keys.find(key) if keys is not None else None
        return None if held is None else self._open.get((topic, held))

    def open(self, header: Header, pending: PendingRequest) -> None:
        """A request waits from now on, one of this header at a time. Deadlines must not decrease from call to call."""
        if not self._waiting:
            self.next_deadline_ns = pending.deadline_ns
        identity = header if self._identity is None else self._identity(header)
        self._by_header[identity] = pending
        self._waiting.append((identity, pending))
        if pending.forwarded:
            self._keys.setdefault(pending.topic, self._new_keys()).add(pending.key)
            self._open[pending.topic, pending.key] = pending

    def expire(self, now_ns: int) -> list[PendingRequest]:
        """Removes and returns the requests whose deadline has come."""
        expired = []
        while self.next_deadline_ns is not None and self.next_deadline_ns <= now_ns:
            identity, pending = self._waiting.popleft()
            self.next_deadline_ns = self._waiting[0][1].deadline_ns if self._waiting else None
            del self._by_header[identity]
            self.close(pending)
            expired.append(pending)
        return expired

    def close(self, pending: PendingRequest) -> None:
        """Nobody needs to join this request any more; its header stays known for a second answer."""
        if pending.forwarded:
            pending.forwarded = False
            if self._open.get((pending.topic, pending.key)) is pending:
                del self._open[pending.topic, pending.key]
                self._keys[pending.topic].discard(pending.key)
