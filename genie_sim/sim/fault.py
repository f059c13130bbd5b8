"""Faults: what goes wrong in a run, and when."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, Protocol, runtime_checkable

import numpy as np

from genie_sim.base.seeds import Draws
from genie_sim.base.settings import Bounds
from genie_sim.sim.bends import Bend, Sense

if TYPE_CHECKING:
    import simpy

    from genie_sim.sim.clock import Steps


class FaultClock(Protocol):
    """The run's clock, as a fault sees it: a ``simpy.Environment`` in whole nanoseconds."""

    @property
    def now(self) -> int:
        """Time since the start of the run [ns]."""

    def process(self, generator: "Steps") -> "simpy.Process":
        """Starts a process, a generator that yields what it waits for. It ends with the run."""

    def timeout(self, delay: float = 0, value: Any = None) -> "simpy.Timeout":
        """Happens after a delay [ns]."""

    def event(self) -> "simpy.Event":
        """Happens when its ``succeed`` is called."""

    def after(
        self, delay_ns: int, call: Callable[..., None], arguments: tuple[Any, ...] = ()
    ) -> None:
        """Schedules ``call(*arguments)`` in ``delay_ns``."""


class AffectedLink(Protocol):
    """A link, as a fault sees it: it carries nothing while ``down_by`` names a cause."""

    name: str
    down_by: list[str]

    def load(self, flow: Hashable, size_bytes: int) -> None:
        """Queues background traffic; the newest of each ``flow`` wait."""


class AffectedHost(Protocol):
    """The ROS graph of a host, as a fault sees it."""

    def void(self, where: str, keep: Literal["memory"] | None = None) -> None:
        """What is queued and in service is lost, dropped by ``where``, and the nodes lose their
        state, unless they ``keep`` what is in memory.
        """


class AffectedProcessor(Protocol):
    """An accelerator or a CPU, as a fault sees it."""

    def serve(self, service_ns: int) -> "Steps":
        """A job, for a process: ``yield from processor.serve(5_000_000)`` waits in the queue of the
        processor and occupies it.
        """

    def stall(self) -> None:
        """Nothing is begun or finished from now on, until ``go_on``."""

    def go_on(self) -> None:
        """Ends a stall."""

    def slow(self, factor: float) -> None:
        """Jobs that come from now on take ``factor`` times as long."""

    def speed_up(self, factor: float) -> None:
        """Ends what ``slow`` has begun."""


class EdgeConnection(Protocol):
    """A car's connection to its ``edge``."""

    edge: str

    def leave(self, lost_by: str) -> None:
        """Breaks it; ``lost_by`` names what drops the messages from now on."""

    def join(self, edge: str) -> None:
        """Connects the car to an edge."""


class AffectedNetwork(Protocol):
    """What a fault may act on: the run's links, hosts, and the cars' connections to their edges."""

    @property
    def clock(self) -> FaultClock: ...

    @property
    def links(self) -> Mapping[str, AffectedLink]:
        """By name, such as ``car1->edge1``."""

    @property
    def graphs(self) -> Mapping[str, AffectedHost]:
        """By car or edge; only the hosts on which the method runs something."""

    @property
    def uplinks(self) -> Mapping[str, EdgeConnection]:
        """By car; only of cars whose frames the method sends to an edge."""

    @property
    def cars(self) -> tuple[str, ...]:
        """All cars."""

    def draws(self, *names: str) -> Draws:
        """The random numbers of these names, by key: that of a key is the same under every
        method.
        """

    def stream(self, *names: str) -> np.random.Generator:
        """The random generator of these names: the same under every method."""

    def take_down(self, target: str, cause: str) -> None:
        """The links at ``target`` carry nothing from now on; they drop messages as
        ``LINK:cause``.
        """

    def put_up(self, target: str, cause: str) -> None:
        """Ends what ``take_down`` has begun."""

    def void(self, host: str, where: str, keep: Literal["memory"] | None = None) -> None:
        """What is queued and in service on a host is lost, dropped by ``where``, and its nodes lose
        their state, unless they ``keep`` what is in memory. Raises ``UserError`` for an unknown
        host.
        """

    def processors(self, host: str) -> Sequence[AffectedProcessor]:
        """The accelerator and the CPU of a host; none if the method runs nothing there."""

    def bend(self, host: str, bend: Bend) -> None:
        """Changes from now on what crosses the border of a host. Messages that are lost are dropped
        by ``LINK:cause``.
        """

    def unbend(self, host: str, bend: Bend) -> None:
        """Ends what ``bend`` has begun."""

    def senses(self, car: str) -> list[tuple[Sense, str]]:
        """What faults make of the images of a car's cameras; see ``Network.senses``."""


class Fault(Protocol):
    """A fault that starts and ends at a target.

    ``dropped_by`` stands in the ``drop`` column of the frames that it loses; ``duration_ns`` is how
    long it takes if nothing else says so, ``None`` or no such attribute for good. A class may have
    a static method ``check``, see ``Outage``.
    """

    @property
    def target(self) -> str: ...

    @property
    def dropped_by(self) -> str: ...

    @property
    def duration_ns(self) -> int | None: ...

    def begin(self, network: AffectedNetwork) -> None:
        """Starts the fault at its target, by what ``network`` lets it do."""

    def end(self, network: AffectedNetwork) -> None:
        """Ends the fault; ``network`` is as it was given to ``begin``."""


@runtime_checkable
class FaultProcess(Protocol):
    """A fault that is a process while it lasts, in place of ``begin`` and ``end``."""

    def run(self, network: AffectedNetwork) -> "Steps":
        """What happens from the beginning on: a generator that yields what it waits for, such as
        ``network.clock.timeout(1_000_000)`` [ns]. It is interrupted (``simpy.Interrupt``) at the
        fault's end, and closed at the end of the run.
        """


@runtime_checkable
class DrawnFault(Protocol):
    """A fault whose targets may be drawn in the run."""

    def drawn_targets(self, network: AffectedNetwork) -> Sequence[str]:
        """Its targets, by name, drawn with the random numbers of ``network``."""


@dataclass(frozen=True, kw_only=True)
class FaultTimes:
    """When a fault happens: once, or again and again at random."""

    begin_ns: int | None = None
    """When it begins; of a fault that happens again and again, when it can at the earliest."""

    end_ns: int | None = None
    """When it is over; by default after as long as this kind of fault takes, or never."""

    mean_time_between_ns: Annotated[int, Bounds(above=0)] | None = None
    """Mean of the exponential times until the fault begins, and until it begins again after its
    end."""

    mean_duration_ns: Annotated[int, Bounds(above=0)] | None = None
    """Mean of the exponential times that it takes, where it happens again and again."""


@dataclass(frozen=True, kw_only=True)
class TimedFault(FaultTimes):
    """A fault and its times. ``name`` names the random stream of those that are drawn, ``kind`` is
    the fault's name in the scenario.
    """

    fault: Fault
    name: str
    kind: str = ""
    begin_ns: int = 0
    mean_duration_ns: int = 0
