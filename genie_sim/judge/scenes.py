"""What cars are judged by, many instants at once: who looks from where, and what is there."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from genie_sim.core.messages import Frame, Image, Location
from genie_sim.judge.joins import Array
from genie_sim.judge.objects import LabelCodes
from genie_sim.record.columns import Codes
from genie_sim.tracks.consumer import Shown

BORDER_RAD = 1e-12  # what stands on the border of a picture is in view, however that is rounded


class RealObject(Protocol):
    """Something that is really there."""

    @property
    def label(self) -> str: ...

    @property
    def location(self) -> Location: ...

    @property
    def moving(self) -> bool: ...


class DriveTruth(Protocol):
    """What is really there on one car's drive.

    ``visible`` and ``are_there`` are called when a window of instants is full, not at each: a truth
    keeps what it needs of earlier times. Labels are those of detections; what has the same class
    (``base.classes.class_of``) is the same.
    """

    @property
    def cameras(self) -> Collection[str] | None:
        """The cameras (``Frame.camera``) whose frames are judged, since it knows what is in their
        view; those of others are not. ``None``: all are.
        """

    @property
    def tolerance_m(self) -> float:
        """How far from an object one that is held may be and still be right."""

    @property
    def range_m(self) -> float:
        """How far from the camera an object counts."""

    def knows(self, label: str) -> bool:
        """Whether it knows of all objects of this label's class; others are not judged."""

    def visible(self, frame: Frame) -> Sequence[RealObject]:
        """What a consumer is expected to hold when this frame is taken: what its camera can see, in
        its field of view or not.
        """

    def are_there(
        self, frames: Sequence[Frame], labels: Sequence[str], east_m: Array, north_m: Array
    ) -> Array:
        """Whether anything of a label's class, visible or not, is within ``tolerance_m`` of a place
        when its frame is taken, for each of (n,) frames, labels and places [m]. It is asked about
        what is held where nothing of its class is visible.
        """


class JudgedScene(NamedTuple):
    """What is judged at an instant: the camera's frame, what is there, and the objects that answers
    show to a consumer, or else those that the detector finds without any delay.
    """

    image: Image
    truth: DriveTruth
    shown: Sequence[Shown]
    is_consumer: bool


class Visible(NamedTuple):
    """Columns (n,), a row per object that can be seen, scene by scene: the index of the scene,
    codes of the label, of the class and of class and place, whether it moves, and where it is [m].
    """

    scene: Array
    label: Array
    class_: Array
    place_code: Array
    moving: Array
    east_m: Array
    north_m: Array

    @classmethod
    def of(cls, scenes: Sequence[JudgedScene], labels: LabelCodes, places: Codes) -> "Visible":
        """All that can be seen in some scenes, in the field of view or not; ``places`` are the
        codes of class and place (``RecentPlaces``).
        """
        rows: list[tuple[Any, ...]] = []
        image: Image | None = None
        things: list[tuple[Any, ...]] = []
        for number, scene in enumerate(scenes):
            if scene.image is not image:  # it is the same where two are judged at an instant
                image, things = scene.image, []
                for thing in scene.truth.visible(image.content):
                    label, class_ = labels[thing.label]
                    east_m, north_m, _ = thing.location
                    place_code = places[class_, east_m, north_m]
                    things.append((label, class_, place_code, thing.moving, east_m, north_m))
            rows += [(number, *thing) for thing in things]
        columns = list(zip(*rows, strict=True)) or [()] * len(cls._fields)
        kinds = [np.int64] * 4 + [np.bool_] + [np.float64] * 2
        return cls(*(np.array(of, dtype=kind) for of, kind in zip(columns, kinds, strict=True)))


class SceneViews(NamedTuple):
    """Columns (scenes,): the time [ns], the code of the camera, a car and a stream, the number of
    the truth, whether it is about a consumer, the camera's place [m], heading and half of its field
    of view [rad], and the tolerance and range [m] of the truth.
    """

    now_ns: Array
    camera: Array
    truth: Array
    is_consumer: Array
    east_m: Array
    north_m: Array
    heading_rad: Array
    half_fov_rad: Array
    tolerance_m: Array
    range_m: Array

    @classmethod
    def of(
        cls, scenes: Sequence[JudgedScene], cameras: Codes, truths: Mapping[str, int]
    ) -> "SceneViews":
        """Those of some scenes, with the codes of cameras, and the number of each car's truth."""
        rows = []
        for image, truth, _, _ in scenes:
            pose, half_fov_rad = image.pose, image.horizontal_fov_rad / 2
            view = pose.east_m, pose.north_m, pose.heading_rad, half_fov_rad
            rows.append((*view, truth.tolerance_m, truth.range_m))
        headers = [scene.image.header for scene in scenes]
        return cls(
            np.array([header.stamp_ns for header in headers]),
            np.array([cameras[header.origin, header.frame_id] for header in headers]),
            np.array([truths[header.origin] for header in headers]),
            np.array([scene.is_consumer for scene in scenes]),
            *np.array(rows, dtype=np.float64).T,
        )

    @property
    def instant(self) -> Array:
        """The number of each scene's instant: the consumer's scene comes first, and that of the
        zero-delay detector, if any, after it.
        """
        instants: Array = np.cumsum(self.is_consumer) - 1
        return instants

    def see(self, scene: Array, east_m: Array, north_m: Array) -> Array:
        """Which places [m] (n,) are in the field of view of their scene, of which ``scene`` (n,)
        has the index, and near enough.
        """
        away_east_m, away_north_m = east_m - self.east_m[scene], north_m - self.north_m[scene]
        distance_m2 = away_east_m * away_east_m + away_north_m * away_north_m
        in_view = in_field_of_view(
            away_east_m, away_north_m, self.heading_rad[scene], self.half_fov_rad[scene]
        )
        in_view &= distance_m2 <= self.range_m[scene] * self.range_m[scene]
        return in_view


def in_field_of_view(
    away_east_m: Array, away_north_m: Array, heading_rad: Array, half_fov_rad: Array
) -> Array:
    """Which of (n,) places, so far away from their cameras, are in the horizontal field of view;
    no camera with a NaN sees any.
    """
    turn_rad = np.arctan2(away_north_m, away_east_m) - heading_rad
    turn_rad -= math.tau * np.rint(turn_rad / math.tau)
    in_view: Array = np.abs(turn_rad) <= half_fov_rad + BORDER_RAD
    return in_view
