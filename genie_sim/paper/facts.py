"""The numbers of one run that claims, calibration and sweeps use: ``metric:method`` of
frames, ``metric:car`` and ``metric:edge`` of Genies -> value, NaN where not defined."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from genie_sim.analysis import metrics
from genie_sim.paper.definitions import fact
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import MethodInfo, Metric
from genie_sim.units import NS_PER_MS, NS_PER_S

Facts = dict[str, float]

METHODS = (  # of the paper's evaluation
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)

BASELINES = tuple(method.name for method in METHODS if method.baseline)

FOR_EVER_NS = 2**62
EARLY_PERCENTILES = (10, 20, 30, 40, 50)


def facts_of(
    frames: Columns, lookups: Columns, resources: Columns, redefined: bool = True
) -> Facts:
    """All facts of a run from its tables, as the default defines its metrics, and with ``redefined`` under every other
    definition, too (``definitions.fact``)."""
    facts = _of_metrics(
        metrics.compute(METHODS, {"frames": frames, "lookups": lookups}, intervals=False)
    )
    facts.update(_of_early_and_late(frames))
    both = frames.where(method="remote")
    both = both.rows((both["bytes_up"] > 0) & (both["bytes_down"] > 0))
    if len(both):
        facts["image_to_objects_bytes:remote"] = ratio(
            both["bytes_up"].sum(), both["bytes_down"].sum()
        )
    maps = lookups.rows(lookups["kind"] != "image")
    for placement in metrics.PLACEMENTS:
        facts[f"boost_per_object:{placement}"] = _boost_per_object(maps.where(placement=placement))
    of_cars = lookups.where(kind="image", requester="client", placement="car")
    facts["image_peak_at:car"] = _peak_at(metrics.windowed_reuse(of_cars), frames)
    facts.update({f"object_reuse:{genie}": reused for genie, reused in metrics.reuse(maps).items()})
    if redefined:
        facts.update(_from_stamp(frames, lookups, resources))
        facts.update(of_running_ratios(lookups))
        facts["image_running_peak_at:car"] = _peak_at(metrics.running_reuse(of_cars), frames)
    facts.update(
        _of_resources(resources, frames["stamp_ns"][frames["lap"] == 1].min(initial=FOR_EVER_NS))
    )
    return facts


def _from_stamp(frames: Columns, lookups: Columns, resources: Columns) -> Facts:
    """Times from the camera's stamp, and what follows from them, by names of their own."""
    stamped = frames.assign(received_ns=frames["stamp_ns"])
    found = _of_metrics(metrics.compute(METHODS, {"frames": stamped}, intervals=False))
    found |= _of_early_and_late(stamped)
    return {
        renamed: found[name] for name in found if (renamed := fact(name, {"time": "stamp"})) != name
    }


def _of_metrics(found: Iterable[Metric]) -> Facts:
    """Each metric's value; of reuse the highest window, too."""
    facts: Facts = {}
    for one in found:
        key = one.component or (one.method if one.placement == "all" else one.placement)
        facts[f"{one.metric}:{key}"] = math.nan if one.value is None else one.value
        if "reuse" in one.metric:
            facts[f"{one.metric}_high:{key}"] = math.nan if one.high is None else one.high
    return facts


def _of_early_and_late(frames: Columns) -> Facts:
    """Of each method the early percentiles, the answers to the last third of the frames, and each car's times."""
    facts: Facts = {}
    for method in (method.name for method in METHODS):
        mine = frames.where(method=method)
        if not len(mine):
            continue
        times_ms, stamp_ns = metrics.response_ms(mine, "first"), mine["stamp_ns"]
        for percent, value in zip(
            EARLY_PERCENTILES, _percentiles(times_ms, EARLY_PERCENTILES), strict=True
        ):
            facts[f"first_answer_p{percent}:{method}"] = value
        late = stamp_ns > stamp_ns.min() + 2 / 3 * (stamp_ns.max() - stamp_ns.min())
        for answer, name in (("fresh", "late_fresh_share"), ("first", "late_answered_share")):
            facts[f"{name}:{method}"] = float(
                (~np.isnan(mine.floats(f"{answer}_answer_ns")))[late].mean()
            )
        for car in frames["car"].unique():
            of_car = times_ms[mine["car"] == car]
            known = of_car[~np.isnan(of_car)]
            facts[f"first_answer_mean:{method}:{car}"] = (
                float(known.mean()) if len(known) else math.nan
            )
            facts[f"first_answer_p99:{method}:{car}"] = _percentiles(of_car, [99])[0]
    return facts


def of_baselines(facts: Facts) -> Facts:
    """Of a run's facts those that no Genie had a part in."""
    plain = {name: value for name, value in facts.items() if not name.startswith("improvement_")}
    return {name: value for name, value in plain.items() if set(name.split(":")) & {*BASELINES}}


def of_running_ratios(lookups: Columns) -> Facts:
    """The highest running ratio that any Genie of a role had, for each of the reuse metrics with error bars."""
    of_image = lookups["kind"] == "image"
    images, objects = lookups.rows(of_image), lookups.rows(~of_image)
    facts: Facts = {}
    for metric, events in (
        ("image_reuse", images.where(requester="client")),
        ("image_reuse_with_neighbours", images),
        ("object_reuse", objects),
    ):
        for placement in metrics.PLACEMENTS:
            ratios = metrics.running_reuse(events.where(placement=placement))["ratio"]
            facts[f"{metric}_highest_running:{placement}"] = (
                float(ratios.max()) if len(ratios) else math.nan
            )
    return facts


def _of_resources(resources: Columns, lap_ns: int) -> Facts:
    """What devices had done at the end, and detectors when the second lap began."""
    facts: Facts = {}
    resources = resources.by("t_ns")
    cpus = [
        of_one.rows([-1])
        for _, of_one in resources.where(method="genie", kind="cpu").groups("resource")
    ]
    busy_ns, completed = (
        sum(int(one[name][0]) for one in cpus) for name in ("busy_ns", "completed")
    )
    facts["handling_ms"] = ratio(busy_ns / NS_PER_MS, completed)
    runs = lap1 = 0
    for method, of_method in resources.where(kind="accelerator").groups("method"):
        for resource, samples in of_method.groups("resource"):
            host, completed = resource.removesuffix(".accelerator"), samples["completed"]
            facts[f"accelerator_rate:{method}:{host}"] = ratio(
                completed[-1], samples["busy_ns"][-1] / NS_PER_S
            )
            if method == "genie":
                runs += int(completed[-1])
                lap1 += int(completed[samples["t_ns"] <= lap_ns].max(initial=0))
    of_laps = {":lap1": lap1, ":lap2": runs - lap1} if lap_ns < FOR_EVER_NS else {}
    return facts | {
        f"detector_runs{lap}": float(count) for lap, count in {"": runs, **of_laps}.items()
    }


def _boost_per_object(maps: Columns) -> float:
    """All confidence added by the end of the run, over the objects then stored: another reading of Section V-E."""
    return ratio(maps["boost_sum"].sum(), sum(metrics.last_of_genies(maps)))


def _peak_at(ratios: Columns, frames: Columns) -> float:
    """When the highest ratio was reached, as a share of the run."""
    if not len(ratios) or ratios["ratio"].max() <= 0:
        return math.nan
    at_ns = int(ratios["t_ns"][np.argmax(ratios["ratio"])])
    begin_ns, end_ns = int(frames["stamp_ns"].min()), int(frames["stamp_ns"].max())
    return ratio(at_ns - begin_ns, end_ns - begin_ns)


def _percentiles(values: np.ndarray, percents: Sequence[float]) -> list[float]:
    known = values[~np.isnan(values)]
    return np.percentile(known, percents).tolist() if len(known) else [math.nan] * len(percents)


def ratio(above: float, below: float) -> float:
    """NaN where the one below is zero."""
    return float(above / below) if below else math.nan
