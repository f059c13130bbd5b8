"""Metrics of the paper's Section V, as arithmetic on the tables of a run.

``low`` and ``high`` of a metric mean, by the kind of metric:

- latencies, shares, improvements and boosts of one run: the 95 % interval from batch means over
  blocks of one second of camera time, each car (for boosts each Genie) a stratum. It covers the
  variability *inside* this run, with frames of one second correlated as they like; it says nothing
  of other seeds or drives. Of shares it is Wilson's, with as many rows as that variability stands
  for.
- reuse: the lowest and highest ratio in any window of 50 requests of any Genie (the paper's error
  bars).
- ``statistics.across_seeds``: the 95 % t interval over runs.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from genie_sim.analysis import attacks, correctness, looks, outages, prices
from genie_sim.analysis.registry import DEADLINE_MS, RECENT_MS, WINDOW_REQUESTS
from genie_sim.analysis.statistics import Blocks, around, latencies, share
from genie_sim.recording.columns import Columns, Floats, Text
from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.text import significant
from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

    Table = Columns | pd.DataFrame

PLACEMENTS = ("car", "edge")  # of Genies
# what each part of a mean took, by answer
PART = {"first": "first_answer_part", "fresh": "fresh_answer_part"}

Where = tuple[str, str, str]  # method, placement, component
# What makes an answer fresh: that a detector looked at this very frame for it, or, as in the
# paper, that it does not come out of a map alone, so that a cached answer is fresh, too.
Fresh = Literal["look", "answer"]


def compute(
    methods: Sequence[MethodInfo],
    tables: "Mapping[str, Table]",
    *,
    intervals: bool = True,
    fresh: Fresh = "look",
) -> list[Metric]:
    """All metrics of one run, in a fixed order.

    Numbers have ten digits: those that follow may differ between processors, which add up in
    different orders.

    Parameters
    ----------
    methods : sequence of MethodInfo
        Those that ran.
    tables : mapping of str to Columns or pandas.DataFrame
        ``frames``, and what else was recorded; the columns are those of ``recording.records``.
    intervals : bool
        Whether frames and boosts get intervals, too. Many runs, whose spread counts, need none.
    fresh : str
        What makes an answer fresh, for all metrics but those of ``steps``.
    """
    names = [method.name for method in methods]
    frames = with_fresh(Columns.of(tables["frames"]), fresh)
    filled = {name: Columns.of(table) for name, table in tables.items() if len(table)}
    metrics: list[Metric] = []
    if "frames" in filled:
        metrics += _of_frames(frames, methods, intervals)
    if "lookups" in filled:
        for name, placement in product(names, PLACEMENTS):
            metrics += _of_genies(filled["lookups"], name, placement, intervals)
    if "looks" in filled:
        metrics += looks.of_looks({**filled, "frames": frames}, names, intervals)
    if "resources" in filled:
        metrics += _of_resources(filled["resources"], frames, names)
    if "hosts" in filled and "frames" in filled:
        metrics += prices.of_hosts({**filled, "frames": frames}, names)
    if "answers" in filled:
        metrics += correctness.of_answers(filled["answers"], names)
    if "held" in filled:
        metrics += correctness.of_held(filled["held"], names)
        metrics += correctness.of_laps(filled["held"], frames, names)
    if "faults" in filled and "frames" in filled:
        metrics += outages.of_faults(filled["faults"], frames, filled.get("held"), names)
    if {"attacks", "held", "held_objects"} <= filled.keys():
        metrics += attacks.of_attacks(
            filled["attacks"], filled["held"], filled["held_objects"], names
        )
    if "steps" in filled:
        metrics += _of_steps(filled["steps"], frames, names)
    return [_rounded(metric) for metric in metrics]


def with_fresh(frames: Columns, fresh: Fresh) -> Columns:
    """Returns the table ``frames`` with its fresh answers by this definition."""
    if fresh == "look":
        return frames
    return frames.assign(
        fresh_answer_ns=frames["result_answer_ns"], objects_fresh=frames["objects_result"]
    )


def response_ms(frames: Columns, answer: str) -> Floats:
    """From received to the ``first`` or the ``fresh`` answer, in milliseconds; NaN where there is
    none.
    """
    return (frames.floats(f"{answer}_answer_ns") - frames.floats("received_ns")) / NS_PER_MS


def reuse(lookups: Columns) -> dict[str, float]:
    """hits / requests of each Genie; a coalesced request is not a hit. Genies that were asked
    nothing are left out.
    """
    genies: Text = lookups["genie"]
    requests, hits = (
        np.bincount(genies.codes, lookups[name], len(genies.names)) for name in ("requests", "hits")
    )
    return {
        genies.names[code]: float(hits[code] / requests[code]) for code in np.flatnonzero(requests)
    }


def windowed_reuse(lookups: Columns, window: int = WINDOW_REQUESTS) -> Columns:
    """hits / requests over the last ``window`` requests, per Genie: columns ``genie``, ``t_ns``,
    ``ratio``.

    A window ends with each message and holds as few messages as make up ``window`` requests:
    exactly ``window`` for images, which are asked for one by one. A Genie with fewer requests has
    no window.
    """
    events, (requests, hits), first = _counted(lookups)
    ends = np.flatnonzero(requests[1:] - requests[first] >= window) + 1
    starts = np.searchsorted(requests, requests[ends] - window, side="right") - 1
    ratios = (hits[ends] - hits[starts]) / (requests[ends] - requests[starts])
    return Columns(
        {"genie": events["genie"][ends - 1], "t_ns": events["t_ns"][ends - 1], "ratio": ratios}
    )


def running_reuse(lookups: Columns) -> Columns:
    """hits / requests of each Genie so far, after each of its messages: columns ``t_ns`` and
    ``ratio``.
    """
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
    """The look-ups Genie by Genie, the requests and the hits before each of them and after the
    last, and of each the place of its Genie's first.
    """
    events = lookups.rows(np.argsort(lookups["genie"].codes, kind="stable"))
    counts = [np.concatenate([[0], np.cumsum(events[name])]) for name in ("requests", "hits")]
    codes = events["genie"].codes
    return events, counts, np.searchsorted(codes, codes)


def running_boost(lookups: Columns) -> Columns:
    """Mean of C_new - C_old over all updates so far: columns ``t_ns``, ``updates`` (how many) and
    ``boost``.
    """
    events = lookups.rows(lookups["updates"] > 0)
    updates = np.cumsum(events["updates"])
    boost = np.cumsum(events["boost_sum"]) / updates
    return Columns({"t_ns": events["t_ns"], "updates": updates, "boost": boost})


def running_use(samples: Columns) -> tuple[Floats, Floats]:
    """Of one resource, in order of time: the instants of its samples [ns], 0 before them, and the
    time that each of its servers has worked until then [ns]. For a queue: its length times how long
    it had that.
    """
    t_ns = np.concatenate([[0.0], samples.floats("t_ns")])
    capacity = samples.floats("capacity")
    if np.isnan(capacity).any():
        return t_ns, np.concatenate([[0.0], np.cumsum(samples.floats("queue") * np.diff(t_ns))])
    return t_ns, np.concatenate([[0.0], samples.floats("busy_ns")]) / float(capacity[0])


def _of_frames(frames: Columns, methods: Sequence[MethodInfo], intervals: bool) -> Iterator[Metric]:
    blocks = Blocks(frames["car"], frames["stamp_ns"], intervals)
    response = {answer: response_ms(frames, answer) for answer in ("first", "fresh")}
    answered = ~np.isnan(frames.floats("first_answer_ns"))
    dropped = ~answered & frames["drop"].has_text
    stamp_ns = frames.floats("stamp_ns")
    look_age_ms = np.maximum(stamp_ns - frames.floats("first_looked_ns"), 0.0) / NS_PER_MS
    newest_look_age_ms = (stamp_ns - frames.floats("looked_ns")) / NS_PER_MS
    parts = {"answered": answered, "dropped": dropped, "in_flight": ~answered & ~dropped}
    flags = {
        "answered_share": answered,
        "under_deadline_share": response["first"] < DEADLINE_MS,
        "fresh_answered_share": ~np.isnan(frames.floats("fresh_answer_ns")),
        "fresh_under_deadline_share": response["fresh"] < DEADLINE_MS,
        "recent_share": newest_look_age_ms <= RECENT_MS,
        "dropped_share": dropped,
        "in_flight_share": parts["in_flight"],
        "empty_answer_share": answered & (frames.floats("objects_served") == 0),
    }
    rows_of = {method.name: frames["method"] == method.name for method in methods}
    ran = [method for method in methods if rows_of[method.name].any()]
    for method in ran:
        rows, where = rows_of[method.name], (method.name, "all", "")
        for answer, values in response.items():
            yield from latencies(blocks, np.where(rows, values, np.nan), f"{answer}_answer", where)
        yield from latencies(blocks, np.where(rows, look_age_ms, np.nan), "look_age", where)
        for name, flag in flags.items():
            yield share(blocks, name, where, part=rows & flag, whole=rows)
        yield share(
            blocks,
            "under_deadline_share_of_answered",
            where,
            part=rows & flags["under_deadline_share"],
            whole=rows & answered,
        )
        published = int(rows.sum())
        yield Metric("frames_published", *where, value=published, unit="frames", n=published)
        for part, flag in parts.items():  # each frame is in exactly one of them
            count = int((rows & flag).sum())
            yield Metric(f"frames_{part}", *where, value=count, unit="frames", n=published)
        yield _throughput(frames.rows(rows), where)
    baselines = [method.name for method in ran if method.baseline]
    others = [method.name for method in ran if not method.baseline]
    for answer, values in response.items():
        times = {method.name: np.where(rows_of[method.name], values, np.nan) for method in ran}
        for name, baseline in product(others, baselines):
            yield _improvement(
                blocks,
                f"improvement_{answer}_answer",
                (name, "all", baseline),
                ours_ms=times[name],
                theirs_ms=times[baseline],
            )


def _throughput(frames: Columns, where: Where) -> Metric:
    """Fresh answers per second, from the first stamp to the last instant on record."""
    fresh = frames.floats("fresh_answer_ns")
    instants = np.concatenate([frames.floats("stamp_ns"), frames.floats("first_answer_ns"), fresh])
    seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
    count = int((~np.isnan(fresh)).sum())
    rate = count / seconds if seconds > 0 else None
    return Metric("fresh_answer_throughput", *where, value=rate, unit="1/s", n=count)


def _improvement(
    blocks: Blocks, name: str, where: Where, *, ours_ms: Floats, theirs_ms: Floats
) -> Metric:
    """1 - mean(ours) / mean(theirs), of times of the same frames, NaN where there is no answer.

    Both methods see the same frames, so their blocks are paired.

    Parameters
    ----------
    blocks : Blocks
        Of the frames.
    name : str
        The metric.
    where : tuple of str
        Method, placement and component of the metric.
    ours_ms, theirs_ms : array of float
        A time in milliseconds for each frame, under the method and under its baseline.
    """
    ours_known, theirs_known = ~np.isnan(ours_ms), ~np.isnan(theirs_ms)
    n = min(int(ours_known.sum()), int(theirs_known.sum()))
    if not n:
        return Metric(name, *where, value=None, unit="1")
    ours, theirs = float(ours_ms[ours_known].mean()), float(theirs_ms[theirs_known].mean())
    if not theirs:
        return Metric(name, *where, value=None, unit="1")
    ours_moves = blocks.influence(np.nan_to_num(ours_ms), ours_known.astype(float))
    theirs_moves = blocks.influence(np.nan_to_num(theirs_ms), theirs_known.astype(float))
    half = blocks.half_width(ours_moves / theirs - ours / theirs**2 * theirs_moves)
    value = 1 - ours / theirs
    low, high = around(value, half)
    return Metric(name, *where, value=value, unit="1", low=low, high=high, n=n)


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
    n = len(of_clients)
    coalesced = int((of_clients["outcome"] == "coalesced").sum())
    coalesced_share = coalesced / n if n else None
    yield Metric("coalesced_share", *where, value=coalesced_share, unit="1", n=n)
    yield _reuse(objects, "object_reuse", where)
    yield _pooled(objects, "object_reuse_pooled", where)
    for kind in ("sighting", "boost"):
        yield _reuse(objects.where(kind=kind), f"object_reuse_{kind}", where)
    yield _boost(objects, where, intervals)
    for name, events in (("stored_images", images), ("stored_objects", objects)):
        entries = last_of_genies(events)
        mean = float(np.mean(entries)) if entries else None
        yield Metric(name, *where, value=mean, unit="entries/Genie", n=len(entries))


def last_of_genies(events: Columns) -> list[int]:
    """How many entries each Genie's cache or map had at the end."""
    return [int(of_genie["entries"][-1]) for _, of_genie in events.groups("genie")]


def _reuse(lookups: Columns, name: str, where: Where) -> Metric:
    ratios, windows = list(reuse(lookups).values()), windowed_reuse(lookups)["ratio"]
    low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
    value = float(np.mean(ratios)) if ratios else None
    n = int(lookups["requests"].sum())
    return Metric(name, *where, value=value, unit="1", low=low, high=high, n=n)


def _pooled(lookups: Columns, name: str, where: Where) -> Metric:
    """Hits over the requests of all Genies together, so that each request weighs the same, not each
    Genie.
    """
    hits, n = int(lookups["hits"].sum()), int(lookups["requests"].sum())
    return Metric(name, *where, value=hits / n if n else None, unit="1", n=n)


def _boost(objects: Columns, where: Where, intervals: bool) -> Metric:
    """The running mean of C_new - C_old at the end of the run, over all these Genies."""
    events = objects.rows(objects["updates"] > 0)
    n = int(events["updates"].sum())
    if not n:
        return Metric("confidence_boost", *where, value=None, unit="1")
    value = float(events["boost_sum"].sum() / n)
    blocks = Blocks(events["genie"], events["t_ns"], intervals)
    half = blocks.half_width(blocks.influence(events["boost_sum"], events.floats("updates")))
    low, high = around(value, half)
    return Metric("confidence_boost", *where, value=value, unit="1", low=low, high=high, n=n)


def _of_resources(resources: Columns, frames: Columns, methods: Sequence[str]) -> Iterator[Metric]:
    """Per method and resource, which is the ``component``; a link has the placement ``all``.

    Utilization, mean queue and throughput are those until the last frame was published (afterwards
    a run only waits for answers); the other counts are those at its end. Queues are seen at the
    samples only.
    """
    ordered = resources.by("t_ns")
    cars = set(frames["car"].unique())
    for method in methods:
        stamps = frames["stamp_ns"][frames["method"] == method]
        last_stamp_ns = stamps.max() if len(stamps) else np.inf
        for name, samples in ordered.where(method=method).groups("resource"):
            host = re.sub(r"(\.accelerator|\.cpu|/.*)$", "", name)
            placement = "all" if "->" in name else "car" if host in cars else "edge"
            where = method, placement, name
            for metric, value, unit, n in _of_resource(samples, last_stamp_ns):
                yield Metric(metric, *where, value=value, unit=unit, n=n)


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
    """What each part took, mean over all frames that got the answer; the parts add up to the mean
    response time.
    """
    for method in methods:
        of_method, published = steps.where(method=method), frames.where(method=method)
        for answer, metric in PART.items():
            n = int((~np.isnan(published.floats(f"{answer}_answer_ns"))).sum())
            of_answer = of_method.rows(of_method["which"].isin((answer, "both")))
            duration_ns, parts = of_answer["end_ns"] - of_answer["begin_ns"], of_answer["part"]
            sums_ns = np.bincount(parts.codes, duration_ns, len(parts.names))
            for part, sum_ns in zip(parts.names, sums_ns, strict=True):
                if n and sum_ns:
                    mean_ms = float(sum_ns) / n / NS_PER_MS
                    yield Metric(metric, method, "all", part, value=mean_ms, unit="ms", n=n)


def _rounded(metric: Metric) -> Metric:
    """A metric with its numbers as they are written down."""
    where = metric.method, metric.placement, metric.component
    value, low, high = _ten(metric.value), _ten(metric.low), _ten(metric.high)
    return Metric(
        metric.metric, *where, value=value, unit=metric.unit, low=low, high=high, n=metric.n
    )


def _ten(value: float | None) -> float | None:
    return significant(value, digits=10) if isinstance(value, float) else value
