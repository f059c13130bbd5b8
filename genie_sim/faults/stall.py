"""A stall: a host hangs."""

from dataclasses import dataclass

from genie_sim.faults.targets import FaultOfHost
from genie_sim.sim.fault import AffectedNetwork


@dataclass(frozen=True)
class Stall(FaultOfHost):
    """The accelerator and the CPU of ``target`` stand still; then they go on where they were.
    Messages still arrive, and wait.
    """

    target: str
    """A car or an edge."""

    dropped_by = "stall"  # it drops nothing itself: full queues do

    def begin(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.stall()

    def end(self, network: AffectedNetwork) -> None:
        for processor in network.processors(self.target):
            processor.go_on()
