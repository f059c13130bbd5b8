"""A crash: a host is away, and may forget everything."""

from dataclasses import dataclass
from typing import Literal

from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class Crash(Fault):
    """The host ``target`` crashes, and is back at the end. Meanwhile its links are cut. What is
    queued and in service there is lost.
    """

    target: str
    """A car or an edge."""

    memory: Literal["cold", "warm"] = "cold"
    """Whether caches, maps and pending requests are lost (`cold`), or are there again after the
    restart (`warm`)."""

    dropped_by = "crash"

    def strike(self, network: Network) -> Strike:
        where = f"{self.target}:{self.dropped_by}"
        network.cut(self.target, self.dropped_by)
        network.void(self.target, where, keeps_memory=self.memory == "warm")
        for processor in network.processors(self.target):
            processor.stall()
        yield
        # what came meanwhile, from cameras and links, reached nobody
        network.void(self.target, where, keeps_memory=True)
        for processor in network.processors(self.target):
            processor.go_on()
        network.restore(self.target, self.dropped_by)
