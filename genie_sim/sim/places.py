"""Where a car is while it drives its route."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import cached_property

from genie_sim.core.messages import Frame
from genie_sim.sim.settings import Route

Point = tuple[float, float]
Place = Callable[[int], Point]  # east and north [m] at a time [ns]


class RecordedPlace:
    """Where a car is that replays a recording: on the straight line between the poses of two
    frames. Before its first frame, after its last one and between two laps it stands.

    Parameters
    ----------
    route : Route
        Its window, laps, pause and start.
    frames : sequence of Frame
        Those of one camera, in order of time.
    """

    def __init__(self, route: Route, frames: Sequence[Frame]) -> None:
        self._route = route
        self._recording = frames

    @cached_property
    def _frames(self) -> list[Frame]:
        begin_ns, end_ns = self._route.window_of(self._recording)
        return [frame for frame in self._recording if begin_ns <= frame.stamp_ns < end_ns]

    @cached_property
    def _stamps_ns(self) -> list[int]:
        return [frame.stamp_ns for frame in self._frames]

    def __call__(self, now_ns: int) -> Point:
        route, (begin_ns, end_ns) = self._route, self._route.window_of(self._recording)
        lap_ns = end_ns - begin_ns + route.pause_ns
        driven_ns = min(max(now_ns - route.start_ns, 0), route.laps * lap_ns - 1)
        stamp_ns = begin_ns + driven_ns % lap_ns
        stamps_ns, frames = self._stamps_ns, self._frames
        number = bisect_right(stamps_ns, stamp_ns)
        before, after = max(number - 1, 0), min(number, len(frames) - 1)
        first, second = frames[before].pose, frames[after].pose
        span_ns = stamps_ns[after] - stamps_ns[before]
        share = (stamp_ns - stamps_ns[before]) / span_ns if span_ns else 0.0
        return (
            first.east_m + share * (second.east_m - first.east_m),
            first.north_m + share * (second.north_m - first.north_m),
        )


class DrivenPlace:
    """Where a car of a town is, whose drive tells ``position`` at any time after its start."""

    def __init__(self, position: Place, start_ns: int, duration_ns: int) -> None:
        self._position = position
        self._start_ns = start_ns
        self._duration_ns = duration_ns

    def __call__(self, now_ns: int) -> Point:
        return self._position(min(max(now_ns - self._start_ns, 0), self._duration_ns))
