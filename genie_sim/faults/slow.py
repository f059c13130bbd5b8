"""A straggler: a host is slower than usual, because of heat or of others on it."""

from dataclasses import dataclass
from typing import Annotated

from genie_sim.base.marks import Bounds
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class Slow(Fault):
    """Jobs that come to the accelerator and the CPU of ``target`` take ``factor`` times as long."""

    target: str
    """A car or an edge."""

    # Hot computers lower their clock: 1.3 to 2; a straggler is far slower. Assumed.
    factor: Annotated[float, Bounds(above=0)] = 2.0
    """How much longer jobs take. Assumed."""

    def strike(self, network: Network) -> Strike:
        for processor in network.processors(self.target):
            processor.slow(self.factor)
        yield
        for processor in network.processors(self.target):
            processor.speed_up(self.factor)
