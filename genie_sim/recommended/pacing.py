"""When a car sends a frame up for a look: a detector's pass over one frame.

Looks are a flow of their own beside answers. A *view* is where a car's cameras look: streams whose
headings differ by less than 15 degrees share one. Looks of a view have a timetable: one falls due
every so often, and the frame nearest to that instant goes up, if the way is free. While answers
come too late to count, fewer and fewer go up. What is lost on the way is noticed as TCP does (RFC
6298).
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from genie_sim.core.messages import Header

VIEW_RAD = math.radians(15.0)  # assumed: streams with headings this near show the same view
LIVE_NS = 500_000_000  # assumed: a stream without a frame for this long is no part of a view
FIRST_TIMEOUT_NS = 1_000_000_000  # RFC 6298, section 2.1: before the first round trip is known
# Assumed: timeouts grow no further, as RFC 6298, section 2.5, allows from 60 s on.
MAX_TIMEOUT_NS = 5_000_000_000
MAX_BACKOFF = 8
MAX_PROBE_NS = 10_000_000_000  # assumed: between frames that go up while answers come back stale

LossCause = Literal["overtaken", "timed_out"]


@dataclass(frozen=True, slots=True)
class Loss:
    """A frame that went up and will not be answered."""

    header: Header
    cause: LossCause


class LookArrival(NamedTuple):
    """What the coming of an answer means: whether it is in time to be a look, whether it was
    still waited for, and which frames it shows to be lost.
    """

    is_in_time: bool
    is_awaited: bool
    losses: Sequence[Loss]


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


class Departure(NamedTuple):
    """A frame goes up: the time [ns] since the one before it from its view, ``None`` for a view's
    first.
    """

    gap_ns: int | None


class SentFrame(NamedTuple):
    """The stamp [ns] of a frame that went up, and when that look of its view had been due, a view's
    first at its stamp. Of frames with one stamp, that for the later look went up last.
    """

    stamp_ns: int
    due_ns: int


@dataclass(slots=True)
class Stream:
    """What is known of one camera stream: stamp [ns] and heading [rad] of its newest frame, the
    time [ns] to it from the one before, and the frame that went up last; ``None`` until there is
    one.
    """

    stamp_ns: int
    heading_rad: float
    interval_ns: int | None = None
    last_sent: SentFrame | None = None

    def next_ns(self, newest: "Stream") -> float:
        """When its next frame is expected, at the time of the ``newest`` frame of its view, whose
        interval stands in for its own where that is unknown. Infinity if both are, or if the frame
        is overdue by more than half an interval: then the camera stands still.
        """
        interval_ns = self.interval_ns or newest.interval_ns
        if interval_ns is None:
            return math.inf
        next_ns = self.stamp_ns + interval_ns
        return next_ns if newest.stamp_ns - next_ns <= interval_ns / 2 else math.inf


class CameraStreams:
    """The camera streams of one car, and which of them show one view."""

    def __init__(self) -> None:
        self._streams: dict[str, Stream] = {}

    def add_frame(self, header: Header, heading_rad: float) -> dict[str, Stream]:
        """Notes a new frame; returns the streams of its view, by name, its own among them."""
        stream = self._streams.get(header.frame_id)
        if stream is None:
            stream = self._streams[header.frame_id] = Stream(header.stamp_ns, heading_rad)
        elif header.stamp_ns > stream.stamp_ns:
            stream.interval_ns = header.stamp_ns - stream.stamp_ns
        stream.stamp_ns, stream.heading_rad = header.stamp_ns, heading_rad
        return {
            name: member
            for name, member in self._streams.items()
            if header.stamp_ns - member.stamp_ns <= LIVE_NS
            and _turn_rad(heading_rad, member.heading_rad) < VIEW_RAD
        }


class NewestLooks:
    """Which frame of each view a detector looked at last."""

    def __init__(self) -> None:
        self._looked_ns: dict[str, int] = {}  # by stream: the stamp of its newest look
        self._streams = CameraStreams()

    def add_frame(self, header: Header, heading_rad: float) -> int | None:
        """Notes a new frame; returns the stamp of the newest look of its view, ``None`` before the
        first.
        """
        view = self._streams.add_frame(header, heading_rad)
        looks_ns = [self._looked_ns[name] for name in view if name in self._looked_ns]
        return max(looks_ns, default=None)

    def add_look(self, header: Header) -> None:
        """A detector's answer to this frame has come, in time."""
        before_ns = self._looked_ns.get(header.frame_id, header.stamp_ns)
        self._looked_ns[header.frame_id] = max(header.stamp_ns, before_ns)


class Pacer:
    """Decides for each frame of one car whether it goes up. It has no clock: callers give the time.

    Parameters
    ----------
    every_ns : int
        Looks of a view are due this far apart; 0: every frame is. Between the frames that go up is
        this time on average, or that between all frames of the view where it is longer.
    in_flight : int
        At most this many frames are on their way at a time.
    stale_ns : int
        An answer about an older frame is no look. While the round trip is longer than this, only
        one frame is on its way; with each such answer in a row the time between looks grows: to
        this time, then twice as long each time, up to 10 s.
    """

    def __init__(self, *, every_ns: int, in_flight: int, stale_ns: int) -> None:
        self._every_ns = every_ns
        self._in_flight = in_flight
        self._stale_ns = stale_ns
        self._streams = CameraStreams()
        self._outstanding: dict[Header, int] = {}  # when each went up, in that order
        self._stale_in_a_row = 0
        self.round_trip = RoundTrip()

    @property
    def outstanding(self) -> int:
        """How many frames are on their way: not answered, not lost."""
        return len(self._outstanding)

    def dispatch(self, header: Header, heading_rad: float, now_ns: int) -> Departure | None:
        """Sends a new frame up, if that is to be; ``None``: it stays."""
        view = self._streams.add_frame(header, heading_rad)
        stream = view[header.frame_id]
        every_ns = self._interval_ns()
        departures = [member.last_sent for member in view.values() if member.last_sent is not None]
        last = max(departures, default=None)
        due_ns = None if last is None else _due_ns(last, every_ns)
        if self.outstanding >= self._window() or not _is_its_turn(
            stream, view.values(), due_ns, every_ns
        ):
            return None
        stream.last_sent = SentFrame(header.stamp_ns, header.stamp_ns if due_ns is None else due_ns)
        self._outstanding[header] = now_ns
        return Departure(None if last is None else header.stamp_ns - last.stamp_ns)

    def answered(self, header: Header, now_ns: int) -> LookArrival:
        """An answer came from the edge. Lost are the frames that went up before its own and are not
        answered, because every way keeps the order.
        """
        is_in_time = now_ns - header.stamp_ns <= self._stale_ns
        sent_ns = self._outstanding.get(header)
        if sent_ns is None:
            return LookArrival(is_in_time, is_awaited=False, losses=())
        losses = []
        for earlier in list(self._outstanding):
            del self._outstanding[earlier]
            if earlier == header:
                break
            losses.append(Loss(earlier, "overtaken"))
        self._stale_in_a_row = 0 if is_in_time else self._stale_in_a_row + 1
        self.round_trip.measured(now_ns - sent_ns)
        return LookArrival(is_in_time, is_awaited=True, losses=losses)

    def expire(self, now_ns: int) -> list[Loss]:
        """Removes and returns the frames that have been on their way for longer than the timeout.

        Frames that are lost together double the timeout once.
        """
        timeout_ns = self.round_trip.timeout_ns
        headers = [
            header
            for header, sent_ns in self._outstanding.items()
            if now_ns - sent_ns >= timeout_ns
        ]
        for header in headers:
            del self._outstanding[header]
        if headers:
            self.round_trip.timed_out()
        return [Loss(header, "timed_out") for header in headers]

    def next_deadline_ns(self) -> int | None:
        """When ``expire`` has something to do, if no answer comes before."""
        for sent_ns in self._outstanding.values():
            return sent_ns + self.round_trip.timeout_ns
        return None

    def _window(self) -> int:
        smoothed_ns = self.round_trip.smoothed_ns
        return 1 if smoothed_ns is not None and smoothed_ns > self._stale_ns else self._in_flight

    def _interval_ns(self) -> int:
        """How far apart the looks of a view fall due. An answer that is too late is of no use but
        to show that the next would be, too: then a probe goes up, first after ``stale``, then after
        twice as long each time.
        """
        if self._stale_in_a_row == 0:
            return self._every_ns
        probe_ns = self._stale_ns << min(self._stale_in_a_row - 1, 10)
        return max(self._every_ns, min(probe_ns, MAX_PROBE_NS))


def _due_ns(last: SentFrame, every_ns: int) -> int:
    """When the look after a view's ``last`` one falls due: by the timetable, or anew from that look
    where a whole gap was missed.
    """
    is_missed = last.stamp_ns - last.due_ns >= every_ns
    return every_ns + (last.stamp_ns if is_missed else last.due_ns)


def _is_its_turn(
    stream: Stream, view: Collection[Stream], due_ns: int | None, every_ns: int
) -> bool:
    """Whether this stream's newest frame is the one for the look that is due: no later frame of the
    view comes nearer to that instant, and no other stream is to have this look.

    With a look every 100 ms, and frames of A at 0, 100, 200 ms, of B at 40, 140, 240 ms:

    ====  =====  =======================================================================
    look  frame
    ====  =====  =======================================================================
    --    A 0    goes up: the view's first
    100   B 40   stays: it is 60 ms early, and A 100 comes nearer
    100   A 100  stays: the last look of B is older, and its frame 140 comes before 150
    100   B 140  goes up
    200   A 200  goes up: the last look of B is newer
    ====  =====  =======================================================================
    """
    if due_ns is None:
        return True
    early_ns = due_ns - stream.stamp_ns
    if early_ns > 0:
        late_ns = min(member.next_ns(stream) for member in view) - due_ns  # of the next frame
        if late_ns < early_ns or late_ns == math.inf:
            return False
    # A stream whose last look is older has this one, if its frame comes within half a gap after.
    latest_ns = due_ns + every_ns / 2
    waiting = (member for member in view if _sent_ns(member) < _sent_ns(stream))
    return all(max(member.next_ns(stream), stream.stamp_ns) >= latest_ns for member in waiting)


def _sent_ns(stream: Stream) -> float:
    """The stamp of the frame of a stream that went up last; before the first minus infinity."""
    return -math.inf if stream.last_sent is None else stream.last_sent.stamp_ns


def _turn_rad(heading_rad: float, other_rad: float) -> float:
    """The angle between two headings, from 0 to pi."""
    return abs(math.remainder(heading_rad - other_rad, math.tau))
