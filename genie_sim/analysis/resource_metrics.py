"""Metrics of devices, links and queues, each of which is the component of its numbers.

Utilization, mean queue and throughput are those until the last frame was published (afterwards a
run only waits for answers); the other counts are those at its end. Queues are counted at each
change, not at samples.
"""

import re
from collections.abc import Mapping

import numpy as np

from genie_sim.analysis.metric import LOWER, MetricDefinition, Views, Where
from genie_sim.analysis.statistics import Measured
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns, Floats
from genie_sim.record.results import MethodInfo


class Samples:
    """The samples of one resource, in order of time, and those of the ``seconds`` until the last
    frame was published.
    """

    def __init__(self, rows: Columns, last_stamp_ns: float) -> None:
        self.all = rows
        self.active = rows.rows(rows["t_ns"] <= last_stamp_ns)
        self.seconds = float(self.active["t_ns"].max()) / NS_PER_S if len(self.active) else 0.0


def views(
    tables: Mapping[str, Columns], methods: Mapping[str, MethodInfo], intervals: bool
) -> Views:
    """Each resource under each method; a link has the placement ``all``."""
    if "resources" not in tables:
        return
    ordered, frames = tables["resources"].by("t_ns"), tables["frames"]
    cars = set(frames["car"].unique())
    for method in methods:
        stamps = frames["stamp_ns"][frames["method"] == method]
        last_stamp_ns = stamps.max() if len(stamps) else np.inf
        for name, samples in ordered.where(method=method).groups("resource"):
            host = re.sub(r"(\.accelerator|\.cpu|/.*)$", "", name)
            placement = "all" if "->" in name else "car" if host in cars else "edge"
            yield Where(method, placement, name), Samples(samples, last_stamp_ns)


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


class ResourceMetric(MetricDefinition):
    """A metric of a resource."""

    view = Samples

    def titled(self, placement: str = "all", component: str = "") -> str:
        return f"{self.title}, {component}" if component else self.title


class Utilization(ResourceMetric):
    """Share of the time in which a device or link works."""

    title = "utilization"
    better = LOWER
    reads = "resources: t_ns, busy_ns, capacity"

    def of(self, view: Samples) -> Measured | None:
        capacity = view.all.floats("capacity")[-1]
        if np.isnan(capacity) or not view.seconds:
            return None
        busy_s = float(view.active["busy_ns"][-1]) / NS_PER_S
        return Measured(busy_s / (float(capacity) * view.seconds), n=len(view.active))


class QueueMean(ResourceMetric):
    """Mean number of messages that wait, over time."""

    title = "queue length, mean"
    unit = "messages"
    better = LOWER
    reads = "resources: t_ns, queue_ns"

    def of(self, view: Samples) -> Measured | None:
        if not view.seconds:
            return None
        waited_s = float(view.active["queue_ns"][-1]) / NS_PER_S
        return Measured(waited_s / view.seconds, n=len(view.active))


class Throughput(ResourceMetric):
    """Messages completed per second."""

    title = "throughput"
    unit = "1/s"
    reads = "resources: t_ns, completed"

    def of(self, view: Samples) -> Measured | None:
        if not view.seconds:
            return None
        return Measured(int(view.active["completed"][-1]) / view.seconds, n=len(view.active))


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
        return Measured(int(view.all["completed"][-1]), n=len(view.all))


class MessagesDropped(ResourceMetric):
    """Messages dropped until the end."""

    title = "messages dropped"
    unit = "messages"
    better = LOWER
    reads = "resources: dropped"

    def of(self, view: Samples) -> Measured:
        return Measured(int(view.all["dropped"][-1]), n=len(view.all))


class BytesCarried(ResourceMetric):
    """Bytes that a link carried until the end."""

    title = "bytes carried"
    unit = "B"
    reads = "resources: bytes"

    def of(self, view: Samples) -> Measured | None:
        carried = view.all.floats("bytes")[-1]
        return None if np.isnan(carried) else Measured(int(carried), n=len(view.all))


METRICS = {
    "utilization": Utilization(),
    "queue_mean": QueueMean(),
    "throughput": Throughput(),
    "queue_max": QueueMax(),
    "completed": Completed(),
    "dropped": MessagesDropped(),
    "bytes": BytesCarried(),
}
