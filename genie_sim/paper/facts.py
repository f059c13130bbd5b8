"""The numbers of one run that claims, calibration and sweeps use: ``metric:method`` of
frames, ``metric:car`` and ``metric:edge`` of Genies -> value, NaN where not defined."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from genie_sim.analysis import metrics
from genie_sim.recording.results import MethodInfo
from genie_sim.units import NS_PER_MS, NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

Facts = dict[str, float]

METHODS = (  # of the paper's evaluation
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)

EARLY_PERCENTILES = (10, 20, 30, 40, 50)


def facts_of(
    frames: pd.DataFrame, lookups: pd.DataFrame, resources: pd.DataFrame, lap_ns: int | None = None
) -> Facts:
    """All facts of a run from its tables. ``lap_ns``: when the second lap begins, if there is one."""
    facts: Facts = {}
    cars = sorted(frames["car"].astype(str).unique())
    for one in metrics.compute(METHODS, frames, lookups, resources.iloc[:0]):  # of resources what is named below
        key = one.component or (one.method if one.placement == "all" else one.placement)
        facts[f"{one.metric}:{key}"] = math.nan if one.value is None else one.value
        if "reuse" in one.metric:
            facts[f"{one.metric}_high:{key}"] = math.nan if one.high is None else one.high
    for method in (method.name for method in METHODS):
        mine = frames[frames["method"] == method]
        if mine.empty:
            continue
        times_ms = metrics.response_ms(mine, "first")
        for percent in EARLY_PERCENTILES:
            facts[f"first_answer_p{percent}:{method}"] = _percentile(times_ms, percent)
        late = mine["stamp_ns"] > mine["stamp_ns"].min() + 2 / 3 * (mine["stamp_ns"].max() - mine["stamp_ns"].min())
        facts[f"late_fresh_share:{method}"] = float(mine["fresh_answer_ns"].notna()[late].mean())
        facts[f"late_answered_share:{method}"] = float(mine["first_answer_ns"].notna()[late].mean())
        for car in cars:
            of_car = metrics.response_ms(mine[mine["car"] == car], "first")
            known = of_car[~np.isnan(of_car)]
            facts[f"first_answer_mean:{method}:{car}"] = float(known.mean()) if len(known) else math.nan
            facts[f"first_answer_p99:{method}:{car}"] = _percentile(of_car, 99)
    both = frames[(frames["method"] == "remote") & (frames["bytes_up"] > 0) & (frames["bytes_down"] > 0)]
    facts["image_to_objects_bytes"] = ratio(both["bytes_up"].sum(), both["bytes_down"].sum())
    for placement in metrics.PLACEMENTS:
        facts[f"boost_per_object:{placement}"] = _boost_per_object(lookups[lookups["placement"] == placement])
    facts["image_peak_at:car"] = _peak_at(lookups, frames)
    for genie, reused in metrics.reuse(lookups[lookups["kind"] != "image"]).items():
        facts[f"object_reuse:{genie}"] = float(reused)
    facts.update(_of_resources(resources, lap_ns))
    return facts


def _of_resources(resources: pd.DataFrame, lap_ns: int | None) -> Facts:
    facts: Facts = {}
    last = resources.sort_values("t_ns", kind="stable").groupby(["method", "resource"], observed=True).last()
    last = last.reset_index()
    cpus = last[(last["method"] == "genie") & (last["kind"] == "cpu")]
    facts["handling_ms"] = ratio(cpus["busy_ns"].sum() / NS_PER_MS, cpus["completed"].sum())
    accelerators = last[last["kind"] == "accelerator"]
    columns = (accelerators[name].tolist() for name in ("method", "resource", "completed", "busy_ns"))
    for method, resource, completed, busy_ns in zip(*columns, strict=True):
        host = str(resource).removesuffix(".accelerator")
        facts[f"accelerator_rate:{method}:{host}"] = ratio(completed, busy_ns / NS_PER_S)
    of_genie = resources[(resources["method"] == "genie") & (resources["kind"] == "accelerator")]
    facts["detector_runs"] = float(accelerators.loc[accelerators["method"] == "genie", "completed"].sum())
    if lap_ns is not None:
        first = of_genie[of_genie["t_ns"] <= lap_ns].groupby("resource", observed=True)["completed"].max().sum()
        facts["detector_runs:lap1"] = float(first)
        facts["detector_runs:lap2"] = facts["detector_runs"] - float(first)
    return facts


def _boost_per_object(lookups: pd.DataFrame) -> float:
    """All confidence added by the end of the run, over the objects then stored: another reading of Section V-E."""
    maps = lookups[lookups["kind"] != "image"]
    return ratio(maps["boost_sum"].sum(), maps.groupby("genie", observed=True)["entries"].last().sum())


def _peak_at(lookups: pd.DataFrame, frames: pd.DataFrame) -> float:
    """When the highest windowed image reuse of any car's Genie was reached, as a share of the run."""
    of_clients = (lookups["kind"] == "image") & (lookups["requester"] == "client")
    windows = metrics.windowed_reuse(lookups[of_clients & (lookups["placement"] == "car")])
    if not len(windows) or windows["ratio"].max() <= 0:
        return math.nan
    at_ns = int(windows["t_ns"].to_numpy()[np.argmax(windows["ratio"].to_numpy(float))])
    begin_ns, end_ns = int(frames["stamp_ns"].min()), int(frames["stamp_ns"].max())
    return ratio(at_ns - begin_ns, end_ns - begin_ns)


def _percentile(values: np.ndarray, percent: float) -> float:
    known = values[~np.isnan(values)]
    return float(np.percentile(known, percent)) if len(known) else math.nan


def ratio(above: float, below: float) -> float:
    """NaN where the one below is zero."""
    return float(above / below) if below else math.nan
