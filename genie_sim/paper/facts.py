"""The numbers of one run that claims use, each under a typed key."""

import math
from collections.abc import Iterable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from genie_sim.analysis import genie_metrics, metrics
from genie_sim.analysis.metric import DEADLINE_MS
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.paper.definitions import FROM_STAMP
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, MetricValue

METHODS = (  # of the paper's evaluation
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)

FOR_EVER_NS = 2**62
FORMER = {  # what the evaluation calls metrics of a run
    "image_reuse": "image_reuse_with_neighbours",
    "image_reuse_own": "image_reuse",
    "confidence_boost": "boost_per_object",
    "boost_per_sighting": "confidence_boost",
}
EARLY_PERCENTILES = (10, 20, 30, 40, 50)
# answer -> the share of frames that have it in time; a result is a detection, or a cached answer
DEADLINES = {
    "first": "under_deadline_share",
    "fresh": "fresh_under_deadline_share",
    "result": "result_under_deadline_share",
}


class Fact(NamedTuple):
    """Which number of a run, by the same four names as in ``metrics.json``.

    ``component`` is a baseline, a car, an edge, a Genie or a lap; else it is empty.
    """

    metric: str
    method: str = "genie"
    placement: str = "all"
    component: str = ""

    def __str__(self) -> str:
        """For column heads and tables."""
        place = self.method if self.placement == "all" else self.placement
        return ":".join(filter(None, (self.metric, place, self.component)))


Facts = dict[Fact, float]  # NaN where not defined


def placed(metric: str, placement: str) -> Fact:
    """A metric of the Genies on ``car`` or ``edge``."""
    return Fact(metric, placement=placement)


def facts_of(frames: Columns, lookups: Columns, resources: Columns) -> Facts:
    """All facts of a run from its tables. Each of its metrics has the name and the value that it
    has in the run; what definitions of the paper's metrics mean instead has a name of its own
    (``definitions.meant``).
    """
    maps = lookups.rows(lookups["kind"] != "image")
    facts = _of_answers(frames) | _of_bytes(frames)
    measured = metrics.compute(METHODS, {"frames": frames, "lookups": lookups}, intervals=False)
    facts = _of_metrics(measured) | facts | _windows(lookups)
    for genie, reused in genie_metrics.reuse(maps).items():
        facts[Fact("object_reuse", component=genie)] = reused
    for placement in genie_metrics.PLACEMENTS:
        facts[placed("boost_per_object", placement)] = _boost_per_object(
            maps.where(placement=placement)
        )
    facts |= highest_running_ratios(lookups)
    requests_of_cars = lookups.where(kind="image", requester="client", placement="car")
    for metric, ratios in (
        ("image_peak_at", windowed_reuse(requests_of_cars)),
        ("image_peak_at_running", genie_metrics.running_reuse(requests_of_cars)),
    ):
        facts[placed(metric, "car")] = _peak_at(ratios, frames)
    first_lap = frames["lap"] == 1
    lap_ns = frames["stamp_ns"][first_lap].min(initial=FOR_EVER_NS)
    return facts | _of_resources(resources, lap_ns)


def _of_metrics(rows: Iterable[MetricValue]) -> Facts:
    """Each metric's value; of reuse the highest window, too."""
    facts: Facts = {}
    for row in rows:
        fact = Fact(FORMER.get(row.metric, row.metric), row.method, row.placement, row.component)
        facts[fact] = math.nan if row.value is None else row.value
    return facts


def _windows(lookups: Columns) -> Facts:
    """The highest reuse in any window of requests."""
    of_image = lookups["kind"] == "image"
    images, objects = lookups.rows(of_image), lookups.rows(~of_image)
    facts: Facts = {}
    for metric, events in (
        ("image_reuse", images.where(requester="client")),
        ("image_reuse_with_neighbours", images),
        ("object_reuse", objects),
    ):
        for placement in genie_metrics.PLACEMENTS:
            ratios = windowed_reuse(events.where(placement=placement))["ratio"]
            highest = float(ratios.max()) if len(ratios) else math.nan
            facts[placed(f"{metric}_high", placement)] = highest
    return facts


def windowed_reuse(lookups: Columns, window: int = 50) -> Columns:
    """hits / requests over the last ``window`` requests, per Genie: columns ``genie``, ``t_ns``,
    ``ratio``.

    A window ends with each message and holds as few messages as make up ``window`` requests:
    exactly ``window`` for images, which are asked for one by one. A Genie with fewer requests has
    no window.
    """
    events, (requests, hits), first = genie_metrics._counted(lookups)
    ends = np.flatnonzero(requests[1:] - requests[first] >= window) + 1
    starts = np.searchsorted(requests, requests[ends] - window, side="right") - 1
    ratios = (hits[ends] - hits[starts]) / (requests[ends] - requests[starts])
    return Columns(
        {"genie": events["genie"][ends - 1], "t_ns": events["t_ns"][ends - 1], "ratio": ratios}
    )


def response_ms(frames: Columns, answer: str) -> np.ndarray:
    """From received to an answer [ms]."""
    return (frames.floats(f"{answer}_answer_ns") - frames.floats("received_ns")) / NS_PER_MS


def _of_answers(frames: Columns) -> Facts:
    """Of each method its times since it received a frame and since the camera's stamp, and the
    answers to the last third of the frames.
    """
    facts: Facts = {}
    from_stamp = frames.assign(received_ns=frames["stamp_ns"])
    for method in (method.name for method in METHODS):
        of_method, stamped = frames.where(method=method), from_stamp.where(method=method)
        if not len(of_method):
            continue
        for rows, end in ((of_method, ""), (stamped, FROM_STAMP)):
            facts |= _of_times(rows, method, end)
            for answer, deadline in DEADLINES.items():
                times_ms = response_ms(rows, answer)
                facts |= {
                    Fact(f"{answer}_answer_mean{end}", method): _mean(times_ms),
                    Fact(f"{answer}_answer_p95{end}", method): _percentiles(times_ms, [95])[0],
                    Fact(f"{deadline}{end}", method): float(np.mean(times_ms < DEADLINE_MS)),
                }
        has_result = ~np.isnan(of_method.floats("result_answer_ns"))
        facts[Fact("result_answered_share", method)] = float(has_result.mean())
        stamp_ns = of_method["stamp_ns"]
        late = stamp_ns > stamp_ns.min() + 2 / 3 * (stamp_ns.max() - stamp_ns.min())
        for answer, metric in (("result", "late_result_share"), ("first", "late_answered_share")):
            answered = ~np.isnan(of_method.floats(f"{answer}_answer_ns"))
            facts[Fact(metric, method)] = float(answered[late].mean())
    for baseline in (method.name for method in METHODS if method.baseline):
        for name, end in product((f"{answer}_answer" for answer in DEADLINES), ("", FROM_STAMP)):
            ours, theirs = (Fact(f"{name}_mean{end}", m) for m in ("genie", baseline))
            if ours in facts and theirs in facts:
                improvement = Fact(f"improvement_{name}{end}", component=baseline)
                facts[improvement] = 1 - ratio(facts[ours], facts[theirs])
    return facts


def _of_times(frames: Columns, method: str, end: str) -> Facts:
    """The early percentiles of a method's first answers, and each car's times; ``end``: of the
    metrics' names.
    """
    times_ms = response_ms(frames, "first")
    early_ms = _percentiles(times_ms, EARLY_PERCENTILES)
    facts = {
        Fact(f"first_answer_p{percent}{end}", method): value
        for percent, value in zip(EARLY_PERCENTILES, early_ms, strict=True)
    }
    for car in frames["car"].unique():
        of_car = times_ms[frames["car"] == car]
        facts[Fact(f"first_answer_mean{end}", method, component=car)] = _mean(of_car)
        facts[Fact(f"first_answer_p99{end}", method, component=car)] = _percentiles(of_car, [99])[0]
    return facts


def _of_bytes(frames: Columns) -> Facts:
    """How much larger an image is than the answers sent down for it."""
    remote = frames.where(method="remote")
    remote = remote.rows((remote["bytes_up"] > 0) & (remote["bytes_down"] > 0))
    if not len(remote):
        return {}
    share = ratio(remote["bytes_up"].sum(), remote["bytes_down"].sum())
    return {Fact("image_to_objects_bytes", "remote"): share}


def highest_running_ratios(lookups: Columns) -> Facts:
    """The highest running ratio that any Genie of a role had, for each of the reuse metrics with
    error bars.
    """
    of_image = lookups["kind"] == "image"
    images, objects = lookups.rows(of_image), lookups.rows(~of_image)
    facts: Facts = {}
    for metric, events in (
        ("image_reuse", images.where(requester="client")),
        ("image_reuse_with_neighbours", images),
        ("object_reuse", objects),
    ):
        for placement in genie_metrics.PLACEMENTS:
            ratios = genie_metrics.running_reuse(events.where(placement=placement))["ratio"]
            highest = float(ratios.max()) if len(ratios) else math.nan
            facts[placed(f"{metric}_high_running", placement)] = highest
    return facts


def _of_resources(resources: Columns, lap_ns: int) -> Facts:
    """What devices had done at the end, and detectors when the second lap began."""
    resources = resources.by("t_ns")
    busy_ns = handled = 0
    for _, samples in resources.where(method="genie", kind="cpu").groups("resource"):
        busy_ns += int(samples["busy_ns"][-1])
        handled += int(samples["completed"][-1])
    facts = {Fact("handling_ms"): ratio(busy_ns / NS_PER_MS, handled)}
    runs = in_lap1 = 0
    for method, of_method in resources.where(kind="accelerator").groups("method"):
        for resource, samples in of_method.groups("resource"):
            host, completed = resource.removesuffix(".accelerator"), samples["completed"]
            rate = ratio(completed[-1], samples["busy_ns"][-1] / NS_PER_S)
            facts[Fact("accelerator_rate", method, component=host)] = rate
            if method == "genie":
                runs += int(completed[-1])
                in_lap1 += int(completed[samples["t_ns"] <= lap_ns].max(initial=0))
    facts[Fact("detector_runs")] = float(runs)
    if lap_ns < FOR_EVER_NS:
        facts[Fact("detector_runs", component="lap1")] = float(in_lap1)
        facts[Fact("detector_runs", component="lap2")] = float(runs - in_lap1)
    return facts


def _boost_per_object(maps: Columns) -> float:
    """All confidence added by the end of the run, over the objects then stored: another reading of
    Section V-E.
    """
    return ratio(maps["boost_sum"].sum(), sum(genie_metrics.last_of_genies(maps)))


def _peak_at(ratios: Columns, frames: Columns) -> float:
    """When the highest ratio was reached, as a share of the run."""
    if not len(ratios) or ratios["ratio"].max() <= 0:
        return math.nan
    at_ns = int(ratios["t_ns"][np.argmax(ratios["ratio"])])
    begin_ns, end_ns = int(frames["stamp_ns"].min()), int(frames["stamp_ns"].max())
    return ratio(at_ns - begin_ns, end_ns - begin_ns)


def _mean(values: np.ndarray) -> float:
    defined = values[~np.isnan(values)]
    return float(defined.mean()) if len(defined) else math.nan


def _percentiles(values: np.ndarray, percents: Sequence[float]) -> list[float]:
    defined = values[~np.isnan(values)]
    return np.percentile(defined, percents).tolist() if len(defined) else [math.nan] * len(percents)


def ratio(above: float, below: float) -> float:
    """NaN where the one below is zero."""
    return float(above / below) if below else math.nan
