"""Judges the objects that consumers hold by what is really there.

Each car is judged when its first camera, or any of them, takes a frame. What its consumer holds is
compared with the truth of that very instant, not with that of the frames that its answers are
about: a late answer counts as a wrong one (streaming accuracy; M. Li, Y. Wang, D. Ramanan, "Towards
Streaming Perception", ECCV 2020)."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, Protocol

from genie_sim.classes import class_of
from genie_sim.core.consumer import Consumer, Newest
from genie_sim.core.matching import Near, Placed, near, pairs, placed
from genie_sim.messages import Detection, Detections, Frame, Image, Location
from genie_sim.recording.gospa import GOSPA_CUT_M, gospa_m
from genie_sim.recording.recent_places import RecentPlaces
from genie_sim.recording.records import HeldObjectRow, HeldRow
from genie_sim.recording.tables import Table
from genie_sim.units import NS_PER_S

CONSUMER, ZERO_DELAY = "consumer", "zero_delay"
REMEMBERED_NS = 10 * NS_PER_S  # what was there so long ago counts as moved away


class RealObject(Protocol):
    """Something that is really there."""

    @property
    def label(self) -> str: ...

    @property
    def location(self) -> Location: ...

    @property
    def moving(self) -> bool: ...


class DriveTruth(Protocol):
    """What is really there on one car's drive."""

    @property
    def reach_m(self) -> float:
        """How far from an object one that is held may be and still be right."""

    @property
    def range_m(self) -> float:
        """How far from the camera an object counts."""

    def knows(self, label: str) -> bool:
        """Whether objects of a class would be known if they were there."""

    def visible(self, frame: Frame) -> Sequence[RealObject]:
        """What the frame's camera can see."""

    def is_there(self, frame: Frame, label: str, east_m: float, north_m: float) -> bool:
        """Whether anything of a class, visible or not, is within ``reach_m`` of a place when the
        frame is taken.
        """


class _Judged(NamedTuple):
    """An object at a place, and how it is judged: what tells the rows of ``held_objects`` apart."""

    label: str
    east_m: float
    north_m: float
    judgement: str


class _Comparison(NamedTuple):
    """What is held, and what is really there, at one instant.

    ``judgements`` has a word for each object that is held; ``candidates`` are the pairs of the two
    lists that are near enough for GOSPA, ``matches`` those that make an object right.
    """

    held: Sequence[Detection]
    judgements: Sequence[str]
    real: Sequence[RealObject]
    candidates: Sequence[Near]
    matches: Sequence[Near]


class MapAccuracy:
    """Judges what the consumers of one method hold.

    Parameters
    ----------
    method : str
        The name under which rows are written.
    truths : mapping of str to DriveTruth
        What is there on the drive of each car. Cars without are not judged.
    table : Table
        Gets a row of counts per instant (``records.HELD``).
    judged_without_delay : collection of str
        Cars for which the detector's own answer without any delay is judged already. It is the
        same under every method.
    make_consumer : callable
        Makes the consumer of one car.
    objects : Table, optional
        Gets a row per object that is held or missed (``records.HELD_OBJECTS``).
    all_streams : bool
        Whether the frames of every stream of a car are instants at which it is judged, within their
        fields of view, not only those of the first.
    """

    def __init__(
        self,
        method: str,
        truths: Mapping[str, DriveTruth],
        table: Table,
        judged_without_delay: Collection[str] = (),
        make_consumer: Callable[[], Consumer] = Newest,
        *,
        objects: Table | None = None,
        all_streams: bool = False,
    ) -> None:
        self._method = method
        self._truths = truths
        self._table = table
        self._judged_without_delay = judged_without_delay
        self._objects = objects
        self._all_streams = all_streams
        self._consumers = {car: make_consumer() for car in truths}
        self._first_streams: dict[str, str] = {}  # of each car, the one whose frames are instants
        # By car: when an object of a class was first in an answer at exactly this place.
        self._first_seen_ns: dict[str, dict[tuple[str, Location], int]] = {
            car: {} for car in truths
        }
        # By car and stream: since when each object is judged as it is.
        self._open: dict[str, dict[str, dict[_Judged, int]]] = {car: {} for car in truths}
        # To the camera of any car that is judged.
        max_reach_m = max((truth.reach_m for truth in truths.values()), default=1.0)
        self._visible_lately = RecentPlaces(max_reach_m)

    def answered(self, answer: Detections, now_ns: int) -> None:
        """An answer is in the consumer's hands."""
        stamp_ns, _, car = answer.header
        if car not in self._truths:
            return
        self._consumers[car].on_answer(answer, now_ns)
        first_seen_ns = self._first_seen_ns[car]
        for detection in answer.objects:
            if detection.location is not None:
                first_seen_ns.setdefault((detection.label, detection.location), stamp_ns)

    def published(self, image: Image) -> None:
        """A camera took a frame; the car is judged unless only its first camera's frames count."""
        now_ns, stream, car = image.header
        truth = self._truths.get(car)
        if truth is None:
            return
        consumer = self._consumers[car]
        consumer.on_frame(image)
        if self._first_streams.setdefault(car, stream) != stream and not self._all_streams:
            return
        real = [
            thing
            for thing in truth.visible(image.content)
            if _in_view(image, thing.location, truth.range_m)
        ]
        self._visible_lately.forget(now_ns - REMEMBERED_NS)
        held = consumer.held(now_ns)
        comparison = self._compare(image, held, real)
        self._count(CONSUMER, image, comparison)
        if self._objects is not None:
            self._follow(image, comparison)
        self._forget_first_seen(car, held)
        if car not in self._judged_without_delay:
            self._count(ZERO_DELAY, image, self._compare(image, image.content.detections, real))
        for thing in real:
            place = class_of(thing.label), thing.location[0], thing.location[1]
            self._visible_lately.add(place, now_ns)

    def close(self) -> None:
        """Nothing more happens: what is held now is held until the end."""
        for car, streams in self._open.items():
            for objects in streams.values():
                self._end(car, objects, None)
        self._open.clear()

    def _compare(
        self, image: Image, objects: Sequence[Detection], real: Sequence[RealObject]
    ) -> _Comparison:
        """Judges each object in view, of a class that the truth knows."""
        truth = self._truths[image.header.origin]
        held = [
            detection
            for detection in objects
            if detection.location is not None
            and truth.knows(detection.label)
            and _in_view(image, detection.location, truth.range_m)
        ]
        held_places = placed(held)
        real_places = [
            (class_of(thing.label), thing.location[0], thing.location[1]) for thing in real
        ]
        candidates = near(held_places, real_places, max(truth.reach_m, GOSPA_CUT_M))
        matches = pairs(candidates, truth.reach_m)
        right = {i for _, i, _ in matches}
        near_real = {i for distance_m2, i, _ in candidates if distance_m2 <= truth.reach_m**2}
        judgements = []
        for i, place in enumerate(held_places):
            if i in right:
                judgements.append("right")
            elif i in near_real:
                judgements.append("duplicate")
            else:
                judgements.append(self._cause(image, place))
        return _Comparison(held, judgements, real, candidates, matches)

    def _count(self, what: str, image: Image, comparison: _Comparison) -> None:
        """Writes a row of ``held``."""
        now_ns, _, car = image.header
        judgements, matches = comparison.judgements, comparison.matches
        # What is there and cannot be seen is neither right nor wrong.
        counted = [i for i, judgement in enumerate(judgements) if judgement != "hidden"]
        compared = [
            pair
            for pair in comparison.candidates
            if pair[0] <= GOSPA_CUT_M**2 and judgements[pair[1]] != "hidden"
        ]
        moving = sum(thing.moving for thing in comparison.real)
        found_moving = sum(comparison.real[j].moving for _, _, j in matches)
        shared = [i for i in counted if _is_shared(comparison.held[i], car)]
        ages_s = [0.0] * len(counted)
        if what == CONSUMER:
            ages_s = [self._age_s(car, now_ns, comparison.held[i]) for i in counted]
        errors_m = [math.sqrt(distance_m2) for distance_m2, _, _ in matches]
        row = HeldRow(
            method=self._method,
            what=what,
            car=car,
            stamp_ns=now_ns,
            held=len(counted),
            right=len(matches),
            moved_away=judgements.count("moved_away"),
            never_there=judgements.count("never_there"),
            duplicate=judgements.count("duplicate"),
            shared=len(shared),
            shared_right=sum(judgements[i] == "right" for i in shared),
            hidden=judgements.count("hidden"),
            visible_static=len(comparison.real) - moving,
            found_static=len(matches) - found_moving,
            visible_moving=moving,
            found_moving=found_moving,
            gospa_m=gospa_m(compared, len(counted), len(comparison.real)),
            age_s=_mean(ages_s),
            error_m=_mean(errors_m),
        )
        self._table.append(row)

    def _follow(self, image: Image, comparison: _Comparison) -> None:
        """Notes since when each object is judged as it is, and writes a row of ``held_objects`` for
        each that is so no more.
        """
        found = {j for _, _, j in comparison.matches}
        judged: list[tuple[Detection | RealObject, str]] = [
            (detection, judgement)
            for detection, judgement in zip(comparison.held, comparison.judgements, strict=True)
            if judgement != "hidden"
        ]
        judged += [(thing, "missed") for j, thing in enumerate(comparison.real) if j not in found]
        now_ns, stream, car = image.header
        earlier = self._open[car].get(stream, {})
        current = self._open[car][stream] = {}
        for thing, judgement in judged:
            assert thing.location is not None
            key = _Judged(thing.label, thing.location[0], thing.location[1], judgement)
            current[key] = earlier.pop(key, now_ns)
        self._end(car, earlier, now_ns)

    def _end(self, car: str, begins_ns: Mapping[_Judged, int], end_ns: int | None) -> None:
        for key, begin_ns in begins_ns.items():
            assert self._objects is not None
            row = HeldObjectRow(
                method=self._method,
                car=car,
                label=key.label,
                east_m=key.east_m,
                north_m=key.north_m,
                judged=key.judgement,
                begin_ns=begin_ns,
                end_ns=end_ns,
            )
            self._objects.append(row)

    def _cause(self, image: Image, place: Placed) -> str:
        """Why an object is held where nothing visible is."""
        label, east_m, north_m = place
        truth = self._truths[image.header.origin]
        if truth.is_there(image.content, label, east_m, north_m):
            return "hidden"
        if self._visible_lately.any_near(place, truth.reach_m):
            return "moved_away"
        return "never_there"

    def _forget_first_seen(self, car: str, held: Iterable[Detection]) -> None:
        """Keeps the ages of what is still held."""
        first_seen_ns = self._first_seen_ns[car]
        keys = [(detection.label, detection.location) for detection in held if detection.location]
        self._first_seen_ns[car] = {key: first_seen_ns[key] for key in keys if key in first_seen_ns}

    def _age_s(self, car: str, now_ns: int, detection: Detection) -> float:
        """The time since the frame in which an object was seen: as a map that tracks says, else the
        first one whose answer had an object of its class at exactly its place.
        """
        assert detection.location is not None
        if detection.motion is not None:
            seen_ns = detection.motion.seen.stamp_ns
        else:
            key = detection.label, detection.location
            seen_ns = self._first_seen_ns[car].get(key, now_ns)
        return max(now_ns - seen_ns, 0) / NS_PER_S


def _is_shared(detection: Detection, car: str) -> bool:
    """Whether the car holds this for what another car saw."""
    return detection.motion is not None and detection.motion.seen.origin != car


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _in_view(image: Image, location: Location, range_m: float) -> bool:
    """In the frame's horizontal field of view, and near enough."""
    pose = image.pose
    east_m, north_m = location[0] - pose.east_m, location[1] - pose.north_m
    if east_m * east_m + north_m * north_m > range_m * range_m:
        return False
    bearing_rad = math.remainder(math.atan2(north_m, east_m) - pose.heading_rad, math.tau)
    return abs(bearing_rad) <= image.horizontal_fov_rad / 2
