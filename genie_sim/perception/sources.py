"""Frame sources: where the frames of a scenario come from. The ``perception:`` section names one and its arguments.

To add one, write a class with the method of ``FrameSource`` and name it in ``SOURCES`` (or in a scenario as
``source: package.module:Class``). Its arguments are its settings in YAML.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from genie_sim import files
from genie_sim.core.geometry import Geodetic
from genie_sim.errors import UserError, shown
from genie_sim.messages import Frame

if TYPE_CHECKING:
    from genie_sim.perception.trace import Trace

SOURCES: dict[str, str] = {
    "recorded": "genie_sim.perception.sources:Recorded",
    "live": "genie_sim.perception.sources:Live",
    "town": "genie_sim.town.source:InTown",
}
Progress = Callable[[float, float, str], None]


class Drive(Protocol):
    """What one car's cameras see: frames by recording, in order of time, in the scenario's east-north-up frame."""

    @property
    def name(self) -> str: ...

    @property
    def frames(self) -> Mapping[str, Sequence[Frame]]: ...


class TrueWorld(Protocol):
    """Knows where everything really is."""

    def is_there(self, label: str, east_m: float, north_m: float, range_m: float, t_ns: int) -> bool:
        """Whether anything of a class is within a distance of a place at a time of the source's clock."""


class Frames(Protocol):
    """An open source. ``truth`` is ``None`` where nobody knows what is really there. ``seeded``: another seed gives
    other frames."""

    seeded: bool

    @property
    def truth(self) -> TrueWorld | None: ...

    def drive(self, car: str, trace: str | None, start_ns: int) -> Drive:
        """What a car sees that starts at this time; ``trace`` is its route's. Raises ``UserError``."""

    def digests(self) -> Mapping[str, str]:
        """What decides the frames handed out so far, for the run's id: digests by name."""

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        """Where they come from, by name, for ``run.json``."""


class FrameSource(Protocol):
    """The settings of a source."""

    def open(self, seed: int, origin: Geodetic | None, progress: Progress | None = None) -> Frames:
        """The frames, placed around ``origin`` (``None``: the source's own). Raises ``UserError``."""


@dataclass(frozen=True)
class Recorded:
    """What the cameras show comes from a perception trace: a name or a path."""

    trace: str = "kitti_0005"

    def open(self, seed: int, origin: Geodetic | None, progress: Progress | None = None) -> Recordings:
        from genie_sim.perception.trace import read_trace

        return Recordings(read_trace(files.find(files.TRACE, self.trace)), origin)


@dataclass(frozen=True)
class Live:
    """The frames of a KITTI drive go through a detector while the scenario is prepared.

    ``kitti`` may begin with an environment variable, ``drive`` is ``date/number``.
    """

    kitti: str = "$GENIE_SIM_KITTI"
    drive: str = "2011_09_26/0005"
    cameras: tuple[str, ...] = ("02", "03")
    detector: str = "yolox_nano"
    min_score: float = 0.3

    def __post_init__(self) -> None:
        if not re.fullmatch(r"\d{4}_\d{2}_\d{2}/\d{4}", self.drive, re.ASCII):
            raise ValueError(f"drive: must be a date and a number such as '2011_09_26/0005', not {shown(self.drive)}")
        if not self.cameras:
            raise ValueError("cameras: must not be empty")
        if not 0 <= self.min_score <= 1:
            raise ValueError(f"min_score: must be from 0 to 1, but is {self.min_score:g}")

    def open(self, seed: int, origin: Geodetic | None, progress: Progress | None = None) -> Recordings:
        from genie_sim.perception.perceive import perceive

        root = os.path.expandvars(self.kitti)
        if root.startswith("$"):
            raise UserError(
                f"perception.kitti: {self.kitti}: the environment variable is not set; set it to KITTI's folder"
            )

        def tell(done: int, total: int) -> None:
            if progress is not None:
                progress(done, total, "perceive")

        made = perceive(root, self.drive, self.cameras, self.detector, min_score=self.min_score, progress=tell)
        return Recordings(made, origin)


@dataclass
class Recordings:
    """Traces around one origin: the scenario's, and those that single routes name."""

    main: Trace
    origin: Geodetic | None = None
    truth: None = None
    seeded: bool = False
    _read: dict[str | None, Trace] = field(default_factory=dict)
    _of_cars: dict[str, Trace] = field(default_factory=dict)

    def drive(self, car: str, trace: str | None, start_ns: int) -> Trace:
        from genie_sim.perception.trace import read_trace

        if trace not in self._read:
            made = self.main if trace is None else read_trace(files.find(files.TRACE, trace))
            self._read[trace] = made.rebased(self.main.origin if self.origin is None else self.origin)
        self._of_cars[car] = self._read[trace]
        return self._of_cars[car]

    def digests(self) -> Mapping[str, str]:
        return {car: trace.digest for car, trace in self._of_cars.items()}

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        return {trace.name: dict(trace.provenance) for trace in self._of_cars.values()}
