"""What the hosts of a run have to do over time: accelerators, queues and links."""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from genie_sim.record.columns import Columns
from genie_sim.report.packing import US, deltas, scaled

if TYPE_CHECKING:
    from genie_sim.record.results import Run

HOSTS_PER_PLACEMENT = 6  # that are shown


def shown_hosts(run: "Run") -> list[str]:
    """The first cars and the first edges of the scenario."""
    scenario = run.facts["scenario"]
    return [
        host["name"] for kind in ("cars", "edges") for host in scenario[kind][:HOSTS_PER_PLACEMENT]
    ]


def hosts_over_time(
    samples: Columns, hosts: list[str]
) -> Iterator[tuple[str, dict[str, list[int]]]]:
    """What each host has to do under one method, sample by sample: how busy its accelerator was
    since the sample before [per mille], how many messages wait in its queues and for its links,
    and how many it has lost so far.
    """
    by_host: dict[str, list[tuple[str, Columns]]] = {host: [] for host in hosts}
    for resource, rows in samples.groups("resource"):
        host = re.split(r"->|[./]", resource)[0]
        if host in by_host:
            by_host[host].append((rows["kind"].tolist()[0], rows.by("t_ns")))
    for host, resources in by_host.items():
        if not resources:
            continue
        t_ns = np.unique(np.concatenate([rows["t_ns"] for _, rows in resources]))
        busy, waiting, lost = (np.zeros(len(t_ns), dtype=np.int64) for _ in range(3))
        for kind, rows in resources:
            places = np.searchsorted(t_ns, rows["t_ns"])
            if kind == "accelerator":
                took_ns = np.diff(rows["t_ns"], prepend=rows["t_ns"][0]) * rows["capacity"]
                worked_ns = np.diff(rows["busy_ns"], prepend=rows["busy_ns"][0])
                busy[places] = scaled(worked_ns / np.maximum(took_ns, 1), 1000)
            elif kind in ("queue", "link"):
                waiting[places] += rows["queue"]
                lost[places] += rows["dropped"]
        yield (
            host,
            {
                "t_us": deltas(t_ns // US),
                "busy": busy.tolist(),
                "waiting": waiting.tolist(),
                "lost": deltas(lost),
            },
        )
