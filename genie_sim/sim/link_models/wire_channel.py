"""One direction of a wire: how long each message takes."""

from collections.abc import Iterator
from itertools import chain, repeat
from typing import TYPE_CHECKING

import numpy as np

from genie_sim.base.units import NS_PER_S
from genie_sim.sim.link_models.loss import BurstLoss, LossProcess

if TYPE_CHECKING:
    from genie_sim.sim.link_models.wire import Wire


def _delays_ns(wire: "Wire", rng: np.random.Generator) -> Iterator[list[int]]:
    """Those of a link with jitter: several numbers at once are the same ones, and cost little more
    than one.
    """
    while True:
        yield (wire.delay_ns + rng.integers(wire.jitter_ns + 1, size=16)).tolist()


class WireChannel:
    """One direction of a wire."""

    def __init__(self, wire: "Wire", rate_bps: int | None, rng: np.random.Generator) -> None:
        self._wire = wire
        self._rate_bps = rate_bps
        self._rng = rng
        self._loss = wire.loss
        self._delays_ns = (
            chain.from_iterable(_delays_ns(wire, rng)) if wire.jitter_ns else repeat(wire.delay_ns)
        )
        self._occupied_ns: dict[int, int] = {}  # by the message's size
        self._losses = LossProcess(wire.loss, rng) if isinstance(wire.loss, BurstLoss) else None

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        """How long the wire is in use for a message, headers of all its segments included."""
        if self._rate_bps is None:
            return 0
        occupied_ns = self._occupied_ns.get(size_bytes)
        if occupied_ns is None:
            occupied_ns = -(-self._wire.wire_bits(size_bytes) * NS_PER_S // self._rate_bps)
            self._occupied_ns[size_bytes] = occupied_ns
        return occupied_ns

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        wire, loss = self._wire, self._loss
        if not loss:
            return next(self._delays_ns)
        if isinstance(loss, BurstLoss):
            return self._delay_in_bursts_ns(loss, size_bytes)
        if self._rng.random() < loss:
            return None
        return wire.delay_ns + (
            int(self._rng.integers(wire.jitter_ns + 1)) if wire.jitter_ns else 0
        )

    def _delay_in_bursts_ns(self, loss: BurstLoss, size_bytes: int) -> int | None:
        assert self._losses is not None
        count = max(1, self._wire.segments(size_bytes)) if loss.per == "segment" else 1
        delay_ns = next(self._delays_ns)
        if not self._losses.hits(count):
            return delay_ns
        return None if loss.repair_ns is None else delay_ns + loss.repair_ns
