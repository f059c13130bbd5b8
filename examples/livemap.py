"""A live map: an edge combines what its cars see, and sends the map down to all of them.

After LiveMap (Q. Liu, T. Han, J. Xie, B. Kim: LiveMap: Real-Time Dynamic Map in Automotive Edge
Computing. INFOCOM 2021, arXiv 2012.10252; T-IV 2023, arXiv 2210.05034). A frame is detected on
board, and the objects go up, or at the edge, and the frame goes up. The edge matches the objects of
all cars by place and class, tracks them, and broadcasts. A controller decides which frames are
handled, and where: latency against coverage.

With ``others`` it un-selects what several cars see anyway, after AdaMap (Q. Liu et al., SEC 2023,
arXiv 2309.13526).

What differs: their controllers are learned, here each car takes the way that was faster lately and
tries the other now and then; their edge matches pictures of objects, too; theirs un-selects point
clouds of single objects by a graph, here a whole frame is left out when others see all of it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from genie_sim.extend import (
    LOCAL,
    NS_PER_MS,
    NS_PER_S,
    REMOTE,
    REMOTE_UPLINK,
    Bounds,
    Detection,
    Detections,
    Effect,
    ExistenceFilter,
    Expired,
    Header,
    HostConfig,
    HostContext,
    Image,
    Interceptor,
    LocalAndRemote,
    Look,
    Message,
    Method,
    Pacer,
    Publish,
    TrackMap,
    ViewSector,
)

REACH_M, SELF_M = 60.0, 4.0  # what a car is sent, and what is the car itself: as ``SharingRules``
VIEW_M = 50.0  # how far a car looks for what others see
LATELY_NS = NS_PER_S  # so long a sighting of another car counts
HEARD_NS = 2 * NS_PER_S  # so long a car is sent maps after its newest frame
WAYS = {"car": (LOCAL,), "edge": (REMOTE,), "faster": (LOCAL, REMOTE)}


@dataclass(frozen=True)
class LiveMap(Method):
    """An edge makes one map of what its cars and its own detector find in their frames."""

    title = "live map"

    where: Literal["car", "edge", "faster"] = "faster"
    """Where frames are detected: on the car, at the edge, or where it is faster."""

    probe_ns: Annotated[int, Bounds(above=0)] = NS_PER_S
    """A way that was not used for so long is tried."""

    every_ns: int = 100 * NS_PER_MS
    """So often a car gets a map unasked."""

    others: Annotated[int, Bounds(minimum=0)] = 0
    """See ``Controller``."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        if not host.has_edge:
            return HostConfig(detector=True)
        return HostConfig(
            detector=True, interceptor=partial(self._reporter, host), uplink=REMOTE_UPLINK
        )

    def on_edge(self, host: HostContext) -> HostConfig:
        if not host.gets_images:
            return HostConfig()
        return HostConfig(detector=True, interceptor=partial(self._server, host))

    def _reporter(
        self, host: HostContext, subscribed: tuple[str, ...], published: tuple[str, ...]
    ) -> "Reporter":
        controller = Controller(WAYS[self.where], self.probe_ns, self.others)
        return Reporter(f"{host.name}/reporter", controller, subscribed, published)

    def _server(
        self, host: HostContext, subscribed: tuple[str, ...], published: tuple[str, ...]
    ) -> "MapServer":
        tracks = TrackMap(ExistenceFilter(laws=host.laws))
        return MapServer(f"{host.name}/map", tracks, self.every_ns, subscribed, published)


@dataclass(slots=True, unsafe_hash=True)
class Told(Detection):
    """An object of the map, with the other cars (``others``) that have seen it lately."""

    others: tuple[str, ...] = ()


class Controller:
    """Decides which frames of one car are handled, and where: ``ways`` are suffixes of topics.

    Each way has one frame at a time. Where ``others`` is not 0, a frame is left out if that many
    other cars have seen each object of the map that is in view, and there is any.
    """

    def __init__(self, ways: tuple[str, ...], probe_ns: int, others: int) -> None:
        self._probe_ns = probe_ns
        self._others = others
        self._pacers = {way: Pacer(every_ns=0, in_flight=1, stale_ns=NS_PER_S) for way in ways}
        self._used_ns = dict.fromkeys(ways, -probe_ns)
        self._map: Detections | None = None

    def way(self, image: Image, now_ns: int) -> str | None:
        """Where a frame is detected; ``None`` if it is not handled."""
        if self._others and self._is_seen_by_others(image):
            return None
        way = min(self._pacers, key=lambda one: self._latency_ns(one, now_ns))
        longest_unused = min(self._used_ns, key=lambda one: self._used_ns[one])
        if now_ns - self._used_ns[longest_unused] >= self._probe_ns:
            way = longest_unused
        departure = self._pacers[way].dispatch(image.header, image.pose.heading_rad, now_ns)
        if departure is None:
            return None
        self._used_ns[way] = now_ns
        return way

    def came(self, new: Detections, now_ns: int) -> None:
        """A map came down: the answer to a frame that was handled, or unasked."""
        self._map = new
        if new.source != "map":
            for pacer in self._pacers.values():
                pacer.answered(new.header, now_ns)

    def lost(self, now_ns: int) -> list[Header]:
        """The frames that should be in the map by now, and are not."""
        return [one.header for pacer in self._pacers.values() for one in pacer.expire(now_ns)]

    def next_deadline_ns(self) -> int | None:
        deadlines = [pacer.next_deadline_ns() for pacer in self._pacers.values()]
        return min((one for one in deadlines if one is not None), default=None)

    def _latency_ns(self, way: str, now_ns: int) -> int:
        """What a way took lately, or takes already for the frame that is on it; 0: not known."""
        pacer = self._pacers[way]
        so_far_ns = now_ns - self._used_ns[way] if pacer.outstanding else 0
        return max(pacer.round_trip.smoothed_ns or 0, so_far_ns)

    def _is_seen_by_others(self, image: Image) -> bool:
        if self._map is None:
            return False
        view = ViewSector(image.pose, image.horizontal_fov_rad, VIEW_M)
        seen_by = [
            len(item.others)
            for item in self._map.objects
            if item.location
            and isinstance(item, Told)
            and view.distance_m(*item.location[:2]) is not None
        ]
        return min(seen_by, default=0) >= self._others


class Reporter(LocalAndRemote):
    """On a car: frames go where the controller says, objects found on board go up, maps come."""

    def __init__(
        self,
        name: str,
        controller: Controller,
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
    ) -> None:
        super().__init__(name, subscribed, published)
        self._controller = controller
        self._on_board: Image | None = None

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        effects = self.on_deadline(now_ns)
        if isinstance(message, Image):
            way = self._controller.way(message, now_ns)
            if way is None:
                return [*effects, Expired(message.header)]
            if way == LOCAL:
                self._on_board = message
            return [*effects, Publish(self._images + way, message)]
        assert isinstance(message, Detections)
        if topic == self._objects + REMOTE:
            self._controller.came(message, now_ns)
            return [*effects, Publish(self._objects, message)]
        look = look_at(self._on_board, message)
        if look is None:
            return effects
        return [
            *effects,
            Publish(self._images + REMOTE, message.with_objects(()).with_look(look, None)),
        ]

    def next_deadline_ns(self) -> int | None:
        return self._controller.next_deadline_ns()

    def on_deadline(self, now_ns: int) -> list[Effect]:
        return [Expired(header) for header in self._controller.lost(now_ns)]


class MapServer(Interceptor):
    """On an edge: looks go in, its own detector's and those of cars; each car gets the map."""

    def __init__(
        self,
        name: str,
        tracks: TrackMap,
        every_ns: int,
        subscribed: tuple[str, ...],
        published: tuple[str, ...],
    ) -> None:
        self.name = name
        self._tracks = tracks
        self._every_ns = every_ns
        (self._images,), (self._objects,) = subscribed, published
        self._frames: dict[str, Image] = {}  # by car, that are with the detector: one of each
        self._cars: dict[str, Look] = {}  # the newest look of each
        self._told_ns: dict[str, int] = {}  # when each car got its last map

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if isinstance(message, Image):
            self._frames[message.header.origin] = message
            return [Publish(self._images + LOCAL, message)]
        assert isinstance(message, Detections)
        if topic == self._images:  # a car found these itself
            look = message.look
        else:
            look = look_at(self._frames.get(message.header.origin), message)
        return [] if look is None else list(self._combined(message, look, now_ns))

    def _combined(self, answer: Detections, look: Look, now_ns: int) -> Iterator[Effect]:
        """Counts a look. Its car gets the map, and so does who has not had one for long."""
        self._tracks.learn(look, now_ns)
        origin = look.header.origin
        self._cars[origin] = look
        for car, newest in self._cars.items():
            if car == origin:
                new = answer
            elif (
                now_ns - newest.header.stamp_ns < HEARD_NS
                and now_ns - self._told_ns[car] >= self._every_ns
            ):
                # The edge sends down by the header: the last frame of that car is answered again.
                new = Detections(newest.header, (), "map", self.name)
            else:
                continue
            self._told_ns[car] = now_ns
            objects = tuple(self._around(newest, now_ns))
            yield Publish(self._objects, new.with_objects(objects).with_look(None, now_ns))

    def _around(self, car: Look, now_ns: int) -> Iterator[Detection]:
        """The map around a car: each object, with the other cars that have seen it lately."""
        for track in self._tracks:
            existence = self._tracks.probability(track, now_ns)
            away_m = math.dist(track.place(now_ns), car.pose[:2])
            if existence < self._tracks.p_min or not SELF_M < away_m <= REACH_M:
                continue
            seen = track.as_detection(now_ns, existence)
            others = tuple(
                origin
                for origin, stamp_ns in sorted(track.seen_by_ns.items())
                if origin != car.header.origin and now_ns - stamp_ns < LATELY_NS
            )
            yield Told(
                label=seen.label,
                score=seen.score,
                box=seen.box,
                location=seen.location,
                confidence=seen.confidence,
                placed_by=seen.placed_by,
                motion=seen.motion,
                seen_in=seen.seen_in,
                others=others,
            )


def look_at(image: Image | None, answer: Detections) -> Look | None:
    """What a detector found in an image, and from where; ``None`` if it answers another one."""
    if image is None or image.header != answer.header:
        return None
    return Look(image.header, image.pose, image.horizontal_fov_rad, answer.objects)
