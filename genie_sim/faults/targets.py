"""What faults befall: one host each, or several."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import ClassVar, Literal

from genie_sim.base.errors import unknown
from genie_sim.sim.fault import TimedFault

Problem = tuple[int, str, str]  # the fault's index, the field, and what is wrong with it


class FaultOfHost:
    """The base of faults that befall one host, their ``target``."""

    befalls: ClassVar[Literal["car", "car or edge"]] = "car or edge"
    """What may be the target."""

    duration_ns = None  # for good, if nothing says when it ends
    target: str

    @classmethod
    def check(
        cls,
        faults: Sequence[TimedFault],
        edge_of: Mapping[str, str | None],
        edges: Collection[str],
    ) -> Iterator[Problem]:
        """Yields each problem of the scenario's faults of this kind."""
        hosts = edge_of if cls.befalls == "car" else [*edge_of, *edges]
        for index, timed in enumerate(faults):
            yield from unknown_targets(index, timed.fault.target, cls.befalls, hosts)


def unknown_targets(
    index: int, target: str | Sequence[str], what: str, known: Collection[str]
) -> Iterator[Problem]:
    """Yields the problem of each target of one fault, of which there may be several; ``what`` says
    what they should be.
    """
    for host in (target,) if isinstance(target, str) else target:
        if host not in known:
            yield index, "target", unknown(what, host, known)
