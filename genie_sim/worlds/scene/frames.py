"""The frames of a car's cameras in a scene of objects, such as a town: poses, and what a detector
finds of what is in view.
"""

import functools
import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

import numpy as np

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.frame_source import Drive
from genie_sim.data.trace import ANGLE_DECIMALS, IMAGE_HEADER_BYTES, POSITION_DECIMALS, rounded
from genie_sim.worlds.scene.detector import DetectedObjects
from genie_sim.worlds.scene.keys import frame_key, named_key
from genie_sim.worlds.scene.objects import HEIGHT, HORIZONTAL_FOV_RAD, WIDTH, SceneObject
from genie_sim.worlds.scene.scene import Scene
from genie_sim.worlds.scene.surrogate import surrogates
from genie_sim.worlds.scene.view import ViewPoses, VisibleObjects

CAMERA_UP_M = 1.65  # of KITTI's cameras: cvlibs.net/datasets/kitti/setup.php
# Of a camera, whose views are computed at once: a frame costs half as much as in batches of 16.
BATCH_FRAMES = 64
# to the left of the car's middle; KITTI's colour cameras are 0.54 m apart (setup.php)
BASELINES_M = {"02": 0.27, "03": -0.27}


class Motions(NamedTuple):
    """Where cars are at some times, as columns (n,): east and north [m], the heading [rad] with
    cosine and sine, and the speed [m/s].
    """

    east_m: Array
    north_m: Array
    heading_rad: Array
    cos: Array
    sin: Array
    speed_mps: Array


class Course(Protocol):
    """Where a car is at any time of its drive."""

    def at(self, t_s: Array) -> Motions:
        """At some times (n,) of the scene's clock."""


class SceneDrive(Drive):
    """What the cameras of one car see in a scene, from ``start_ns`` of the scene's clock on. It has
    the frames of a ``Trace``, made when they are looked at.

    Parameters
    ----------
    scene : what there is to see
    car : the name of the car, which has random numbers of its own
    course : gives the car's course when it is first asked for
    duration_ns : how long the drive takes
    interval_ns : between two frames of a camera
    start_ns : when it begins, by the scene's clock
    """

    def __init__(
        self,
        scene: Scene,
        car: str,
        course: Callable[[], Course],
        *,
        duration_ns: int,
        interval_ns: int,
        start_ns: int,
    ) -> None:
        if interval_ns <= 0 or duration_ns <= 0 or start_ns < 0:
            raise UserError(
                f"{scene.name}: drive of {car}: duration {duration_ns} ns and interval "
                f"{interval_ns} ns must be positive, start {start_ns} ns not negative"
            )
        self.scene = scene
        self.duration_ns, self.interval_ns, self.start_ns = duration_ns, interval_ns, start_ns
        self.name = f"{scene.name}_{car}"
        named = f"{scene.digest} {car}"
        self.picture_prefix = hashlib.sha256(named.encode()).hexdigest()[:48]
        self.key = named_key(scene.random_name, scene.seed, car)
        self._make_course = course
        count = math.ceil(duration_ns / interval_ns)
        self.frames: Mapping[str, Sequence[SceneFrame]] = {
            camera: CameraFrames(self, camera, count) for camera in BASELINES_M
        }

    @functools.cached_property
    def course(self) -> Course:
        """Where the car is, at any time of the drive."""
        return self._make_course()

    def position(self, t_ns: int) -> tuple[float, float]:
        motions = self.course.at(np.array([(self.start_ns + t_ns) * 1e-9]))
        return motions.east_m.item(0), motions.north_m.item(0)


class FrameBatch:
    """Some frames of one camera, some seconds at most: their poses, and what is in view and
    detected, computed for all of them when it is first asked for.

    ``indices`` (slots,) are those of the frames on the drive; ``indices[slot]`` is the frame that
    has a slot here.
    """

    def __init__(self, drive: SceneDrive, camera: str, indices: Sequence[int]) -> None:
        self.drive, self.camera = drive, camera
        scene_ns = [drive.start_ns + index * drive.interval_ns for index in indices]
        t_s = np.array(scene_ns) * 1e-9
        motions = drive.course.at(t_s)
        left_m = BASELINES_M[camera]
        keys = [frame_key(drive.key, camera, at_ns) for at_ns in scene_ns]
        # As columns: of every car of a fleet some batch is in memory at any time.
        self._poses = ViewPoses(
            east_m=np.array(rounded(motions.east_m - left_m * motions.sin, POSITION_DECIMALS)),
            north_m=np.array(rounded(motions.north_m + left_m * motions.cos, POSITION_DECIMALS)),
            cos=motions.cos,
            sin=motions.sin,
            t_s=t_s,
            key=np.array(keys, dtype=np.uint64),
        )
        headings_rad = [math.remainder(rad, math.tau) for rad in motions.heading_rad.tolist()]
        self._headings_rad = np.array(rounded(headings_rad, ANGLE_DECIMALS))

    def key(self, slot: int) -> int:
        """Bits of one of the frames alone."""
        return self._poses.key.item(slot)

    def camera_pose(self, slot: int) -> CameraPose:
        """Where the camera is in one of the frames."""
        east_m, north_m = self._poses.east_m.item(slot), self._poses.north_m.item(slot)
        return CameraPose(east_m, north_m, CAMERA_UP_M, self._headings_rad.item(slot))

    @functools.cached_property
    def _visible(self) -> VisibleObjects:
        return self.drive.scene.visibility.visible(self._poses)

    @functools.cached_property
    def _detected(self) -> DetectedObjects:
        return self.drive.scene.detector.detect(self._visible, self._poses)

    def detections(self, slot: int) -> tuple[Detection, ...]:
        """What the detector finds in one of the frames, best score first."""
        fleeting = self.drive.scene.detector.fleeting(self._poses, slot)
        detections = self._detected.detections(slot) + fleeting
        return tuple(sorted(detections, key=attrgetter("score"), reverse=True))

    def truth(self, slot: int) -> tuple[SceneObject, ...]:
        """What is really in view in one of the frames."""
        span = slice(*self._visible.slot.searchsorted((slot, slot + 1)))
        return tuple(self.drive.scene.truth(self._visible.only(span)))


class SceneFrame:
    """One camera frame of a town or of traffic: has what a ``TraceFrame`` has, but no boxes. It is
    the frame ``index`` of its camera, and has a ``slot`` in its batch.

    ``digest`` names the scene, the car, the camera and the time: no two frames are byte for byte
    the same picture. ``dhash`` are bits of their own for each frame, so that pictures are never
    similar by it, however near their poses. ``detections`` are made when they are first asked for;
    their random numbers hang on the scene's seed, the car, the camera and the time alone: where
    settings change, what is still there is seen with the same luck.
    """

    __slots__ = (
        "_batch",
        "_detections",
        "_slot",
        "camera",
        "dhash",
        "digest",
        "index",
        "pose",
        "stamp_ns",
    )

    kind = "camera"
    width = WIDTH
    height = HEIGHT
    size_bytes = WIDTH * HEIGHT * 3 + IMAGE_HEADER_BYTES
    horizontal_fov_rad = HORIZONTAL_FOV_RAD

    def __init__(self, batch: FrameBatch, slot: int, index: int) -> None:
        drive = batch.drive
        self._batch, self._slot = batch, slot
        self.camera, self.index = batch.camera, index
        self.stamp_ns = index * drive.interval_ns
        self.dhash, self.pose = batch.key(slot), batch.camera_pose(slot)
        self.digest = f"{drive.picture_prefix}{self.camera}{self.scene_ns:014x}"
        self._detections: tuple[Detection, ...] | None = None

    @property
    def detections(self) -> tuple[Detection, ...]:
        """What the detector finds in this frame, best score first."""
        if self._detections is None:
            self._detections = self._batch.detections(self._slot)
        return self._detections

    def truth(self) -> tuple[SceneObject, ...]:
        """What is really in view: in the field of view, not hidden, not too far away, and at least
        25 pixels high in the picture, as KITTI's labels that count.
        """
        return self._batch.truth(self._slot)

    @property
    def scene_ns(self) -> int:
        """When it is taken, on the clock of the scene."""
        return self._batch.drive.start_ns + self.stamp_ns

    @property
    def features(self) -> dict[str, bytes]:
        """Surrogates, by name: there are no pictures."""
        seed = self._batch.drive.scene.seed
        return {
            name: surrogate.at(self.pose, self.dhash)
            for name, surrogate in surrogates(seed).items()
        }

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneFrame) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


class CameraFrames(Sequence[SceneFrame]):
    """All frames of one camera of a drive; made anew each time they are asked for."""

    __slots__ = ("_camera", "_count", "_drive")

    def __init__(self, drive: SceneDrive, camera: str, count: int) -> None:
        self._drive, self._camera, self._count = drive, camera, count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[SceneFrame]:
        return self._frames(range(self._count))

    def __getitem__(self, index: Any) -> Any:
        indices = range(self._count)[index]
        if isinstance(indices, range):
            return tuple(self._frames(indices))
        return next(self._frames((indices,)))

    def _frames(self, indices: Sequence[int]) -> Iterator[SceneFrame]:
        for begin in range(0, len(indices), BATCH_FRAMES):
            batch_indices = indices[begin : begin + BATCH_FRAMES]
            batch = FrameBatch(self._drive, self._camera, batch_indices)
            for slot, index in enumerate(batch_indices):
                yield SceneFrame(batch, slot, index)
