"""A hand-over: a car changes from its edge to another."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from genie_sim.errors import unknown
from genie_sim.units import NS_PER_MS, duration_text

if TYPE_CHECKING:
    from genie_sim.sim.fault import TimedFault
    from genie_sim.sim.world import World


@dataclass(frozen=True)
class HandOver:
    """The car ``target`` leaves its edge, and joins another (``edge``) at the end.

    It is hard, as that of a mobile network and of a ROS node that connects to another master: what the car sends in
    between is lost, and so is what waits for the old link or is on it, and what the old edge answers in that time.
    ``gap_ns`` is how long the car can send and receive nothing [S: 5g6gacademy.com, 5G drive testing, lesson 12.3.5:
    30 to 80 ms within LTE, 50 to 150 ms within 5G].
    """

    target: str
    edge: str
    gap_ns: int = 50 * NS_PER_MS

    @property
    def duration_ns(self) -> int:
        return self.gap_ns

    @property
    def dropped_by(self) -> str:
        return f"{self.target}:hand_over"

    def begin(self, world: "World") -> None:
        uplink = world.uplinks.get(self.target)
        if uplink is not None:  # else nothing of the car goes to any edge
            uplink.leave(self.dropped_by)

    def end(self, world: "World") -> None:
        uplink = world.uplinks.get(self.target)
        if uplink is not None:
            uplink.join(self.edge)

    @staticmethod
    def check(
        mine: "Sequence[TimedFault]", edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Each leads a car from its edge to another that exists, after the one before is over: (which fault, field,
        what is wrong)."""
        now_at, free_ns = dict(edge_of), dict.fromkeys(edge_of, 0)
        for place, timed in sorted(enumerate(mine), key=lambda one: one[1].begin_ns):
            one = timed.fault
            assert isinstance(one, HandOver)
            if one.target not in now_at:
                yield place, "target", unknown("car", one.target, now_at)
                continue
            here = now_at[one.target]
            if here is None:
                yield place, "target", f"{one.target} has no 'edge' to leave"
            elif one.edge not in edges:
                yield place, "edge", unknown("edge", one.edge, edges)
            elif timed.mean_time_between_ns is not None:
                yield place, "mean_time_between", "a car changes to an edge once; give 'begin'"
            elif timed.end_ns != timed.begin_ns + one.gap_ns:
                yield place, "end", "a hand-over is over after its 'gap'; leave it out"
            elif one.edge == here:
                yield place, "edge", f"{one.target} is with {here} already"
            elif timed.begin_ns < free_ns[one.target]:
                over = duration_text(free_ns[one.target])
                yield place, "begin", f"comes before the hand-over before it is over, at {over}"
            now_at[one.target], free_ns[one.target] = one.edge, timed.end_ns or timed.begin_ns
