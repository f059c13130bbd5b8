"""Faults: what goes wrong in a world, and when."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from genie_sim.sim.world import World


class Fault(Protocol):
    """Something that begins to be wrong with a ``target``, and is right again later.

    ``dropped_by`` stands in the ``drop`` column of the frames that it loses; ``duration_ns`` is how long it takes where
    nothing else says so, ``None`` or none at all for good. A class may have a static method ``check``, see ``Outage``.
    """

    @property
    def target(self) -> str: ...

    @property
    def dropped_by(self) -> str: ...

    @property
    def duration_ns(self) -> int | None: ...

    def begin(self, world: "World") -> None:
        """From now on it is wrong."""

    def end(self, world: "World") -> None:
        """It is right again."""


@dataclass(frozen=True, slots=True)
class TimedFault:
    """A fault and its times: once from ``begin_ns`` to ``end_ns``, or again and again with exponential times of the
    mean ``mean_time_between_ns`` until the next begins and ``mean_duration_ns`` until it is over.

    ``name`` names the random stream of those times.
    """

    fault: Fault
    name: str
    begin_ns: int = 0
    end_ns: int | None = None
    mean_time_between_ns: int | None = None
    mean_duration_ns: int = 0


def start(world: "World", timed: TimedFault) -> None:
    """Lets a fault happen at its times. The world's own end does not wait for a fault that goes on for ever."""
    env, fault, between_ns = world.env, timed.fault, timed.mean_time_between_ns
    if between_ns is None:
        env.after(timed.begin_ns, _once, world, timed)
        return
    rng = world.stream(timed.name)

    def next_time(mean_ns: int) -> int:
        return max(1, round(rng.exponential(mean_ns)))

    def begin() -> None:
        if env.now <= world.end_ns:
            fault.begin(world)
            env.after(next_time(timed.mean_duration_ns), end)

    def end() -> None:
        fault.end(world)
        if env.now <= world.end_ns:
            env.after(next_time(between_ns), begin)

    env.after(timed.begin_ns + next_time(between_ns), begin)


def _once(world: "World", timed: TimedFault) -> None:
    timed.fault.begin(world)
    if timed.end_ns is not None:
        world.env.after(timed.end_ns - timed.begin_ns, timed.fault.end, world)
