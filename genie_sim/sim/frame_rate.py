"""How many frames a second were recorded, and which of them a slower camera takes."""

from collections.abc import Sequence

from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Frame


def recorded_rate(frames: Sequence[Frame]) -> float:
    """How many frames a second there are, on average; 0 where that is not known."""
    span_ns = frames[-1].stamp_ns - frames[0].stamp_ns
    return (len(frames) - 1) * NS_PER_S / span_ns if span_ns else 0.0


def thinned(frames: Sequence[Frame], rate: float) -> list[Frame]:
    """Those of some frames that a camera of ``rate`` frames a second takes: the first, and then
    always the one nearest to when the next is due. Where none was recorded it takes none.
    """
    if len(frames) < 2:
        return list(frames)
    gap_ns, early_ns = NS_PER_S / rate, NS_PER_S / recorded_rate(frames) / 2
    selection, due_ns = [], float(frames[0].stamp_ns)
    for frame in frames:
        if frame.stamp_ns >= due_ns - early_ns:
            selection.append(frame)
            skips = (frame.stamp_ns - due_ns + early_ns) // gap_ns
            due_ns += (skips + 1) * gap_ns
    return selection
