"""What became of paced looks, how old the newest look of a view is, and what edges told."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from genie_sim.analysis.statistics import Blocks, latencies
from genie_sim.recording.columns import Columns, Floats
from genie_sim.recording.results import Metric
from genie_sim.units import NS_PER_MS

ENDS = ("answered", "stale", "overtaken", "timed_out")  # of a frame that went up


def of_looks(
    tables: Mapping[str, Columns], methods: Sequence[str], intervals: bool = True
) -> Iterator[Metric]:
    """The metrics of each method that paces its looks."""
    looks, frames = tables["looks"], tables["frames"]
    for method in methods:
        events = looks.where(method=method)
        if not len(events):
            continue
        published, where = len(frames.where(method=method)), (method, "all", "")
        own = len(events.where(way="own", outcome="answered"))
        yield Metric("looks_own_share", *where, value=own / published, unit="1", n=published)
        yield from _of_way_up(events.where(way="edge"), method, published)
        answered = events.where(way="map")
        blocks = Blocks(answered["car"], answered["stamp_ns"], intervals)
        age_ms = (answered["stamp_ns"] - answered.floats("looked_ns")) / NS_PER_MS
        yield from latencies(blocks, age_ms, "view_age", where)
        if "held" in tables:
            yield from _of_shared(tables["held"].where(method=method, what="consumer"), method)


def _of_way_up(events: Columns, method: str, published: int) -> Iterator[Metric]:
    """How the frames that went up to the edge ended, and how long the answered ones took."""
    where = method, "all", ""
    sent = len(events.where(outcome="sent"))
    yield Metric("looks_sent_share", *where, value=sent / published, unit="1", n=published)
    counts = {end: len(events.where(outcome=end)) for end in ENDS}
    counts["in_flight"] = sent - sum(counts.values())
    for end, count in counts.items():
        yield Metric(
            f"looks_{end}_share", *where, value=count / sent if sent else None, unit="1", n=sent
        )
    round_trips_ms = _round_trips_ms(events)
    n = len(round_trips_ms)
    mean_ms = float(round_trips_ms.mean()) if n else None
    yield Metric("look_round_trip_mean", *where, value=mean_ms, unit="ms", n=n)


def _round_trips_ms(events: Columns) -> Floats:
    """From when a frame went up until its answer came, of those answered in time or stale."""
    ended = events["outcome"].isin(("answered", "stale"))
    chosen = events.rows(ended | (events["outcome"] == "sent"))
    # Of a frame that was answered, both events stand side by side, the earlier one first.
    order = np.lexsort(
        (chosen["t_ns"], chosen["stamp_ns"], chosen["stream"].codes, chosen["car"].codes)
    )
    chosen = chosen.rows(order)
    answered = np.flatnonzero(chosen["outcome"] != "sent")
    times_ns = chosen["t_ns"]
    return np.asarray((times_ns[answered] - times_ns[answered - 1]) / NS_PER_MS)


def _of_shared(held: Columns, method: str) -> Iterator[Metric]:
    """What the consumers hold because another car saw it."""
    where = method, "all", ""
    total, shared, right = (int(held[name].sum()) for name in ("held", "shared", "shared_right"))
    share = shared / total if total else None
    yield Metric("shared_share", *where, value=share, unit="1", n=total)
    right_share = right / shared if shared else None
    yield Metric("shared_right_share", *where, value=right_share, unit="1", n=shared)
