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
- a *camera* is a code of a car and a stream, a *turn* the number of an instant among its camera's;
- *label* and *class_* are codes of names, which share one numbering (``LabelCodes``); *car* is the
  number of a car, *place* a code of a class and a place (``RecentPlaces``).

What an array has a value for says its type, ``PerScene`` and so on; an array of indices is named
after both, as ``scene_of_instant``. A window in which the detector is judged for car1 alone, since
car2 drove under an earlier method::

    scene               0           1           2           3           4
    car                 car1        car1        car2        car1        car1
    objects             consumer's  detector's  consumer's  consumer's  detector's
    instant_of_scene    0           0           1           2           2
    camera_of_scene     0           0           1           0           0
    turn_of_scene       0           unused      0           1           unused

    scene_of_instant    0, 2, 3
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
    turns,
)
from genie_sim.judge.objects import LabelCodes
from genie_sim.judge.recent_places import RecentPlaces
from genie_sim.judge.scenes import DriveTruth, JudgedScene, SceneViews, Visible
from genie_sim.record.columns import Codes, Columns, Text
from genie_sim.record.records import CONSUMER, JUDGED, ZERO_DELAY
from genie_sim.record.tables import Table
from genie_sim.tracks.consumer import Consumer, Newest, Shown

PerScene = Array  # a value for each scene of the window
PerItem = Array  # for each object that is held in view, whatever its scene
PerVisible = Array  # for each object that is there and in view, whatever its scene
PerPair = Array  # for each pair of an item and a visible object

WINDOW, WINDOW_OF_CAR = 1024, 8  # scenes that are judged at once: the larger number of both

JUDGEMENTS = (*JUDGED, "hidden")  # what is hidden has no row
RIGHT, MISSED, MOVED_AWAY, NEVER_THERE, DUPLICATE, HIDDEN = range(len(JUDGEMENTS))


class _Judged(NamedTuple):
    """The objects that are held in view, and how each is judged, an index of ``JUDGEMENTS``; then
    the pairs with visible objects, scene by scene and nearest first, and which of these match.
    """

    items: Held
    judgement: PerItem
    pairs: Pairs
    is_match: PerPair


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
        # of each car the number of its truth; cars on one drive have one
        self._truth_of = {
            car: next(place for place, other in enumerate(truths.values()) if other is truth)
            for car, truth in truths.items()
        }
        self._labels = LabelCodes()
        self._cars: Codes = Codes()
        self._cars.update((car, number) for number, car in enumerate(truths))
        self._recent_places = RecentPlaces()
        self._spans: HeldSpans | None = None
        if held_objects is not None:
            self._spans = HeldSpans(
                method,
                held_objects,
                cars=self._cars,
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
        """A camera took a frame. It is an instant at which its car is judged if the truth has
        labels of this camera, and if the camera is the car's first, or all count.
        """
        now_ns, stream, car = image.header
        truth = self._truths.get(car)
        if truth is None:
            return
        consumer = self._consumers[car]
        consumer.on_frame(image)
        labelled = getattr(truth, "cameras", None)
        if labelled is not None and getattr(image.content, "camera", None) not in labelled:
            return
        if self._first_streams.setdefault(car, stream) != stream and not self._all_streams:
            return
        self._scenes.append(JudgedScene(image, truth, consumer.shown(now_ns), is_consumer=True))
        if car not in self._earlier_cars:
            detections = (Shown(image.content.detections),)
            self._scenes.append(JudgedScene(image, truth, detections, is_consumer=False))
        if len(self._scenes) >= self._window:
            self._judge()

    def close(self) -> None:
        """Nothing more happens: what is held now is held until the end."""
        if self._scenes:
            self._judge()
        if self._spans is not None:
            self._spans.close()

    def _judge(self) -> None:
        """Writes the rows of the window."""
        views = SceneViews.of(self._scenes, self._cars)
        visible = Visible.of(self._scenes, self._labels, self._recent_places.codes)
        visible = visible.rows(views.see(visible.scene, visible.east_m, visible.north_m))
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
        is_judged: PerItem = views.see(items.scene, items.east_m, items.north_m)
        is_judged &= self._knows(views.car[items.scene], items.label)
        items = items.rows(is_judged)
        pairs = self._pairs(items, visible, views.tolerance_m)
        is_match: PerPair = np.zeros(len(pairs.ours), dtype=bool)
        is_match[matches(pairs)] = True

        judgement: PerItem = np.full(len(items.scene), NEVER_THERE)
        judgement[pairs.ours] = DUPLICATE
        judgement[pairs.ours[is_match]] = RIGHT
        others = np.flatnonzero(judgement == NEVER_THERE)
        judgement[others[self._are_there(items.rows(others))]] = HIDDEN
        others = np.flatnonzero(judgement == NEVER_THERE)
        judgement[others[self._were_there(views, visible, items.rows(others))]] = MOVED_AWAY
        return _Judged(items=items, judgement=judgement, pairs=pairs, is_match=is_match)

    def _pairs(self, items: Held, visible: Visible, tolerance_m: PerScene) -> Pairs:
        """The pairs of a held and a visible object of one scene and class, within the tolerance of
        the scene, scene by scene, nearest first.
        """
        classes = len(self._labels.codes)
        held_group = pair_codes(items.scene, items.class_, classes)
        visible_group = pair_codes(visible.scene, visible.class_, classes)
        pairs = near(
            GroupedPlaces(held_group, items.east_m, items.north_m),
            GroupedPlaces(visible_group, visible.east_m, visible.north_m),
            float(tolerance_m.max()),
        )
        scene_of_pair: PerPair = items.scene[pairs.ours]
        order = np.lexsort((pairs.theirs, pairs.ours, pairs.distance_m2, scene_of_pair))
        is_within = pairs.distance_m2 <= (tolerance_m * tolerance_m)[scene_of_pair]
        return pairs.rows(order[is_within[order]])

    def _knows(self, car: PerItem, label: PerItem) -> PerItem:
        """Which labels the truth of the car knows, given their codes and the cars'."""
        truths, labels = list(self._truths.values()), list(self._labels.codes)
        is_known = np.zeros((len(truths), len(labels)), dtype=bool)
        is_known[car, label] = True  # asked about
        for of_car, of_label in np.argwhere(is_known).tolist():
            is_known[of_car, of_label] = truths[of_car].knows(labels[of_label])
        result: PerItem = is_known[car, label]
        return result

    def _are_there(self, items: Held) -> PerItem:
        """Whether anything of its class, visible or not, is where each is held."""
        result = np.zeros(len(items.scene), dtype=bool)
        labels = list(self._labels.codes)
        truth_of_scene = [self._truth_of[scene.image.header.origin] for scene in self._scenes]
        truth_of_item: PerItem = np.array(truth_of_scene)[items.scene]
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

    def _were_there(self, views: SceneViews, visible: Visible, items: Held) -> PerItem:
        """Whether anything of its class was visible lately, before the scene, where each is."""
        # What the consumer holds and what is found without delay are judged at one instant.
        instant_of_scene: PerScene = np.cumsum(views.is_consumer) - 1
        seen = visible.rows(views.is_consumer[visible.scene])
        return self._recent_places.were_there(
            GroupedPlaces(items.class_, items.east_m, items.north_m),
            tolerance_m=views.tolerance_m[items.scene],
            instant=instant_of_scene[items.scene],
            visible=np.stack([seen.place, instant_of_scene[seen.scene]]),
            now_ns=views.now_ns[views.is_consumer],
        )

    def _count(self, views: SceneViews, visible: Visible, judged: _Judged) -> None:
        """Writes the rows of ``held``."""
        items, judgement, pairs = judged.items, judged.judgement, judged.pairs
        scenes = len(views.now_ns)

        by_judgement = [
            _per_scene(items.scene, judgement == code, scenes) for code in range(len(JUDGEMENTS))
        ]
        scene_of_pair: PerPair = items.scene[pairs.ours]
        moving: PerVisible = visible.moving == 1
        found: PerVisible = np.zeros(len(moving), dtype=bool)
        found[pairs.theirs[judged.is_match]] = True
        errors_m = np.sqrt(pairs.distance_m2[judged.is_match])
        right = by_judgement[RIGHT]
        with np.errstate(invalid="ignore"):
            error_m = (
                np.bincount(scene_of_pair[judged.is_match], weights=errors_m, minlength=scenes)
                / right
            )
        columns = {
            "method": Text.of(np.zeros(scenes, dtype=np.int64), [self._method]),
            "what": Text.of(np.where(views.is_consumer, 0, 1), [CONSUMER, ZERO_DELAY]),
            "car": Text.of(views.car, list(self._cars)),
            "stamp_ns": views.now_ns,
            # what is there and cannot be seen is neither right nor wrong
            "held": _per_scene(items.scene, judgement != HIDDEN, scenes),
            "right": right,
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
        items, codes = judged.items, spans.cameras
        is_held: PerItem = views.is_consumer[items.scene] & (judged.judgement != HIDDEN)
        is_missed: PerVisible = views.is_consumer[visible.scene]
        is_missed[judged.pairs.theirs[judged.is_match]] = False
        missed = visible.rows(is_missed)
        scene_of_object = np.concatenate([items.scene[is_held], missed.scene])
        camera_of_scene: PerScene = np.array(
            [
                codes[self._cars[scene.image.header.origin], scene.image.header.frame_id]
                for scene in self._scenes
            ]
        )
        scene_of_instant = np.flatnonzero(views.is_consumer)
        turn_of_scene: PerScene = np.zeros(len(camera_of_scene), dtype=np.int64)
        turn_of_scene[scene_of_instant] = turns(camera_of_scene[scene_of_instant])
        objects = JudgedObjects(
            camera=camera_of_scene[scene_of_object],
            turn=turn_of_scene[scene_of_object],
            order=np.arange(len(scene_of_object)),
            label=np.concatenate([items.label[is_held], missed.label]),
            east_m=np.concatenate([items.east_m[is_held], missed.east_m]),
            north_m=np.concatenate([items.north_m[is_held], missed.north_m]),
            judgement=np.append(judged.judgement[is_held], np.full(len(missed.scene), MISSED)),
        )
        spans.add(
            objects,
            camera_of=camera_of_scene[scene_of_instant],
            turn_of=turn_of_scene[scene_of_instant],
            now_ns=views.now_ns[scene_of_instant],
        )


def _per_scene(scene: Array, selection: Array, scenes: int) -> PerScene:
    """How many items, or visible objects, are selected in each scene."""
    return np.bincount(scene[selection], minlength=scenes)
