"""Metrics of the paper's Section V, as arithmetic on the tables of a run.

``low`` and ``high`` of a metric mean, by the kind of metric:

- latencies, shares, improvements and boosts of one run: the 95 % interval from batch means over blocks of one second
  of camera time, each car (for boosts each Genie) a stratum. It covers the variability *inside* this run, with frames
  of one second correlated as they like; it says nothing of other seeds or drives.
- reuse: the lowest and highest ratio in any window of 50 requests of any Genie (the paper's error bars).
- ``statistics.across_seeds``: the 95 % t interval over runs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis import correctness
from genie_sim.analysis.statistics import Blocks, Floats, around, share
from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

PLACEMENTS = ("car", "edge")  # of Genies
DEADLINE_MS = 33.0  # Section V-B: 30 frames/s
WINDOW_REQUESTS = 50
PERCENTILES = (50, 95, 99)

Where = tuple[str, str, str]  # method, placement, component


def compute(
    methods: Sequence[MethodInfo],
    frames: pd.DataFrame,
    lookups: pd.DataFrame,
    resources: pd.DataFrame,
    answers: pd.DataFrame | None = None,
    held: pd.DataFrame | None = None,
) -> list[Metric]:
    """All metrics of one run from its tables (columns: ``records``), in a fixed order; ``methods`` are those that ran.

    Numbers have ten digits: what follows may differ between processors, which add up in different orders.
    """
    names = [method.name for method in methods]
    found = [
        *_of_frames(frames, methods),
        *(metric for name in names for place in PLACEMENTS for metric in _of_genies(lookups, name, place)),
        *_of_resources(resources, frames, names),
        *(correctness.of_answers(answers, names) if answers is not None and len(answers) else ()),
        *(correctness.of_held(held, names) if held is not None and len(held) else ()),
    ]
    return [replace(one, value=_ten(one.value), low=_ten(one.low), high=_ten(one.high)) for one in found]


def response_ms(frames: pd.DataFrame, answer: str) -> Floats:
    """From received to the ``first`` or the ``fresh`` answer, in milliseconds; NaN where there is none."""
    return (_floats(frames[f"{answer}_answer_ns"]) - _floats(frames["received_ns"])) / NS_PER_MS


def reuse(lookups: pd.DataFrame) -> pd.Series[float]:
    """hits / requests of each Genie; a coalesced request is not a hit. Genies that were asked nothing are left out."""
    sums = lookups.groupby("genie", observed=True)[["requests", "hits"]].sum()
    sums = sums[sums["requests"] > 0]
    return sums["hits"] / sums["requests"]


def windowed_reuse(lookups: pd.DataFrame, window: int = WINDOW_REQUESTS) -> pd.DataFrame:
    """hits / requests over the last ``window`` requests, per Genie: columns ``genie``, ``t_ns``, ``ratio``.

    A window ends with each message and holds as few messages as make up ``window`` requests: exactly ``window`` for
    images, which are asked for one by one. A Genie with fewer requests has no window.
    """
    import pandas as pd

    genies: list[Any] = []
    instants, ratios = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for genie, events in lookups.groupby("genie", observed=True):
        requests = np.concatenate([[0], np.cumsum(events["requests"].to_numpy())])
        hits = np.concatenate([[0], np.cumsum(events["hits"].to_numpy())])
        ends = np.flatnonzero(requests >= window)
        starts = np.searchsorted(requests, requests[ends] - window, side="right") - 1
        ratios.append((hits[ends] - hits[starts]) / (requests[ends] - requests[starts]))
        instants.append(events["t_ns"].to_numpy()[ends - 1])
        genies += [genie] * len(ends)
    return pd.DataFrame({"genie": genies, "t_ns": np.concatenate(instants), "ratio": np.concatenate(ratios)})


def running_boost(lookups: pd.DataFrame) -> pd.DataFrame:
    """Mean of C_new - C_old over all updates so far: columns ``t_ns``, ``updates`` (how many) and ``boost``."""
    import pandas as pd

    events = lookups[lookups["updates"] > 0]
    updates = events["updates"].cumsum().to_numpy()
    boost = events["boost_sum"].cumsum().to_numpy() / updates
    return pd.DataFrame({"t_ns": events["t_ns"].to_numpy(), "updates": updates, "boost": boost})


def running_use(samples: pd.DataFrame) -> tuple[Floats, Floats]:
    """Of one resource, in order of time: the instants of its samples [ns], 0 before them, and the time that each of its
    servers has worked until then [ns]. For a queue: its length times how long it had that."""
    t_ns = np.concatenate([[0.0], samples["t_ns"].to_numpy(float)])
    if samples["capacity"].isna().any():
        return t_ns, np.concatenate([[0.0], np.cumsum(samples["queue"].to_numpy(float) * np.diff(t_ns))])
    return t_ns, np.concatenate([[0.0], samples["busy_ns"].to_numpy(float)]) / float(samples["capacity"].iloc[0])


def _of_frames(frames: pd.DataFrame, methods: Sequence[MethodInfo]) -> Iterator[Metric]:
    if frames.empty:
        return
    blocks = Blocks(frames["car"], frames["stamp_ns"])
    method = frames["method"].to_numpy(dtype=str)
    response = {answer: response_ms(frames, answer) for answer in ("first", "fresh")}
    answered = frames["first_answer_ns"].notna().to_numpy()
    dropped = ~answered & frames["drop"].notna().to_numpy()
    shares = {
        "answered": answered,
        "under_deadline": response["first"] < DEADLINE_MS,
        "fresh_answered": frames["fresh_answer_ns"].notna().to_numpy(),
        "fresh_under_deadline": response["fresh"] < DEADLINE_MS,
        "dropped": dropped,
        "in_flight": ~answered & ~dropped,
        "empty_answer": answered & (_floats(frames["objects_served"]) == 0),
    }
    ran = [one for one in methods if (method == one.name).any()]
    for name in (one.name for one in ran):
        mine, where = method == name, (name, "all", "")
        for answer, values in response.items():
            yield from _latencies(blocks, np.where(mine, values, np.nan), f"{answer}_answer", where)
        for name_of_share, flags in shares.items():
            yield share(blocks, f"{name_of_share}_share", where, mine & flags, mine)
        in_time = mine & shares["under_deadline"]
        yield share(blocks, "under_deadline_share_of_answered", where, in_time, mine & answered)
        published = int(mine.sum())
        yield Metric("frames_published", *where, published, "frames", n=published)
        for part in ("answered", "dropped", "in_flight"):  # each frame is in exactly one of these
            yield Metric(f"frames_{part}", *where, int((mine & shares[part]).sum()), "frames", n=published)
        yield _throughput(frames[mine], where)
    for answer, values in response.items():
        times = {one.name: np.where(method == one.name, values, np.nan) for one in ran}
        for better in (one.name for one in ran if not one.baseline):
            for baseline in (one.name for one in ran if one.baseline):
                where = better, "all", baseline
                yield _improvement(blocks, f"improvement_{answer}_answer", where, times[better], times[baseline])


def _latencies(blocks: Blocks, values_ms: Floats, name: str, where: Where) -> Iterator[Metric]:
    """Mean and percentiles of the values that are not NaN.

    A percentile's interval is Woodruff's: the interval of the share of values below it, read back through the
    distribution; it ends at the run's smallest and largest value.
    """
    known = ~np.isnan(values_ms)
    values, n = values_ms[known], int(known.sum())
    if not n:
        for part in ("mean", *(f"p{percent}" for percent in PERCENTILES)):
            yield Metric(f"{name}_{part}", *where, None, "ms")
        return
    mean = float(values.mean())
    half = blocks.half_width(blocks.influence(np.where(known, values_ms, 0.0), known.astype(float)))
    yield Metric(f"{name}_mean", *where, mean, "ms", *around(mean, half), n)
    for percent in PERCENTILES:
        value, share = float(np.percentile(values, percent)), percent / 100
        below = known & (values_ms <= value)
        half = blocks.half_width(blocks.influence(below.astype(float), known.astype(float)))
        ends = (None, None) if half is None else (max(share - half, 0.0), min(share + half, 1.0))
        low, high = (None if end is None else float(np.quantile(values, end)) for end in ends)
        yield Metric(f"{name}_p{percent}", *where, value, "ms", low, high, n)


def _throughput(frames: pd.DataFrame, where: Where) -> Metric:
    """Fresh answers per second, from the first stamp to the last instant on record."""
    fresh = _floats(frames["fresh_answer_ns"])
    instants = np.concatenate([_floats(frames["stamp_ns"]), _floats(frames["first_answer_ns"]), fresh])
    seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
    count = int((~np.isnan(fresh)).sum())
    return Metric("fresh_answer_throughput", *where, count / seconds if seconds > 0 else None, "1/s", n=count)


def _improvement(blocks: Blocks, name: str, where: Where, ours_ms: Floats, theirs_ms: Floats) -> Metric:
    """1 - mean(ours) / mean(theirs); both saw the same frames, so their blocks are paired."""
    known = [~np.isnan(arm) for arm in (ours_ms, theirs_ms)]
    n = min(int(flags.sum()) for flags in known)
    if not n:
        return Metric(name, *where, None, "1")
    ours, theirs = (float(arm[flags].mean()) for arm, flags in zip((ours_ms, theirs_ms), known, strict=True))
    if not theirs:
        return Metric(name, *where, None, "1")
    moves = [blocks.influence(np.nan_to_num(arm), (~np.isnan(arm)).astype(float)) for arm in (ours_ms, theirs_ms)]
    half = blocks.half_width(moves[0] / theirs - ours / theirs**2 * moves[1])
    value = 1 - ours / theirs
    return Metric(name, *where, value, "1", *around(value, half), n)


def _of_genies(lookups: pd.DataFrame, method: str, placement: str) -> Iterator[Metric]:
    """Of the Genies that a method runs on cars or on edges."""
    lookups = lookups[(lookups["method"] == method) & (lookups["placement"] == placement)]
    if lookups.empty:
        return
    where = method, placement, ""
    images, objects = lookups[lookups["kind"] == "image"], lookups[lookups["kind"] != "image"]
    of_clients = images[images["requester"] == "client"]
    yield _reuse(of_clients, "image_reuse", where)
    yield _reuse(images, "image_reuse_with_neighbours", where)
    coalesced = int((of_clients["outcome"] == "coalesced").sum())
    n = len(of_clients)
    yield Metric("coalesced_share", *where, coalesced / n if n else None, "1", n=n)
    yield _reuse(objects, "object_reuse", where)
    for kind in ("sighting", "boost"):
        yield _reuse(objects[objects["kind"] == kind], f"object_reuse_{kind}", where)
    yield _boost(objects, where)
    for name, events in (("stored_images", images), ("stored_objects", objects)):
        last = events.groupby("genie", observed=True)["entries"].last()
        yield Metric(name, *where, float(last.mean()) if len(last) else None, "entries/Genie", n=len(last))


def _reuse(lookups: pd.DataFrame, name: str, where: Where) -> Metric:
    ratios, windows = reuse(lookups), windowed_reuse(lookups)["ratio"]
    low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
    value = float(ratios.mean()) if len(ratios) else None
    return Metric(name, *where, value, "1", low, high, int(lookups["requests"].sum()))


def _boost(objects: pd.DataFrame, where: Where) -> Metric:
    """The running mean of C_new - C_old at the end of the run, over all these Genies."""
    events = objects[objects["updates"] > 0]
    n = int(events["updates"].sum())
    if not n:
        return Metric("confidence_boost", *where, None, "1")
    value = float(events["boost_sum"].sum() / n)
    blocks = Blocks(events["genie"], events["t_ns"])
    half = blocks.half_width(blocks.influence(_floats(events["boost_sum"]), _floats(events["updates"])))
    return Metric("confidence_boost", *where, value, "1", *around(value, half), n)


def _of_resources(resources: pd.DataFrame, frames: pd.DataFrame, methods: Sequence[str]) -> Iterator[Metric]:
    """Per method and resource, which is the ``component``; a link has the placement ``all``.

    Utilization, mean queue and throughput are those until the last frame was published (afterwards a run only waits
    for answers); the other counts are those at its end. Queues are seen at the samples only.
    """
    ordered = resources.sort_values("t_ns", kind="stable")
    cars = set(frames["car"].unique())
    for method in methods:
        mine = ordered[ordered["method"] == method]
        stamps = frames.loc[frames["method"] == method, "stamp_ns"]
        last_stamp_ns = stamps.max() if len(stamps) else np.inf
        for resource, samples in mine.groupby("resource", observed=True):
            name = str(resource)
            is_link, host = "->" in name, re.sub(r"(\.accelerator|\.cpu|/.*)$", "", name)
            placement = "all" if is_link else "car" if host in cars else "edge"
            for metric, value, unit, n in _of_resource(samples, last_stamp_ns):
                yield Metric(metric, method, placement, name, value, unit, n=n)


def _of_resource(samples: pd.DataFrame, last_stamp_ns: float) -> Iterator[tuple[str, float, str, int]]:
    """Name, value, unit, n."""
    last, n = samples.iloc[-1], len(samples)
    active = samples[samples["t_ns"] <= last_stamp_ns]
    seconds = float(active["t_ns"].max()) / NS_PER_S if len(active) else 0.0
    capacity = _number(last["capacity"])
    if seconds > 0:
        if capacity is not None:
            busy_s = float(active["busy_ns"].iloc[-1]) / NS_PER_S
            yield "utilization", busy_s / (capacity * seconds), "1", len(active)
        yield "queue_mean", float(active["queue"].mean()), "messages", len(active)
        yield "throughput", int(active["completed"].iloc[-1]) / seconds, "1/s", len(active)
    yield "queue_max", int(samples["queue"].max()), "messages", n
    yield "completed", int(last["completed"]), "messages", n
    yield "dropped", int(last["dropped"]), "messages", n
    carried = _number(last["bytes"])
    if carried is not None:
        yield "bytes", int(carried), "B", n


def _floats(column: pd.Series[Any]) -> Floats:
    return column.to_numpy(dtype=np.float64, na_value=np.nan)


def _ten(value: float | None) -> float | None:
    return float(f"{value:.10g}") if isinstance(value, float) else value


def _number(value: Any) -> float | None:
    return None if value is None or value != value else float(value)
