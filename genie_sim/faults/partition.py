"""A partition: some hosts and all others do not reach each other."""

from dataclasses import dataclass

from genie_sim.core.messages import Message
from genie_sim.sim.bends import Bend
from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class Partition(Fault):
    """The network falls into two parts: the hosts named in ``target``, and all others. Nothing gets
    from one part to the other; within each everything goes on.
    """

    target: tuple[str, ...]
    """The cars and edges of one part."""

    dropped_by = "partition"

    def strike(self, network: Network) -> Strike:
        def inside(message: Message, host: str) -> Message | None:
            """The message, if the host at the other end is in the same part."""
            return message if host in self.target else None

        bend = Bend(inside, inside, self.dropped_by)
        for host in self.target:
            network.bend(host, bend)
        yield
        for host in self.target:
            network.unbend(host, bend)
