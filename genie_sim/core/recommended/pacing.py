"""When a car sends a frame up for a look: a detector's pass over one frame.

Looks are a flow of their own beside answers. A *view* is where a car's cameras look: streams whose
headings differ by less than 15 degrees share one. A frame goes up when its view has not been looked
at for a while, if the way is free. What is lost on the way is noticed as TCP does (RFC 6298).
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from genie_sim.core.messages import Header

VIEW_RAD = math.radians(15.0)  # streams with headings this near show the same view
LIVE_NS = 500_000_000  # a stream without a frame for this long is no part of a view
FIRST_TIMEOUT_NS = 1_000_000_000  # RFC 6298, section 2.1: before the first round trip is known
MAX_TIMEOUT_NS = 5_000_000_000
MAX_BACKOFF = 8

LossCause = Literal["overtaken", "timed_out"]


@dataclass(frozen=True, slots=True)
class Loss:
    """A frame that went up and will not be answered."""

    header: Header
    cause: LossCause


class LookArrival(NamedTuple):
    """What the coming of an answer tells: whether it is fresh enough to count as a look, whether it
    was still waited for, and which frames it shows to be lost.
    """

    is_fresh: bool
    is_awaited: bool
    lost: Sequence[Loss]


class RoundTrip:
    """Smoothed round trip and timeout of the way up and back (RFC 6298), in integer nanoseconds."""

    def __init__(self) -> None:
        self.smoothed_ns: int | None = None
        self._variation_ns = 0
        self._backoff = 1

    def measured(self, round_trip_ns: int) -> None:
        """An answer came this long after its frame went up."""
        if self.smoothed_ns is None:
            self.smoothed_ns, self._variation_ns = round_trip_ns, round_trip_ns // 2
        else:
            deviation_ns = abs(self.smoothed_ns - round_trip_ns)
            self._variation_ns = (3 * self._variation_ns + deviation_ns) // 4
            self.smoothed_ns = (7 * self.smoothed_ns + round_trip_ns) // 8
        self._backoff = 1

    def timed_out(self) -> None:
        """No answer came in time: the next timeout is twice as long."""
        self._backoff = min(2 * self._backoff, MAX_BACKOFF)

    @property
    def timeout_ns(self) -> int:
        """How long a frame may be on its way before it counts as lost."""
        if self.smoothed_ns is None:
            usual_ns = FIRST_TIMEOUT_NS
        else:
            usual_ns = max(
                self.smoothed_ns + 4 * self._variation_ns,
                self.smoothed_ns + self.smoothed_ns // 2,
            )
        return min(self._backoff * usual_ns, MAX_TIMEOUT_NS)


@dataclass(slots=True)
class Stream:
    """What is known of one camera stream: stamps [ns] and heading [rad] of its newest frame, and
    the stamp of the frame that last went up, ``None`` before the first.
    """

    stamp_ns: int
    heading_rad: float
    sent_stamp_ns: int | None = None


class Views:
    """The camera streams of one car, by what they show."""

    def __init__(self) -> None:
        self._streams: dict[str, Stream] = {}

    def of_frame(self, header: Header, heading_rad: float) -> dict[str, Stream]:
        """The streams of this new frame's view, by name, its own among them."""
        stream = self._streams.get(header.frame_id)
        if stream is None:
            stream = self._streams[header.frame_id] = Stream(header.stamp_ns, heading_rad)
        stream.stamp_ns, stream.heading_rad = header.stamp_ns, heading_rad
        return {
            name: other
            for name, other in self._streams.items()
            if header.stamp_ns - other.stamp_ns <= LIVE_NS
            and _turn_rad(heading_rad, other.heading_rad) < VIEW_RAD
        }


class NewestLooks:
    """Which frame of each view a detector looked at last."""

    def __init__(self) -> None:
        self._looked_ns: dict[str, int] = {}  # by stream: the stamp of its newest look
        self._views = Views()

    def looked_ns(self, header: Header, heading_rad: float) -> int | None:
        """The stamp of the newest look of this new frame's view; ``None`` before the first."""
        view = self._views.of_frame(header, heading_rad)
        looks_ns = [self._looked_ns[name] for name in view if name in self._looked_ns]
        return max(looks_ns, default=None)

    def learned(self, header: Header) -> None:
        """A detector's answer to this frame has come, in time to count."""
        before_ns = self._looked_ns.get(header.frame_id, header.stamp_ns)
        self._looked_ns[header.frame_id] = max(header.stamp_ns, before_ns)


class Pacer:
    """Decides for each frame of one car whether it goes up. It has no clock: callers give the time.

    Parameters
    ----------
    every_ns : int
        A view is due when the frame that last went up from it is this old.
    in_flight : int
        At most this many frames are on their way at a time.
    stale_ns : int
        An answer about an older frame counts as no look; while the round trip is longer than this,
        only one frame is on its way.
    """

    def __init__(self, *, every_ns: int, in_flight: int, stale_ns: int) -> None:
        self._every_ns = every_ns
        self._in_flight = in_flight
        self._stale_ns = stale_ns
        self._views = Views()
        self._outstanding: dict[Header, int] = {}  # when each went up, in that order
        self.round_trip = RoundTrip()

    @property
    def outstanding(self) -> int:
        """How many frames are on their way: not answered, not lost."""
        return len(self._outstanding)

    def sends(self, header: Header, heading_rad: float, now_ns: int) -> bool:
        """Whether this new frame goes up; it then is on its way."""
        view = self._views.of_frame(header, heading_rad)
        stream = view[header.frame_id]
        if self.outstanding >= self._window() or not self._due(stream, view.values()):
            return False
        stream.sent_stamp_ns = header.stamp_ns
        self._outstanding[header] = now_ns
        return True

    def answered(self, header: Header, now_ns: int) -> LookArrival:
        """An answer came from the edge. Lost are the frames that went up before its own and are not
        answered, because every way keeps the order.
        """
        is_fresh = now_ns - header.stamp_ns <= self._stale_ns
        sent_ns = self._outstanding.get(header)
        if sent_ns is None:
            return LookArrival(is_fresh, is_awaited=False, lost=())
        lost = []
        for earlier in list(self._outstanding):
            del self._outstanding[earlier]
            if earlier == header:
                break
            lost.append(Loss(earlier, "overtaken"))
        self.round_trip.measured(now_ns - sent_ns)
        return LookArrival(is_fresh, is_awaited=True, lost=lost)

    def expire(self, now_ns: int) -> list[Loss]:
        """Removes and returns the frames that have been on their way for longer than the timeout.

        Frames that are lost together double the timeout once.
        """
        timeout_ns = self.round_trip.timeout_ns
        lost = [
            header
            for header, sent_ns in self._outstanding.items()
            if now_ns - sent_ns >= timeout_ns
        ]
        for header in lost:
            del self._outstanding[header]
        if lost:
            self.round_trip.timed_out()
        return [Loss(header, "timed_out") for header in lost]

    def next_deadline_ns(self) -> int | None:
        """When ``expire`` has something to do, if no answer comes before."""
        for sent_ns in self._outstanding.values():
            return sent_ns + self.round_trip.timeout_ns
        return None

    def _window(self) -> int:
        smoothed_ns = self.round_trip.smoothed_ns
        return 1 if smoothed_ns is not None and smoothed_ns > self._stale_ns else self._in_flight

    def _due(self, stream: Stream, view: Collection[Stream]) -> bool:
        """Whether the view of this stream's newest frame is to be looked at, and by this stream."""
        sent = [other.sent_stamp_ns for other in view if other.sent_stamp_ns is not None]
        if sent and stream.stamp_ns - max(sent) < self._every_ns:
            return False
        if stream.sent_stamp_ns is None:
            return True
        # The turn is that of the stream that has waited longest; a new one has waited for ever.
        return len(sent) == len(view) and stream.sent_stamp_ns == min(sent)


def _turn_rad(heading_rad: float, other_rad: float) -> float:
    """The angle between two headings, from 0 to pi."""
    return abs(math.remainder(heading_rad - other_rad, math.tau))
