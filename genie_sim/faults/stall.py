"""A stall: a host hangs."""

from dataclasses import dataclass

from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class Stall(Fault):
    """The accelerator and the CPU of ``target`` stand still; then they go on where they were.
    Messages still arrive, and wait.
    """

    target: str
    """A car or an edge."""

    def strike(self, network: Network) -> Strike:
        for processor in network.processors(self.target):
            processor.stall()
        yield
        for processor in network.processors(self.target):
            processor.go_on()
