"""What a fault did: before it, while it lasted, after it, and how long until all was as before.

The fault is the first of each method that is no hand-over. A frame, or an instant of ``held``,
belongs to the phase of its stamp, which is the component of the numbers.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.correctness import FalseObjects, HeldRatio, ObjectRecall
from genie_sim.analysis.frame_metrics import Answered, FrameShare, LookAge, WithFreshResult
from genie_sim.analysis.metric import HIGHER, LOWER, Metric, Views, Where, average
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.records import CONSUMER
from genie_sim.record.results import MethodInfo

WINDOW_NS = NS_PER_S // 2
RECOVERED = 0.95  # of the share of fresh results before the fault
PHASES = ("before", "during", "after")
FAULTS = "Around the first fault"


class PhaseFrames(NamedTuple):
    """The frames of one phase."""

    frames: Columns


class PhaseHeld(NamedTuple):
    """What is measured of what consumers hold: above and below, row by row of one phase."""

    ratio: type[HeldRatio]
    above: Any
    below: Any


class AfterFault(NamedTuple):
    """All frames of a method, and the fault's end [ns], NaN where it did not end."""

    frames: Columns
    begin_ns: int
    end_ns: float


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """The phases of the first fault of each method."""
    frames, held = tables["frames"], tables.get("held")
    if "faults" not in tables or not len(frames):
        return
    faults = tables["faults"]
    faults = faults.rows(
        np.array([fault != "hand_over" for fault in faults["fault"].tolist()], bool)
    )
    for method in methods:
        of_method = faults.where(method=method)
        if not len(of_method):
            continue
        first = of_method.by("begin_ns").rows(slice(0, 1))
        fault = int(first["begin_ns"][0]), float(first.floats("end_ns")[0])
        published = frames.where(method=method)
        for phase, rows in _phases(published, *fault):
            yield Where(method, component=phase), PhaseFrames(published.rows(rows))
        yield Where(method), AfterFault(published, *fault)
        if held is None:
            continue
        of_consumers = held.where(method=method, what=CONSUMER)
        for ratio in (ObjectRecall, FalseObjects):
            terms = [np.nan_to_num(term) for term in ratio().terms(of_consumers)]
            for phase, rows in _phases(of_consumers, *fault):
                yield (
                    Where(method, component=phase),
                    PhaseHeld(ratio, *(term[rows] for term in terms)),
                )


def _phases(rows: Columns, begin_ns: int, end_ns: float) -> Iterator[tuple[str, Any]]:
    """Each phase, and which of the rows are in it; ``end_ns`` is NaN where it did not end."""
    stamps_ns = rows["stamp_ns"]
    phases = (stamps_ns >= begin_ns).astype(int) + (stamps_ns >= end_ns)
    for number, phase in enumerate(PHASES):
        yield phase, phases == number


class FaultMetric(Metric):
    """A metric before, during or after the first fault that is no hand-over (the component)."""

    pattern: str
    """The title, with a place for the phase."""

    section = FAULTS

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.title = cls.pattern.format("around a fault")

    def titled(self, placement: str = "all", component: str = "") -> str:
        return self.pattern.format(f"{component} the fault") if component else self.title


class FaultAnswered(FaultMetric):
    """Share of the frames with any answer, before, during or after the first fault that is no
    hand-over (the component).
    """

    pattern = "frames answered {}"
    better = HIGHER
    view = PhaseFrames
    share: FrameShare = Answered()
    reads = Answered.reads

    def of(self, view: PhaseFrames) -> Measured:
        return average(self.share.flags(view.frames))


class FaultFresh(FaultAnswered):
    """Share of the frames with a fresh result, before, during or after the first fault that is no
    hand-over (the component).
    """

    pattern = "frames with a fresh result {}"
    share = WithFreshResult()
    reads = WithFreshResult.reads


class FaultLatency(FaultMetric):
    """Mean time from a frame's stamp to its first answer, before, during or after the first fault
    that is no hand-over (the component).
    """

    pattern = "first answer since the stamp {}, mean"
    unit = "ms"
    better = LOWER
    view = PhaseFrames
    reads = "frames: first_answer_ns, stamp_ns"

    def of(self, view: PhaseFrames) -> Measured:
        times_ms = (view.frames.floats("first_answer_ns") - view.frames["stamp_ns"]) / NS_PER_MS
        return average(times_ms[~np.isnan(times_ms)])


class FaultLookAge(FaultMetric):
    """Mean time from the newest frame in which a detector saw any of a first answer to its own
    frame, before, during or after the first fault that is no hand-over (the component).
    """

    pattern = "age of look {}, mean"
    unit = "ms"
    better = LOWER
    view = PhaseFrames
    reads = LookAge.reads

    def of(self, view: PhaseFrames) -> Measured:
        ages_ms = LookAge("mean").times_ms(view.frames)
        return average(ages_ms[~np.isnan(ages_ms)])


class FaultRecovery(Metric):
    """From the end of the first fault to the first half second with 95 % of the share of fresh
    results before it.
    """

    title = "recovery after a fault"
    unit = "s"
    better = LOWER
    section = FAULTS
    view = AfterFault
    reads = "frames: stamp_ns, fresh_answer_ns"

    def of(self, view: AfterFault) -> Measured:
        stamps_ns = view.frames["stamp_ns"]
        fresh = ~np.isnan(view.frames.floats("fresh_answer_ns"))
        before = fresh[stamps_ns < view.begin_ns]
        if not before.any() or np.isnan(view.end_ns):
            return Measured(None)
        enough = RECOVERED * float(before.mean())
        return Measured(_recovery_s(stamps_ns - int(view.end_ns), fresh, enough))


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


class FaultRecall(FaultMetric):
    """Share of the visible objects that consumers hold, before, during or after the first fault
    that is no hand-over (the component).
    """

    pattern = "recall of visible objects {}"
    better = HIGHER
    view = PhaseHeld
    ratio: type[HeldRatio] = ObjectRecall
    reads = "held: right, visible_static, visible_moving"

    def of(self, view: PhaseHeld) -> Measured | None:
        if view.ratio is not self.ratio:
            return None
        above, below = float(np.sum(view.above)), float(np.sum(view.below))
        return Measured(above / below if below else None, n=round(below))


class FaultFalseObjects(FaultRecall):
    """Share of the held objects that are not there, before, during or after the first fault that is
    no hand-over (the component).
    """

    pattern = "false objects {}"
    better = LOWER
    ratio = FalseObjects
    reads = "held: right, held"


METRICS = {
    "fault_answered_share": FaultAnswered(),
    "fault_fresh_share": FaultFresh(),
    "fault_latency": FaultLatency(),
    "fault_look_age": FaultLookAge(),
    "fault_recovery": FaultRecovery(),
    "fault_recall": FaultRecall(),
    "fault_ghosts": FaultFalseObjects(),
}
