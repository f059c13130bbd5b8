"""Metrics of the paper's Section V, as arithmetic on the tables of a run.

``low`` and ``high`` of a metric mean, by the kind of metric:

- latencies, shares, improvements and boosts of one run: the 95 % interval from batch means over blocks of one second
  of camera time, each car (for boosts each Genie) a stratum. It covers the variability *inside* this run, with frames
  of one second correlated as they like; it says nothing of other seeds or drives.
- reuse: the lowest and highest ratio in any window of 50 requests of any Genie (the paper's error bars).
- ``across_seeds``: the 95 % t interval over runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

METHODS = ("local", "remote", "genie")
ROLES = ("local", "remote")
DEADLINE_MS = 33.0  # Section V-B: 30 frames/s
WINDOW_REQUESTS = 50
BLOCK_NS = NS_PER_S
CONFIDENCE = 0.95
PERCENTILES = (50, 95, 99)

_METRIC = ["metric", "role", "unit"]  # the columns that tell which

Floats = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class Metric:
    """One number of a run. ``role`` is a method, a role of Genies, or a resource; ``value`` is None where it is not
    defined; ``n`` counts what it was computed over: frames, requests, updates, samples or runs. Shares have unit 1."""

    name: str
    role: str
    value: float | None
    unit: str
    low: float | None = None
    high: float | None = None
    n: int = 0


def compute(
    frames: pd.DataFrame, lookups: pd.DataFrame, resources: pd.DataFrame, truth: pd.DataFrame | None = None
) -> list[Metric]:
    """All metrics of one run from its tables (columns: ``records``), in a fixed order.

    Numbers have ten digits: what follows may differ between processors, which add up in different orders.
    """
    found = [
        *_of_frames(frames),
        *(metric for role in ROLES for metric in _of_lookups(lookups[lookups["role"] == role], role)),
        *_of_resources(resources, frames),
        *(_of_truth(truth) if truth is not None and len(truth) else ()),
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


def across_seeds(runs: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Mean, 95 % t interval and count of each metric within the groups ``by``: columns value, low, high, runs.

    The unit of replication is the seed: with several runs of a group under one seed, their mean counts once. One seed
    gives no interval.
    """
    from scipy.special import stdtrit

    per_seed = runs.groupby([*by, *_METRIC, "seed"], sort=False, dropna=False)["value"].mean()
    grouped = per_seed.groupby([*by, *_METRIC], sort=False, dropna=False)
    spread = grouped.std().to_numpy()
    found = grouped.agg(value="mean", runs="count").reset_index()
    n = found["runs"].to_numpy()
    half = np.full(len(n), np.nan)
    several = n > 1
    half[several] = stdtrit(n[several] - 1, (1 + CONFIDENCE) / 2) * spread[several] / np.sqrt(n[several])
    found = found.assign(low=found["value"] - half, high=found["value"] + half)
    for name in ("value", "low", "high"):  # ten digits: processors add up in different orders
        found[name] = [float(f"{number:.10g}") for number in found[name]]
    return found[[*by, *_METRIC, "value", "low", "high", "runs"]]


class _Blocks:
    """Rows grouped into one second each, every stratum (car or Genie) for itself."""

    def __init__(self, strata: pd.Series[Any], instants_ns: pd.Series[int]) -> None:
        stratum = np.unique(strata.to_numpy(dtype=str), return_inverse=True)[1]
        seconds = instants_ns.to_numpy() // BLOCK_NS
        per_stratum = int(seconds.max()) + 1
        blocks, self._of_row = np.unique(stratum * per_stratum + seconds, return_inverse=True)
        self._stratum = blocks // per_stratum
        self._sizes = np.bincount(self._stratum)

    def influence(self, above: Floats, below: Floats) -> Floats:
        """How far each block moves the ratio sum(above) / sum(below): the linearised ratio estimator's residuals."""
        sums, counts = self._sum(above), self._sum(below)
        ratio = sums.sum() / counts.sum()
        return np.asarray((sums - ratio * counts) / counts.sum())

    def half_width(self, influence: Floats) -> float | None:
        """Half the confidence interval; None if a stratum lasted for one block only."""
        from scipy.special import stdtrit

        if self._sizes.min() < 2:
            return None
        means = np.bincount(self._stratum, influence) / self._sizes
        squares = np.bincount(self._stratum, (influence - means[self._stratum]) ** 2)
        error = np.sqrt((self._sizes / (self._sizes - 1) * squares).sum())
        return float(stdtrit((self._sizes - 1).sum(), (1 + CONFIDENCE) / 2) * error)

    def _sum(self, values: Floats) -> Floats:
        sums: Floats = np.bincount(self._of_row, values, minlength=len(self._stratum)).astype(np.float64)
        return sums


def _of_frames(frames: pd.DataFrame) -> Iterator[Metric]:
    if frames.empty:
        return
    blocks = _Blocks(frames["car"], frames["stamp_ns"])
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
    means: dict[tuple[str, str], Metric] = {}
    for name in METHODS:
        mine = method == name
        if not mine.any():
            continue
        for answer, values in response.items():
            for metric in _latencies(blocks, np.where(mine, values, np.nan), f"{answer}_answer", name):
                means.setdefault((name, answer), metric)  # the mean comes first
                yield metric
        for share, flags in shares.items():
            yield _share(blocks, f"{share}_share", name, mine & flags, mine)
        yield _share(blocks, "under_deadline_share_of_answered", name, mine & shares["under_deadline"], mine & answered)
        published = int(mine.sum())
        yield Metric("frames_published", name, published, "frames", n=published)
        for part in ("answered", "dropped", "in_flight"):  # each frame is in exactly one of these
            yield Metric(f"frames_{part}", name, int((mine & shares[part]).sum()), "frames", n=published)
        yield _throughput(frames[mine], name)
    for answer, values in response.items():
        for baseline in ROLES:
            if ("genie", answer) in means and (baseline, answer) in means:
                pair = means["genie", answer], means[baseline, answer]
                arms = [np.where(method == name, values, np.nan) for name in ("genie", baseline)]
                yield _improvement(blocks, f"improvement_{answer}_answer", baseline, pair, arms)


def _latencies(blocks: _Blocks, values_ms: Floats, name: str, role: str) -> Iterator[Metric]:
    """Mean and percentiles of the values that are not NaN.

    A percentile's interval is Woodruff's: the interval of the share of values below it, read back through the
    distribution; it ends at the run's smallest and largest value.
    """
    known = ~np.isnan(values_ms)
    values, n = values_ms[known], int(known.sum())
    if not n:
        yield from (Metric(f"{name}_{part}", role, None, "ms") for part in ("mean", *(f"p{p}" for p in PERCENTILES)))
        return
    mean = float(values.mean())
    half = blocks.half_width(blocks.influence(np.where(known, values_ms, 0.0), known.astype(float)))
    yield Metric(f"{name}_mean", role, mean, "ms", *_around(mean, half), n)
    for percent in PERCENTILES:
        value, share = float(np.percentile(values, percent)), percent / 100
        below = known & (values_ms <= value)
        half = blocks.half_width(blocks.influence(below.astype(float), known.astype(float)))
        ends = (None, None) if half is None else (max(share - half, 0.0), min(share + half, 1.0))
        low, high = (None if end is None else float(np.quantile(values, end)) for end in ends)
        yield Metric(f"{name}_p{percent}", role, value, "ms", low, high, n)


def _share(blocks: _Blocks, name: str, role: str, part: Floats, whole: Floats) -> Metric:
    """How many of ``whole`` are in ``part``; the interval stays within [0, 1]."""
    n = int(whole.sum())
    if not n:
        return Metric(name, role, None, "1")
    value = float(part.sum() / n)
    low, high = _around(value, blocks.half_width(blocks.influence(part.astype(float), whole.astype(float))))
    low, high = (None if end is None else min(max(end, 0.0), 1.0) for end in (low, high))
    return Metric(name, role, value, "1", low, high, n)


def _throughput(frames: pd.DataFrame, method: str) -> Metric:
    """Fresh answers per second, from the first stamp to the last instant on record."""
    fresh = _floats(frames["fresh_answer_ns"])
    instants = np.concatenate([_floats(frames["stamp_ns"]), _floats(frames["first_answer_ns"]), fresh])
    seconds = (np.nanmax(instants) - np.nanmin(instants)) / NS_PER_S
    count = int((~np.isnan(fresh)).sum())
    return Metric("fresh_answer_throughput", method, count / seconds if seconds > 0 else None, "1/s", n=count)


def _improvement(
    blocks: _Blocks, name: str, baseline: str, means: tuple[Metric, Metric], arms: Sequence[Floats]
) -> Metric:
    """1 - mean(DG) / mean(baseline); both arms saw the same frames, so their blocks are paired."""
    ours, theirs = means[0].value, means[1].value
    if ours is None or not theirs:
        return Metric(name, baseline, None, "1")
    moves = [blocks.influence(np.nan_to_num(arm), (~np.isnan(arm)).astype(float)) for arm in arms]
    half = blocks.half_width(moves[0] / theirs - ours / theirs**2 * moves[1])
    value = 1 - ours / theirs
    return Metric(name, baseline, value, "1", *_around(value, half), min(means[0].n, means[1].n))


def _of_lookups(lookups: pd.DataFrame, role: str) -> Iterator[Metric]:
    if lookups.empty:
        return
    images, objects = lookups[lookups["kind"] == "image"], lookups[lookups["kind"] != "image"]
    of_clients = images[images["asker"] == "client"]
    yield _reuse(of_clients, "image_reuse", role)
    yield _reuse(images, "image_reuse_with_neighbours", role)
    coalesced = int((of_clients["outcome"] == "coalesced").sum())
    n = len(of_clients)
    yield Metric("coalesced_share", role, coalesced / n if n else None, "1", n=n)
    yield _reuse(objects, "object_reuse", role)
    for kind in ("sighting", "boost"):
        yield _reuse(objects[objects["kind"] == kind], f"object_reuse_{kind}", role)
    yield _boost(objects, role)
    for name, events in (("stored_images", images), ("stored_objects", objects)):
        last = events.groupby("genie", observed=True)["entries"].last()
        yield Metric(name, role, float(last.mean()) if len(last) else None, "entries/Genie", n=len(last))


def _reuse(lookups: pd.DataFrame, name: str, role: str) -> Metric:
    ratios, windows = reuse(lookups), windowed_reuse(lookups)["ratio"]
    low, high = (float(windows.min()), float(windows.max())) if len(windows) else (None, None)
    value = float(ratios.mean()) if len(ratios) else None
    return Metric(name, role, value, "1", low, high, int(lookups["requests"].sum()))


def _boost(objects: pd.DataFrame, role: str) -> Metric:
    """The running mean of C_new - C_old at the end of the run, over all Genies of the role."""
    events = objects[objects["updates"] > 0]
    n = int(events["updates"].sum())
    if not n:
        return Metric("confidence_boost", role, None, "1")
    value = float(events["boost_sum"].sum() / n)
    blocks = _Blocks(events["genie"], events["t_ns"])
    half = blocks.half_width(blocks.influence(_floats(events["boost_sum"]), _floats(events["updates"])))
    return Metric("confidence_boost", role, value, "1", *_around(value, half), n)


def _of_resources(resources: pd.DataFrame, frames: pd.DataFrame) -> Iterator[Metric]:
    """Per method and resource; the role is ``genie: edge1.accelerator``.

    Utilisation, mean queue and throughput are those until the last frame was published (afterwards a run only waits
    for answers); the other counts are those at its end. Queues are seen at the samples only.
    """
    ordered = resources.sort_values("t_ns", kind="stable")
    for method in METHODS:
        mine = ordered[ordered["method"] == method]
        stamps = frames.loc[frames["method"] == method, "stamp_ns"]
        last_stamp_ns = stamps.max() if len(stamps) else np.inf
        for resource, samples in mine.groupby("resource", observed=True):
            yield from _of_resource(samples, f"{method}: {resource}", last_stamp_ns)


def _of_resource(samples: pd.DataFrame, role: str, last_stamp_ns: float) -> Iterator[Metric]:
    last, n = samples.iloc[-1], len(samples)
    active = samples[samples["t_ns"] <= last_stamp_ns]
    seconds = float(active["t_ns"].max()) / NS_PER_S if len(active) else 0.0
    capacity = _number(last["capacity"])
    if seconds > 0:
        if capacity is not None:
            busy_s = float(active["busy_ns"].iloc[-1]) / NS_PER_S
            yield Metric("utilisation", role, busy_s / (capacity * seconds), "1", n=len(active))
        yield Metric("queue_mean", role, float(active["queue"].mean()), "messages", n=len(active))
        yield Metric("throughput", role, int(active["completed"].iloc[-1]) / seconds, "1/s", n=len(active))
    yield Metric("queue_max", role, int(samples["queue"].max()), "messages", n=n)
    yield Metric("completed", role, int(last["completed"]), "messages", n=n)
    yield Metric("dropped", role, int(last["dropped"]), "messages", n=n)
    carried = _number(last["bytes"])
    if carried is not None:
        yield Metric("bytes", role, int(carried), "B", n=n)


def _of_truth(truth: pd.DataFrame) -> Iterator[Metric]:
    """Of the first answers: served objects that are not there, cache hits that show an object which is not in view,
    and objects in view that were served (recall)."""
    blocks = _Blocks(truth["car"], truth["stamp_ns"])
    method = truth["method"].to_numpy(dtype=str)
    hit = truth["source"].astype(str).str.endswith("_cache").to_numpy()
    count = {name: _floats(truth[name]) for name in ("served", "true", "not_in_view", "in_view", "found")}
    for name in METHODS:
        mine = method == name
        if mine.any():
            yield _share(blocks, "ghost_share", name, mine * (count["served"] - count["true"]), mine * count["served"])
            wrong = mine & hit & (count["not_in_view"] > 0)
            yield _share(blocks, "wrong_hit_share", name, wrong, mine & hit)
            yield _share(blocks, "object_recall", name, mine * count["found"], mine * count["in_view"])


def _around(value: float, half: float | None) -> tuple[float | None, float | None]:
    return (None, None) if half is None else (value - half, value + half)


def _floats(column: pd.Series[Any]) -> Floats:
    return column.to_numpy(dtype=np.float64, na_value=np.nan)


def _ten(value: float | None) -> float | None:
    return float(f"{value:.10g}") if isinstance(value, float) else value


def _number(value: Any) -> float | None:
    return None if value is None or value != value else float(value)
