"""Metrics of devices, links and queues, each of which is the component of its numbers.

Utilization, mean queue and throughput are those of the time in which their host takes frames: of a
car and its links from its start to its last frame, of an edge until the last frame of all, both
between two samples. What is dropped counts until the end of the run. Queues are counted at each
change, not at samples.
"""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from genie_sim.analysis.metric import LOWER, MAIN, Given, MethodTables, Metric
from genie_sim.analysis.statistics import Estimate
from genie_sim.base.units import NS_PER_S
from genie_sim.record.columns import Columns
from genie_sim.record.results import MetricValue

MAX_RESOURCES = 12  # that a table or a figure shows
MIN_USE = 0.01  # a resource that is used less is idle

# What follows the host in the name of a resource.
AFTER_HOST = re.compile(r"(\.accelerator|\.cpu|/.*)$")


class Use(NamedTuple):
    """The samples of one resource in order of time, from when to when its host takes frames, and
    when the warm-up ended [ns].
    """

    samples: Columns
    begin_ns: float
    end_ns: float
    counted_ns: float

    def grown(self, column: str, begin_ns: float, end_ns: float = np.inf) -> float:
        """How much a count grew; before its first sample it was 0."""
        counts = np.concatenate([[0], self.samples[column]])
        ends = np.searchsorted(self.samples["t_ns"], [begin_ns, end_ns], side="right")
        return float(np.diff(counts[ends])[0])

    def rate(self, column: str, capacity: float = 1.0) -> Estimate | None:
        """Growth per second while its host takes frames; ``None`` without a capacity or a time."""
        seconds = (self.end_ns - self.begin_ns) / NS_PER_S
        if np.isnan(capacity) or not seconds > 0:
            return None
        unit = NS_PER_S if column.endswith("_ns") else 1
        t_ns = self.samples["t_ns"]
        n = int(((t_ns >= self.begin_ns) & (t_ns <= self.end_ns)).sum())
        growth = self.grown(column, self.begin_ns, self.end_ns) / unit
        return Estimate(growth / (capacity * seconds), n=n)


def views(tables: MethodTables) -> Iterator[Given]:
    """Each resource of a method; a link has the placement ``all``."""
    if "resources" not in tables:
        return
    begins_ns: dict[str, float] = {}
    ends_ns: dict[str, float] = {}
    if "hosts" in tables:
        hosts = tables["hosts"]
        begins_ns = dict(zip(hosts["host"].tolist(), hosts["begin_ns"].tolist(), strict=True))
        ends_ns = dict.fromkeys(hosts.where(placement="car")["host"].tolist(), 0.0)
    if "frames" in tables:
        for car, frames in tables["frames"].groups("car"):
            ends_ns[car] = float(frames["stamp_ns"].max())
    counted_ns = min(begins_ns.values(), default=0.0)
    driven = {car: (begins_ns.get(car, counted_ns), end_ns) for car, end_ns in ends_ns.items()}
    whole = counted_ns, max(ends_ns.values(), default=np.inf)
    ordered = tables["resources"].by("t_ns")
    instants_ns = np.union1d([0.0], ordered.floats("t_ns"))
    for name, samples in ordered.groups("resource"):
        hosts_of = AFTER_HOST.sub("", name).split("->")
        begin_ns, end_ns = next((driven[host] for host in hosts_of if host in driven), whole)
        within = instants_ns[(instants_ns >= begin_ns) & (instants_ns <= end_ns)]
        begin_ns, end_ns = (within[0], within[-1]) if len(within) else (0.0, 0.0)
        placement = "car" if hosts_of[0] in driven else "edge"
        use = Use(samples, float(begin_ns), float(end_ns), counted_ns)
        yield Given("resources", use, "all" if len(hosts_of) > 1 else placement, name)


def busiest(metrics: Iterable[MetricValue]) -> list[str]:
    """The devices and links that a method uses by 1 % at least, the busiest first."""
    highest: dict[str, float] = {}
    for metric in metrics:
        if metric.metric == "utilization" and metric.value is not None:
            highest[metric.component] = max(highest.get(metric.component, 0.0), metric.value)
    used = [name for name in highest if highest[name] >= MIN_USE]
    return sorted(used, key=lambda name: (-highest[name], name))


def _utilization(use: Use) -> Estimate | None:
    return use.rate("busy_ns", float(use.samples.floats("capacity")[-1]))


def _dropped(use: Use) -> Estimate:
    return Estimate(int(use.grown("dropped", use.counted_ns)), n=len(use.samples))


METRICS = {
    "utilization": Metric(
        "utilization",
        "%",
        LOWER,
        meaning="Share of the time in which a device or link works; on a car, of the time in which "
        "it drives.",
        formula=_utilization,
        kind="resources",
        tier=MAIN,
    ),
    "queue_mean": Metric(
        "queue length, mean",
        "messages",
        LOWER,
        meaning="Mean number of messages that wait, over time; on a car, over the time in which it "
        "drives.",
        formula=lambda use: use.rate("queue_ns"),
        kind="resources",
    ),
    "throughput": Metric(
        "throughput",
        "1/s",
        meaning="Messages completed per second; on a car, of the time in which it drives.",
        formula=lambda use: use.rate("completed"),
        kind="resources",
    ),
    "dropped": Metric(
        "messages dropped",
        "messages",
        LOWER,
        meaning="Messages dropped until the end.",
        formula=_dropped,
        kind="resources",
    ),
}
