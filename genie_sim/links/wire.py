"""A wire: a message takes the time of its bits at a constant rate, then a delay, which is the same
for all but for jitter; some messages are lost.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from genie_sim.base.marks import Bounds, Share
from genie_sim.base.units import NS_PER_S
from genie_sim.links.burst_loss import BurstLoss, LossProcess
from genie_sim.sim.link_model import LinkEnds, TimedTransmitter

if TYPE_CHECKING:
    from genie_sim.sim.network import Network

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
    """Propagation delay of every message, one way."""

    jitter_ns: int = 0
    """Additional delay, drawn uniformly from 0 to this value for every message."""

    loss: Share | BurstLoss = 0.0
    """Probability that a message is lost, or a mapping of losses in bursts, such as `{mean: 0.01,
    burst: 20}`."""

    mtu_payload_bytes: Annotated[int, Bounds(above=0)] = ETHERNET_PAYLOAD_BYTES
    """Payload of a segment, at most."""

    overhead_bytes: int = ETHERNET_OVERHEAD_BYTES
    """Headers, preamble and gap of a segment."""

    def link_bits(self, size_bytes: int) -> int:
        """The bits of a message of ``size_bytes`` with the overhead of its segments."""
        return (size_bytes + self.segments(size_bytes) * self.overhead_bytes) * 8

    def segments(self, size_bytes: int) -> int:
        """The number of segments of a message."""
        return -(-size_bytes // self.mtu_payload_bytes)

    def transmitter(self, network: "Network", ends: LinkEnds) -> "WireTransmitter":
        return WireTransmitter(self, network, ends)


class WireTransmitter(TimedTransmitter):
    """One direction of a wire."""

    def __init__(self, wire: Wire, network: "Network", ends: LinkEnds) -> None:
        super().__init__(network, ends)
        self._wire = wire
        self._rate_bps = wire.rate_up_bps if ends.up else wire.rate_down_bps
        self._loss = wire.loss
        self._jitter_ns = wire.jitter_ns
        self._occupied_ns: dict[int, int] = {}  # by the message's size
        self._segments = 0  # so far, where losses do not pass in time
        self._losses: LossProcess | None = None
        if isinstance(wire.loss, BurstLoss):
            self._losses = LossProcess(wire.loss, self.random.spawn(1)[0])

    def occupied_ns(self, size_bytes: int, now_ns: int) -> int:
        """How long the wire is in use for a message, headers of all its segments included."""
        if self._rate_bps is None:
            return 0
        occupied_ns = self._occupied_ns.get(size_bytes)
        if occupied_ns is None:
            occupied_ns = -(-self._wire.link_bits(size_bytes) * NS_PER_S // self._rate_bps)
            self._occupied_ns[size_bytes] = occupied_ns
        return occupied_ns

    def delay_ns(self, size_bytes: int, now_ns: int) -> int | None:
        delay_ns, loss = self._wire.delay_ns, self._loss
        if self._jitter_ns:
            delay_ns += int(self.random.random() * (self._jitter_ns + 1))
        if not loss:
            return delay_ns
        if isinstance(loss, BurstLoss):
            is_lost = self._is_in_burst(size_bytes, now_ns)
        else:
            is_lost = self.random.random() < loss
        return None if is_lost else delay_ns

    def _is_in_burst(self, size_bytes: int, now_ns: int) -> bool:
        """Whether a burst takes any segment of a message whose last bit has left now."""
        assert self._losses is not None
        wire = self._wire
        count = max(1, wire.segments(size_bytes))
        if self._rate_bps is None:
            first, self._segments = self._segments, self._segments + count
        else:  # a step is the time of a full segment
            begin_ns = now_ns - self.occupied_ns(size_bytes, now_ns)
            step_bits = wire.link_bits(wire.mtu_payload_bytes) * NS_PER_S
            first = begin_ns * self._rate_bps // step_bits
        return self._losses.pass_steps(first, count)
