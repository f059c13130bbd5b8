"""The broadcast media that are shipped, and one of a user's own."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
import simpy

from genie_sim.sim.link_models import Air
from tests.conformance.broadcasts import BroadcastConformance


@dataclass(frozen=True)
class Telepathy:
    """Everybody hears everything at once, a millisecond after it was said."""

    takes_ns: int = 1_000_000
    """How long a message takes."""

    def radio(self, air: Air) -> Minds:
        return Minds(self.takes_ns, air)


class Minds:
    def __init__(self, takes_ns: int, air: Air) -> None:
        self.takes_ns, self.air = takes_ns, air
        self.hosts: list[str] = []

    def sender(self, host: str) -> Mind:
        self.hosts.append(host)
        return Mind(host, self)


class Mind:
    def __init__(self, host: str, minds: Minds) -> None:
        self.host, self.minds = host, minds

    @property
    def heard_by(self) -> tuple[str, ...]:
        return tuple(host for host in self.minds.hosts if host != self.host)

    def sent(self, size_bytes: int) -> simpy.Event:
        return self.minds.air.clock.timeout(self.minds.takes_ns)

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        return 0

    def set_up(self, is_up: bool) -> None:
        pass


@pytest.mark.parametrize(
    "broadcast",
    [
        "sidelink",
        {"medium": "sidelink", "range": "20 m", "rate": "0.1 Mbit/s", "loss": 0.3},
        {"medium": f"{__name__}:Telepathy", "takes": "3 ms"},
    ],
)
class TestBroadcasts(BroadcastConformance):
    pass
