"""Collective perception: cars tell each other which objects they see.

The rules of ETSI TS 103 324 (Collective Perception Service), with the numbers of ETSI TR 103 562
and of G. Thandavarayan, M. Sepulcre, J. Gozalvez: Generation of Cooperative Perception Messages for
Connected and Automated Vehicles. IEEE Transactions on Vehicular Technology 69, 2020, DOI
10.1109/TVT.2020.3036165. At an interval a car looks for objects to tell: those that are new, have
moved by 4 m, are faster or slower by 0.5 m/s, or were told a second ago; and all persons, if one of
them was told half a second ago. Receivers add what they hear to what they see.

What differs: the car's frames are its clock, so messages leave with them. Sensor containers, the
split of long messages, congestion control (DCC) and the rule about directions are left out. How a
receiver combines objects is not in the standard: here by place and class, and the newest counts.
"""

import math
from dataclasses import dataclass
from functools import partial
from typing import Annotated

from sidelink import Sidelink, connect

from genie_sim.extend import (
    COAST_NS,
    HIGHER,
    LOCAL,
    NS_PER_MS,
    NS_PER_S,
    PERSON,
    Bounds,
    CameraPose,
    Detection,
    Detections,
    Effect,
    ExistenceFilter,
    Header,
    HostConfig,
    HostContext,
    Image,
    Interceptor,
    Look,
    Message,
    Method,
    Metric,
    Network,
    Publish,
    TrackMap,
    kind_of,
    share_of,
)

TOPIC = "/cpm"
# Thandavarayan et al., Intelligent Vehicles Symposium 2019: header, management and station
# container; and one object
MESSAGE_BYTES, OBJECT_BYTES = 121, 35
SAME_M, SELF_M = 2.0, 4.0  # one object; the car itself, as others see it: as ``SharingRules``
OLD_NS = (
    1_500 * NS_PER_MS
)  # what was seen longer ago is not told: ``TimeOfMeasurement``, TR 103 562
FRAMES = 64  # that may wait for the detector's answer
Objects = dict[tuple[str, int], Detection]  # by the car that tracks them, and its number for each


@dataclass(frozen=True, eq=False)
class Told:
    """What a car broadcasts: objects, each where it was in the frame that shows it."""

    header: Header
    size_bytes: int
    objects: Objects


class HeardObjects:
    """What a car has heard of others: what each told last of every object."""

    def __init__(self) -> None:
        self._told: Objects = {}

    def add(self, told: Told) -> None:
        """A message came."""
        self._told |= told.objects

    def objects(self, now_ns: int, within_ns: int = OLD_NS) -> Objects:
        """The objects that were seen within a time, where they are now; what several cars see is
        the sighting that is newest.
        """
        self._told = seen_since(self._told, now_ns - OLD_NS)
        told = moved(seen_since(self._told, now_ns - within_ns), now_ns)
        objects: Objects = {}
        for key in sorted(told, key=lambda key: (-seen_ns(told[key]), key)):
            others = {other: objects[other] for other in objects if other[0] != key[0]}
            if nearest(told[key], others) is None:
                objects[key] = told[key]
        return objects


def seen_since(objects: Objects, since_ns: int) -> Objects:
    """Those that were last seen then or later."""
    return {key: item for key, item in objects.items() if seen_ns(item) >= since_ns}


def seen_ns(item: Detection) -> int:
    """When the frame was taken that shows it."""
    assert item.motion is not None
    stamp_ns: int = item.motion.seen_in.stamp_ns
    return stamp_ns


def moved(objects: Objects, now_ns: int) -> Objects:
    """Objects where they should be now."""
    return {key: at(item, now_ns) for key, item in objects.items()}


def at(item: Detection, now_ns: int) -> Detection:
    """An object where it should be now."""
    assert item.location is not None and item.motion is not None
    since_s = min(now_ns - seen_ns(item), COAST_NS) * 1e-9
    (east_mps, north_mps), (east_m, north_m, up_m) = item.motion.velocity_mps, item.location
    return item.with_location((east_m + since_s * east_mps, north_m + since_s * north_mps, up_m))


def away_m(item: Detection, other: Detection | CameraPose) -> float:
    """How far an object is from another, or from a camera."""
    place = other.location if isinstance(other, Detection) else other
    assert item.location is not None and place is not None
    return math.dist(item.location[:2], place[:2])


def nearest(item: Detection, others: Objects) -> tuple[str, int] | None:
    """The key of the nearest of other objects that is the same, by place and class."""
    kind = kind_of(item.label)
    same = [
        (away_m(item, other), key) for key, other in others.items() if kind_of(other.label) is kind
    ]
    distance_m, key = min(same, default=(math.inf, None))
    return key if distance_m <= SAME_M else None


def together(own: Objects, heard: Objects) -> tuple[Detection, ...]:
    """A car's own objects and those that it has heard of; of the same the one seen last."""
    objects = dict(own)
    for key, item in heard.items():
        same = nearest(item, own)
        if same is None or seen_ns(item) > seen_ns(own[same]):
            objects[same or key] = item
    return (*objects.values(),)


class Listening(Interceptor):
    """Passes a car's frames to its detector, tracks what that finds, and answers with all that the
    car and those that it hears have seen. A subclass says what the car tells others.
    """

    def __init__(self, host: HostContext, topic: str, every_ns: int, *topics: tuple[str, ...]):
        self.name, self._car = f"{host.name}{topic}", host.name
        self._topic, self._every_ns = topic, every_ns
        (self._images,), (self._objects,) = topics
        self._tracks = TrackMap(ExistenceFilter(laws=host.laws))
        self._heard = HeardObjects()
        self._frames: dict[Header, Image] = {}  # that the detector has
        self._told_ns: int | None = None  # the stamp of the frame with which it told last

    def tell(self, frame: Image, now_ns: int) -> Told | None:
        """What the car broadcasts when it takes a frame, an interval after the last."""
        raise NotImplementedError

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL, self._topic

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL, self._topic

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if isinstance(message, Told):
            self.hear(message, now_ns)
            return []
        if isinstance(message, Image):
            return [Publish(self._images + LOCAL, message), *self._broadcast(message, now_ns)]
        assert isinstance(message, Detections)
        return [Publish(self._objects, self._answer(message, now_ns))]

    def hear(self, told: Told, now_ns: int) -> None:
        """Another car's message came."""
        self._heard.add(told)

    def own(self, now_ns: int) -> Objects:
        """What the car has seen and takes to be there, each where it was seen."""
        existences = {track: self._tracks.probability(track, now_ns) for track in self._tracks}
        return {
            (self._car, track.number): track.as_detection(track.seen_ns, existence)
            for track, existence in existences.items()
            if existence >= self._tracks.p_min
        }

    def _broadcast(self, frame: Image, now_ns: int) -> list[Effect]:
        self._frames[frame.header] = frame
        if len(self._frames) > FRAMES:
            self._frames.pop(next(iter(self._frames)))
        stamp_ns = frame.header.stamp_ns
        if self._told_ns is not None and stamp_ns - self._told_ns < self._every_ns:
            return []
        self._told_ns = stamp_ns
        told = self.tell(frame, now_ns)
        return [] if told is None else [Publish(self._topic, told)]

    def _answer(self, answer: Detections, now_ns: int) -> Detections:
        frame = self._frames.pop(answer.header, None)
        if frame is None:
            return answer
        placed = tuple(seen for seen in answer.objects if seen.location is not None)
        look = Look(answer.header, frame.pose, frame.horizontal_fov_rad, placed)
        self._tracks.learn(look, now_ns)
        heard = self._heard.objects(now_ns)
        others = {key: item for key, item in heard.items() if away_m(item, frame.pose) > SELF_M}
        objects = together(moved(self.own(now_ns), now_ns), others)
        return answer.with_objects(objects).with_look(None, now_ns)


class Inclusion:
    """Which objects the standard wants in a message; the times are those of ``CPM``."""

    def __init__(self, moved_m: float, faster_mps: float, again_ns: int, persons_ns: int) -> None:
        self._moved_m, self._faster_mps = moved_m, faster_mps
        self._again_ns, self._persons_ns = again_ns, persons_ns
        self._told: dict[tuple[str, int], tuple[Detection, int]] = {}  # as it was, and when

    def due(self, objects: Objects, now_ns: int) -> Objects:
        """Those that are told now, of all that the car could tell, where they are now."""
        persons = {key for key, item in objects.items() if kind_of(item.label) is PERSON}
        due = {key for key, item in objects.items() if self._is_due(key, item, now_ns)}
        if due & persons:
            due |= persons
        found = {key: item for key, item in objects.items() if key in due}
        self._told = {key: told for key, told in self._told.items() if key in objects}
        self._told |= {key: (item, now_ns) for key, item in found.items()}
        return found

    def _is_due(self, key: tuple[str, int], item: Detection, now_ns: int) -> bool:
        if key not in self._told:
            return True
        told, told_ns = self._told[key]
        if kind_of(item.label) is PERSON:
            return now_ns - told_ns >= self._persons_ns
        return (
            away_m(item, told) > self._moved_m
            or abs(speed_mps(item) - speed_mps(told)) > self._faster_mps
            or now_ns - told_ns >= self._again_ns
        )


def speed_mps(item: Detection) -> float:
    """How fast an object is."""
    assert item.motion is not None
    return math.hypot(*item.motion.velocity_mps)


class Teller(Listening):
    """A car that tells the objects that the rules want."""

    def __init__(self, host: HostContext, method: "CPM", *topics: tuple[str, ...]) -> None:
        super().__init__(host, TOPIC, method.every_ns, *topics)
        self._longest_ns, self._unless_heard_ns = method.longest_ns, method.unless_heard_ns
        self._rules = Inclusion(*method.rules)
        self._sent_ns: int | None = None

    def tell(self, frame: Image, now_ns: int) -> Told | None:
        own = seen_since(self.own(now_ns), now_ns - OLD_NS)
        objects = moved(own, now_ns)
        if self._unless_heard_ns:
            heard = self._heard.objects(now_ns, self._unless_heard_ns)
            objects = {key: item for key, item in objects.items() if nearest(item, heard) is None}
        due = self._rules.due(objects, now_ns)
        if not due and self._sent_ns is not None and now_ns - self._sent_ns < self._longest_ns:
            return None
        self._sent_ns = now_ns
        header = Header(frame.header.stamp_ns, TOPIC, frame.header.origin)
        size_bytes = MESSAGE_BYTES + OBJECT_BYTES * len(due)
        return Told(header, size_bytes, {key: own[key] for key in due})


class CPM(Method):
    """Cars detect on board, and tell each other what they see."""

    title = "collective perception"

    def __init__(
        self,
        *,
        every_ns: Annotated[int, Bounds(minimum=100 * NS_PER_MS, maximum=NS_PER_S)] = 100_000_000,
        longest_ns: Annotated[int, Bounds(minimum=0)] = NS_PER_S,
        moved_m: Annotated[float, Bounds(minimum=0)] = 4.0,
        faster_mps: Annotated[float, Bounds(minimum=0)] = 0.5,
        again_ns: Annotated[int, Bounds(minimum=0)] = NS_PER_S,
        persons_ns: Annotated[int, Bounds(minimum=0)] = NS_PER_S // 2,
        unless_heard_ns: Annotated[int, Bounds(minimum=0, maximum=OLD_NS)] = 0,
        range_m: Annotated[float, Bounds(above=0)] = 300.0,
    ) -> None:
        """``every`` and ``longest``: the shortest and the longest time between messages. An object
        is told when it has ``moved`` so far, is ``faster_mps`` faster or slower, or was told so
        long ago (``again``; ``persons``). ``unless_heard``: not if others saw it within this time.
        ``range``: how far a car is heard.
        """
        self.range_m = range_m
        self.every_ns, self.longest_ns, self.unless_heard_ns = every_ns, longest_ns, unless_heard_ns
        self.rules = moved_m, faster_mps, again_ns, persons_ns

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        return HostConfig(detector=True, interceptor=partial(Teller, host, self))

    def on_edge(self, host: HostContext) -> HostConfig:
        return HostConfig()

    def wire(self, network: Network) -> None:
        connect(network, network.cars, (TOPIC,), Sidelink(range_m=self.range_m))


hidden_held = Metric(
    "hidden objects held",
    "objects",
    HIGHER,
    meaning="Objects that a car holds in its field of view and cannot see, such as behind a house.",
    formula=lambda held: share_of(held, held["hidden"]),
    kind="held",
)
