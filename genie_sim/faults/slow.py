"""A straggler: a host is slower than usual, because of heat or of others on it."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.settings import Bounds
from genie_sim.faults.targets import check_targets
from genie_sim.sim.fault import AffectedNetwork, TimedFault


@dataclass(frozen=True)
class Slow:
    """Jobs that come to the accelerator and the CPU of ``target`` take ``factor`` times as long."""

    target: str
    """A car or an edge."""

    # Hot computers lower their clock: 1.3 to 2; a straggler is far slower. Assumed.
    factor: Annotated[float, Bounds(above=0)] = 2.0
    """How much longer jobs take. Assumed."""

    duration_ns = None  # for good, if nothing says when it ends

    @property
    def dropped_by(self) -> str:
        return "slow"  # it drops nothing itself: full queues do

    def begin(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.slow(self.factor)

    def end(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.speed_up(self.factor)

    @staticmethod
    def check(
        faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Yields each problem of the scenario's faults of this kind."""
        yield from check_targets(faults, "car or edge", [*edge_of, *edges])
