"""Checks of what faults befall."""

from collections.abc import Collection, Iterator, Sequence

from genie_sim.base.errors import unknown
from genie_sim.sim.fault import TimedFault


def check_targets(
    faults: Sequence[TimedFault], what: str, known: Collection[str]
) -> Iterator[tuple[int, str, str]]:
    """Yields (index, field, problem) of each fault whose target is not ``known``; ``what`` says
    what it should be.
    """
    for index, timed in enumerate(faults):
        yield from unknown_targets(index, timed.fault.target, what, known)


def unknown_targets(
    index: int, target: str | Sequence[str], what: str, known: Collection[str]
) -> Iterator[tuple[int, str, str]]:
    """Yields the problem of each target of one fault, of which there may be several."""
    for host in (target,) if isinstance(target, str) else target:
        if host not in known:
            yield index, "target", unknown(what, host, known)
