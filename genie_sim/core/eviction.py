"""Which stored answer goes when the cache is full, or when its time is over.

To add a policy, write a class with the methods of ``Eviction`` and name it in ``EVICTIONS`` (or in
a scenario as ``package.module:Class``).
"""

import heapq
from collections import OrderedDict
from collections.abc import Callable, Hashable


class Eviction:
    """Watches the keys of a cache and names the next one to go. Times are integer nanoseconds.

    By itself, answers never grow old; a cache with a capacity lets the oldest go first (FIFO).
    """

    def __init__(self) -> None:
        # a dict would search for its first key
        self._keys: OrderedDict[Hashable, int | None] = OrderedDict()

    def stored(self, key: Hashable, now_ns: int) -> None:
        """An answer was stored under ``key`` at ``now_ns`` [ns], for the first time or again."""
        self._keys.setdefault(key, None)

    def used(self, key: Hashable, now_ns: int) -> None:
        """The answer under ``key`` was replayed at ``now_ns`` [ns]."""

    def removed(self, key: Hashable) -> None:
        """``key`` is gone."""
        self._keys.pop(key, None)

    def victim(self) -> Hashable:
        """The key to remove from a full cache that holds at least one."""
        return next(iter(self._keys))

    def expires_ns(self, key: Hashable) -> int | None:
        """From when on [ns] the answer under ``key`` is too old, ``None`` for never."""
        return None


class LRU(Eviction):
    """The least recently used answer goes first."""

    def stored(self, key: Hashable, now_ns: int) -> None:
        self.used(key, now_ns)

    def used(self, key: Hashable, now_ns: int) -> None:
        self._keys[key] = None
        self._keys.move_to_end(key)


class LFU(Eviction):
    """The least frequently used answer goes first; of equally used ones the least recently used."""

    def __init__(self) -> None:
        self._uses: dict[Hashable, tuple[int, int]] = {}
        self._heap: list[tuple[int, int, Hashable]] = []
        self._clock = 0

    def stored(self, key: Hashable, now_ns: int) -> None:
        self.used(key, now_ns)

    def used(self, key: Hashable, now_ns: int) -> None:
        self._clock += 1
        rank = (self._uses.get(key, (0, 0))[0] + 1, self._clock)
        self._uses[key] = rank
        heapq.heappush(self._heap, (*rank, key))
        if len(self._heap) > 8 * len(self._uses) + 64:  # mostly stale ranks: rebuild
            self._heap = [(*current, stored_key) for stored_key, current in self._uses.items()]
            heapq.heapify(self._heap)

    def removed(self, key: Hashable) -> None:
        self._uses.pop(key, None)

    def victim(self) -> Hashable:
        while True:  # skip what a later use or a removal has made stale
            uses, clock, key = self._heap[0]
            if self._uses.get(key) == (uses, clock):
                return key
            heapq.heappop(self._heap)


class TTL(Eviction):
    """An answer lives for ``ttl_ns`` after it was stored; when the cache is full the oldest goes
    first.
    """

    def __init__(self, ttl_ns: int) -> None:
        if ttl_ns <= 0:
            raise ValueError("ttl: the time to live must be positive")
        super().__init__()
        self._ttl_ns = ttl_ns

    def stored(self, key: Hashable, now_ns: int) -> None:
        self._keys[key] = now_ns + self._ttl_ns
        self._keys.move_to_end(key)

    def expires_ns(self, key: Hashable) -> int | None:
        return self._keys.get(key)


EVICTIONS: dict[str, Callable[..., Eviction]] = {
    "fifo": Eviction,
    "lru": LRU,
    "lfu": LFU,
    "ttl": TTL,
}
