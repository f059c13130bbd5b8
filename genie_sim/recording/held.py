"""Judges answers: ``agreement`` by what the detector itself finds in that very frame, a proxy of correctness without
labels; ``Held`` by what is really there, at every frame of each car's first camera.

A consumer's newest answers are compared with the truth of that very instant, not with that of the frames they answer:
being late is being wrong (streaming accuracy; M. Li, Y. Wang, D. Ramanan, "Towards Streaming Perception", ECCV 2020).
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from genie_sim.core.consumer import Consumer, Newest
from genie_sim.core.matching import SAME_M, Near, Placed, class_of, near, pairs, placed
from genie_sim.messages import Detection, Detections, Frame, Image, Location
from genie_sim.recording.tables import Table
from genie_sim.units import NS_PER_S

GOSPA_CUT_M = 5.0
CONSUMER, FLOOR = "consumer", "floor"
REMEMBERED_NS = 10 * NS_PER_S  # what was there so long ago counts as moved away

Judged = tuple[str, float, float, str]  # an object's label, place [m] and judgement
Places = dict[tuple[str, int, int], tuple[int, float, float]]


class Real(Protocol):
    """Something that is really there."""

    @property
    def label(self) -> str: ...

    @property
    def location(self) -> Location: ...

    @property
    def moving(self) -> bool: ...


class DriveTruth(Protocol):
    """What is really there on one car's drive. ``reach_m``: how far from it an object may be served; ``range_m``: how
    far away an object counts."""

    @property
    def reach_m(self) -> float: ...

    @property
    def range_m(self) -> float: ...

    def knows(self, label: str) -> bool:
        """Whether objects of a class would be known if they were there."""

    def visible(self, frame: Frame) -> Sequence[Real]:
        """What the frame's camera can see."""

    def is_there(self, frame: Frame, label: str, east_m: float, north_m: float) -> bool:
        """Whether anything of a class, visible or not, is within ``reach_m`` of a place when the frame is taken."""


@dataclass(eq=False)
class Held:
    """Judges one method's consumers; ``table`` gets the counts (``records.HELD``), ``objects``, if any, which objects
    they are (``records.HELD_OBJECTS``).

    ``truths``: what is there on the drive of each car; cars without are not judged. The floor, the detector's own
    answer without any delay, is the same under every method: that of the cars in ``floored`` is written already.
    """

    method: str
    truths: Mapping[str, DriveTruth]
    table: Table
    floored: Collection[str] = ()
    make_consumer: Callable[[], Consumer] = Newest
    objects: Table | None = None

    def __post_init__(self) -> None:
        self._open: dict[str, dict[Judged, int]] = {
            car: {} for car in self.truths
        }  # since when each is so
        self._consumers = {car: self.make_consumer() for car in self.truths}
        self._streams: dict[str, str] = {}  # of each car, the one whose frames are the instants
        self._since_ns: dict[str, dict[tuple[str, Location], int]] = {
            car: {} for car in self.truths
        }
        self._were: Places = {}  # what was visible, in order of time

    def answered(self, answer: Detections, now_ns: int) -> None:
        """An answer is in the consumer's hands."""
        stamp_ns, _, car = answer.header
        if car not in self.truths:
            return
        self._consumers[car].on_answer(answer, now_ns)
        since_ns = self._since_ns[car]
        for one in answer.objects:
            if one.location is not None:
                since_ns.setdefault((one.label, one.location), stamp_ns)

    def published(self, image: Image) -> None:
        """A camera took a frame; the car is judged if it is the camera that was the car's first."""
        now_ns, stream, car = image.header
        if car in self.truths:
            self._consumers[car].on_frame(image)
        if car not in self.truths or self._streams.setdefault(car, stream) != stream:
            return
        truth = self.truths[car]
        there = [
            one
            for one in truth.visible(image.content)
            if _in_view(image, one.location, truth.range_m)
        ]
        held = self._consumers[car].held(now_ns)
        self._write(CONSUMER, image, held, there)
        known = self._since_ns[car]
        kept = ((one.label, one.location) for one in held if one.location is not None)
        self._since_ns[car] = {key: known[key] for key in kept if key in known}
        if car not in self.floored:
            self._write(FLOOR, image, image.content.detections, there)
        self._remember(now_ns, there, truth.reach_m)

    def _write(
        self, what: str, image: Image, objects: Sequence[Detection], there: Sequence[Real]
    ) -> None:
        now_ns, _, car = image.header
        truth, since_ns = self.truths[car], self._since_ns[car]
        judged = [
            one
            for one in objects
            if one.location is not None
            and truth.knows(one.label)
            and _in_view(image, one.location, truth.range_m)
        ]
        mine = placed(judged)
        real = [(class_of(one.label), one.location[0], one.location[1]) for one in there]
        candidates = near(mine, real, max(truth.reach_m, GOSPA_CUT_M))
        found = pairs(candidates, truth.reach_m)
        right, seen = {i for _, i, _ in found}, [there[j].moving for _, _, j in found]
        near_real = {i for distance_m2, i, _ in candidates if distance_m2 <= truth.reach_m**2}
        causes = {
            i: "duplicate" if i in near_real else self._cause(image, one)
            for i, one in enumerate(mine)
            if i not in right
        }
        kept = [i for i in range(len(mine)) if causes.get(i) != "hidden"]
        cut_m2 = GOSPA_CUT_M * GOSPA_CUT_M
        compared = [
            one for one in candidates if one[0] <= cut_m2 and causes.get(one[1]) != "hidden"
        ]
        ghosts = list(causes.values())
        moving = sum(one.moving for one in there)
        ages_s = [
            self._age_s(now_ns, judged[i], since_ns) if what == CONSUMER else 0.0 for i in kept
        ]
        self.table.append((
            self.method, what, car, now_ns, len(kept), len(found),
            *(ghosts.count(cause) for cause in ("moved_away", "never_there", "duplicate", "hidden")),
            len(there) - moving, seen.count(False), moving, seen.count(True),
            gospa_m(compared, len(kept), len(real)),
            sum(ages_s) / len(ages_s) if ages_s else None,
            sum(math.sqrt(distance_m2) for distance_m2, _, _ in found) / len(found) if found else None,
        ))  # fmt: skip

        if what == CONSUMER and self.objects is not None:
            matched = {j for _, _, j in found}
            missed = [(one, "missed") for j, one in enumerate(there) if j not in matched]
            self._follow(
                car, now_ns, [*((judged[i], causes.get(i, "right")) for i in kept), *missed]
            )

    def _follow(
        self, car: str, now_ns: int, objects: Iterable[tuple[Detection | Real, str]]
    ) -> None:
        """Notes since when each object is so, and writes a row for each that is so no more."""
        before, now = self._open[car], {}
        for one, judgement in objects:
            if one.location is not None:
                key = one.label, one.location[0], one.location[1], judgement
                now[key] = before.pop(key, now_ns)
        self._open[car] = now
        self._end(car, before, now_ns)

    def _end(self, car: str, ended: Mapping[Judged, int], now_ns: int | None) -> None:
        assert self.objects is not None
        for key, begin_ns in ended.items():
            self.objects.append((self.method, car, *key, begin_ns, now_ns))

    def close(self) -> None:
        """Nothing more happens: what is held now is held until the end."""
        for car, objects in self._open.items():
            if objects:
                self._end(car, objects, None)
        self._open.clear()

    def _cause(self, image: Image, one: Placed) -> str:
        """Why an object is held where nothing visible is."""
        label, east_m, north_m = one
        reach_m = self.truths[image.header.origin].reach_m
        if self.truths[image.header.origin].is_there(image.content, label, east_m, north_m):
            return "hidden"
        x, y = math.floor(east_m / reach_m), math.floor(north_m / reach_m)
        for i in (x - 1, x, x + 1):
            for j in (y - 1, y, y + 1):
                was = self._were.get((label, i, j))
                if was is not None and _near(was[1], was[2], one, reach_m):
                    return "moved_away"
        return "never_there"

    def _remember(self, now_ns: int, there: Sequence[Real], cell_m: float) -> None:
        were = self._were
        for one in there:
            east_m, north_m, _ = one.location
            key = class_of(one.label), math.floor(east_m / cell_m), math.floor(north_m / cell_m)
            were.pop(key, None)
            were[key] = now_ns, east_m, north_m
        while were:
            oldest = next(iter(were))
            if were[oldest][0] >= now_ns - REMEMBERED_NS:
                break
            del were[oldest]

    @staticmethod
    def _age_s(now_ns: int, one: Detection, since_ns: Mapping[tuple[str, Location], int]) -> float:
        """Since the frame in which the object was seen: as a map that tracks says, else the first one whose answer had
        an object of this class at exactly this place."""
        motion = getattr(one, "motion", None)
        assert one.location is not None
        seen_ns: int = (
            motion.seen.stamp_ns
            if motion is not None
            else since_ns.get((one.label, one.location), now_ns)
        )
        return max(now_ns - seen_ns, 0) / NS_PER_S


def _near(east_m: float, north_m: float, one: Placed, reach_m: float) -> bool:
    return (east_m - one[1]) ** 2 + (north_m - one[2]) ** 2 <= reach_m * reach_m


def _in_view(image: Image, at: Location, range_m: float) -> bool:
    """In the frame's horizontal field of view, and near enough."""
    pose = image.pose
    east_m, north_m = at[0] - pose.east_m, at[1] - pose.north_m
    if east_m * east_m + north_m * north_m > range_m * range_m:
        return False
    bearing_rad = math.remainder(math.atan2(north_m, east_m) - pose.heading_rad, math.tau)
    return abs(bearing_rad) <= image.horizontal_fov_rad / 2


def agreement(answer: Detections, image: Image) -> tuple[int, int, int]:
    """How many objects an answer has, how many the detector finds in the frame itself, and how many pairs they make."""
    detections = image.content.detections
    detected = placed(detections)
    if answer.objects is detections or answer.objects == detections:
        return len(detected), len(detected), len(detected)
    served = placed(answer.objects)
    return len(served), len(detected), len(pairs(near(served, detected, SAME_M)))


def gospa_m(
    candidates: Sequence[Near], ours: int, theirs: int, cut_m: float = GOSPA_CUT_M
) -> float:
    """The GOSPA distance [m] of order 2 with alpha 2 between so many objects, of which ``near`` gave those within
    ``cut_m``: squared distances of the best pairs, and ``cut_m`` squared / 2 for each object without one.

    Source: A. S. Rahmathullah, A. F. Garcia-Fernandez, L. Svensson, "Generalized optimal sub-pattern assignment
    metric", FUSION 2017, Proposition 1.
    """
    cut_m2 = cut_m * cut_m
    rows, columns = ({one[side] for one in candidates} for side in (1, 2))
    if len(rows) == len(candidates) == len(columns):
        gained = sum(cut_m2 - distance_m2 for distance_m2, _, _ in candidates)
    else:
        gained = sum(_most_gained(group, cut_m2) for group in _connected(candidates))
    return math.sqrt(max(cut_m2 / 2 * (ours + theirs) - gained, 0.0))


def _connected(candidates: Sequence[Near]) -> Iterable[list[Near]]:
    """Groups of pairs that share objects with no other group."""
    parents: dict[int, int] = {}  # of ours i at i, of theirs j at ~j

    def root(end: int) -> int:
        while (above := parents.setdefault(end, end)) != end:
            end = above
        return end

    for _, i, j in candidates:
        parents[root(i)] = root(~j)
    groups: dict[int, list[Near]] = {}
    for one in candidates:
        groups.setdefault(root(one[1]), []).append(one)
    return groups.values()


def _most_gained(group: Sequence[Near], cut_m2: float) -> float:
    """The most that pairing the objects of a group takes off, each paired at most once."""
    rows, columns = ({one[side]: None for one in group} for side in (1, 2))
    if len(rows) == 1 or len(columns) == 1:
        return cut_m2 - min(distance_m2 for distance_m2, _, _ in group)
    if len(rows) > len(columns):
        rows, columns, group = columns, rows, [(one[0], one[2], one[1]) for one in group]
    row, column = (
        {index: place for place, index in enumerate(indices)} for indices in (rows, columns)
    )
    gains = [[0.0] * len(columns) for _ in rows]
    for distance_m2, i, j in group:
        gains[row[i]][column[j]] = cut_m2 - distance_m2
    return math.fsum(gains[i][j] for i, j in enumerate(_assigned(gains)))


def _assigned(gains: Sequence[Sequence[float]]) -> list[int]:
    """The column of each row, no two alike, whose gains sum to the most; there are at least as many columns as rows.

    Shortest augmenting paths, as in scipy's ``linear_sum_assignment``, which takes as long to import as a run takes.
    Source: R. Jonker, A. Volgenant, Computing 38, 1987. Place 0 of the lists is the row that is being assigned.
    """
    columns = range(1, len(gains[0]) + 1)
    of_row, of_column = (
        [0.0] * (len(gains) + 1),
        [0.0] * (len(columns) + 1),
    )  # prices: none pays less than it costs
    owner = [0] * (len(columns) + 1)
    for row in range(1, len(gains) + 1):
        owner[0], here = row, 0
        least, came_from, done = [math.inf] * (len(columns) + 1), [0] * (len(columns) + 1), {0}
        while owner[here]:
            i = owner[here]
            for j in columns:
                cost = -gains[i - 1][j - 1] - of_row[i] - of_column[j]
                if j not in done and cost < least[j]:
                    least[j], came_from[j] = cost, here
            here = min((j for j in columns if j not in done), key=least.__getitem__)
            step = least[here]
            for j in (0, *columns):
                if j in done:
                    of_row[owner[j]] += step
                    of_column[j] -= step
                else:
                    least[j] -= step
            done.add(here)
        while here:
            owner[here] = owner[came_from[here]]
            here = came_from[here]
    found = {owner[j]: j - 1 for j in columns if owner[j]}
    return [found[row] for row in range(1, len(gains) + 1)]
