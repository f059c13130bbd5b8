"""A partition: some hosts and all others do not reach each other."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from genie_sim.core.messages import Message
from genie_sim.faults.targets import unknown_targets
from genie_sim.sim.bends import Bend
from genie_sim.sim.fault import AffectedNetwork, TimedFault


@dataclass(frozen=True)
class Partition:
    """The network falls into two parts: the hosts named in ``target``, and all others. Nothing gets
    from one part to the other; within each everything goes on.
    """

    target: tuple[str, ...]
    """The cars and edges of one part."""

    duration_ns = None  # for good, if nothing says when it ends
    dropped_by = "partition"

    def begin(self, network: AffectedNetwork) -> None:
        for host in self.target:
            network.bend(host, Bend(self._pass, self._pass, self.dropped_by))

    def end(self, network: AffectedNetwork) -> None:
        for host in self.target:
            network.unbend(host, Bend(self._pass, self._pass, self.dropped_by))

    def _pass(self, message: Message, other: str) -> Message | None:
        """The message, if the host at the other end is in the same part."""
        return message if other in self.target else None

    @staticmethod
    def check(
        faults: Sequence[TimedFault], edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Yields each problem of the scenario's faults of this kind."""
        hosts = [*edge_of, *edges]
        for index, timed in enumerate(faults):
            yield from unknown_targets(index, timed.fault.target, "car or edge", hosts)
            if not timed.fault.target:
                yield index, "target", "must not be empty"
