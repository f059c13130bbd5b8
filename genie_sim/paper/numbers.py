"""The numbers of runs that claims are tested with: each metric of a run under its own name, and
what the paper tells besides. One table holds them: scenario x variant x seed x number.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.analysis import frame_metrics, genie_metrics
from genie_sim.analysis.metric import DEADLINE_MS
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.record import tables
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, MetricValue, Run
from genie_sim.record.tables import Column, Schema, Table

if TYPE_CHECKING:
    import pandas as pd

METHODS = (  # of the paper's evaluation
    MethodInfo("local", "local (L)", baseline=True),
    MethodInfo("remote", "remote (R)", baseline=True),
    MethodInfo("genie", "Genie (DG)", baseline=False),
)
FILE = "numbers.parquet"
FOR_EVER_NS = 2**62
EARLY_PERCENTILES = (10, 20, 30, 40, 50)
RELATIVE = 1e-6  # sums of floats may end differently on another machine


class Number(NamedTuple):
    """Which number of a run, by the same four names as in its ``metrics.json``.

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


Numbers = dict[Number, float]  # NaN where not defined
SCHEMA = Schema(
    "evaluation_numbers",
    "A number of a run of the evaluation.",
    (
        Column("variant", "text", "", "what was changed for some claims, or base"),
        Column("scenario", "text", "", "the scenario that was simulated"),
        Column("seed", "int32", "", "the seed"),
        Column("metric", "text", "", "as in the metrics of a run, or the evaluation's own"),
        Column("method", "text", "", "the method"),
        Column("placement", "text", "", "car, edge or all"),
        Column("component", "text", "", "a baseline, a car, an edge, a Genie or a lap, or empty"),
        Column("value", "float64", "", "NaN where it is not defined"),
    ),
)


def placed(metric: str, placement: str) -> Number:
    """A metric of the Genies on ``car`` or ``edge``."""
    return Number(metric, placement=placement)


def of_run(run: Run) -> Numbers:
    """All numbers of a run: its metrics, and those that only the evaluation asks for."""
    return of_tables(run.tables) | of_metrics(run.measured)  # a metric of runs is that of the run


def of_metrics(measured: Iterable[MetricValue]) -> Numbers:
    """Each metric's value by its own name, and the ends of the range of a reuse."""
    numbers: Numbers = {}
    for row in measured:
        number = Number(row.metric, row.method, row.placement, row.component)
        numbers[number] = math.nan if row.value is None else row.value
        if row.range_low is not None and row.range_high is not None:
            numbers[number._replace(metric=f"{row.metric}_lowest")] = row.range_low
            numbers[number._replace(metric=f"{row.metric}_highest")] = row.range_high
    return numbers


def of_tables(columns: Mapping[str, Columns]) -> Numbers:
    """The numbers that only the evaluation asks for, from a run's tables ``frames``, ``lookups``
    and ``resources``.
    """
    frames, lookups = columns["frames"], columns["lookups"]
    lap_ns = frames["stamp_ns"][frames["lap"] == 1].min(initial=FOR_EVER_NS)
    return {
        **_of_answers(frames),
        **_of_bytes(frames),
        **_of_lookups(lookups, frames),
        **_of_resources(columns["resources"], int(lap_ns)),
    }


def write(folder: Path, numbers: "pd.DataFrame") -> None:
    """Writes the numbers of runs, a row each: the columns of ``SCHEMA``. Raises OSError."""
    names = [column.name for column in SCHEMA.columns]
    table = Table(SCHEMA)
    for row in numbers[names].sort_values(names[:-1]).itertuples(index=False, name=None):
        table.append(row)
    table.write(folder / FILE)


def read(folder: Path) -> "pd.DataFrame":
    """The numbers of an evaluation. Raises ``UserError``."""
    return tables.read(folder / FILE, SCHEMA).to_frame()


def differences(
    kept_numbers: Mapping[Number, float], new_numbers: Mapping[Number, float]
) -> list[str]:
    """The numbers that one has and the other has not, or that differ."""
    lines = [str(number) for number in sorted(kept_numbers.keys() ^ new_numbers.keys())]
    for number in sorted(kept_numbers.keys() & new_numbers.keys()):
        before, now = kept_numbers[number], new_numbers[number]
        is_close = math.isclose(before, now, rel_tol=RELATIVE, abs_tol=1e-12)
        if not (is_close or (math.isnan(before) and math.isnan(now))):
            lines.append(f"{number}: {before:g} is now {now:g}")
    return lines


def table_differences(kept_table: "pd.DataFrame", new_table: "pd.DataFrame") -> list[str]:
    """The same of two evaluations' tables, with the run that each number is of."""
    lines = []
    sides = [_by_run(table) for table in (kept_table, new_table)]
    for place in sorted({*sides[0], *sides[1]}):
        before, now = (side.get(place, {}) for side in sides)
        variant, scenario, seed = place
        lines += [
            f"{scenario}, {variant}, seed {seed}: {line}" for line in differences(before, now)
        ]
    return lines


def _by_run(table: "pd.DataFrame") -> dict[tuple[str, str, int], Numbers]:
    names = ["variant", "scenario", "seed", *Number._fields, "value"]
    runs: dict[tuple[str, str, int], Numbers] = {}
    for variant, scenario, seed, *number, value in table[names].itertuples(index=False, name=None):
        runs.setdefault((variant, scenario, int(seed)), {})[Number(*number)] = value
    return runs


def _of_answers(frames: Columns) -> Numbers:
    """Of each method the early percentiles of first answers; its times to the result, a detection
    or a cached answer of this very frame; each car's times; and what the last third of the frames
    gets.
    """
    numbers: Numbers = {}
    for method, rows in frames.groups("method"):
        first_ms, result_ms = (
            frame_metrics.response_ms(rows, answer) for answer in ("first", "result")
        )
        early = _percentiles(first_ms, EARLY_PERCENTILES)
        numbers |= {
            Number(f"first_answer_p{percent}", method): time_ms
            for percent, time_ms in zip(EARLY_PERCENTILES, early, strict=True)
        }
        numbers |= {
            Number("result_answer_mean", method): _mean(result_ms),
            Number("result_under_deadline_share", method): float(np.mean(result_ms < DEADLINE_MS)),
            Number("result_answered_share", method): float(np.mean(~np.isnan(result_ms))),
        }
        for car in rows["car"].unique():
            of_car = first_ms[rows["car"] == car]
            median, late, latest = _percentiles(of_car, [50, 99, 100])
            numbers |= {
                Number("first_answer_mean", method, component=car): _mean(of_car),
                Number("first_answer_p50", method, component=car): median,
                Number("first_answer_p99", method, component=car): late,
                Number("first_answer_max", method, component=car): latest,
            }
        stamp_ns = rows["stamp_ns"]
        last = stamp_ns > stamp_ns.min() + 2 / 3 * (stamp_ns.max() - stamp_ns.min())
        for metric, times_ms in (("late_result", result_ms), ("late_answered", first_ms)):
            numbers[Number(f"{metric}_share", method)] = float(np.mean(~np.isnan(times_ms[last])))
    return numbers


def _of_bytes(frames: Columns) -> Numbers:
    """How much larger an image is than the answers sent down for it."""
    remote = frames.where(method="remote")
    remote = remote.rows((remote["bytes_up"] > 0) & (remote["bytes_down"] > 0))
    if not len(remote):
        return {}
    share = ratio(remote["bytes_up"].sum(), remote["bytes_down"].sum())
    return {Number("image_to_objects_bytes", "remote"): share}


def _of_lookups(lookups: Columns, frames: Columns) -> Numbers:
    """Object reuse of each Genie, and when the image reuse of cars was highest."""
    of_genies = genie_metrics.reuse(genie_metrics.objects(lookups))
    numbers = {
        Number("object_reuse", component=genie): reused for genie, reused in of_genies.items()
    }
    running = genie_metrics.running_reuse(genie_metrics.images(lookups).where(placement="car"))
    return numbers | {placed("image_peak_at", "car"): _peak_at(running, frames)}


def _of_resources(resources: Columns, lap_ns: int) -> Numbers:
    """What devices had done at the end, and detectors when the second lap began."""
    resources = resources.by("t_ns")
    busy_ns = handled = 0
    for _, samples in resources.where(method="genie", kind="cpu").groups("resource"):
        busy_ns += int(samples["busy_ns"][-1])
        handled += int(samples["completed"][-1])
    numbers = {Number("handling_ms"): ratio(busy_ns / NS_PER_MS, handled)}
    runs = in_lap1 = 0
    for method, of_method in resources.where(kind="accelerator").groups("method"):
        for resource, samples in of_method.groups("resource"):
            host, completed = resource.removesuffix(".accelerator"), samples["completed"]
            rate = ratio(completed[-1], samples["busy_ns"][-1] / NS_PER_S)
            numbers[Number("accelerator_rate", method, component=host)] = rate
            if method == "genie":
                runs += int(completed[-1])
                in_lap1 += int(completed[samples["t_ns"] <= lap_ns].max(initial=0))
    numbers[Number("detector_runs")] = float(runs)
    if lap_ns < FOR_EVER_NS:
        numbers[Number("detector_runs", component="lap1")] = float(in_lap1)
        numbers[Number("detector_runs", component="lap2")] = float(runs - in_lap1)
    return numbers


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


def ratio(above: Any, below: Any) -> float:
    """NaN where the one below is zero."""
    return float(above / below) if below else math.nan
