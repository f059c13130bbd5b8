"""Metrics of published frames: response times, what became of them, and improvements."""

from collections.abc import Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis.metric import (
    DEADLINE_MS,
    HIGHER,
    LOWER,
    RECENT_MS,
    Metric,
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
ANSWERS = {"first": "first answer", "fresh": "fresh result"}  # as titles and meanings say


class FrameRows(Rows):
    """The frames that were published under a method."""


class PairedFrames(NamedTuple):
    """The same frames under a method and under its baseline, for one ``answer``."""

    answer: str
    ours: Rows
    theirs: Rows


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """The frames of each method, then each method beside each baseline."""
    frames = tables["frames"]
    if not len(frames):
        return
    blocks = Blocks(frames["car"], frames["stamp_ns"], intervals)
    of_methods = {
        method: FrameRows(frames, frames["method"] == method.name, blocks, Where(method.name))
        for method in methods.values()
    }
    ran = {method: rows for method, rows in of_methods.items() if rows.chosen.any()}
    for rows in ran.values():
        yield rows.where, rows
    baselines = [rows for method, rows in ran.items() if method.baseline]
    others = [rows for method, rows in ran.items() if not method.baseline]
    for answer, ours, theirs in product(ANSWERS, others, baselines):
        where = Where(ours.where.method, component=theirs.where.method)
        yield where, PairedFrames(answer, ours, theirs)


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

    span: str
    """From when to when, as its meaning ends."""

    def __init__(self, statistic: str) -> None:
        self._statistic = statistic
        name, words = STATISTICS[statistic]
        self.title, self.meaning = f"{self.title}, {name}", f"{words} {self.span}"

    def times_ms(self, frames: Columns) -> Floats:
        """Of each frame; NaN where there is none."""
        raise NotImplementedError

    def terms(self, rows: Columns) -> tuple[Any, Any]:
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


class ResponseTime(FrameTime):
    """Time until a frame has an answer."""

    def __init__(self, answer: str, statistic: str) -> None:
        self._answer = answer
        self.title = ANSWERS[answer]
        self.span = (
            f"from when a frame reaches the queue of its first ROS node to its {self.title}."
        )
        self.reads = f"frames: received_ns, {answer}_answer_ns"
        super().__init__(statistic)

    def times_ms(self, frames: Columns) -> Floats:
        return response_ms(frames, self._answer)


class LookAge(FrameTime):
    """How old a first answer is."""

    title = "age of look"
    span = "from the newest frame in which a detector saw any of a first answer to its own frame."
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

    def terms(self, rows: Columns) -> tuple[Any, Any]:
        return self.flags(rows), np.ones(len(rows))


class Answered(FrameShare):
    """Share of all published frames with any answer."""

    title = "frames answered"
    better = HIGHER
    reads = "frames: first_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return ~np.isnan(frames.floats("first_answer_ns"))


class InTime(FrameShare):
    """Share of the frames with an answer in time."""

    better = HIGHER
    section = TIMES

    def __init__(self, answer: str) -> None:
        self._answer = answer
        self.title = f"{ANSWERS[answer]} within {DEADLINE_MS:g} ms"
        self.meaning = f"Share of all published frames with a {self.title}."
        self.reads = f"frames: received_ns, {answer}_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return response_ms(frames, self._answer) < DEADLINE_MS


class WithFreshResult(FrameShare):
    """Share of all published frames for which a detector looked at this very frame."""

    title = "frames with a fresh result"
    better = HIGHER
    reads = "frames: fresh_answer_ns"

    def flags(self, frames: Columns) -> Any:
        return ~np.isnan(frames.floats("fresh_answer_ns"))


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


class FramesPublished(Metric):
    """Frames that cameras published."""

    title = "published frames"
    unit = "frames"
    view = FrameRows

    def of(self, view: FrameRows) -> Measured:
        published = int(view.chosen.sum())
        return Measured(published, n=published)


class FrameCount(FramesPublished):
    """How many frames a share counts."""

    def __init__(self, title: str, share: FrameShare) -> None:
        self.title, self.better, self.reads = title, share.better, share.reads
        self.meaning = share.meaning.replace("Share of all published frames", "Published frames")
        self._share = share

    def of(self, view: FrameRows) -> Measured:
        count = int((view.chosen & self._share.flags(view.table)).sum())
        return Measured(count, n=int(view.chosen.sum()))


class FreshThroughput(Metric):
    """Frames that got a fresh result, per second, summed over the cars: of each in the time from
    its first frame to the last answer.
    """

    title = "throughput of fresh results"
    unit = "1/s"
    better = HIGHER
    section = FRAMES
    view = FrameRows
    reads = "frames: car, stamp_ns, first_answer_ns, fresh_answer_ns"

    def of(self, view: FrameRows) -> Measured:
        names = ("stamp_ns", "first_answer_ns", "fresh_answer_ns")
        rates, n = [], 0
        for _, of_car in view.rows.groups("car"):
            instants = np.concatenate([of_car.floats(name) for name in names])
            seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
            count = int((~np.isnan(of_car.floats("fresh_answer_ns"))).sum())
            n += count
            if seconds > 0:
                rates.append(count / seconds)
        return Measured(sum(rates) if rates else None, n=n)


class Improvement(Metric):
    """How much shorter the mean time is than that of a baseline."""

    better = HIGHER
    section = IMPROVEMENTS
    view = PairedFrames

    def __init__(self, answer: str) -> None:
        self._answer = answer
        self.title = f"improvement of the mean {ANSWERS[answer]}"
        self.meaning = f"1 - mean {ANSWERS[answer]} of the method / that of the baseline."
        self.reads = f"frames: received_ns, {answer}_answer_ns"

    def titled(self, placement: str = "all", component: str = "") -> str:
        return f"{self.title} over {component}" if component else self.title

    def of(self, view: PairedFrames) -> Measured | None:
        """Both methods see the same frames, so their blocks are paired."""
        if view.answer != self._answer:
            return None
        times_ms = response_ms(view.ours.table, self._answer)
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


METRICS = {
    "first_answer_mean": ResponseTime("first", "mean"),
    "first_answer_p50": ResponseTime("first", "p50"),
    "first_answer_p95": ResponseTime("first", "p95"),
    "first_answer_p99": ResponseTime("first", "p99"),
    "fresh_answer_mean": ResponseTime("fresh", "mean"),
    "fresh_answer_p50": ResponseTime("fresh", "p50"),
    "fresh_answer_p95": ResponseTime("fresh", "p95"),
    "fresh_answer_p99": ResponseTime("fresh", "p99"),
    "look_age_mean": LookAge("mean"),
    "look_age_p95": LookAge("p95"),
    "answered_share": Answered(),
    "under_deadline_share": InTime("first"),
    "fresh_answered_share": WithFreshResult(),
    "fresh_under_deadline_share": InTime("fresh"),
    "recent_share": WithRecentResult(),
    "dropped_share": Dropped(),
    "in_flight_share": InFlight(),
    "empty_answer_share": EmptyAnswer(),
    "frames_published": FramesPublished(),
    "frames_answered": FrameCount("answered frames", Answered()),
    "frames_dropped": FrameCount("dropped frames", Dropped()),
    "frames_in_flight": FrameCount("frames in flight", InFlight()),
    "fresh_answer_throughput": FreshThroughput(),
    "improvement_first_answer": Improvement("first"),
    "improvement_fresh_answer": Improvement("fresh"),
}
