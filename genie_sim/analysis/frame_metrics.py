"""Metrics of published frames: response times, what became of them, improvements, and parts."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    DEADLINE_MS,
    HIGHER,
    LOWER,
    RECENT_MS,
    MetricDefinition,
    Ratio,
    Rows,
    Views,
    Where,
)
from genie_sim.analysis.statistics import Blocks, Measured, around, mean, percentile
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.record.columns import Columns, Floats
from genie_sim.record.results import MethodInfo

TIMES, FRAMES, IMPROVEMENTS = "Response times", "Published frames", "Improvements"
STATISTICS = {  # how the title ends, and how the meaning begins
    "mean": ("mean", "Mean time"),
    "p50": ("median", "Median time"),
    "p95": ("p95", "95th percentile of the time"),
    "p99": ("p99", "99th percentile of the time"),
}
# what each part of a mean took, by answer
PART = {"first": "first_answer_part", "fresh": "fresh_answer_part"}


class FrameRows(Rows):
    """The frames that were published under a method."""


class PairedFrames(NamedTuple):
    """The same frames under a method and under its baseline, for one ``answer``."""

    answer: str
    ours: Rows
    theirs: Rows


class PartOfTime(NamedTuple):
    """What a part took of all frames that got an answer [ns], and how many these are."""

    answer: str
    sum_ns: float
    n: int


def views(frames: Columns, methods: Sequence[MethodInfo], intervals: bool) -> Views:
    """The frames of each method, then each method beside each baseline."""
    blocks = Blocks(frames["car"], frames["stamp_ns"], intervals)
    of_methods = {
        method: FrameRows(frames, frames["method"] == method.name, blocks, Where(method.name))
        for method in methods
    }
    ran = {method: rows for method, rows in of_methods.items() if rows.chosen.any()}
    for rows in ran.values():
        yield rows.where, rows
    baselines = [rows for method, rows in ran.items() if method.baseline]
    others = [rows for method, rows in ran.items() if not method.baseline]
    for answer, ours, theirs in product(PART, others, baselines):
        where = Where(ours.where.method, component=theirs.where.method)
        yield where, PairedFrames(answer, ours, theirs)


def part_views(steps: Columns, frames: Columns, methods: Sequence[str]) -> Views:
    """Each part of the time of each method's answers, with the part as component."""
    for method, answer in product(methods, PART):
        answered = frames.where(method=method).floats(f"{answer}_answer_ns")
        n = int((~np.isnan(answered)).sum())
        rows = steps.where(method=method)
        rows = rows.rows(rows["which"].isin((answer, "both")))
        parts = rows["part"]
        sums_ns = np.bincount(parts.codes, rows["end_ns"] - rows["begin_ns"], len(parts.names))
        for part, sum_ns in zip(parts.names, sums_ns.tolist(), strict=True):
            if n and sum_ns:
                yield Where(method, component=part), PartOfTime(answer, sum_ns, n)


def response_ms(frames: Columns, answer: str) -> Floats:
    """From received to the ``first`` or the ``fresh`` answer, in milliseconds; NaN where there is
    none.
    """
    return (frames.floats(f"{answer}_answer_ns") - frames.floats("received_ns")) / NS_PER_MS


class FrameTime(Ratio):
    """Time of frames, of which one statistic is the metric."""

    unit = "ms"
    better = LOWER
    section = TIMES
    view = FrameRows
    table = "frames"

    def __init__(self, statistic: str) -> None:
        self._statistic = statistic
        self.title = f"{self.title}, {STATISTICS[statistic][0]}"

    @property
    def meaning(self) -> str:
        return super().meaning.replace("Time", STATISTICS[self._statistic][1], 1)

    def times_ms(self, frames: Columns) -> Floats:
        """Of each frame; NaN where there is none."""
        raise NotImplementedError

    def parts(self, rows: Columns) -> tuple[Any, Any]:
        """The mean as a ratio of sums."""
        times_ms = self.times_ms(rows)
        return np.nan_to_num(times_ms), ~np.isnan(times_ms)

    def of(self, view: Rows) -> Measured:
        times_ms = np.where(view.chosen, self.times_ms(view.table), np.nan)
        return statistic_of(self._statistic, view.blocks, times_ms)


def statistic_of(statistic: str, blocks: Blocks, values: Floats) -> Measured:
    """The mean or a percentile of the values that are not NaN."""
    if statistic == "mean":
        return mean(blocks, values)
    return percentile(blocks, values, int(statistic.removeprefix("p")))


class FirstAnswer(FrameTime):
    """Time from when a frame reaches the queue of its first ROS node to its first answer."""

    title = "first answer"
    reads = "frames: received_ns, first_answer_ns"

    def times_ms(self, frames: Columns) -> Floats:
        return response_ms(frames, "first")


class FreshResult(FrameTime):
    """Time from when a frame reaches the queue of its first ROS node to its fresh result."""

    title = "fresh result"
    reads = "frames: received_ns, fresh_answer_ns"

    def times_ms(self, frames: Columns) -> Floats:
        return response_ms(frames, "fresh")


class LookAge(FrameTime):
    """Time from the newest frame in which a detector saw any of a first answer to its own frame."""

    title = "age of look"
    reads = "frames: stamp_ns, first_looked_ns"

    def times_ms(self, frames: Columns) -> Floats:
        age_ns = frames.floats("stamp_ns") - frames.floats("first_looked_ns")
        return np.maximum(age_ns, 0.0) / NS_PER_MS


class FrameShare(Ratio):
    """A share of the published frames."""

    section = FRAMES
    view = FrameRows
    table = "frames"

    def flags(self, frames: Columns) -> Any:
        """Which frames count."""
        raise NotImplementedError

    def parts(self, rows: Columns) -> tuple[Any, Any]:
        return self.flags(rows), np.ones(len(rows))


class Answered(FrameShare):
    """Share of all published frames with any answer."""

    title = "frames answered"
    better = HIGHER
    reads = "frames: first_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return ~np.isnan(frames.floats("first_answer_ns"))


class FirstInTime(FrameShare):
    """Share of all published frames with a first answer within 33 ms."""

    title = f"first answer within {DEADLINE_MS:g} ms"
    better = HIGHER
    section = TIMES
    answer = "first"
    reads = "frames: received_ns, first_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return response_ms(frames, self.answer) < DEADLINE_MS


class FirstInTimeOfAnswered(FirstInTime):
    """Share of the answered frames with a first answer within 33 ms."""

    title = f"{FirstInTime.title}, of answered frames"
    section = ""

    def parts(self, rows: Columns) -> tuple[Any, Any]:
        return self.flags(rows), ~np.isnan(rows.floats("first_answer_ns"))


class WithFreshResult(FrameShare):
    """Share of all published frames for which a detector looked at this very frame."""

    title = "frames with a fresh result"
    better = HIGHER
    reads = "frames: fresh_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return ~np.isnan(frames.floats("fresh_answer_ns"))


class FreshInTime(FirstInTime):
    """Share of all published frames with a fresh result within 33 ms."""

    title = f"fresh result within {DEADLINE_MS:g} ms"
    answer = "fresh"
    reads = FreshResult.reads


class WithRecentResult(FrameShare):
    """Share of all published frames with an answer from a look at most 100 ms older."""

    title = "frames with a recent result"
    better = HIGHER
    reads = "frames: stamp_ns, looked_ns"

    def flags(self, frames: Columns) -> Any:
        age_ns = frames.floats("stamp_ns") - frames.floats("looked_ns")
        return age_ns / NS_PER_MS <= RECENT_MS


class Dropped(FrameShare):
    """Share of all published frames that a queue or a link dropped."""

    title = "frames dropped"
    better = LOWER
    reads = "frames: first_answer_ns, drop"

    def flags(self, frames: Columns) -> Any:
        return np.isnan(frames.floats("first_answer_ns")) & frames["drop"].has_text


class InFlight(FrameShare):
    """Share of all published frames still unanswered at the end."""

    title = "frames in flight"
    reads = "frames: first_answer_ns, drop"

    def flags(self, frames: Columns) -> Any:
        return np.isnan(frames.floats("first_answer_ns")) & ~frames["drop"].has_text


class EmptyAnswer(FrameShare):
    """Share of all published frames whose first answer holds no object."""

    title = "frames with an empty first answer"
    reads = "frames: first_answer_ns, objects_served"

    def flags(self, frames: Columns) -> Any:
        answered = ~np.isnan(frames.floats("first_answer_ns"))
        return answered & (frames.floats("objects_served") == 0)


class FramesPublished(MetricDefinition):
    """Frames that cameras published."""

    title = "published frames"
    unit = "frames"
    view = FrameRows

    def of(self, view: FrameRows) -> Measured:
        published = int(view.chosen.sum())
        return Measured(published, n=published)


class FrameCount(FramesPublished):
    """How many frames a share counts."""

    share: FrameShare

    def of(self, view: FrameRows) -> Measured:
        count = int((view.chosen & self.share.flags(view.table)).sum())
        return Measured(count, n=int(view.chosen.sum()))


class FramesAnswered(FrameCount):
    """Frames with any answer."""

    title = "answered frames"
    better = HIGHER
    share = Answered()
    reads = "frames: first_answer_ns"


class FramesDropped(FrameCount):
    """Frames that a queue or a link dropped."""

    title = "dropped frames"
    better = LOWER
    share = Dropped()
    reads = "frames: first_answer_ns, drop"


class FramesInFlight(FrameCount):
    """Frames still unanswered at the end."""

    title = "frames in flight"
    share = InFlight()
    reads = "frames: first_answer_ns, drop"


class FreshThroughput(MetricDefinition):
    """Frames that got a fresh result, per second."""

    title = "throughput of fresh results"
    unit = "1/s"
    better = HIGHER
    section = FRAMES
    view = FrameRows
    reads = "frames: stamp_ns, first_answer_ns, fresh_answer_ns"

    def of(self, view: FrameRows) -> Measured:
        """From the first stamp to the last instant on record."""
        frames = view.rows
        names = ("stamp_ns", "first_answer_ns", "fresh_answer_ns")
        instants = np.concatenate([frames.floats(name) for name in names])
        seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
        count = int((~np.isnan(frames.floats("fresh_answer_ns"))).sum())
        return Measured(count / seconds if seconds > 0 else None, n=count)


class Improvement(MetricDefinition):
    """1 - a mean time of the method / that of the baseline."""

    better = HIGHER
    section = IMPROVEMENTS
    view = PairedFrames
    answer: str

    def titled(self, placement: str = "all", component: str = "") -> str:
        return f"{self.title} over {component}" if component else self.title

    def of(self, view: PairedFrames) -> Measured | None:
        """Both methods see the same frames, so their blocks are paired."""
        if view.answer != self.answer:
            return None
        times_ms = response_ms(view.ours.table, self.answer)
        known = ~np.isnan(times_ms)
        of_both, moves = [], []
        for rows in (view.ours, view.theirs):
            answered = rows.chosen & known
            if not answered.any():
                return Measured(None)
            of_both.append(times_ms[answered])
            moves.append(
                rows.blocks.influence(np.where(answered, times_ms, 0.0), answered.astype(float))
            )
        ours, theirs = (float(times_ms.mean()) for times_ms in of_both)
        if not theirs:
            return Measured(None)
        half = view.ours.blocks.half_width(moves[0] / theirs - ours / theirs**2 * moves[1])
        value = 1 - ours / theirs
        return Measured(value, *around(value, half), min(map(len, of_both)))


class ImprovementOfFirst(Improvement):
    """1 - mean first answer of the method / that of the baseline."""

    title = "improvement of the mean first answer"
    answer = "first"
    reads = "frames: received_ns, first_answer_ns"


class ImprovementOfFresh(Improvement):
    """1 - mean fresh result of the method / that of the baseline."""

    title = "improvement of the mean fresh result"
    answer = "fresh"
    reads = "frames: received_ns, fresh_answer_ns"


class PartOfFirst(MetricDefinition):
    """Mean time that a part takes from when a frame reaches the queue of its first ROS node to its
    first answer.
    """

    title = "part of the first answer"
    unit = "ms"
    better = LOWER
    view = PartOfTime
    answer = "first"
    reads = "steps: which, part, begin_ns, end_ns; frames: first_answer_ns"

    def of(self, view: PartOfTime) -> Measured | None:
        """Over all frames that got the answer; the parts add up to the mean response time."""
        if view.answer != self.answer:
            return None
        return Measured(view.sum_ns / view.n / NS_PER_MS, n=view.n)


class PartOfFresh(PartOfFirst):
    """Mean time that a part takes from when a frame reaches the queue of its first ROS node to its
    fresh result.
    """

    title = "part of the fresh result"
    answer = "fresh"
    reads = "steps: which, part, begin_ns, end_ns; frames: fresh_answer_ns"


METRICS = {
    "first_answer_mean": FirstAnswer("mean"),
    "first_answer_p50": FirstAnswer("p50"),
    "first_answer_p95": FirstAnswer("p95"),
    "first_answer_p99": FirstAnswer("p99"),
    "fresh_answer_mean": FreshResult("mean"),
    "fresh_answer_p50": FreshResult("p50"),
    "fresh_answer_p95": FreshResult("p95"),
    "fresh_answer_p99": FreshResult("p99"),
    "look_age_mean": LookAge("mean"),
    "look_age_p50": LookAge("p50"),
    "look_age_p95": LookAge("p95"),
    "look_age_p99": LookAge("p99"),
    "answered_share": Answered(),
    "under_deadline_share": FirstInTime(),
    "fresh_answered_share": WithFreshResult(),
    "fresh_under_deadline_share": FreshInTime(),
    "recent_share": WithRecentResult(),
    "dropped_share": Dropped(),
    "in_flight_share": InFlight(),
    "empty_answer_share": EmptyAnswer(),
    "under_deadline_share_of_answered": FirstInTimeOfAnswered(),
    "frames_published": FramesPublished(),
    "frames_answered": FramesAnswered(),
    "frames_dropped": FramesDropped(),
    "frames_in_flight": FramesInFlight(),
    "fresh_answer_throughput": FreshThroughput(),
    "improvement_first_answer": ImprovementOfFirst(),
    "improvement_fresh_answer": ImprovementOfFresh(),
    "first_answer_part": PartOfFirst(),
    "fresh_answer_part": PartOfFresh(),
}
