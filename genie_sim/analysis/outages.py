"""What a fault did: before it, while it lasted, after it, and how long until all was as before."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from genie_sim.analysis.correctness import HELD
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric
from genie_sim.units import NS_PER_MS, NS_PER_S

WINDOW_NS = NS_PER_S // 2
RECOVERED = 0.95  # of the share of fresh results before the fault
PHASES = ("before", "during", "after")
JUDGED = {"fault_recall": "object_recall", "fault_ghosts": "ghost_share"}


def of_faults(
    faults: Columns, frames: Columns, held: Columns | None, methods: Sequence[str]
) -> Iterator[Metric]:
    """Metrics of the first fault of each method that is no hand-over, with the phase as component.

    A frame, or an instant of ``held``, belongs to the phase of its stamp.
    """
    for name in methods:
        own = faults.where(method=name)
        own = own.rows(np.array([fault != "hand_over" for fault in own["fault"].tolist()], bool))
        if not len(own):
            continue
        first = own.by("begin_ns").rows(slice(0, 1))
        begin_ns, end_ns = int(first["begin_ns"][0]), float(first.floats("end_ns")[0])
        yield from _of_frames(frames.where(method=name), name, begin_ns, end_ns)
        if held is not None:
            yield from _of_held(held.where(method=name, what="consumer"), name, begin_ns, end_ns)


def _of_frames(frames: Columns, method: str, begin_ns: int, end_ns: float) -> Iterator[Metric]:
    """Answers, fresh results, latency, age of look and recovery."""
    stamps_ns = frames["stamp_ns"]
    phases = _phases(stamps_ns, begin_ns, end_ns)
    fresh = ~np.isnan(frames.floats("fresh_answer_ns"))
    latency_ms = (frames.floats("first_answer_ns") - stamps_ns) / NS_PER_MS
    look_age_ms = np.maximum(stamps_ns - frames.floats("first_looked_ns"), 0.0) / NS_PER_MS
    answered = ~np.isnan(latency_ms)
    looked = ~np.isnan(look_age_ms)
    for number, phase in enumerate(PHASES):
        rows = phases == number
        where = (method, "all", phase)
        yield _mean("fault_answered_share", where, answered[rows], unit="1")
        yield _mean("fault_fresh_share", where, fresh[rows], unit="1")
        yield _mean("fault_latency", where, latency_ms[rows & answered], unit="ms")
        yield _mean("fault_look_age", where, look_age_ms[rows & looked], unit="ms")
    before = fresh[phases == 0]
    recovery_s = None
    if before.any() and not np.isnan(end_ns):
        recovery_s = _recovery_s(stamps_ns - int(end_ns), fresh, RECOVERED * float(before.mean()))
    yield Metric("fault_recovery", method, "all", "", value=recovery_s, unit="s")


def _phases(stamps_ns: Any, begin_ns: int, end_ns: float) -> Any:
    """Before, during or after the fault: 0, 1 or 2. ``end_ns`` is NaN where it did not end."""
    return (stamps_ns >= begin_ns).astype(int) + (stamps_ns >= end_ns)


def _mean(metric: str, where: tuple[str, str, str], values: Any, unit: str) -> Metric:
    value = float(np.mean(values)) if len(values) else None
    return Metric(metric, *where, value=value, unit=unit, n=len(values))


def _of_held(held: Columns, method: str, begin_ns: int, end_ns: float) -> Iterator[Metric]:
    """Recall and ghosts of what consumers hold."""
    phases = _phases(held["stamp_ns"], begin_ns, end_ns)
    for metric, source in JUDGED.items():
        unit, parts = HELD[source]
        above, below = (np.nan_to_num(part) for part in parts(held))
        for number, phase in enumerate(PHASES):
            part, whole = (float(np.sum(values[phases == number])) for values in (above, below))
            value = part / whole if whole else None
            yield Metric(metric, method, "all", phase, value=value, unit=unit, n=round(whole))


def _recovery_s(after_ns: Any, fresh: Any, enough: float) -> float | None:
    """When the first window of half a second begins whose share of fresh results is ``enough``;
    ``None`` if there is none.

    ``after_ns`` are the stamps of the frames since the end of the fault, ``fresh`` whether they
    have a fresh result.
    """
    for number in range(int(after_ns.max()) // WINDOW_NS + 1):
        rows = after_ns // WINDOW_NS == number
        if rows.any() and fresh[rows].mean() >= enough:
            return number * WINDOW_NS / NS_PER_S
    return None
