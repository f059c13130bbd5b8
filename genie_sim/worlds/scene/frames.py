"""The frames of a car's cameras in a scene of objects, such as a town: poses, and what a detector
finds of what is in view.
"""

import functools
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

import numpy as np

from genie_sim.base.geometry import Array, Geodetic
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.units import duration_text
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.data.frame_source import Drive, Drives
from genie_sim.data.trace import ANGLE_DECIMALS, IMAGE_HEADER_BYTES, POSITION_DECIMALS
from genie_sim.worlds.scene.detector import DetectedObjects, SyntheticDetector, transient
from genie_sim.worlds.scene.laws import FittedLaws
from genie_sim.worlds.scene.noise import FRAME_TRANSIENT, mix
from genie_sim.worlds.scene.objects import HEIGHT, HORIZONTAL_FOV_RAD, WIDTH, SceneObject
from genie_sim.worlds.scene.surrogate import surrogates
from genie_sim.worlds.scene.view import ViewPoses, VisibleObjects

CAMERA_UP_M = 1.65  # of KITTI's cameras: cvlibs.net/datasets/kitti/setup.php
MAX_FRAMES = 100_000_000
# Of a camera, whose views are computed at once: a frame costs half as much as in batches of 16.
BATCH_FRAMES = 64
# to the left of the car's middle; KITTI's colour cameras are 0.54 m apart (setup.php)
BASELINES_M = {"02": 0.27, "03": -0.27}
_score = attrgetter("score")


def check_frames(duration_ns: int, interval_ns: int) -> None:
    """Raises ``SettingError`` for more frames than anyone has simulated: a typing error, which
    would exhaust the memory before any message appears.
    """
    if duration_ns / interval_ns > MAX_FRAMES:
        text = f"makes more than {MAX_FRAMES:,} frames of {duration_text(duration_ns)}"
        raise SettingError("interval", text)


class SceneVisibility(Protocol):
    """What any camera in a scene has in view: not hidden, in its field of view, near enough."""

    def visible(self, poses: ViewPoses) -> VisibleObjects:
        """Of all poses together; fastest if they are near each other."""


class Scene(Protocol):
    """Objects, where they are, and how a detector sees them. ``digest`` is that of all that decides
    what cameras see, ``seed`` that of the surrogates of features.
    """

    @property
    def name(self) -> str: ...

    @property
    def digest(self) -> str: ...

    @property
    def provenance(self) -> Mapping[str, object]: ...

    @property
    def seed(self) -> int: ...

    @property
    def laws(self) -> FittedLaws: ...

    @property
    def detector(self) -> SyntheticDetector: ...

    @property
    def visibility(self) -> SceneVisibility: ...

    def truth(self, visible: VisibleObjects, t_s: Array) -> list[SceneObject | None]:
        """The objects that are visible from some poses, as they are at each pose's time [s]; a
        ghost is ``None``.
        """


class Motion(NamedTuple):
    """Where a car is at some time, its heading with cosine and sine, and its speed."""

    east_m: float
    north_m: float
    heading_rad: float
    cos: float
    sin: float
    speed_mps: float


class CarMotion(Protocol):
    """Where a car is at any time of its drive."""

    def at(self, t_s: float) -> Motion:
        """By the scene's clock."""


class SceneDrives(Drives):
    """Frames of cars that drive through a scene."""

    seeded = True

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def digests(self) -> Mapping[str, str]:
        return {self.scene.name: self.scene.digest}

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        return {self.scene.name: dict(self.scene.provenance)}


class SceneTruth:
    """What is really there on the drives through a scene: an object that is held is right within
    ``tolerance_m`` of one of its class, and objects up to ``range_m`` away count.
    """

    def __init__(self, tolerance_m: float, range_m: float) -> None:
        self.tolerance_m, self.range_m = tolerance_m, range_m

    def visible(self, frame: "SceneFrame") -> Sequence[SceneObject]:
        return frame.truth()


class SceneDrive(Drive):
    """What the cameras of one car see in a scene, from ``start_ns`` of the scene's clock on. It has
    the frames of a ``Trace``.

    ``frames`` are made when they are looked at; they keep what is in view where the drive
    ``is_judged``: what is really there will be asked for, frame by frame.
    """

    is_judged = False
    origin: Geodetic

    def __init__(
        self, scene: Scene, car: str, *, duration_ns: int, interval_ns: int, start_ns: int
    ) -> None:
        self.scene, self.car = scene, car
        self.duration_ns, self.interval_ns, self.start_ns = duration_ns, interval_ns, start_ns
        self.name = f"{scene.name}_{car}"
        text = json.dumps([scene.digest, car, start_ns, interval_ns])
        self.picture_prefix = hashlib.sha256(text.encode()).hexdigest()[:48]
        self.car_key = int(self.picture_prefix[:16], 16)
        count = math.ceil(duration_ns / interval_ns)
        self.frames: Mapping[str, Sequence[SceneFrame]] = {
            name: CameraFrames(self, name, count) for name in BASELINES_M
        }

    @functools.cached_property
    def course(self) -> CarMotion:
        """Where the car is, at any time of the drive."""
        raise NotImplementedError

    def position(self, t_ns: int) -> tuple[float, float]:
        east_m, north_m, *_ = self.course.at((self.start_ns + t_ns) * 1e-9)
        return east_m, north_m


class FrameBatch:
    """Some frames of one camera, some seconds at most: their poses, and what is in view and
    detected, computed for all of them when it is first asked for.
    """

    def __init__(self, drive: SceneDrive, camera: str, indices: Sequence[int]) -> None:
        self.drive, self.camera = drive, camera
        keys = [mix(drive.car_key ^ (index << 8) ^ int(camera)) for index in indices]
        rows = []
        headings_rad = []
        left_m = BASELINES_M[camera]
        for index in indices:
            t_s = (drive.start_ns + index * drive.interval_ns) * 1e-9
            east_m, north_m, heading_rad, c, s, _ = drive.course.at(t_s)
            east_m = round(east_m - left_m * s, POSITION_DECIMALS)
            north_m = round(north_m + left_m * c, POSITION_DECIMALS)
            headings_rad.append(round(math.remainder(heading_rad, math.tau), ANGLE_DECIMALS))
            rows.append((east_m, north_m, c, s, t_s))
        # As columns: of every car of a fleet some batch is in memory at any time.
        self._view_poses = ViewPoses._make((*np.array(rows).T, np.array(keys, dtype=np.uint64)))
        self._headings_rad = np.array(headings_rad)

    def key(self, row: int) -> int:
        """64 random bits of one of the frames."""
        return self._view_poses.key.item(row)

    def pose(self, row: int) -> CameraPose:
        """Where the camera is in one of the frames."""
        east_m = self._view_poses.east_m.item(row)
        north_m = self._view_poses.north_m.item(row)
        return CameraPose(east_m, north_m, CAMERA_UP_M, self._headings_rad.item(row))

    @functools.cached_property
    def _visible(self) -> VisibleObjects:
        return self.drive.scene.visibility.visible(self._view_poses)

    @functools.cached_property
    def _detected(self) -> DetectedObjects:
        detected = self.drive.scene.detector.detect(self._visible, self._view_poses)
        if not self.drive.is_judged:
            del self._visible  # which takes more memory than what is detected of it
        return detected

    def detections(self, row: int) -> tuple[Detection, ...]:
        """What the detector finds in one of the frames, best score first."""
        detections, key, poses = self._detected.of(row), self.key(row), self._view_poses
        draw = FRAME_TRANSIENT.share(key)
        for law in self.drive.scene.laws.transient:
            if 0.0 <= draw < law.per_frame:
                direction = poses.cos.item(row), poses.sin.item(row)
                detections.append(transient(law, mix(key), self.pose(row), direction))
            draw -= law.per_frame
        detections.sort(key=_score, reverse=True)
        return tuple(detections)

    def truth(self, row: int) -> tuple[SceneObject, ...]:
        """What is really in view in one of the frames."""
        begin, end = self._visible.pose.searchsorted((row, row + 1)).tolist()
        visible = VisibleObjects._make(column[begin:end] for column in self._visible)
        objects = self.drive.scene.truth(visible, self._view_poses.t_s)
        return tuple(item for item in objects if item is not None)


class SceneFrame:
    """One camera frame of a town or of traffic: has what a ``TraceFrame`` has, but no boxes.

    ``digest`` names the scene, the car, the camera and the frame: no two frames are byte for byte
    the same picture. ``dhash`` are bits of their own for each frame, so that pictures are never
    similar by it, however near their poses. ``detections`` are made when they are first asked for,
    from the scene's seed, the car and the frame alone.
    """

    __slots__ = (
        "_batch",
        "_detections",
        "_row",
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

    def __init__(self, batch: FrameBatch, row: int, index: int) -> None:
        drive = batch.drive
        self._batch, self._row = batch, row
        self.camera, self.index = batch.camera, index
        self.stamp_ns = index * drive.interval_ns
        self.dhash, self.pose = batch.key(row), batch.pose(row)
        self.digest = f"{drive.picture_prefix}{self.camera}{index:014x}"
        self._detections: tuple[Detection, ...] | None = None

    @property
    def detections(self) -> tuple[Detection, ...]:
        """What the detector finds in this frame, best score first."""
        if self._detections is None:
            self._detections = self._batch.detections(self._row)
        return self._detections

    def truth(self) -> tuple[SceneObject, ...]:
        """What is really in view: in the field of view, not hidden, not too far away, and at least
        25 pixels high in the picture, as KITTI's labels that count.
        """
        return self._batch.truth(self._row)

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

    def __repr__(self) -> str:
        return f"<SceneFrame {self._batch.drive.name} {self.camera} {self.index}>"


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
            for row, index in enumerate(batch_indices):
                yield SceneFrame(batch, row, index)
