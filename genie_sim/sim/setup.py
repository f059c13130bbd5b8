"""Everything that a world is built from, as plain values: names, times in nanoseconds, sizes in bytes."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from genie_sim.core.consumer import ConsumerName
from genie_sim.core.freshness.laws import ASSUMED, DetectorLaws
from genie_sim.core.rules import GenieRules
from genie_sim.messages import Frame
from genie_sim.sim.encoding import Codec
from genie_sim.sim.fault import TimedFault
from genie_sim.sim.link_models import LinkModel
from genie_sim.sim.service import Device


@dataclass(frozen=True, slots=True)
class CameraSetup:
    """One stream of a car: its frames, its phase, and the size of its images (``None``: as recorded)."""

    name: str
    frames: Sequence[Frame]
    phase_ns: int = 0
    size_bytes: int | None = None


@dataclass(frozen=True, slots=True)
class EdgeSetup:
    """An edge server; ``neighbours`` of ``None`` are all other edges."""

    name: str
    device: Device
    neighbours: tuple[str, ...] | None = None


@dataclass(frozen=True, slots=True)
class CarSetup:
    """A car: its computer, its edge and the link to it (``None``: on its own), its cameras and its way.

    ``sees``: its cameras deliver pictures, not only positions. ``window_ns`` is the part of the recordings that it
    drives (``None``: all), from ``start_ns`` on, ``laps`` times with ``pause_ns`` between them.
    """

    name: str
    device: Device
    edge: str | None
    link: LinkModel | None
    cameras: Sequence[CameraSetup]
    sees: bool = True
    genie: bool = True
    window_ns: tuple[int, int] | None = None
    start_ns: int = 0
    laps: int = 1
    pause_ns: int = 0


@dataclass(frozen=True, slots=True)
class Setup:
    """One scenario under one method's settings. Random streams are named by car, edge and link below ``seed``.

    ``laws`` are those of the detectors, as maps and consumers that weigh evidence take them to be. ``codec`` of
    ``None`` sends pictures as they are.
    """

    seed: int
    cars: Sequence[CarSetup]
    edges: Sequence[EdgeSetup]
    edge_network: LinkModel
    genie: GenieRules = field(default_factory=GenieRules)
    queue_length: int = 1
    consumer: ConsumerName = "newest"
    laws: DetectorLaws = ASSUMED
    faults: Sequence[TimedFault] = ()
    codec: Codec | None = None

    @property
    def blind_edges(self) -> set[str | None]:
        """Edges that serve cars without cameras: no picture ever comes there."""
        return {car.edge for car in self.cars if not car.sees}
