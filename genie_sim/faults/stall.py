"""A stall: a host hangs."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from genie_sim.faults.targets import check_targets
from genie_sim.sim.fault import AffectedNetwork, TimedFault


@dataclass(frozen=True)
class Stall:
    """The accelerator and the CPU of ``target`` stand still; then they go on where they were.
    Messages still arrive, and wait.
    """

    target: str
    """A car or an edge."""

    duration_ns = None  # for good, if nothing says when it ends

    @property
    def dropped_by(self) -> str:
        return "stall"  # it drops nothing itself: full queues do

    def begin(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.stall()

    def end(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.go_on()

    @staticmethod
    def check(
        faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Yields each problem of the scenario's faults of this kind."""
        yield from check_targets(faults, "car or edge", [*edge_of, *edges])
