"""A clock that is off: what a host sends bears wrong times."""

from dataclasses import dataclass, field
from functools import partial
from typing import Annotated

from genie_sim.base.settings import Bounds
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.core.messages import Header, Message
from genie_sim.faults.targets import FaultOfHost
from genie_sim.sim.bends import Bend, Restamped, restamped
from genie_sim.sim.fault import AffectedNetwork

LARGEST_NS = 3600 * NS_PER_S
LARGEST_PPM = 1000.0


@dataclass
class ClockFault(FaultOfHost):
    """The clock of ``target`` is off. All times of what the host sends are later by the error, and
    to it all times of what others send are earlier by as much. Its own frames come back to it under
    their own stamps, and the results of a run are in true time.
    """

    target: str
    """A car or an edge."""

    offset_ns: Annotated[int, Bounds(minimum=-LARGEST_NS, maximum=LARGEST_NS)] = 10 * NS_PER_MS
    """How much the clock is ahead when the fault begins; negative: behind. NTP in a local network
    keeps within 1 to 10 ms. Assumed."""

    drift_ppm: Annotated[float, Bounds(minimum=-LARGEST_PPM, maximum=LARGEST_PPM)] = 20.0
    """How fast the error grows from then on, in microseconds per second. Quartz that runs freely:
    10 to 50 ppm. Assumed."""

    _begin_ns: int = field(default=0, init=False, repr=False, compare=False)
    _end_ns: int | None = field(default=None, init=False, repr=False, compare=False)
    _bend: Bend | None = field(default=None, init=False, repr=False, compare=False)

    dropped_by = "clock"  # it drops nothing

    def begin(self, network: AffectedNetwork) -> None:
        self._begin_ns, self._end_ns = network.clock.now, None
        if self._bend is None:
            outward, inward = (partial(self._restamped, sign=sign) for sign in (1, -1))
            self._bend = Bend(inward, outward, self.dropped_by)
            network.bend(self.target, self._bend)

    def end(self, network: AffectedNetwork) -> None:
        # What was sent before still comes back under the stamps of then, so the bend stays.
        self._end_ns = network.clock.now

    def error_ns(self, time_ns: int) -> int:
        """By how much the clock is ahead at a time; 0 before and after the fault."""
        since_ns = time_ns - self._begin_ns
        if since_ns < 0 or (self._end_ns is not None and time_ns >= self._end_ns):
            return 0
        return self.offset_ns + round(since_ns * self.drift_ppm / 1e6)

    def _restamped(self, message: Message, other: str, *, sign: int) -> Message:
        return restamped(message, partial(self._header, sign=sign), partial(self._time, sign=sign))

    def _time(self, time_ns: int, *, sign: int) -> int:
        return time_ns + sign * self.error_ns(time_ns)

    def _header(self, header: Header, *, sign: int) -> Header:
        """A header on the other side of the border. Whoever waits for a header compares it, so one
        that comes back is the same as before.
        """
        if isinstance(header, Restamped) and header.host == self.target:
            return header.before
        is_own = header.origin == self.target
        if is_own != (sign > 0):
            return header  # it crossed the border before the fault began
        error_ns = self.error_ns(header.stamp_ns)
        if error_ns == 0:
            return header
        return Restamped(header, header.stamp_ns + sign * error_ns, self.target)
