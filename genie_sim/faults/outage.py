"""An outage: links carry nothing."""

from dataclasses import dataclass

from genie_sim.sim.fault import Fault, Strike
from genie_sim.sim.network import Network


@dataclass(frozen=True)
class Outage(Fault):
    """The links at ``target`` are cut: a car's, an edge's, those between ``edges``, or one such as
    ``car1->edge1``.

    A message is lost whose last bit leaves while the link is cut.
    """

    target: str
    """A car, an edge, `edges` for the network between them, or one link such as `car1->edge1`."""

    befalls = "car, edge or link"
    dropped_by = "outage"

    def strike(self, network: Network) -> Strike:
        network.cut(self.target, self.dropped_by)
        yield
        network.restore(self.target, self.dropped_by)
