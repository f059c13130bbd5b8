"""Faults: what goes wrong in a run, and when.

A fault is a generator: what stands before its ``yield`` begins it, what stands after it ends it.
To add one, write a class like ``Fault``, put it into a file of ``genie_sim/faults`` and name it in
``FAULTS`` (or in a scenario as ``package.module:Class``).
"""

from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.marks import Bounds
from genie_sim.sim.settings import ALL

if TYPE_CHECKING:
    from genie_sim.sim.network import Network

# Each fault by its name in a scenario.
FAULTS: dict[str, str] = {
    "outage": "genie_sim.faults.outage:Outage",
    "hand_over": "genie_sim.faults.hand_over:HandOver",
    "crash": "genie_sim.faults.crash:Crash",
    "stall": "genie_sim.faults.stall:Stall",
    "slow": "genie_sim.faults.slow:Slow",
    "partition": "genie_sim.faults.partition:Partition",
    "gnss": "genie_sim.faults.gnss:Gnss",
    "camera": "genie_sim.faults.camera:CameraFault",
}
FAULT_PARTS = ("strike",)
ANY = "car, edge or link"
Problem = tuple[int, str, str]  # the fault's index, the field, and what is wrong with it
Strike = Generator[Any, Any, None]  # yields events, or ``None`` to wait for the fault's end


class Fault:
    """The base of all faults. A class of your own has arguments, which are its settings.

    ``dropped_by`` stands in the ``drop`` column of the frames that it loses, if any.
    ``duration_ns`` is how long it takes if nothing else says so, ``None`` for good.
    """

    target: str | tuple[str, ...]
    befalls: ClassVar[Literal["car", "car or edge", "car, edge or link"]] = "car or edge"
    """What may be the target. A link is one such as ``car1->edge1``, or all of ``edges``, the
    network between them."""
    duration_ns: int | None = None
    dropped_by: str

    def strike(self, network: "Network") -> Strike:
        """Begins the fault, yields, and ends it.

        ``yield`` alone waits for the fault's end. ``yield event``, such as
        ``network.clock.timeout(1_000_000)`` [ns], waits for that; a fault that still waits for an
        event at its end is interrupted there (``simpy.Interrupt``), so what it must undo then
        stands in a ``finally``.
        """
        raise NotImplementedError

    @classmethod
    def check(
        cls,
        faults: "Sequence[TimedFault]",
        edge_of: Mapping[str, str | None],
        edges: Collection[str],
    ) -> Iterator[Problem]:
        """Yields each problem of the scenario's faults of this kind: (the fault's index, field,
        what is wrong).
        """
        hosts_of = {"car": [*edge_of], "car or edge": [*edge_of, *edges], ANY: None}
        if cls.befalls not in hosts_of:
            text = unknown("befalls", cls.befalls, hosts_of)
            raise UserError(f"fault {cls.__module__}:{cls.__qualname__}: {text}")
        choices = hosts_of[cls.befalls]
        for index, entry in enumerate(faults):
            target = entry.fault.target
            if not target:
                yield index, "target", "must not be empty"
            for name in (target,) if isinstance(target, str) else target:
                if choices is None:
                    yield from _check_link(index, name, [*edge_of, *edges, "edges"])
                elif name not in choices:
                    yield index, "target", unknown(cls.befalls, name, choices)


def _check_link(index: int, name: str, choices: Collection[str]) -> Iterator[Problem]:
    """Yields the problem of a target that is no known place, nor a link between two."""
    ends = name.removesuffix(f"->{ALL}").split("->")
    if len(ends) > 2 or not set(ends) <= set(choices):
        text = unknown("target", name, choices)
        yield index, "target", f"{text}, or a link such as car1->edge1"


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
