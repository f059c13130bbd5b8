"""A source of scenes: its settings, the drives through a scene, and what they are judged by."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.base.marks import POSITIVE
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.spans import Flags
from genie_sim.base.units import NS_PER_MS, NS_PER_S, duration_text
from genie_sim.data.frame_source import Drives, FrameSource
from genie_sim.worlds.scene.frames import SceneDrive, SceneFrame
from genie_sim.worlds.scene.objects import SceneObject
from genie_sim.worlds.scene.scene import Scene

MAX_FRAMES = 100_000_000  # of a camera


class SceneTruth:
    """What is really there on all drives through a scene: an object that is held is right within
    ``tolerance_m`` of one of its class, and objects up to ``range_m`` away count.
    """

    cameras = None  # the frames of all of them are judged

    def __init__(self, scene: Scene, tolerance_m: float, range_m: float) -> None:
        self._scene, self.tolerance_m, self.range_m = scene, tolerance_m, range_m

    def knows(self, label: str) -> bool:
        return self._scene.knows(label)

    def visible(self, frame: SceneFrame) -> Sequence[SceneObject]:
        return frame.truth()

    def are_there(
        self, frames: Sequence[SceneFrame], labels: Sequence[str], east_m: Array, north_m: Array
    ) -> Flags:
        t_s = np.array([frame.scene_ns for frame in frames]) * 1e-9
        return self._scene.are_there(labels, east_m, north_m, t_s=t_s, tolerance_m=self.tolerance_m)


@dataclass(frozen=True)
class SceneSource(FrameSource):
    """The settings of a source of scenes.

    Each car takes a frame every ``interval_ns``; recordings are "02" and "03". An object that a
    car's consumer holds is right if one of its class really is within ``tolerance_m`` of it;
    objects up to ``range_m`` away count. Both are a ruler, the same whatever a Genie is told.
    Raises ``SettingError`` for more frames than anyone has simulated: a typing error, which would
    exhaust the memory before any message appears.
    """

    is_one_world: ClassVar[bool] = True  # cars meet: what one sees is there for the others
    is_map: ClassVar[bool] = True  # cars drive in it, alone or as a fleet

    duration_ns: Annotated[int, POSITIVE] = 60 * NS_PER_S
    """How long is simulated: how long cars drive, or at most."""

    interval_ns: Annotated[int, POSITIVE] = 100 * NS_PER_MS
    """Time between two frames of a camera."""

    tolerance_m: Annotated[float, POSITIVE] = 2.0
    """How far an answer may be from the truth and still count as right."""

    range_m: Annotated[float, POSITIVE] = 50.0
    """Objects up to this distance are judged, also where the detector looks less far."""

    def __post_init__(self) -> None:
        if self.duration_ns / self.interval_ns > MAX_FRAMES:
            text = f"makes more than {MAX_FRAMES:,} frames of {duration_text(self.duration_ns)}"
            raise SettingError("interval", text)


class SceneDrives(Drives):
    """A scene with the drives of cars through it, and one truth for all of them."""

    seeded = True

    def __init__(self, scene: Scene, settings: SceneSource) -> None:
        self.scene, self.settings = scene, settings
        self._truth = SceneTruth(scene, settings.tolerance_m, settings.range_m)

    def digests(self) -> Mapping[str, str]:
        return {self.scene.name: self.scene.digest}

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        return {self.scene.name: self.scene.provenance()}

    def truth_of(self, drive: SceneDrive) -> SceneTruth:
        """What is really there, of which all drives have the same."""
        return self._truth
