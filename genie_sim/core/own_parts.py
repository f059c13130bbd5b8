"""Parts of a Genie of the user's own, checked while they run: what their methods return must be
what the Genie needs (``contracts``).
"""

from collections.abc import Hashable
from typing import Any

from genie_sim.base.contracts import (
    BOOLEAN,
    HASHABLE,
    NUMBER,
    SHARE,
    Checked,
    Contract,
    optional,
    require,
)
from genie_sim.core.eviction import Eviction
from genie_sim.core.similarity import KeyIndex

DEFENCE_CONTRACTS = dict.fromkeys(("counts", "tells", "believes", "admits"), BOOLEAN)
POLICY_METHODS = {"expires_ns": optional(NUMBER), "serves": BOOLEAN, "existence": SHARE}


class CheckedIndex:
    """The keys of a similarity of the user's own: ``find`` must return a held key."""

    def __init__(self, own: KeyIndex, owner: str) -> None:
        self._own = own
        self._keys: set[Hashable] = set()
        self._contract = Contract("a held key, or None", self._is_right)
        self._owner = owner

    def add(self, key: Hashable, /) -> None:
        self._keys.add(key)
        self._own.add(key)

    def discard(self, key: Hashable, /) -> None:
        self._keys.discard(key)
        self._own.discard(key)

    def find(self, key: Hashable) -> Hashable | None:
        held: Hashable = require(self._owner, "find()", self._own.find(key), self._contract)
        return held

    def _is_right(self, key: Any) -> bool:
        return key is None or (HASHABLE.holds(key) and key in self._keys)


class CheckedEviction(Checked):
    """An eviction policy of the user's own: its victim must be a stored key."""

    def __init__(self, own: Eviction, owner: str) -> None:
        keys: set[Hashable] = set()

        def stored(key: Hashable, now_ns: int) -> None:
            keys.add(key)
            own.stored(key, now_ns)

        def removed(key: Hashable) -> None:
            keys.discard(key)
            own.removed(key)

        victim = Contract("a stored key", lambda key: HASHABLE.holds(key) and key in keys)
        super().__init__(own, owner, {"victim": victim, "expires_ns": optional(NUMBER)})
        self.__dict__.update(stored=stored, removed=removed)


INDEX = Contract(
    "an object with add, discard and find",
    lambda value: all(callable(getattr(value, name, None)) for name in ("add", "discard", "find")),
    lambda value, owner, _: CheckedIndex(value, owner),
)
SIMILARITY_METHODS = {"key": HASHABLE, "index": INDEX}
