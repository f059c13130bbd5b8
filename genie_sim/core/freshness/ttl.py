"""``ttl``: an object that nobody has seen for a fixed time is forgotten."""

from typing import Any

from genie_sim.core.freshness.never import Never, positive


class Ttl(Never):
    """Forgets an object ``ttl_ns`` after its last sighting."""

    def __init__(self, ttl_ns: int = 2_000_000_000) -> None:
        positive(ttl_ns=ttl_ns)
        self._ttl_ns = ttl_ns

    def expires_ns(self, one: Any) -> int:
        seen_ns: int = one.seen_ns
        return seen_ns + self._ttl_ns
