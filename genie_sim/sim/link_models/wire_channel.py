"""One direction of a wire: how long each message takes."""

from typing import TYPE_CHECKING

from genie_sim.base.units import NS_PER_S
from genie_sim.sim.link_models.loss import BurstLoss, LossProcess
from genie_sim.sim.link_models.message_random import MessageRandom

if TYPE_CHECKING:
    from genie_sim.sim.link_models.wire import Wire


class WireChannel:
    """One direction of a wire."""

    def __init__(self, wire: "Wire", rate_bps: int | None, rng: MessageRandom) -> None:
        self._wire = wire
        self._rate_bps = rate_bps
        self._rng = rng
        self._loss = wire.loss
        self._jitter_ns = wire.jitter_ns
        self._occupied_ns: dict[int, int] = {}  # by the message's size
        self._sent = 0  # segments or messages, where losses do not pass in time
        self._losses: LossProcess | None = None
        if isinstance(wire.loss, BurstLoss):
            self._losses = LossProcess(wire.loss, rng.spawn(1)[0])

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
        delay_ns, loss = self._wire.delay_ns, self._loss
        if self._jitter_ns:
            delay_ns += int(self._rng.random() * (self._jitter_ns + 1))
        if not loss:
            return delay_ns
        if not isinstance(loss, BurstLoss):
            return None if self._rng.random() < loss else delay_ns
        if not self._is_hit(loss, size_bytes, now_ns):
            return delay_ns
        return None if loss.repair_ns is None else delay_ns + loss.repair_ns

    def _is_hit(self, loss: BurstLoss, size_bytes: int, now_ns: int) -> bool:
        """Whether bursts take something of a message whose last bit has left now."""
        assert self._losses is not None
        wire, count = self._wire, 1
        if loss.per == "segment":
            count = max(1, wire.segments(size_bytes))
            if self._rate_bps is not None:  # a step is the time of a full segment
                begin_ns = now_ns - self.occupied_ns(size_bytes, now_ns)
                step_bits = wire.wire_bits(wire.mtu_payload_bytes) * NS_PER_S
                return self._losses.hits(begin_ns * self._rate_bps // step_bits, count)
        first, self._sent = self._sent, self._sent + count
        return self._losses.hits(first, count)
