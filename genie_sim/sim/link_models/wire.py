"""A wire: every bit takes its time, then comes the same delay for all, with jitter and independent losses."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, repeat

import numpy as np

from genie_sim.units import NS_PER_S, rate_text, size_text

ETHERNET_PAYLOAD_BYTES = 1448  # a segment's payload at MTU 1500, TCP with time stamps
ETHERNET_OVERHEAD_BYTES = 90  # its headers, preamble, gap and check sequence on the wire


@dataclass(frozen=True)
class Wire:
    """A full-duplex link of constant rates; ``None`` is infinite.

    Every message is delayed by ``delay_ns`` plus a uniform draw from 0 to ``jitter_ns``, and lost with probability
    ``loss``. Each segment of ``mtu_payload_bytes`` has ``overhead_bytes`` of headers.
    """

    rate_up_bps: int | None
    rate_down_bps: int | None
    delay_ns: int
    jitter_ns: int = 0
    loss: float = 0.0
    mtu_payload_bytes: int = ETHERNET_PAYLOAD_BYTES
    overhead_bytes: int = ETHERNET_OVERHEAD_BYTES

    def __post_init__(self) -> None:
        for name in ("rate_up", "rate_down"):
            rate = getattr(self, f"{name}_bps")
            if rate is not None and rate <= 0:
                raise ValueError(f"{name}: must be more than zero, but is {rate_text(rate)}")
        if not 0 <= self.loss <= 1:
            raise ValueError(f"loss: must be from 0 to 1, but is {self.loss:g}")
        if self.mtu_payload_bytes <= 0:
            raise ValueError(
                f"mtu_payload: must be more than zero, but is {size_text(self.mtu_payload_bytes)}"
            )

    def wire_bits(self, size_bytes: int) -> int:
        """What a message of ``size_bytes`` takes on the wire: every segment has its overhead."""
        segments = -(-size_bytes // self.mtu_payload_bytes)
        return (size_bytes + segments * self.overhead_bytes) * 8

    def channel(self, up: bool, rng: np.random.Generator) -> "WireChannel":
        return WireChannel(self, self.rate_up_bps if up else self.rate_down_bps, rng)


def _delays_ns(wire: Wire, rng: np.random.Generator) -> Iterator[list[int]]:
    """Those of a link with jitter: several numbers at once are the same ones, and cost little more than one."""
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
        if wire.loss:
            if self._rng.random() < wire.loss:
                return None
            return wire.delay_ns + (
                int(self._rng.integers(wire.jitter_ns + 1)) if wire.jitter_ns else 0
            )
        return next(self._delays_ns)
