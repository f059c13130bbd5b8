"""An outage: links carry nothing."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from genie_sim.base.errors import unknown
from genie_sim.sim.fault import AffectedNetwork, TimedFault
from genie_sim.sim.settings import ALL


@dataclass(frozen=True)
class Outage:
    """The links at ``target`` are down: a car's, an edge's, those between ``edges``, or one such as
    ``car1->edge1``.

    A message is lost whose last bit leaves while the link is down.
    """

    target: str
    """A car, an edge, `edges` for the network between them, or one link such as `car1->edge1`."""

    duration_ns = None  # for good, if nothing says when it ends
    dropped_by = "outage"

    def begin(self, network: AffectedNetwork) -> None:
        network.take_down(self.target, self.dropped_by)

    def end(self, network: AffectedNetwork) -> None:
        network.put_up(self.target, self.dropped_by)

    @staticmethod
    def check(
        faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Yields each problem of the scenario's faults of this kind: (the fault's index, field,
        what is wrong). Every target must exist.
        """
        targets = {*edge_of, *edges, "edges"}
        for index, timed in enumerate(faults):
            target = timed.fault.target
            ends = target.removesuffix(f"->{ALL}").split("->")
            if len(ends) > 2 or not targets.issuperset(ends):
                text = unknown("target", target, targets)
                yield index, "target", f"{text}, or a link such as car1->edge1"
