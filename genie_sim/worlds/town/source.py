"""The frame source of a generated town: every car drives its own way, and what is really there is
known.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from genie_sim.base.geometry import Geodetic
from genie_sim.worlds.scene.source import SceneDrives, SceneSource
from genie_sim.worlds.town.rules import TownRules

if TYPE_CHECKING:
    from genie_sim.base.progress import Progress
    from genie_sim.worlds.scene.frames import SceneDrive
    from genie_sim.worlds.town.town import Town


@dataclass(frozen=True)
class InTown(SceneSource):
    """Every car drives its own way through a generated town, for ``duration_ns``. The town is made
    from ``town`` and the scenario's seed.
    """

    town: TownRules = field(default_factory=TownRules)
    """How the town is built. Densities are assumed; they give frames as many objects as KITTI's."""

    def open(
        self, seed: int, origin: Geodetic | None, progress: "Progress | None" = None
    ) -> "TownDrives":
        from genie_sim.worlds.town.town import Town

        return TownDrives(Town(self.town, seed, self.range_m), self)


class TownDrives(SceneDrives):
    """A town with the drives through it. A car sees the town at the time that the simulation has
    then, but for the phases of its cameras.
    """

    scene: "Town"

    def __init__(self, town: "Town", settings: InTown) -> None:
        super().__init__(town, settings)
        self.extent_m = (0.0, 0.0, *town.size_m)

    def drive(self, car: str, trace: str | None, start_ns: int) -> "SceneDrive":
        return self.scene.drive(car, self.settings.duration_ns, self.settings.interval_ns, start_ns)
