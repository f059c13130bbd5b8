"""A wire: every bit takes its time, then comes the same delay for all, with jitter and losses."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Annotated

import numpy as np

from genie_sim.settings import Bounds, Share
from genie_sim.sim.link_models.loss import BurstLoss, LossProcess
from genie_sim.units import NS_PER_S

ETHERNET_PAYLOAD_BYTES = 1448  # a segment's payload at MTU 1500, TCP with time stamps
ETHERNET_OVERHEAD_BYTES = 90  # its headers, preamble, gap and check sequence on the wire


@dataclass(frozen=True)
class Wire:
    """A full-duplex link of constant rates; ``None`` is infinite.

    A message occupies the link for as long as its bits and the headers of its segments take.
    """

    rate_up_bps: int | None
    """Bit rate towards the edge; `null` is unlimited."""

    rate_down_bps: int | None
    """Bit rate from the edge; `null` is unlimited."""

    delay_ns: int
    """Propagation delay of every message."""

    jitter_ns: int = 0
    """Additional delay, drawn uniformly from 0 to this value for every message."""

    loss: Share | BurstLoss = 0.0
    """Probability that a message is lost, or a mapping of losses in bursts, such as `{mean: 0.01,
    burst: 20}`."""

    mtu_payload_bytes: Annotated[int, Bounds(above=0)] = ETHERNET_PAYLOAD_BYTES
    """Payload of a segment, at most."""

    overhead_bytes: int = ETHERNET_OVERHEAD_BYTES
    """Headers, preamble and gap of a segment."""

    def wire_bits(self, size_bytes: int) -> int:
        """What a message of ``size_bytes`` takes on the wire: every segment has its overhead."""
        return (size_bytes + self.segments(size_bytes) * self.overhead_bytes) * 8

    def segments(self, size_bytes: int) -> int:
        """The number of segments of a message."""
        return -(-size_bytes // self.mtu_payload_bytes)

    def channel(self, up: bool, rng: np.random.Generator) -> "WireChannel":
        return WireChannel(self, self.rate_up_bps if up else self.rate_down_bps, rng)


def _delays_ns(wire: Wire, rng: np.random.Generator) -> Iterator[list[int]]:
    """Those of a link with jitter: several numbers at once are the same ones, and cost little more
    than one.
    """
    while True:
        yield (wire.delay_ns + rng.integers(wire.jitter_ns + 1, size=16)).tolist()


class WireChannel:
    """One direction of a wire."""

    def __init__(self, wire: Wire, rate_bps: int | None, rng: np.random.Generator) -> None:
        self._wire = wire
        self._rate_bps = rate_bps
        self._rng = rng
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
        wire = self._wire
        if isinstance(wire.loss, BurstLoss):
            return self._delay_in_bursts_ns(wire.loss, size_bytes)
        if wire.loss:
            if self._rng.random() < wire.loss:
                return None
            return wire.delay_ns + (
                int(self._rng.integers(wire.jitter_ns + 1)) if wire.jitter_ns else 0
            )
        return next(self._delays_ns)

    def _delay_in_bursts_ns(self, loss: BurstLoss, size_bytes: int) -> int | None:
        assert self._losses is not None
        count = max(1, self._wire.segments(size_bytes)) if loss.per == "segment" else 1
        delay_ns = next(self._delays_ns)
        if not self._losses.hits(count):
            return delay_ns
        return None if loss.repair_ns is None else delay_ns + loss.repair_ns
