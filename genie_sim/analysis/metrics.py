"""Metrics of the paper's Section V, as arithmetic on the tables of a run.

``low`` and ``high`` of a metric mean, by the kind of metric:

- latencies, shares, improvements and boosts of one run: the 95 % interval from batch means over blocks of one second
  of camera time, each car (for boosts each Genie) a stratum. It covers the variability *inside* this run, with frames
  of one second correlated as they like; it says nothing of other seeds or drives. Of shares it is Wilson's, with as
  many rows as that variability stands for.
- reuse: the lowest and highest ratio in any window of 50 requests of any Genie (the paper's error bars).
- ``statistics.across_seeds``: the 95 % t interval over runs.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis import correctness
from genie_sim.analysis.statistics import Blocks, around, share
from genie_sim.recording.columns import Columns, Floats, Text
from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

    Table = Columns | pd.DataFrame

PLACEMENTS = ("car", "edge")  # of Genies
DEADLINE_MS = 33.0  # Section V-B: 30 frames/s
WINDOW_REQUESTS = 50
PART = {
    "first": "first_answer_part",
    "fresh": "fresh_answer_part",
}  # what each part of a mean took, by answer
PERCENTILES = (50, 95, 99)

Where = tuple[str, str, str]  # method, placement, component


def compute(
    methods: Sequence[MethodInfo], tables: "Mapping[str, Table]", *, intervals: bool = True
) -> list[Metric]:
    """All metrics of one run in a fixed order: of ``frames`` and what else was recorded (columns: ``records``), under
    the ``methods`` that ran. ``intervals``: of frames and boosts, too; for many runs, whose spread is what counts, they
    are left out.

    Numbers have ten digits: what follows may differ between processors, which add up in different orders.
    """
    names = [method.name for method in methods]
    frames = Columns.of(tables["frames"])
    known = {name: Columns.of(table) for name, table in tables.items() if len(table)}
    found: list[Metric] = []
    if "frames" in known:
        found += _of_frames(frames, methods, intervals)
    if "lookups" in known:
        for name, placement in product(names, PLACEMENTS):
            found += _of_genies(known["lookups"], name, placement, intervals)
    if "resources" in known:
        found += _of_resources(known["resources"], frames, names)
    if "answers" in known:
        found += correctness.of_answers(known["answers"], names)
    if "held" in known:
        found += correctness.of_held(known["held"], names)
    if "steps" in known:
        found += _of_steps(known["steps"], frames, names)
    return [
        replace(one, value=_ten(one.value), low=_ten(one.low), high=_ten(one.high)) for one in found
    ]


def response_ms(frames: Columns, answer: str) -> Floats:
    """From received to the ``first`` or the ``fresh`` answer, in milliseconds; NaN where there is none."""
    return (frames.floats(f"{answer}_answer_ns") - frames.floats("received_ns")) / NS_PER_MS


def reuse(lookups: Columns) -> dict[str, float]:
    """hits / requests of each Genie; a coalesced request is not a hit. Genies that were asked nothing are left out."""
    genies: Text = lookups["genie"]
    requests, hits = (
        np.bincount(genies.codes, lookups[name], len(genies.names)) for name in ("requests", "hits")
    )
    return {genies.names[one]: float(hits[one] / requests[one]) for one in np.flatnonzero(requests)}


def windowed_reuse(lookups: Columns, window: int = WINDOW_REQUESTS) -> Columns:
    """hits / requests over the last ``window`` requests, per Genie: columns ``genie``, ``t_ns``, ``ratio``.

    A window ends with each message and holds as few messages as make up ``window`` requests: exactly ``window`` for
    images, which are asked for one by one. A Genie with fewer requests has no window.
    """
    events, (requests, hits), first = _counted(lookups)
    ends = np.flatnonzero(requests[1:] - requests[first] >= window) + 1
    starts = np.searchsorted(requests, requests[ends] - window, side="right") - 1
    ratios = (hits[ends] - hits[starts]) / (requests[ends] - requests[starts])
    return Columns(
        {"genie": events["genie"][ends - 1], "t_ns": events["t_ns"][ends - 1], "ratio": ratios}
    )


def running_reuse(lookups: Columns) -> Columns:
    """hits / requests of each Genie so far, after each of its messages: columns ``t_ns`` and ``ratio``."""
    events, (requests, hits), first = _counted(lookups.rows(lookups["requests"] > 0))
    return Columns(
        {
            "t_ns": events["t_ns"],
            "ratio": (hits[1:] - hits[first]) / (requests[1:] - requests[first]),
        }
    )


def _counted(
    lookups: Columns,
) -> "tuple[Columns, list[np.ndarray[Any, Any]], np.ndarray[Any, Any]]":
    """The look-ups Genie by Genie, the requests and the hits before each of them and after the last, and of each the
    place of its Genie's first."""
    events = lookups.rows(np.argsort(lookups["genie"].codes, kind="stable"))
    counts = [np.concatenate([[0], np.cumsum(events[name])]) for name in ("requests", "hits")]
    codes = events["genie"].codes
    return events, counts, np.searchsorted(codes, codes)


def running_boost(lookups: Columns) -> Columns:
    """Mean of C_new - C_old over all updates so far: columns ``t_ns``, ``updates`` (how many) and ``boost``."""
    events = lookups.rows(lookups["updates"] > 0)
    updates = np.cumsum(events["updates"])
    boost = np.cumsum(events["boost_sum"]) / updates
    return Columns({"t_ns": events["t_ns"], "updates": updates, "boost": boost})


def running_use(samples: Columns) -> tuple[Floats, Floats]:
    """Of one resource, in order of time: the instants of its samples [ns], 0 before them, and the time that each of its
    servers has worked until then [ns]. For a queue: its length times how long it had that."""
    t_ns = np.concatenate([[0.0], samples.floats("t_ns")])
    capacity = samples.floats("capacity")
    if np.isnan(capacity).any():
        return t_ns, np.concatenate([[0.0], np.cumsum(samples.floats("queue") * np.diff(t_ns))])
    return t_ns, np.concatenate([[0.0], samples.floats("busy_ns")]) / float(capacity[0])


def _of_frames(frames: Columns, methods: Sequence[MethodInfo], intervals: bool) -> Iterator[Metric]:
    blocks = Blocks(frames["car"], frames["stamp_ns"], intervals)
    method = frames["method"]
    response = {answer: response_ms(frames, answer) for answer in ("first", "fresh")}
    answered = ~np.isnan(frames.floats("first_answer_ns"))
    dropped = ~answered & frames["drop"].known
    shares = {
        "answered": answered,
        "under_deadline": response["first"] < DEADLINE_MS,
        "fresh_answered": ~np.isnan(frames.floats("fresh_answer_ns")),
        "fresh_under_deadline": response["fresh"] < DEADLINE_MS,
        "dropped": dropped,
        "in_flight": ~answered & ~dropped,
        "empty_answer": answered & (frames.floats("objects_served") == 0),
    }
    masks = {one.name: method == one.name for one in methods}
    ran = [one for one in methods if masks[one.name].any()]
    for name in (one.name for one in ran):
        mine, where = masks[name], (name, "all", "")
        for answer, values in response.items():
            yield from _latencies(blocks, np.where(mine, values, np.nan), f"{answer}_answer", where)
        for name_of_share, flags in shares.items():
            yield share(blocks, f"{name_of_share}_share", where, mine & flags, mine)
        in_time = mine & shares["under_deadline"]
        yield share(blocks, "under_deadline_share_of_answered", where, in_time, mine & answered)
        published = int(mine.sum())
        yield Metric("frames_published", *where, published, "frames", n=published)
        for part in ("answered", "dropped", "in_flight"):  # each frame is in exactly one of these
            yield Metric(
                f"frames_{part}", *where, int((mine & shares[part]).sum()), "frames", n=published
            )
        yield _throughput(frames.rows(mine), where)
    for answer, values in response.items():
        times = {one.name: np.where(masks[one.name], values, np.nan) for one in ran}
        for better in (one.name for one in ran if not one.baseline):
            for baseline in (one.name for one in ran if one.baseline):
                where = better, "all", baseline
                yield _improvement(
                    blocks, f"improvement_{answer}_answer", where, times[better], times[baseline]
                )


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
    for percent, value in zip(
        PERCENTILES, np.percentile(values, PERCENTILES).tolist(), strict=True
    ):
        share = percent / 100
        below = known & (values_ms <= value)
        half = blocks.half_width(blocks.influence(below.astype(float), known.astype(float)))
        ends = (None, None) if half is None else (max(share - half, 0.0), min(share + half, 1.0))
        low, high = (None if end is None else float(np.quantile(values, end)) for end in ends)
        yield Metric(f"{name}_p{percent}", *where, value, "ms", low, high, n)


def _throughput(frames: Columns, where: Where) -> Metric:
    """Fresh answers per second, from the first stamp to the last instant on record."""
    fresh = frames.floats("fresh_answer_ns")
    instants = np.concatenate([frames.floats("stamp_ns"), frames.floats("first_answer_ns"), fresh])
    seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
    count = int((~np.isnan(fresh)).sum())
    return Metric(
        "fresh_answer_throughput", *where, count / seconds if seconds > 0 else None, "1/s", n=count
    )


def _improvement(
    blocks: Blocks, name: str, where: Where, ours_ms: Floats, theirs_ms: Floats
) -> Metric:
    """1 - mean(ours) / mean(theirs); both saw the same frames, so their blocks are paired."""
    known = [~np.isnan(arm) for arm in (ours_ms, theirs_ms)]
    n = min(int(flags.sum()) for flags in known)
    if not n:
        return Metric(name, *where, None, "1")
    ours, theirs = (
        float(arm[flags].mean()) for arm, flags in zip((ours_ms, theirs_ms), known, strict=True)
    )
    if not theirs:
        return Metric(name, *where, None, "1")
    moves = [
        blocks.influence(np.nan_to_num(arm), (~np.isnan(arm)).astype(float))
        for arm in (ours_ms, theirs_ms)
    ]
    half = blocks.half_width(moves[0] / theirs - ours / theirs**2 * moves[1])
    value = 1 - ours / theirs
    return Metric(name, *where, value, "1", *around(value, half), n)


def _of_genies(lookups: Columns, method: str, placement: str, intervals: bool) -> Iterator[Metric]:
    """Of the Genies that a method runs on cars or on edges."""
    lookups = lookups.where(method=method, placement=placement)
    if not len(lookups):
        return
    where = method, placement, ""
    of_image = lookups["kind"] == "image"
    images, objects = lookups.rows(of_image), lookups.rows(~of_image)
    of_clients = images.where(requester="client")
    yield _reuse(of_clients, "image_reuse", where)
    yield _pooled(of_clients, "image_reuse_pooled", where)
    yield _reuse(images, "image_reuse_with_neighbours", where)
    coalesced = int((of_clients["outcome"] == "coalesced").sum())
    n = len(of_clients)
    yield Metric("coalesced_share", *where, coalesced / n if n else None, "1", n=n)
    yield _reuse(objects, "object_reuse", where)
    yield _pooled(objects, "object_reuse_pooled", where)
    for kind in ("sighting", "boost"):
        yield _reuse(objects.where(kind=kind), f"object_reuse_{kind}", where)
    yield _boost(objects, where, intervals)
    for name, events in (("stored_images", images), ("stored_objects", objects)):
        last = last_of_genies(events)
        yield Metric(
            name, *where, float(np.mean(last)) if last else None, "entries/Genie", n=len(last)
        )


def last_of_genies(events: Columns) -> list[int]:
    """How many entries each Genie's cache or map had at the end."""
    return [int(of_one["entries"][-1]) for _, of_one in events.groups("genie")]


def _reuse(lookups: Columns, name: str, where: Where) -> Metric:
    ratios, windows = list(reuse(lookups).values()), windowed_reuse(lookups)["ratio"]
    low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
    value = float(np.mean(ratios)) if ratios else None
    return Metric(name, *where, value, "1", low, high, int(lookups["requests"].sum()))


def _pooled(lookups: Columns, name: str, where: Where) -> Metric:
    """Hits over the requests of all Genies together, so that each request weighs the same, not each Genie."""
    hits, n = int(lookups["hits"].sum()), int(lookups["requests"].sum())
    return Metric(name, *where, hits / n if n else None, "1", n=n)


def _boost(objects: Columns, where: Where, intervals: bool) -> Metric:
    """The running mean of C_new - C_old at the end of the run, over all these Genies."""
    events = objects.rows(objects["updates"] > 0)
    n = int(events["updates"].sum())
    if not n:
        return Metric("confidence_boost", *where, None, "1")
    value = float(events["boost_sum"].sum() / n)
    blocks = Blocks(events["genie"], events["t_ns"], intervals)
    half = blocks.half_width(blocks.influence(events["boost_sum"], events.floats("updates")))
    return Metric("confidence_boost", *where, value, "1", *around(value, half), n)


def _of_resources(resources: Columns, frames: Columns, methods: Sequence[str]) -> Iterator[Metric]:
    """Per method and resource, which is the ``component``; a link has the placement ``all``.

    Utilization, mean queue and throughput are those until the last frame was published (afterwards a run only waits
    for answers); the other counts are those at its end. Queues are seen at the samples only.
    """
    ordered = resources.by("t_ns")
    cars = set(frames["car"].unique())
    for method in methods:
        stamps = frames["stamp_ns"][frames["method"] == method]
        last_stamp_ns = stamps.max() if len(stamps) else np.inf
        for name, samples in ordered.where(method=method).groups("resource"):
            is_link, host = "->" in name, re.sub(r"(\.accelerator|\.cpu|/.*)$", "", name)
            placement = "all" if is_link else "car" if host in cars else "edge"
            for metric, value, unit, n in _of_resource(samples, last_stamp_ns):
                yield Metric(metric, method, placement, name, value, unit, n=n)


def _of_resource(samples: Columns, last_stamp_ns: float) -> Iterator[tuple[str, float, str, int]]:
    """Name, value, unit, n."""
    capacity, carried, n = samples.floats("capacity")[-1], samples.floats("bytes")[-1], len(samples)
    active = samples.rows(samples["t_ns"] <= last_stamp_ns)
    seconds = float(active["t_ns"].max()) / NS_PER_S if len(active) else 0.0
    if seconds > 0:
        if not np.isnan(capacity):
            busy_s = float(active["busy_ns"][-1]) / NS_PER_S
            yield "utilization", busy_s / (float(capacity) * seconds), "1", len(active)
        yield "queue_mean", float(active["queue"].mean()), "messages", len(active)
        yield "throughput", int(active["completed"][-1]) / seconds, "1/s", len(active)
    yield "queue_max", int(samples["queue"].max()), "messages", n
    yield "completed", int(samples["completed"][-1]), "messages", n
    yield "dropped", int(samples["dropped"][-1]), "messages", n
    if not np.isnan(carried):
        yield "bytes", int(carried), "B", n


def _of_steps(steps: Columns, frames: Columns, methods: Sequence[str]) -> Iterator[Metric]:
    """What each part took, mean over all frames that got the answer; the parts add up to the mean response time."""
    for method in methods:
        mine, published = steps.where(method=method), frames.where(method=method)
        for answer, metric in PART.items():
            n = int((~np.isnan(published.floats(f"{answer}_answer_ns"))).sum())
            of_answer = mine.rows(mine["which"].isin((answer, "both")))
            took_ns, parts = of_answer["end_ns"] - of_answer["begin_ns"], of_answer["part"]
            sums = dict(
                zip(parts.names, np.bincount(parts.codes, took_ns, len(parts.names)), strict=True)
            )
            for part, sum_ns in sums.items():
                if n and sum_ns:
                    yield Metric(
                        metric, method, "all", part, float(sum_ns) / n / NS_PER_MS, "ms", n=n
                    )


def _ten(value: float | None) -> float | None:
    return float(f"{value:.10g}") if isinstance(value, float) else value
