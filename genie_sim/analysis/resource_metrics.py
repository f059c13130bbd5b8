"""The use of devices and links, each of which is the component of its numbers.

It is that of the time in which their host takes frames: of a car and its links from its start to
its last frame, of an edge until the last frame of all, both between two samples.
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
    """The samples of one resource in order of time, and from when to when its host takes frames
    [ns].
    """

    samples: Columns
    begin_ns: float
    end_ns: float


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
        use = Use(samples, float(begin_ns), float(end_ns))
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
    """``None`` for a queue, which has no capacity, and where no time passes."""
    seconds = (use.end_ns - use.begin_ns) / NS_PER_S
    capacity = float(use.samples.floats("capacity")[-1])
    if np.isnan(capacity) or not seconds > 0:
        return None
    t_ns = use.samples["t_ns"]
    n = int(((t_ns >= use.begin_ns) & (t_ns <= use.end_ns)).sum())
    busy_ns = np.concatenate([[0], use.samples["busy_ns"]])  # nothing before the first sample
    before, until = busy_ns[np.searchsorted(t_ns, [use.begin_ns, use.end_ns], side="right")]
    return Estimate(float(until - before) / NS_PER_S / (capacity * seconds), n=n)


METRICS = {
    "utilization": Metric(
        "utilization",
        "%",
        LOWER,
        "Use of devices and links",
        meaning="Share of the time in which a device or link works; on a car, of the time in which "
        "it drives.",
        formula=_utilization,
        kind="resources",
        tier=MAIN,
    ),
}
