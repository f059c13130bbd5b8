"""``corroborate``: one car's word is not enough for others."""

from typing import Any

from genie_sim.core.freshness.never import Never, positive
from genie_sim.messages import Header


class Corroborate(Never):
    """An object is served to others once ``n`` cars have seen it within ``within_ns``; a car that has seen it gets it
    at once. Where only one car has been heard for that time there is nobody to ask, and what it sees counts; how often
    is in ``exempted``."""

    def __init__(self, n: int = 2, within_ns: int = 10_000_000_000) -> None:
        positive(within_ns=within_ns)
        if n < 1:
            raise ValueError(f"n: must be at least 1, but is {n}")
        self._n, self._within_ns = n, within_ns
        self._heard: dict[str, int] = {}
        self.exempted = 0

    def seen(self, one: Any, score: float, header: Header) -> None:
        one.origins[header.origin] = self._heard[header.origin] = header.stamp_ns

    def serves(self, one: Any, to: str, now_ns: int) -> bool:
        if to in one.origins:
            return True
        since_ns = now_ns - self._within_ns
        if sum(stamp_ns >= since_ns for stamp_ns in one.origins.values()) >= self._n:
            return True
        alone = sum(stamp_ns >= since_ns for stamp_ns in self._heard.values()) < 2
        self.exempted += alone
        return alone
