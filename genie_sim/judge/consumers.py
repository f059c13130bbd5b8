"""Judges the objects that consumers hold by what is really there.

Each car is judged when its first camera, or any of them, takes a frame. What its consumer holds is
compared with the truth of that very instant, not with that of the frames that its answers are
about: a late answer counts as a wrong one (streaming accuracy; M. Li, Y. Wang, D. Ramanan, "Towards
Streaming Perception", ECCV 2020).

During the run scenes and answers are only noted; a window of them is judged at once. Its arrays
hold indices and codes:

- a *scene* is a row of ``SceneViews``: one car, one frame, one list of objects, those of the
  consumer or those of the zero-delay detector. An *instant* has one scene of a consumer, and one of
  the detector unless an earlier method had it;
- *camera* is a code of a car and a stream, *truth* the number of a truth, which cars on one drive
  share; *label* and *class_* are codes of names, which share one numbering (``LabelCodes``);
  *place_code* is one of a class and a place (``RecentPlaces``).

An *item* is an object that is held in view, and a *pair* is of an item and a visible object. An
array has a value for each scene, item, visible object or pair of the window; an array of indices is
named after both, as ``scene_of_pair``. A window in which the detector is judged for car1 alone,
since car2 drove under an earlier method::

    scene               0           1           2           3           4
    car                 car1        car1        car2        car1        car1
    objects             consumer's  detector's  consumer's  consumer's  detector's
    instant             0           0           1           2           2
    camera              0           0           1           0           0
"""

from collections.abc import Callable, Collection, Mapping
from typing import NamedTuple

import numpy as np

from genie_sim.core.messages import Detections, Image
from genie_sim.judge.held import Held, shown_objects
from genie_sim.judge.held_spans import HeldSpans, JudgedObjects
from genie_sim.judge.joins import (
    Array,
    GroupedPlaces,
    Pairs,
    matches,
    near,
    pair_codes,
    rows_of,
)
from genie_sim.judge.objects import LabelCodes
from genie_sim.judge.recent_places import RecentPlaces
from genie_sim.judge.scenes import DriveTruth, JudgedScene, SceneViews, Visible
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.records import CONSUMER, JUDGED, ZERO_DELAY
from genie_sim.record.tables import Table
from genie_sim.tracks.consumer import Consumer, Newest, Shown

WINDOW, WINDOW_OF_CAR = 1024, 8  # scenes that are judged at once: the larger number of both

JUDGEMENTS = (*JUDGED, "hidden")  # what is hidden has no row
RIGHT, MISSED, MOVED_AWAY, NEVER_THERE, DUPLICATE, HIDDEN = range(len(JUDGEMENTS))


class _Judged(NamedTuple):
    """The objects that are held in view, how each is judged, an index of ``JUDGEMENTS``, and the
    pairs of those held right and what is visible there, nearest first.
    """

    items: Held
    judgement: Array
    matches: Pairs


class ConsumerJudge:
    """Judges what the consumers of one method hold.

    Parameters
    ----------
    method : str
        The name under which rows are written.
    truths : mapping of str to DriveTruth
        What is there on the drive of each car. Cars without are not judged.
    table : Table
        Gets a row of counts per instant (``records.HELD``).
    earlier_cars : collection of str
        Cars for which the detector's own answer without any delay is judged already. It is the
        same under every method.
    make_consumer : callable
        Makes the consumer of one car.
    held_objects : Table, optional
        Gets a row per object that is held or missed (``records.HELD_OBJECTS``).
    all_streams : bool
        Whether the frames of every stream of a car are instants at which it is judged, within their
        fields of view, not only those of the first.
    window : int, optional
        How many scenes are judged at once; does not change results. By default as many as pay: some
        of each car.
    """

    def __init__(
        self,
        method: str,
        truths: Mapping[str, DriveTruth],
        table: Table,
        earlier_cars: Collection[str] = (),
        make_consumer: Callable[[], Consumer] = Newest,
        *,
        held_objects: Table | None = None,
        all_streams: bool = False,
        window: int | None = None,
    ) -> None:
        self._method = method
        self._truths = truths
        self._table = table
        self._earlier_cars = earlier_cars
        self._all_streams = all_streams
        self._window = window or max(WINDOW, WINDOW_OF_CAR * len(truths))
        self._consumers = {car: make_consumer() for car in truths}
        self._first_streams: dict[str, str] = {}  # of each car, the one whose frames are instants
        # of each car the number of its truth: that of the first car that has the same
        self._truth_numbers = {
            car: next(number for number, other in enumerate(truths.values()) if other is truth)
            for car, truth in truths.items()
        }
        self._labels = LabelCodes()
        self._cameras: Codes = Codes()  # of a car and a stream
        self._recent_places = RecentPlaces()
        self._spans: HeldSpans | None = None
        if held_objects is not None:
            self._spans = HeldSpans(
                method,
                held_objects,
                cameras=self._cameras,
                labels=self._labels.codes,
                judgements=JUDGEMENTS,
            )
        # of this window
        self._scenes: list[JudgedScene] = []

    def answered(self, answer: Detections, now_ns: int) -> None:
        """An answer is in the consumer's hands."""
        consumer = self._consumers.get(answer.header.origin)
        if consumer is not None:
            consumer.on_answer(answer, now_ns)

    def published(self, image: Image) -> None:
        """A camera took a frame: the consumer knows, and its car is judged if the frame counts."""
        now_ns, _, car = image.header
        truth = self._truths.get(car)
        if truth is None:
            return
        consumer = self._consumers[car]
        consumer.on_frame(image)
        if not self._is_judged(image, truth):
            return
        self._scenes.append(JudgedScene(image, truth, consumer.shown(now_ns), is_consumer=True))
        if car not in self._earlier_cars:
            detections = (Shown(image.content.detections),)
            self._scenes.append(JudgedScene(image, truth, detections, is_consumer=False))
        if len(self._scenes) >= self._window:
            self._judge()

    def _is_judged(self, image: Image, truth: DriveTruth) -> bool:
        """Whether its car is judged when this frame is taken."""
        if truth.cameras is not None and image.content.camera not in truth.cameras:
            return False  # nobody knows what is in view
        _, stream, car = image.header
        is_first = self._first_streams.setdefault(car, stream) == stream
        return is_first or self._all_streams

    def close(self) -> None:
        """Nothing more happens: what is held now is held until the end."""
        if self._scenes:
            self._judge()
        if self._spans is not None:
            self._spans.close()

    def _judge(self) -> None:
        """Writes the rows of the window."""
        views = SceneViews.of(self._scenes, self._cameras, self._truth_numbers)
        visible = Visible.of(self._scenes, self._labels, self._recent_places.codes)
        visible = rows_of(visible, views.see(visible.scene, visible.east_m, visible.north_m))
        judged = self._compare(views, visible)
        self._count(views, visible, judged)
        if self._spans is not None:
            self._follow(self._spans, views, visible, judged)
        self._scenes = []

    def _compare(self, views: SceneViews, visible: Visible) -> _Judged:
        """Judges each object in view, of a class that the truth knows.

        What is held right has a match; what is near a visible object without one is held twice;
        what remains is there, but hidden, or was there lately, or never was.
        """
        shown = (scene.shown for scene in self._scenes)
        items = shown_objects(zip(views.now_ns.tolist(), shown, strict=True), self._labels)
        is_judged = views.see(items.scene, items.east_m, items.north_m)
        is_judged &= self._knows(views.truth[items.scene], items.label)
        items = rows_of(items, is_judged)
        pairs = self._pairs(items, visible, views.tolerance_m)
        right = matches(pairs)

        judgement = np.full(len(items.scene), NEVER_THERE)
        judgement[pairs.ours] = DUPLICATE
        judgement[right.ours] = RIGHT
        others = np.flatnonzero(judgement == NEVER_THERE)
        judgement[others[self._are_there(views, rows_of(items, others))]] = HIDDEN
        others = np.flatnonzero(judgement == NEVER_THERE)
        judgement[others[self._were_there(views, visible, rows_of(items, others))]] = MOVED_AWAY
        return _Judged(items, judgement, right)

    def _pairs(self, items: Held, visible: Visible, tolerance_m: Array) -> Pairs:
        """The pairs of a held and a visible object of one scene and class, within the tolerance of
        the scene.
        """
        classes = len(self._labels.codes)
        held_group = pair_codes(items.scene, items.class_, classes)
        visible_group = pair_codes(visible.scene, visible.class_, classes)
        pairs = near(
            GroupedPlaces(held_group, items.east_m, items.north_m),
            GroupedPlaces(visible_group, visible.east_m, visible.north_m),
            float(tolerance_m.max()),
        )
        scene_of_pair = items.scene[pairs.ours]
        return rows_of(pairs, pairs.distance_m2 <= (tolerance_m * tolerance_m)[scene_of_pair])

    def _knows(self, truth: Array, label: Array) -> Array:
        """Whether the truth of each, by its number, knows the label, given its code."""
        truths, labels = list(self._truths.values()), list(self._labels.codes)
        is_known = np.zeros((len(truths), len(labels)), dtype=bool)
        is_known[truth, label] = True  # asked about
        for of_truth, of_label in np.argwhere(is_known).tolist():
            is_known[of_truth, of_label] = truths[of_truth].knows(labels[of_label])
        return is_known[truth, label]

    def _are_there(self, views: SceneViews, items: Held) -> Array:
        """Whether anything of its class, visible or not, is where each is held."""
        result = np.zeros(len(items.scene), dtype=bool)
        labels = list(self._labels.codes)
        truth_of_item = views.truth[items.scene]
        for number in np.unique(truth_of_item).tolist():
            rows = np.flatnonzero(truth_of_item == number)
            scenes = [self._scenes[scene] for scene in items.scene[rows].tolist()]
            result[rows] = scenes[0].truth.are_there(
                [scene.image.content for scene in scenes],
                [labels[class_] for class_ in items.class_[rows].tolist()],
                items.east_m[rows],
                items.north_m[rows],
            )
        return result

    def _were_there(self, views: SceneViews, visible: Visible, items: Held) -> Array:
        """Whether anything of its class was visible lately, before the scene, where each is."""
        instant = views.instant
        seen = rows_of(visible, views.is_consumer[visible.scene])
        return self._recent_places.were_there(
            GroupedPlaces(items.class_, items.east_m, items.north_m),
            tolerance_m=views.tolerance_m[items.scene],
            instant=instant[items.scene],
            visible=np.stack([seen.place_code, instant[seen.scene]]),
            now_ns=views.now_ns[views.is_consumer],
        )

    def _count(self, views: SceneViews, visible: Visible, judged: _Judged) -> None:
        """Writes the rows of ``held``."""
        items, judgement, right = judged
        scenes = len(views.now_ns)

        by_judgement = [
            _per_scene(items.scene, judgement == code, scenes) for code in range(len(JUDGEMENTS))
        ]
        moving = visible.moving
        found = np.zeros(len(moving), dtype=bool)
        found[right.theirs] = True
        scene_of_pair = items.scene[right.ours]
        errors_m = np.bincount(scene_of_pair, np.sqrt(right.distance_m2), minlength=scenes)
        with np.errstate(invalid="ignore"):
            error_m = errors_m / by_judgement[RIGHT]
        columns = {
            "method": Text.of(np.zeros(scenes, dtype=np.int64), [self._method]),
            "what": Text.of(np.where(views.is_consumer, 0, 1), [CONSUMER, ZERO_DELAY]),
            "car": Text.of(views.camera, [car for car, _ in self._cameras]),
            "stream": Text.of(views.camera, [stream for _, stream in self._cameras]),
            "stamp_ns": views.now_ns,
            # what is there and cannot be seen is neither right nor wrong
            "held": _per_scene(items.scene, judgement != HIDDEN, scenes),
            "right": by_judgement[RIGHT],
            "moved_away": by_judgement[MOVED_AWAY],
            "never_there": by_judgement[NEVER_THERE],
            "duplicate": by_judgement[DUPLICATE],
            "hidden": by_judgement[HIDDEN],
            "visible_static": _per_scene(visible.scene, ~moving, scenes),
            "found_static": _per_scene(visible.scene, found & ~moving, scenes),
            "visible_moving": _per_scene(visible.scene, moving, scenes),
            "found_moving": _per_scene(visible.scene, found & moving, scenes),
            "error_m": error_m,
        }
        self._table.extend_columns(Columns(columns))

    def _follow(
        self, spans: HeldSpans, views: SceneViews, visible: Visible, judged: _Judged
    ) -> None:
        """Notes since when each object is judged as it is."""
        items = judged.items
        is_held = views.is_consumer[items.scene] & (judged.judgement != HIDDEN)
        is_missed = views.is_consumer[visible.scene]
        is_missed[judged.matches.theirs] = False
        held, missed = rows_of(items, is_held), rows_of(visible, is_missed)
        scene = np.append(held.scene, missed.scene)
        objects = JudgedObjects(
            instant=views.instant[scene],
            camera=views.camera[scene],
            begin_ns=views.now_ns[scene],
            label=np.append(held.label, missed.label),
            judgement=np.append(judged.judgement[is_held], np.full(len(missed.scene), MISSED)),
            east_m=np.append(held.east_m, missed.east_m),
            north_m=np.append(held.north_m, missed.north_m),
        )
        is_instant = views.is_consumer
        spans.add(objects, camera=views.camera[is_instant], now_ns=views.now_ns[is_instant])


def _per_scene(scene: Array, selection: Array, scenes: int) -> Array:
    """How many items, or visible objects, are selected in each scene."""
    return np.bincount(scene[selection], minlength=scenes)
