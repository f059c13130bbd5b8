"""Where a Genie pays off: the study behind docs/results.md, which has the results.

    GENIE_SIM_KITTI=... python -m studies.where_it_pays traces|choose|reported

``traces`` makes the traces of all tracking sequences. Every other step is a sweep: its tables and
its page are in ``results/studies/where_it_pays/STEP``, and what is there already is not simulated
again. The means of its runs go to ``results/where_it_pays/STEP.csv``, and the Genie's differences
to the best other method to ``STEP_gains.csv``. Conditions and methods are those of the shipped
sweep ``where_it_pays``; tracking sequences are added to them.

Declared before any of it was run:

- *Cameras*: real streams alone. Drive 2011_09_26/0005 has recordings 02 and 03; the tracking
  sequences have published detections in 02 alone, one camera a car.
- *Methods*: local, remote and paced remote execution, each with a tracker in the car, and the
  recommended Genie. All of them use the same laws of the detector.
- *Budget*: ten points for each method, ``p_min`` from 0.5 to 0.9 and ``tau`` 0 or 100 ms.
- *Development*: drive 0005 (Ethernet, raw; 5G, JPEG 80), ten tracking sequences (each over
  Ethernet, raw, and over 5G, 86 kB), 4 s of a town over 5G; seed 1.
- *Rule*: the highest mean of streaming F1, where the conditions of a drive are averaged first, then
  the drives; the town counts as one. What the shipped sweep has stays if it is within 0.002 of the
  highest.
- *Tuned to towns*: the same ten points and the same rule on 4 s of three towns (seeds 1 to 3)
  under three conditions. Reported beside the others.
- *Reported*: sequences 0002, 0004, 0008 and 0010, seeds 1 to 5, and towns of seeds 201 to 205,
  which nobody had run. The four sequences had been looked at once before, under other cameras, pace
  and laws. Sequence 0000 is drive 0005 and counts nowhere.
- *Gain*: streaming F1 of the Genie less that of the method without one whose mean is best in that
  condition. Intervals are 95 % t intervals over seeds of one condition, or over drives and towns.
"""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from statistics import fmean, variance
from typing import Any

import pandas as pd

import genie_sim as gs
from genie_sim.analysis.statistics import half_of_mean, mean_and_spread, t_quantile
from genie_sim.study.design import load_design

OUT = Path("results/studies/where_it_pays")
KEPT = Path("results/where_it_pays")
DEVELOPMENT = ("0003", "0005", "0006", "0007", "0009", "0014", "0015", "0016", "0017", "0019")
REPORTED = ("0002", "0004", "0008", "0010")
TOWN_SEEDS = range(201, 206)
NEAR = 0.002
FOR_TOWNS = "_for_towns"
GENIE = "genie_recommended"
WITHOUT_GENIE = ("local_tracker", "remote_tracker", "paced_tracker")
POINTS = tuple(product((*WITHOUT_GENIE, GENIE), (0.5, 0.6, 0.7, 0.8, 0.9), (0, 100)))
USUAL = {  # p_min and tau [ms] of the shipped sweep
    "local_tracker": (0.8, 0),
    "remote_tracker": (0.9, 100),
    "paced_tracker": (0.8, 0),
    GENIE: (0.8, 100),
}
SHOWN = {  # and where
    "streaming_f1": "all",
    "ghost_share": "all",
    "first_answer_mean": "all",
    "bytes_up_per_frame": "all",
    "accelerator_time": "edge",
    "energy_per_frame": "all",
}
OF_REMOTE = {
    "bytes_up_per_frame": "bytes",
    "accelerator_time": "edge_time",
    "energy_per_frame": "energy",
}
CAMERA = {"name": "camera_02", "recording": "02"}

_DESIGN = load_design("where_it_pays")
METHODS: dict[str, dict[str, Any]] = {entry["name"]: entry for entry in _DESIGN.settings["methods"]}
Conditions = dict[str, dict[str, Any]]
SHIPPED: Conditions = dict(_DESIGN.axes["condition"].cases)  # type: ignore[arg-type]
TOWNS = {name: case for name, case in SHIPPED.items() if name.startswith("town")}
DRIVE = {name: case for name, case in SHIPPED.items() if name not in TOWNS}
SHORT_TOWNS = {name: case | {"perception.duration": "4 s"} for name, case in TOWNS.items()}


def trace(sequence: str) -> str:
    """The trace of a tracking sequence, with its truth beside it, made where it is missing."""
    path = OUT / "traces" / f"tracking_{sequence}.parquet"
    if not path.with_suffix(".truth.parquet").is_file():
        truth = ["import", "truth", "--drive", f"tracking/{sequence}", "--trace", str(path)]
        for command in (
            ["tools.make.published", "--sequence", sequence, "--out", str(path)],
            ["genie_sim", *truth],
        ):
            subprocess.run([sys.executable, "-m", *command], check=True)
    return str(path)


def windows(trace_file: str) -> dict[str, Any]:
    """Of each car that would drive on after the end of a drive: its window up to there."""
    end_s = (pd.read_parquet(trace_file, columns=["stamp_ns"])["stamp_ns"].max() + 1) / 1e9
    cars = gs.load_scenario("3car_recommended").cars
    begins_ends_ns = [car.route.window_ns for car in cars]
    return {
        f"cars[{car}].route.window": [f"{begin_ns / 1e9} s", f"{end_s:.9f} s"]
        for car, (begin_ns, end_ns) in enumerate(begins_ends_ns)
        if end_ns / 1e9 > end_s
    }


def sequences(numbers: Sequence[str]) -> Conditions:
    """The conditions of tracking sequences: one camera a car, two links. The windows of cars end
    with the drive.
    """
    conditions: Conditions = {}
    for number in numbers:
        recorded = {"perception.trace": trace(number)} | windows(trace(number))
        small = {"cameras": [CAMERA | {"size": "86 kB"}]}
        conditions[f"{number}, Ethernet, raw"] = recorded | {"cameras": [CAMERA]}
        conditions[f"{number}, 5G, 86 kB"] = recorded | small | {"cars[*].link": "nr5g"}
    return conditions


def tuned(name: str, p_min: float, tau_ms: int, called: str) -> dict[str, Any]:
    """A method of the sweep with other settings of its tracks."""
    settings = {"p_min": p_min, "tau": f"{tau_ms} ms"}
    entry = METHODS[name] | {"name": called}
    if name == GENIE:
        return entry | settings
    return entry | {"consumer": {"name": "tracker", **settings}}


def simulated(
    step: str, conditions: Conditions, methods: Sequence[Mapping[str, Any]], seeds: Sequence[int]
) -> pd.DataFrame:
    """Every run: rows are conditions, seeds and methods, columns are the metrics of ``SHOWN``."""
    runs = gs.sweep(
        "3car_recommended",
        {"condition": {"list": conditions}},
        {"methods": list(methods), "record": ["held", "resources"]},
        seeds=seeds,
        out=OUT / step,
    ).every_run
    runs = runs[(runs["placement"] == runs["metric"].map(SHOWN)) & (runs["component"] == "")]
    by = ["condition", "seed", "method"]
    table = runs.pivot_table("value", by, "metric", sort=False)
    return table.reindex(columns=[metric for metric in SHOWN if metric in table])


def keep(step: str, table: pd.DataFrame) -> None:
    """Writes and prints a table of ``results/where_it_pays``."""
    KEPT.mkdir(parents=True, exist_ok=True)
    table.round(4).to_csv(KEPT / f"{step}.csv")
    print(table.round(3).to_string())


def drive_of(condition: str) -> str:
    """What counts once in a mean over drives; all conditions of the shipped sweep's drive do."""
    return "drive 0005" if condition in DRIVE else condition.partition(",")[0]


def chosen(
    step: str, conditions: Conditions, seeds: Sequence[int], suffix: str
) -> list[dict[str, Any]]:
    """Every method at the ``p_min`` and ``tau`` of the declared rule; keeps the means."""
    points = {f"{m}-{p_min:g}-{tau}": (m, p_min, tau) for m, p_min, tau in POINTS}
    methods = [tuned(*point, called) for called, point in points.items()]
    f1 = simulated(step, conditions, methods, seeds)["streaming_f1"]
    by_condition = f1.groupby(["condition", "method"], sort=False).mean().unstack("method")
    means = by_condition.groupby(by_condition.index.map(drive_of)).mean().mean()
    table = pd.DataFrame([(*points[str(name)], f1) for name, f1 in means.items()])
    table = table.set_axis(["method", "p_min", "tau_ms", "streaming_f1"], axis=1)
    keep(step, table.set_index("method"))
    found = []
    for name, rows in table.groupby("method"):
        of_point = rows.set_index(["p_min", "tau_ms"])["streaming_f1"]
        stays = of_point[USUAL[str(name)]] >= of_point.max() - NEAR
        point: Any = USUAL[str(name)] if stays else of_point.idxmax()
        print(f"{name}{suffix}: p_min {point[0]:g}, tau {point[1]} ms")
        found.append(tuned(str(name), point[0], point[1], f"{name}{suffix}"))
    return found


def traces() -> None:
    """The traces of all tracking sequences of this study."""
    for number in (*DEVELOPMENT, *REPORTED):
        print(trace(number))


def choose() -> list[dict[str, Any]]:
    """The settings of every method, for all conditions."""
    conditions = {name: DRIVE[name] for name in ("Ethernet, raw", "5G, JPEG 80")}
    conditions |= sequences(DEVELOPMENT)
    conditions["town, 5G"] = SHORT_TOWNS["town, 5G"]
    return chosen("choose", conditions, (1,), "")


def choose_for_towns() -> list[dict[str, Any]]:
    """The settings of every method, for towns alone."""
    return chosen("choose_for_towns", SHORT_TOWNS, (1, 2, 3), FOR_TOWNS)


def reported() -> None:
    """Drives and towns on which nothing was chosen. Run it once."""
    found, for_towns = choose(), choose_for_towns()
    drives = simulated("reported_drives", sequences(REPORTED), found, range(1, 6))
    towns = simulated("reported_towns", TOWNS, [*found, *for_towns], TOWN_SEEDS)
    runs = pd.concat([drives, towns])
    keep("reported", runs.groupby(["condition", "method"], sort=False).mean())
    rows, of_drive = gains(drives, "")
    for link in ("Ethernet, raw", "5G, 86 kB"):
        of_link = [gain.mean() for name, gain in of_drive.items() if name.endswith(link)]
        rows.append({"condition": f"four sequences, {link}", **interval(*over_seeds(of_link))})
    for suffix, settings in (("", ""), (FOR_TOWNS, ", tuned to towns")):
        of_town_rows, of_town = gains(towns, suffix)
        rows += [row | {"condition": row["condition"] + settings} for row in of_town_rows]
        mean = interval(*over_all(of_drive, of_town))
        rows.append({"condition": f"sequences and towns{settings}", **mean})
    keep("reported_gains", pd.DataFrame(rows).set_index("condition"))


def gains(runs: pd.DataFrame, suffix: str) -> tuple[list[dict[str, Any]], dict[str, pd.Series]]:
    """For each condition a row of the Genie beside the method without one that is best in the mean;
    and its gains in streaming F1 by seed. ``suffix`` ends the names of the methods.
    """
    rows, gains = [], {}
    for name, of_condition in runs.groupby("condition", sort=False):
        means = of_condition.groupby("method").mean()
        others = [f"{other}{suffix}" for other in WITHOUT_GENIE]
        best = str(means.loc[others, "streaming_f1"].idxmax())
        genie, other, remote = (means.loc[m] for m in (f"{GENIE}{suffix}", best, others[1]))
        f1 = of_condition["streaming_f1"].unstack("method")
        gain = (f1[f"{GENIE}{suffix}"] - f1[best]).droplevel("condition")
        gains[str(name)] = gain
        row: dict[str, Any] = {"condition": name, **interval(*over_seeds(gain.tolist()))}
        row |= {"best": best, "best_f1": other["streaming_f1"], "genie_f1": genie["streaming_f1"]}
        for metric, short in OF_REMOTE.items():
            row[f"{short}_of_remote"] = genie[metric] / remote[metric]
        rows.append(row)
    return rows, gains


def over_all(
    of_drive: Mapping[str, pd.Series], of_town: Mapping[str, pd.Series]
) -> tuple[float, float]:
    """The mean gain over all conditions, and half of its interval over drives and towns.

    The conditions of one drive are averaged first. Every seed invents a town.
    """
    drives: dict[str, list[float]] = {}
    for name, gain in of_drive.items():
        drives.setdefault(drive_of(name), []).append(gain.mean())
    towns = pd.concat(of_town.values(), axis=1).mean(axis=1).tolist()
    share = len(of_town) / (len(of_drive) + len(of_town))
    return stratified([(1 - share, [fmean(values) for values in drives.values()]), (share, towns)])


def over_seeds(values: Sequence[float]) -> tuple[float, float]:
    """Mean, and half of its 95 % t interval: 0 for one value."""
    mean, spread = mean_and_spread(values)
    return mean, half_of_mean(spread, len(values)) if len(values) > 1 else 0.0


def interval(mean: float, half: float) -> dict[str, float]:
    """A mean gain and its interval."""
    return {"gain": mean, "low": mean - half, "high": mean + half}


def stratified(strata: Sequence[tuple[float, Sequence[float]]]) -> tuple[float, float]:
    """The weighted mean of the means of several samples, and half of its 95 % interval.

    The weights sum to 1. The degrees of freedom are Welch's, rounded down.
    """
    mean = sum(weight * fmean(sample) for weight, sample in strata)
    parts = [(w**2 * variance(sample) / len(sample), len(sample) - 1) for w, sample in strata]
    total = sum(part for part, _ in parts)
    if total == 0:
        return mean, 0.0
    freedom = total**2 / sum(part**2 / free for part, free in parts)
    return mean, t_quantile(math.floor(freedom + 1e-9)) * math.sqrt(total)


STEPS = {step.__name__: step for step in (traces, choose, reported)}

if __name__ == "__main__":
    STEPS[sys.argv[1]]()
