"""What a source of frames has: base classes of its settings, of the open source and of the drives
that it gives to cars. ``sources`` has the shipped ones.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol

from genie_sim.base.geometry import Geodetic
from genie_sim.base.grid import Area
from genie_sim.base.progress import Progress
from genie_sim.core.messages import Encoding, Frame


class Drive:
    """What one car's cameras see: frames by recording, in order of time, in the scenario's
    east-north-up frame.

    A drive on a map has a ``duration_ns`` and a ``position``, too.
    """

    __slots__ = ()

    name: str
    """What it is called, such as the name of its trace."""

    frames: Mapping[str, Sequence[Frame]]
    """The frames of each recording, by its name; their stamps are nanoseconds since the drive's
    first frame.
    """

    duration_ns: int
    """How long it takes [ns]; only of a drive on a map."""

    position: Callable[[int], tuple[float, float]] | None = None
    """A method that gives east and north of the car [m] so many nanoseconds after it starts;
    ``None`` where its place is known only when a frame was taken.
    """


class EncodedDrive(Protocol):
    """A drive with its pictures encoded and decoded; ``digest`` tells it from others."""

    @property
    def frames(self) -> Mapping[str, Sequence[Frame]]: ...

    @property
    def digest(self) -> str: ...


class Drives:
    """An open source: the drives of its cars."""

    seeded: bool = False
    """Whether another seed gives other frames."""

    extent_m: Area | None = None
    """The borders of the map; ``None`` where no fleet can drive."""

    def drive(self, car: str, trace: str | None, start_ns: int) -> Drive:
        """What a car sees. Raises ``UserError``.

        Parameters
        ----------
        car : str
            The car's name in the scenario.
        trace : str or None
            The trace that its route names; ``None`` where it names none.
        start_ns : int
            When it starts, in nanoseconds since the beginning of the simulation.
        """
        raise NotImplementedError

    def digests(self) -> Mapping[str, str]:
        """What decides the frames handed out so far, for the run's id: digests by name. A source
        that is ``seeded`` gives all of them once it is open: runs with other seeds are planned by
        them, before a drive is handed out.
        """
        raise NotImplementedError

    def provenance(self) -> Mapping[str, Mapping[str, Any]]:
        """Where they come from, by name, for ``run.json``."""
        raise NotImplementedError

    def starts_ns(self) -> Mapping[str, int] | None:
        """When each car of a fleet starts [ns], by name, where the source brings the cars, such as
        recorded traffic; ``None`` where the scenario says how many there are.
        """
        return None

    def truth_of(self, drive: Any) -> Any:
        """What is really there on a drive from here (``judge.scenes.DriveTruth``); ``None`` where
        nobody knows.
        """
        return None

    def encoded(self, car: str, encoding: Encoding) -> EncodedDrive | None:
        """The drive of a car, by its name, with its pictures encoded and decoded, such as
        ``jpeg90``; ``None`` where there are no pictures. Raises ``UserError``.
        """
        return None


class FrameSource:
    """The settings of a source."""

    is_one_world: ClassVar[bool] = False
    """Whether all cars are there at one time: what one sees is there for the others."""

    is_map: ClassVar[bool] = False
    """Whether cars drive on a map, for ``duration_ns``, and replay no recording."""

    duration_ns: int

    def open(self, seed: int, origin: Geodetic | None, progress: Progress | None = None) -> Drives:
        """The frames. Raises ``UserError``.

        Parameters
        ----------
        seed : int
            The root of all random streams.
        origin : Geodetic or None
            Where the scenario's east-north-up frame has its zero; ``None``: the source's own.
        progress : callable, optional
            Called with how much is done, how much there is, and what is going on.
        """
        raise NotImplementedError
