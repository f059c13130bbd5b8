"""The frame source of recorded traffic: some of its vehicles are cars with cameras, the others are
objects that these see.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from genie_sim.base import files
from genie_sim.base.geometry import Geodetic
from genie_sim.base.marks import Bounds
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.units import NS_PER_S
from genie_sim.worlds.scene.laws import MAX_VIEW_M
from genie_sim.worlds.scene.source import SceneSource
from genie_sim.worlds.traffic.vehicle_types import VehicleType

if TYPE_CHECKING:
    from genie_sim.base.progress import Progress
    from genie_sim.worlds.traffic.traffic import TrafficDrives


@dataclass(frozen=True)
class RecordedTraffic(SceneSource):
    """Cars drive with recorded traffic, such as floating-car data of SUMO.

    All vehicles of the file are there, for cars to see and to be hidden by; those that are
    equipped are cars of the scenario, from when they appear to when they leave.
    """

    fcd: str = "sumo_grid"
    """A file of floating-car data (`.xml`, `.xml.gz`), or the name of one that comes with
    genie-sim."""

    begin_ns: int | None = None
    """The time in the file at which the simulation begins; by default its first time step
    with a vehicle."""

    view_m: Annotated[float, Bounds(above=0, maximum=MAX_VIEW_M)] = 60.0
    """How far a camera's detector looks."""

    equipped: Annotated[float, Bounds(above=0, maximum=1)] | tuple[str, ...] = 1.0
    """Which vehicles have cameras and a computer: a share of them, or those with these ids. A
    vehicle that a small share equips is equipped by every larger one."""

    types: Mapping[str, VehicleType] = field(default_factory=dict)
    """What vehicles of a type in the file are. A type that is not named here is recognised by a
    word in its name, such as `bus`, `truck` or `bicycle`, and is a car otherwise."""

    accept: bool = False
    """Read a file that cannot be right all the same, such as one whose places are in degrees."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.equipped == ():
            raise SettingError("equipped", "must not be empty")
        if isinstance(self.equipped, tuple) and len(set(self.equipped)) < len(self.equipped):
            raise SettingError("equipped", "names a vehicle twice")

    def open(
        self, seed: int, origin: Geodetic | None, progress: "Progress | None" = None
    ) -> "TrafficDrives":
        from genie_sim.worlds.traffic.fcd import read_fcd
        from genie_sim.worlds.traffic.traffic import Traffic, TrafficDrives

        path = files.find(files.TRAFFIC, self.fcd)
        begin_s = None if self.begin_ns is None else self.begin_ns / NS_PER_S
        rows = read_fcd(path, begin_s, self.duration_ns / NS_PER_S, self.accept)
        traffic = Traffic(rows, self, path, seed)
        traffic.warn()
        return TrafficDrives(traffic, self)
