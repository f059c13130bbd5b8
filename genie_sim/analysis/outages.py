"""What a fault did: before it, while it lasted, after it, and how long until all was as before.

The fault is the first of each method that is no hand-over. A frame, or an instant of ``held``,
belongs to the phase of its stamp, which is the component of the numbers.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.correctness import false_objects, recall, without_interval
from genie_sim.analysis.frame_metrics import is_answered
from genie_sim.analysis.metric import HIGHER, LOWER, Given, MethodTables, Metric, average
from genie_sim.analysis.statistics import Estimate
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER

WINDOW_NS = NS_PER_S // 2
RECOVERED = 0.95  # of the share of fresh results before the fault
PHASES = ("before", "during", "after")
FAULTS_SECTION = "Around the first fault"


class Fault(NamedTuple):
    """All frames of a method, and the fault's begin and end [ns], NaN where it did not end."""

    frames: Columns
    begin_ns: int
    end_ns: float


def views(tables: MethodTables) -> Iterator[Given]:
    """The phases of a method's first fault, and the fault."""
    if "faults" not in tables or "frames" not in tables:
        return
    faults = tables["faults"]
    faults = faults.rows(faults["fault"] != "hand_over").by("begin_ns")
    if not len(faults):
        return
    fault = Fault(tables["frames"], int(faults["begin_ns"][0]), float(faults.floats("end_ns")[0]))
    yield from _phases("frames of a phase", fault.frames, fault)
    if "held" in tables:
        yield from _phases("held in a phase", tables["held"].where(what=CONSUMER), fault)
    yield Given("fault", fault)


def _phases(kind: str, rows: Columns, fault: Fault) -> Iterator[Given]:
    stamps_ns = rows["stamp_ns"]
    phases = (stamps_ns >= fault.begin_ns).astype(int) + (stamps_ns >= fault.end_ns)
    for number, phase in enumerate(PHASES):
        yield Given(kind, rows.rows(phases == number), component=phase)


def _recovery(fault: Fault) -> Estimate:
    after_ns = fault.frames["stamp_ns"] - fault.end_ns
    is_fresh = is_answered(fault.frames, "fresh")
    before = is_fresh[fault.frames["stamp_ns"] < fault.begin_ns]
    if before.any() and not np.isnan(fault.end_ns):
        windows = after_ns // WINDOW_NS
        for window in np.unique(windows[windows >= 0]):
            if is_fresh[windows == window].mean() >= RECOVERED * float(before.mean()):
                return Estimate(float(window) * WINDOW_NS / NS_PER_S)
    return Estimate(None)


def _around(title: str, better: str, meaning: str, formula: Any, kind: str) -> Metric:
    return Metric(
        f"{title} around a fault",
        "%",
        better,
        FAULTS_SECTION,
        meaning=f"{meaning}, before, during or after the first fault that is no hand-over (the "
        "component).",
        formula=formula,
        kind=kind,
    )


METRICS = {
    "fault_fresh_share": _around(
        "frames with a fresh result",
        HIGHER,
        "Share of the frames with a fresh result",
        lambda frames: average(is_answered(frames, "fresh")),
        "frames of a phase",
    ),
    "fault_recovery": Metric(
        "recovery after a fault",
        "s",
        LOWER,
        FAULTS_SECTION,
        meaning="From the end of the first fault to the first half second with 95 % of the share "
        "of fresh results before it.",
        formula=_recovery,
        kind="fault",
    ),
    "fault_recall": _around(
        "recall of visible objects",
        HIGHER,
        "Share of the visible objects that consumers hold",
        lambda held: without_interval(recall(held)),
        "held in a phase",
    ),
    "fault_ghosts": _around(
        "false objects",
        LOWER,
        "Share of the held objects that are not right",
        lambda held: without_interval(false_objects(held)),
        "held in a phase",
    ),
}
