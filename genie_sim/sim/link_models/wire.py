"""A wire: every bit takes its time, then comes the same delay for all, with jitter and losses."""

from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.settings import Bounds, Share
from genie_sim.sim.link_models.loss import BurstLoss
from genie_sim.sim.link_models.message_random import MessageRandom
from genie_sim.sim.link_models.wire_channel import WireChannel

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

    def channel(self, up: bool, rng: MessageRandom) -> WireChannel:
        return WireChannel(self, self.rate_up_bps if up else self.rate_down_bps, rng)
