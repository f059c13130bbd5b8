"""A hand-over: a car changes from its edge to another."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from genie_sim.base.errors import unknown
from genie_sim.base.units import NS_PER_MS, duration_text
from genie_sim.sim.fault import Fault, Problem, Strike, TimedFault
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class HandOver(Fault):
    """The car ``target`` leaves its edge, and joins another (``edge``) at the end.

    It is a break-before-make hand-over, as that of a mobile network and of a ROS node that connects
    to another master: what the car sends in between is lost, and so is what waits for the old link
    or is on it, and what the old edge answers in that time.
    """

    target: str
    """The car."""

    edge: str
    """The edge that it changes to."""

    # 30 to 80 ms within LTE, 50 to 150 ms within 5G [S: 5g6gacademy.com, 5G drive testing, lesson
    # 12.3.5]: what both have in common.
    gap_ns: int = 50 * NS_PER_MS
    """How long the car can send and receive nothing."""

    @property
    def duration_ns(self) -> int:  # type: ignore[override]
        return self.gap_ns

    @property
    def dropped_by(self) -> str:  # type: ignore[override]
        return f"{self.target}:hand_over"

    def strike(self, network: Network) -> Strike:
        uplink = network.connections.get(self.target)
        if uplink is not None:  # else nothing of the car goes to any edge
            uplink.leave(self.dropped_by)
        yield
        if uplink is not None:
            uplink.join(self.edge)

    @classmethod
    def check(
        cls, faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[Problem]:
        """Yields each problem of the scenario's hand-overs. Each must lead a car from its edge to
        another that exists, after the one before is over.
        """
        current_edge = dict(edge_of)
        free_ns = dict.fromkeys(edge_of, 0)  # when the car's last hand-over is over
        for index, entry in sorted(enumerate(faults), key=lambda item: item[1].begin_ns):
            hand_over = entry.fault
            assert isinstance(hand_over, HandOver)
            car, edge = hand_over.target, hand_over.edge
            if car not in current_edge:
                yield index, "target", unknown("car", car, current_edge)
                continue
            if current_edge[car] is None:
                yield index, "target", f"{car} has no 'edge' to leave"
            elif edge not in edges:
                yield index, "edge", unknown("edge", edge, edges)
            elif entry.mean_time_between_ns is not None:
                yield index, "mean_time_between", "a car changes to an edge once; give 'begin'"
            elif entry.end_ns != entry.begin_ns + hand_over.gap_ns:
                yield index, "end", "a hand-over is over after its 'gap'; leave it out"
            elif edge == current_edge[car]:
                yield index, "edge", f"{car} is with {edge} already"
            elif entry.begin_ns < free_ns[car]:
                over = duration_text(free_ns[car])
                yield index, "begin", f"comes before the hand-over before it is over, at {over}"
            current_edge[car] = edge
            free_ns[car] = entry.end_ns or entry.begin_ns
