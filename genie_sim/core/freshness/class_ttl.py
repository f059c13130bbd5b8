"""``class_ttl``: how long an object stays depends on what it is, after the four layers of ETSI's local dynamic map.

TR 102 863: permanent static, transient static, transient dynamic, highly dynamic. The times of the dynamic layers are
the longest intervals between messages about such objects in ETSI TR 103 562: 1 s, and 500 ms for persons.
"""

from typing import Any

from genie_sim.core.freshness.never import Never, positive
from genie_sim.core.tracking import FIXED


class ClassTtl(Never):
    """Lights, signs and street furniture stay (permanent static); what has been seen at one place for a second stays
    ``parked_ns`` (transient static), persons ``person_ns`` (highly dynamic), all else ``moving_ns`` (transient dynamic)
    after the last sighting."""

    def __init__(
        self, parked_ns: int = 300_000_000_000, moving_ns: int = 1_000_000_000, person_ns: int = 500_000_000
    ) -> None:
        positive(parked_ns=parked_ns, moving_ns=moving_ns, person_ns=person_ns)
        self._parked_ns, self._moving_ns, self._person_ns = parked_ns, moving_ns, person_ns

    def expires_ns(self, one: Any) -> int | None:
        if one.label in FIXED:
            return None
        seen_ns: int = one.seen_ns
        if one.parked:
            return seen_ns + self._parked_ns
        return seen_ns + (self._person_ns if one.label == "person" else self._moving_ns)
