"""The frame source of a generated town: every car drives its own way, and what is really there is
known.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

from genie_sim.base.geometry import Geodetic
from genie_sim.base.marks import POSITIVE
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.data.frame_source import FrameSource
from genie_sim.worlds.scene.frames import check_frames
from genie_sim.worlds.scene.scene import SceneDrives
from genie_sim.worlds.town.rules import TownRules

if TYPE_CHECKING:
    from genie_sim.base.progress import Progress
    from genie_sim.worlds.scene.frames import SceneDrive
    from genie_sim.worlds.town.town import Town


@dataclass(frozen=True)
class InTown(FrameSource):
    """Every car drives its own way through a generated town.

    Each drives for ``duration_ns`` and takes a frame every ``interval_ns``; recordings are "02" and
    "03". An object that a car's consumer holds is right if one of its class really is within
    ``tolerance_m`` of it; objects up to ``range_m`` away count. Both are a ruler, the same whatever
    a Genie is told. The town is made from ``town`` and the scenario's seed.
    """

    is_one_world: ClassVar[bool] = True  # cars meet: what one sees is there for the others
    is_map: ClassVar[bool] = True  # cars drive in it, alone or as a fleet

    duration_ns: Annotated[int, POSITIVE] = 60 * NS_PER_S
    """How long every car drives."""

    interval_ns: Annotated[int, POSITIVE] = 100 * NS_PER_MS
    """Time between two frames of a camera."""

    tolerance_m: Annotated[float, POSITIVE] = 2.0
    """How far an answer may be from the truth and still count as right."""

    range_m: Annotated[float, POSITIVE] = 50.0
    """Objects up to this distance are judged."""

    town: TownRules = field(default_factory=TownRules)
    """How the town is built. Densities are assumed; they give frames as many objects as KITTI's."""

    def __post_init__(self) -> None:
        check_frames(self.duration_ns, self.interval_ns)

    def open(
        self, seed: int, origin: Geodetic | None, progress: "Progress | None" = None
    ) -> "TownDrives":
        from genie_sim.worlds.town.town import Town

        return TownDrives(Town(self.town, seed), self)


class TownDrives(SceneDrives):
    """A town with the drives through it. A car sees the town at the time that the simulation has
    then, but for the phases of its cameras.
    """

    scene: "Town"

    def __init__(self, town: "Town", settings: InTown) -> None:
        super().__init__(town, tolerance_m=settings.tolerance_m, range_m=settings.range_m)
        self.settings, self.extent_m = settings, (0.0, 0.0, *town.size_m)

    def drive(self, car: str, trace: str | None, start_ns: int) -> "SceneDrive":
        return self.scene.drive(car, self.settings.duration_ns, self.settings.interval_ns, start_ns)
