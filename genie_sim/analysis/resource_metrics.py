"""Metrics of devices, links and queues, each of which is the component of its numbers.

Utilization, mean queue and throughput are those of the time in which their host takes frames: of a
car and its links from its start to its last frame, of an edge until the last frame of all. The
other counts are those at the end of the run. Queues are counted at each change, not at samples.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from genie_sim.analysis.metric import LOWER, Metric, Views, Where
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns, Floats
from genie_sim.record.results import MethodInfo


class UseSpan(NamedTuple):
    """From one instant to another [ns]."""

    begin_ns: float
    end_ns: float


class Samples:
    """The samples of one resource, in order of time, and the ``seconds`` in which its host takes
    frames.

    Parameters
    ----------
    rows : Columns
        The samples.
    span : UseSpan
        From one of the instants at which resources are sampled to another.
    counted_ns : float
        The end of the warm-up.
    """

    def __init__(self, rows: Columns, span: UseSpan, counted_ns: float = 0.0) -> None:
        self.all = rows
        self.seconds = max(span.end_ns - span.begin_ns, 0.0) / NS_PER_S
        t_ns = rows["t_ns"]
        self.n = int(((t_ns >= span.begin_ns) & (t_ns <= span.end_ns)).sum())
        self._span, self._counted_ns = span, counted_ns

    def during(self, column: str) -> float:
        """How much a count grew in that time."""
        return self._until(column, self._span.end_ns) - self._until(column, self._span.begin_ns)

    def in_all(self, column: str) -> int:
        """How much it grew from the end of the warm-up to the end of the run."""
        return int(self.all[column][-1] - self._until(column, self._counted_ns))

    def _until(self, column: str, instant_ns: float) -> float:
        """The count at an instant; before its first sample it was 0."""
        row = int(np.searchsorted(self.all["t_ns"], instant_ns, side="right")) - 1
        return float(self.all[column][row]) if row >= 0 else 0.0


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """Each resource under each method; a link has the placement ``all``."""
    if "resources" not in tables:
        return
    ordered = tables["resources"].by("t_ns")
    for method in methods:
        of_method = ordered.where(method=method)
        counted_ns, spans = driven(tables, method)
        instants_ns = np.union1d([0.0], of_method.floats("t_ns"))
        whole = UseSpan(counted_ns, max((span.end_ns for span in spans.values()), default=np.inf))
        for name, samples in of_method.groups("resource"):
            hosts = re.sub(r"(\.accelerator|\.cpu|\.channel|/.*)$", "", name).split("->")
            (span,) = [spans[host] for host in hosts if host in spans] or [whole]
            placement = "all" if len(hosts) > 1 else "edge" if span is whole else "car"
            sampled = _sampled(span, instants_ns)
            yield Where(method, placement, name), Samples(samples, sampled, counted_ns)


def driven(tables: Mapping[str, Columns], method: str) -> tuple[float, dict[str, UseSpan]]:
    """The end of the warm-up, and from the start of each car to its last frame, by the car."""
    frames, begins_ns, cars = tables["frames"].where(method=method), {}, []
    if "hosts" in tables:
        hosts = tables["hosts"].where(method=method)
        begins_ns = dict(zip(hosts["host"].tolist(), hosts["begin_ns"].tolist(), strict=True))
        cars = hosts.where(placement="car")["host"].tolist()
    ends_ns = {car: float(of_car["stamp_ns"].max()) for car, of_car in frames.groups("car")}
    counted_ns = min(begins_ns.values(), default=0)
    return counted_ns, {
        car: UseSpan(begins_ns.get(car, counted_ns), ends_ns.get(car, 0.0))
        for car in (*ends_ns, *cars)
    }


def _sampled(span: UseSpan, instants_ns: Floats) -> UseSpan:
    """The part of a time between the first and the last sample within it."""
    within = instants_ns[(instants_ns >= span.begin_ns) & (instants_ns <= span.end_ns)]
    return UseSpan(float(within[0]), float(within[-1])) if len(within) else UseSpan(0.0, 0.0)


def running_use(samples: Columns) -> tuple[Floats, Floats]:
    """Of one resource, in order of time: the instants of its samples [ns], 0 before them, and the
    time that each of its servers has worked until then [ns]. For a queue: its length times how long
    it had that.
    """
    t_ns = np.concatenate([[0.0], samples.floats("t_ns")])
    capacity = samples.floats("capacity")
    if np.isnan(capacity).any():
        return t_ns, np.concatenate([[0.0], samples.floats("queue_ns")])
    return t_ns, np.concatenate([[0.0], samples.floats("busy_ns")]) / float(capacity[0])


class ResourceMetric(Metric):
    """A metric of a resource."""

    view = Samples

    def titled(self, placement: str = "all", component: str = "") -> str:
        return f"{self.title}, {component}" if component else self.title


class Utilization(ResourceMetric):
    """Share of the time in which a device or link works; on a car, of the time in which it
    drives. That of a channel is the channel busy ratio where the host is.
    """

    title = "utilization"
    better = LOWER
    reads = "resources: t_ns, busy_ns, capacity"

    def of(self, view: Samples) -> Measured | None:
        capacity = view.all.floats("capacity")[-1]
        if np.isnan(capacity) or not view.seconds:
            return None
        busy_s = view.during("busy_ns") / NS_PER_S
        return Measured(busy_s / (float(capacity) * view.seconds), n=view.n)


class QueueMean(ResourceMetric):
    """Mean number of messages that wait, over time; on a car, over the time in which it drives."""

    title = "queue length, mean"
    unit = "messages"
    better = LOWER
    reads = "resources: t_ns, queue_ns"

    def of(self, view: Samples) -> Measured | None:
        if not view.seconds:
            return None
        waited_s = view.during("queue_ns") / NS_PER_S
        return Measured(waited_s / view.seconds, n=view.n)


class Throughput(ResourceMetric):
    """Messages completed per second; on a car, of the time in which it drives."""

    title = "throughput"
    unit = "1/s"
    reads = "resources: t_ns, completed"

    def of(self, view: Samples) -> Measured | None:
        if not view.seconds:
            return None
        return Measured(view.during("completed") / view.seconds, n=view.n)


class QueueMax(ResourceMetric):
    """The most messages that wait at a time."""

    title = "queue length, maximum"
    unit = "messages"
    better = LOWER
    reads = "resources: queue_max"

    def of(self, view: Samples) -> Measured:
        return Measured(int(view.all["queue_max"][-1]), n=len(view.all))


class Completed(ResourceMetric):
    """Messages completed until the end."""

    title = "messages completed"
    unit = "messages"
    reads = "resources: completed"

    def of(self, view: Samples) -> Measured:
        return Measured(view.in_all("completed"), n=len(view.all))


class MessagesDropped(ResourceMetric):
    """Messages dropped until the end."""

    title = "messages dropped"
    unit = "messages"
    better = LOWER
    reads = "resources: dropped"

    def of(self, view: Samples) -> Measured:
        return Measured(view.in_all("dropped"), n=len(view.all))


class BytesCarried(ResourceMetric):
    """Bytes that a link carried until the end."""

    title = "bytes carried"
    unit = "B"
    reads = "resources: bytes"

    def of(self, view: Samples) -> Measured | None:
        if np.isnan(view.all.floats("bytes")[-1]):
            return None
        return Measured(view.in_all("bytes"), n=len(view.all))


METRICS = {
    "utilization": Utilization(),
    "queue_mean": QueueMean(),
    "throughput": Throughput(),
    "queue_max": QueueMax(),
    "completed": Completed(),
    "dropped": MessagesDropped(),
    "bytes": BytesCarried(),
}
