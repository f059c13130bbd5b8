"""How long an object stays after its last sighting, and who else must have seen it.

``class_ttl`` follows the four layers of ETSI's local dynamic map (TR 102 863): permanent static,
transient static, transient dynamic, highly dynamic. The times of the dynamic layers are the longest
intervals between messages about such objects in ETSI TR 103 562: 1 s, and 500 ms for persons.
"""

from typing import Any

from genie_sim.core.freshness.never import Never, positive
from genie_sim.core.messages import Header
from genie_sim.core.tracking import FIXED


class Ttl(Never):
    """Forgets an object ``ttl_ns`` after its last sighting.

    Parameters
    ----------
    ttl_ns : int
        How long after its last sighting an object is served.
    """

    def __init__(self, ttl_ns: int = 2_000_000_000) -> None:
        positive(ttl_ns=ttl_ns)
        self._ttl_ns = ttl_ns

    def expires_ns(self, stored: Any) -> int:
        seen_ns: int = stored.seen_ns
        return seen_ns + self._ttl_ns


class ClassTtl(Never):
    """Lights, signs and street furniture stay (permanent static); what has been seen at one place
    for a second stays ``parked_ns`` (transient static), persons ``person_ns`` (highly dynamic), all
    else ``moving_ns`` (transient dynamic) after the last sighting.

    Parameters
    ----------
    parked_ns : int
        How long after its last sighting a parked vehicle is served.
    moving_ns : int
        The same for a moving vehicle.
    person_ns : int
        The same for a person.
    """

    def __init__(
        self,
        parked_ns: int = 300_000_000_000,
        moving_ns: int = 1_000_000_000,
        person_ns: int = 500_000_000,
    ) -> None:
        positive(parked_ns=parked_ns, moving_ns=moving_ns, person_ns=person_ns)
        self._parked_ns, self._moving_ns, self._person_ns = parked_ns, moving_ns, person_ns

    def expires_ns(self, stored: Any) -> int | None:
        if stored.label in FIXED:
            return None
        seen_ns: int = stored.seen_ns
        if stored.parked:
            return seen_ns + self._parked_ns
        return seen_ns + (self._person_ns if stored.label == "person" else self._moving_ns)


class Corroborated(Never):
    """An object is served to others once ``n`` cars have seen it within ``within_ns``; a car that
    has seen it gets it at once. Where only one car has been heard for that time there is nobody to
    ask, and what it sees counts; how often is in ``exempted``.

    Parameters
    ----------
    n : int
        How many cars must have seen an object.
    within_ns : int
        The time within which they must have seen it.
    """

    def __init__(self, n: int = 2, within_ns: int = 10_000_000_000) -> None:
        positive(within_ns=within_ns)
        if n < 1:
            raise ValueError(f"n: must be at least 1, but is {n}")
        self._n, self._within_ns = n, within_ns
        self._heard: dict[str, int] = {}
        self.exempted = 0

    def seen(self, stored: Any, score: float, header: Header) -> None:
        stored.origins[header.origin] = self._heard[header.origin] = header.stamp_ns

    def serves(self, stored: Any, to: str, now_ns: int) -> bool:
        if to in stored.origins:
            return True
        since_ns = now_ns - self._within_ns
        if sum(stamp_ns >= since_ns for stamp_ns in stored.origins.values()) >= self._n:
            return True
        alone = sum(stamp_ns >= since_ns for stamp_ns in self._heard.values()) < 2
        self.exempted += alone
        return alone
