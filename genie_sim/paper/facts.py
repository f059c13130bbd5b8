"""The numbers of one run that claims, calibration and sweeps use: ``metric:method`` of
frames, ``metric:car`` and ``metric:edge`` of Genies -> value, NaN where not defined."""

from __future__ import annotations

import math

import numpy as np

from genie_sim.analysis import metrics
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import MethodInfo
from genie_sim.units import NS_PER_MS, NS_PER_S

Facts = dict[str, float]

METHODS = (  # of the paper's evaluation
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)

BASELINES = tuple(method.name for method in METHODS if method.baseline)

EARLY_PERCENTILES = (10, 20, 30, 40, 50)


def facts_of(frames: Columns, lookups: Columns, resources: Columns, lap_ns: int | None = None) -> Facts:
    """All facts of a run from its tables. ``lap_ns``: when the second lap begins, if there is one."""
    facts: Facts = {}
    for one in metrics.compute(METHODS, frames, lookups, resources.rows([])):  # of resources what is named below
        key = one.component or (one.method if one.placement == "all" else one.placement)
        facts[f"{one.metric}:{key}"] = math.nan if one.value is None else one.value
        if "reuse" in one.metric:
            facts[f"{one.metric}_high:{key}"] = math.nan if one.high is None else one.high
    for method in (method.name for method in METHODS):
        mine = frames.where(method=method)
        if not len(mine):
            continue
        times_ms, stamp_ns = metrics.response_ms(mine, "first"), mine["stamp_ns"]
        for percent in EARLY_PERCENTILES:
            facts[f"first_answer_p{percent}:{method}"] = _percentile(times_ms, percent)
        late = stamp_ns > stamp_ns.min() + 2 / 3 * (stamp_ns.max() - stamp_ns.min())
        for answer, name in (("fresh", "late_fresh_share"), ("first", "late_answered_share")):
            facts[f"{name}:{method}"] = float((~np.isnan(mine.floats(f"{answer}_answer_ns")))[late].mean())
        for car in frames["car"].unique():
            of_car = times_ms[mine["car"] == car]
            known = of_car[~np.isnan(of_car)]
            facts[f"first_answer_mean:{method}:{car}"] = float(known.mean()) if len(known) else math.nan
            facts[f"first_answer_p99:{method}:{car}"] = _percentile(of_car, 99)
    both = frames.where(method="remote")
    both = both.rows((both["bytes_up"] > 0) & (both["bytes_down"] > 0))
    if len(both):
        facts["image_to_objects_bytes:remote"] = ratio(both["bytes_up"].sum(), both["bytes_down"].sum())
    maps = lookups.rows(lookups["kind"] != "image")
    for placement in metrics.PLACEMENTS:
        facts[f"boost_per_object:{placement}"] = _boost_per_object(maps.where(placement=placement))
    facts["image_peak_at:car"] = _peak_at(lookups, frames)
    facts.update({f"object_reuse:{genie}": reused for genie, reused in metrics.reuse(maps).items()})
    facts.update(_of_resources(resources, lap_ns))
    return facts


def of_baselines(facts: Facts) -> Facts:
    """Of a run's facts those that no Genie had a part in."""
    plain = {name: value for name, value in facts.items() if not name.startswith("improvement_")}
    return {name: value for name, value in plain.items() if set(name.split(":")) & {*BASELINES}}


def _of_resources(resources: Columns, lap_ns: int | None) -> Facts:
    """What devices had done at the end."""
    facts: Facts = {}
    resources = resources.by("t_ns")
    cpus = [of_one.rows([-1]) for _, of_one in resources.where(method="genie", kind="cpu").groups("resource")]
    busy_ns, completed = (sum(int(one[name][0]) for one in cpus) for name in ("busy_ns", "completed"))
    facts["handling_ms"] = ratio(busy_ns / NS_PER_MS, completed)
    runs = {"": 0, ":lap1": 0}
    for method, of_method in resources.where(kind="accelerator").groups("method"):
        for resource, samples in of_method.groups("resource"):
            host, completed = resource.removesuffix(".accelerator"), samples["completed"]
            facts[f"accelerator_rate:{method}:{host}"] = ratio(completed[-1], samples["busy_ns"][-1] / NS_PER_S)
            if method == "genie":
                runs[""] += int(completed[-1])
                if lap_ns is not None:
                    runs[":lap1"] += int(completed[samples["t_ns"] <= lap_ns].max(initial=0))
    facts["detector_runs"] = float(runs[""])
    if lap_ns is not None:
        facts["detector_runs:lap1"] = float(runs[":lap1"])
        facts["detector_runs:lap2"] = facts["detector_runs"] - facts["detector_runs:lap1"]
    return facts


def _boost_per_object(maps: Columns) -> float:
    """All confidence added by the end of the run, over the objects then stored: another reading of Section V-E."""
    return ratio(maps["boost_sum"].sum(), sum(metrics.last_of_genies(maps)))


def _peak_at(lookups: Columns, frames: Columns) -> float:
    """When the highest windowed image reuse of any car's Genie was reached, as a share of the run."""
    windows = metrics.windowed_reuse(lookups.where(kind="image", requester="client", placement="car"))
    if not len(windows) or windows["ratio"].max() <= 0:
        return math.nan
    at_ns = int(windows["t_ns"][np.argmax(windows["ratio"])])
    begin_ns, end_ns = int(frames["stamp_ns"].min()), int(frames["stamp_ns"].max())
    return ratio(at_ns - begin_ns, end_ns - begin_ns)


def _percentile(values: np.ndarray, percent: float) -> float:
    known = values[~np.isnan(values)]
    return float(np.percentile(known, percent)) if len(known) else math.nan


def ratio(above: float, below: float) -> float:
    """NaN where the one below is zero."""
    return float(above / below) if below else math.nan
