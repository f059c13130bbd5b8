"""A straggler: a host is slower than usual, because of heat or of others on it."""

from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.settings import Bounds
from genie_sim.faults.targets import FaultOfHost
from genie_sim.sim.fault import AffectedNetwork


@dataclass(frozen=True)
class Slow(FaultOfHost):
    """Jobs that come to the accelerator and the CPU of ``target`` take ``factor`` times as long."""

    target: str
    """A car or an edge."""

    # Hot computers lower their clock: 1.3 to 2; a straggler is far slower. Assumed.
    factor: Annotated[float, Bounds(above=0)] = 2.0
    """How much longer jobs take. Assumed."""

    dropped_by = "slow"  # it drops nothing itself: full queues do

    def begin(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.slow(self.factor)

    def end(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.speed_up(self.factor)
