"""An outage: links carry nothing."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from genie_sim.errors import unknown

if TYPE_CHECKING:
    from genie_sim.sim.fault import TimedFault
    from genie_sim.sim.world import World


@dataclass(frozen=True)
class Outage:
    """The links at ``target`` are down: a car's, an edge's, those between ``edges``, or one such as ``car1->edge1``.

    A message is lost whose last bit leaves while the link is down.
    """

    target: str

    duration_ns = None  # until it is over; for good if nothing says when

    @property
    def dropped_by(self) -> str:
        return "outage"

    def begin(self, world: "World") -> None:
        world.outages.append((self.target, self.dropped_by))
        for link in world.links_at(self.target):
            link.down_by.append(self.dropped_by)

    def end(self, world: "World") -> None:
        world.outages.remove((self.target, self.dropped_by))
        for link in world.links_at(self.target):
            link.down_by.remove(self.dropped_by)

    @staticmethod
    def check(
        mine: "Sequence[TimedFault]", edge_of: Mapping[str, str | None], edges: Collection[str]
    ) -> Iterator[tuple[int, str, str]]:
        """Every target is there: (which fault, field, what is wrong)."""
        known = {*edge_of, *edges, "edges"}
        for place, timed in enumerate(mine):
            ends = timed.fault.target.split("->")
            if len(ends) > 2 or not known.issuperset(ends):
                yield (
                    place,
                    "target",
                    f"{unknown('target', timed.fault.target, known)}, or a link such as car1->edge1",
                )
