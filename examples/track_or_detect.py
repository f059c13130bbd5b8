"""Track on the car, or detect at the edge? Each frame is decided by what waits behind it.

After LTED-Ada (K. Guo, Y. Shen, X. Wang, C. You, Y. Rui, T. Q. S. Quek: Video Object Recognition in
Mobile Edge Networks: Local Tracking or Edge Detection? arXiv 2511.20716, 2025). A device handles
its frames in order. To track takes next to no time, but the objects drift away from what the last
detection saw; to detect at the edge is accurate, but it takes a round trip, and what the camera
takes meanwhile waits. So accuracy stands against the delay of a frame, its wait included.

Taken from the abstract: the two ways, that the choice knows frame rate, link and a required delay,
and the rivals (``FixedInterval``: always, never, every n-th). Ours: their policy is learned, this
one is drift-plus-penalty; and their tracker looks at pictures, this one predicts places.
"""

from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import Annotated

from genie_sim.extend import (
    NS_PER_MS,
    NS_PER_S,
    REMOTE,
    REMOTE_UPLINK,
    Bounds,
    Detections,
    Effect,
    ExistenceFilter,
    Expired,
    HostConfig,
    HostContext,
    Image,
    LocalAndRemote,
    Look,
    Message,
    Method,
    Observation,
    Publish,
    RoundTrip,
    TrackMap,
    Viewer,
)

VIEW_M = 50.0  # how far a tracked object is served, as by the recommended Genie
LOST_AFTER_NS = NS_PER_S  # so long a place is predicted (``tracks.track.COAST_NS``)


class DriftPlusPenalty:
    """As few errors as possible, while frames are answered after ``required_ns`` on average.

    ``debt`` is the virtual queue: by how much the frames so far were late, in required delays. A
    detection costs the debt times the delay that it adds, to this frame and to all that wait. To
    track costs an error, ``weight`` times the share of ``LOST_AFTER_NS`` since the last detection.
    """

    def __init__(self, required_ns: int, weight: float) -> None:
        self._required_ns = required_ns
        self._weight = weight
        self.debt = 0.0

    def detects(self, age_ns: int, waiting: int, round_trip_ns: int) -> bool:
        """Whether a frame goes to the edge. The last detection is of a frame ``age_ns`` older,
        ``waiting`` frames stand behind this one, and the edge answers after ``round_trip_ns``.
        """
        error = min(age_ns / LOST_AFTER_NS, 1.0)
        added = (1 + waiting) * round_trip_ns / self._required_ns
        return self._weight * error >= self.debt * added

    def handled(self, delay_ns: int) -> None:
        """A frame was answered, so long after it was taken."""
        self.debt = max(self.debt + delay_ns / self._required_ns - 1.0, 0.0)


class EveryNth:
    """Detects the first frame, and then every ``every``-th; 0: none but the first."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._tracked: int | None = None  # frames since the last detection; before the first: none

    def detects(self, age_ns: int, waiting: int, round_trip_ns: int) -> bool:
        """Whether a frame goes to the edge, whatever the circumstances."""
        if self._tracked is None or 0 < self._every <= self._tracked + 1:
            self._tracked = 0
            return True
        self._tracked += 1
        return False

    def handled(self, delay_ns: int) -> None:
        """Delays change nothing."""


Choice = DriftPlusPenalty | EveryNth


class Tracking(Method):
    """Each frame is tracked on the car or detected at the edge."""

    def choice(self) -> Choice:
        """What decides on one car."""
        raise NotImplementedError

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        if not host.has_edge:
            return HostConfig()
        return HostConfig(interceptor=partial(self._handler, host), uplink=REMOTE_UPLINK)

    def _handler(
        self, host: HostContext, subscribed: tuple[str, ...], published: tuple[str, ...]
    ) -> "Handler":
        state = self.choice(), TrackMap(ExistenceFilter(laws=host.laws), view_range_m=VIEW_M)
        return Handler(f"{host.name}/tracker", state, subscribed, published)


@dataclass(frozen=True)
class TrackOrDetect(Tracking):
    """Each frame is tracked on the car or detected at the edge, by the delay that it may take."""

    title = "track or detect"

    required_ns: Annotated[int, Bounds(above=0)] = 100 * NS_PER_MS
    """The mean delay that frames may have."""

    weight: Annotated[float, Bounds(minimum=0)] = 1.0
    """How much errors weigh against delays."""

    def choice(self) -> Choice:
        return DriftPlusPenalty(self.required_ns, self.weight)


@dataclass(frozen=True)
class FixedInterval(Tracking):
    """Every n-th frame is detected at the edge, the others are tracked on the car."""

    title = "fixed interval"

    every: Annotated[int, Bounds(minimum=0)] = 5
    """1 detects all frames, 0 only the first one."""

    def choice(self) -> Choice:
        return EveryNth(self.every)


class Handler(LocalAndRemote):
    """Handles a car's frames one after another. While one is at the edge, the others wait."""

    def __init__(
        self,
        name: str,
        state: tuple[Choice, TrackMap],
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
    ) -> None:
        super().__init__(name, subscribed, published)
        self._choice, self._tracks = state
        self._waiting: deque[Image] = deque()
        self._at_edge: Image | None = None
        self._sent_ns = 0
        self._detected_ns: int | None = None  # the stamp of the newest frame that was detected
        self._round_trip = RoundTrip()

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        effects = self.on_deadline(now_ns)
        if isinstance(message, Image):
            self._waiting.append(message)
        elif self._at_edge is not None and message.header == self._at_edge.header:
            assert isinstance(message, Detections)
            self._round_trip.measured(now_ns - self._sent_ns)
            effects.append(self._detected(self._at_edge, message, now_ns))
        return effects + self._handle(now_ns)

    def next_deadline_ns(self) -> int | None:
        return None if self._at_edge is None else self._sent_ns + self._round_trip.timeout_ns

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """A frame whose answer does not come is tracked after all."""
        deadline_ns = self.next_deadline_ns()
        if self._at_edge is None or deadline_ns is None or now_ns < deadline_ns:
            return []
        self._round_trip.timed_out()
        lost, self._at_edge = self._at_edge, None
        return self._tracked(lost, now_ns) + self._handle(now_ns)

    def on_memory_lost(self) -> list[Observation]:
        return [Expired(image.header) for image in self._waiting]

    def _handle(self, now_ns: int) -> list[Effect]:
        """Tracks what waits, up to a frame that goes to the edge."""
        effects: list[Effect] = []
        while self._waiting and self._at_edge is None:
            image = self._waiting.popleft()
            stamp_ns = image.header.stamp_ns
            # before the first detection there is nothing to track
            before_ns = stamp_ns - LOST_AFTER_NS if self._detected_ns is None else self._detected_ns
            round_trip_ns = self._round_trip.smoothed_ns or 0
            if self._choice.detects(stamp_ns - before_ns, len(self._waiting), round_trip_ns):
                self._at_edge, self._sent_ns = image, now_ns
                effects.append(Publish(self._images + REMOTE, image))
            else:
                effects += self._tracked(image, now_ns)
        return effects

    def _tracked(self, image: Image, now_ns: int) -> list[Effect]:
        """The answer out of the tracks; no detector will look at this frame."""
        answer = Detections(image.header, (), "map", self.name)
        return [self._answer(image, answer, now_ns), Expired(image.header)]

    def _detected(self, image: Image, answer: Detections, now_ns: int) -> Effect:
        self._at_edge = None
        self._detected_ns = image.header.stamp_ns
        look = Look(image.header, image.pose, image.horizontal_fov_rad, answer.objects)
        self._tracks.learn(look, now_ns)
        return self._answer(image, answer, now_ns)

    def _answer(self, image: Image, answer: Detections, now_ns: int) -> Effect:
        """The answer with the tracks in view of the frame, where they are now."""
        self._choice.handled(now_ns - image.header.stamp_ns)
        self._tracks.forget(now_ns)
        viewer = Viewer(image.header, image.pose, image.horizontal_fov_rad)
        objects = self._tracks.in_view(viewer, now_ns)
        return Publish(self._objects, answer.with_objects(objects).with_look(None, now_ns))
