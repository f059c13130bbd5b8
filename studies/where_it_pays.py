"""Where a Genie pays off: the study behind docs/where-it-pays.md, which has the results.

    GENIE_SIM_KITTI=... python -m studies.where_it_pays traces|choose|second|seen|held_out|towns

``traces`` makes the traces of all tracking sequences. Every other step is a sweep: its tables and
its page are in ``results/studies/where_it_pays/STEP/sweep``, and what is there already is not
simulated again. Conditions and methods are those of the shipped sweep ``where_it_pays``; tracking
sequences are added to them.
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
from genie_sim.analysis.statistics import over_seeds, t_quantile
from genie_sim.study.design import load_design

OUT = Path("results/studies/where_it_pays")
TUNING = ("0003", "0005", "0007", "0009", "0014", "0016", "0019")
SEEN = ("0006", "0017", "0015")
HELD_OUT = ("0002", "0004", "0008", "0010")
P_MINS, TAUS_MS = (0.5, 0.6, 0.7, 0.8, 0.9), (0, 100)
WITHOUT_GENIE = ("local_tracker", "remote_tracker", "paced_tracker")
GENIE = "genie_recommended"
CAMERA = {"name": "camera_02", "recording": "02"}

_DESIGN = load_design("where_it_pays")
METHODS: dict[str, dict[str, Any]] = {entry["name"]: entry for entry in _DESIGN.settings["methods"]}
Conditions = dict[str, dict[str, Any]]
SHIPPED: Conditions = dict(_DESIGN.axes["condition"].cases)  # type: ignore[arg-type]
TOWNS = {name: case for name, case in SHIPPED.items() if name.startswith("town")}
DRIVE = {name: case for name, case in SHIPPED.items() if name not in TOWNS}


def trace(sequence: str) -> str:
    """The trace of a tracking sequence, with its truth beside it, made where it is missing."""
    path = OUT / "traces" / f"tracking_{sequence}.parquet"
    if not path.is_file():
        drive = ["--drive", f"tracking/{sequence}"]
        for command in (
            ["perceive", *drive, "--detector", "pointrcnn", "--out", str(path)],
            ["truth", *drive, "--trace", str(path)],
        ):
            subprocess.run([sys.executable, "-m", "genie_sim", *command], check=True)
    return str(path)


def sequences(numbers: Sequence[str]) -> Conditions:
    """The conditions of tracking sequences: one camera a car, two links."""
    links = {f"cars[{car}].link": "nr5g" for car in range(3)}
    conditions: Conditions = {}
    for number in numbers:
        recorded = {"perception.trace": trace(number)}
        small = {"cameras": [CAMERA | {"size": "86 kB"}]}
        conditions[f"{number}, Ethernet, raw"] = recorded | {"cameras": [CAMERA]}
        conditions[f"{number}, 5G, 86 kB"] = recorded | small | links
    return conditions


def tuned(name: str, p_min: float, tau_ms: int) -> dict[str, Any]:
    """A method of the sweep with other settings of its tracks."""
    settings = {"p_min": p_min, "tau": f"{tau_ms} ms"}
    entry = METHODS[name] | {"name": f"{name}-{p_min:g}-{tau_ms}"}
    if name == GENIE:
        freshness = {"name": "recommended", **settings}
        return entry | {
            "genie": {"algorithm": "recommended", "object_map": {"freshness": freshness}}
        }
    return entry | {"consumer": {"name": "tracker", **settings}}


def simulated(
    step: str, conditions: Conditions, methods: Sequence[Mapping[str, Any]], seeds: Sequence[int]
) -> pd.DataFrame:
    """Streaming F1 of every run: rows are conditions and seeds, columns are methods."""
    runs = gs.sweep(
        "3car_recommended",
        {"condition": {"list": conditions}},
        {"methods": list(methods), "record": ["held", "resources"]},
        seeds=seeds,
        every_run=True,
        out=OUT / step,
    )
    f1 = runs[(runs["metric"] == "streaming_f1") & (runs["component"] == "")]
    return f1.pivot_table(index=["condition", "seed"], columns="method", values="value", sort=False)


def traces() -> None:
    """The traces of all tracking sequences of this study."""
    for number in (*TUNING, *SEEN, *HELD_OUT):
        print(trace(number))


def choose() -> None:
    """Every p_min and tau of every method on the tuning set: the means over its conditions."""
    conditions = {name: DRIVE[name] for name in ("Ethernet, raw", "5G, JPEG 80")}
    conditions |= sequences(TUNING)
    conditions["town, 5G"] = TOWNS["town, 5G"] | {"perception.duration": "4 s"}
    methods = [tuned(*of) for of in product((*WITHOUT_GENIE, GENIE), P_MINS, TAUS_MS)]
    print(simulated("choose", conditions, methods, (1,)).mean().round(3).to_string())


def second() -> None:
    """The same on drive 0005 alone, with thin uplinks, for tau 100 ms."""
    methods = [tuned(*of, 100) for of in product((*WITHOUT_GENIE, GENIE), P_MINS)]
    show(simulated("second", DRIVE, methods, (1,)))


def towns() -> None:
    """What trackers that are tuned to a town change: p_min in four towns."""
    conditions = TOWNS | {"town of twelve, 5G": {"scenario": "town_recommended"}}
    of_p_min = product(("local_tracker", "remote_tracker", GENIE), P_MINS)
    show(simulated("towns", conditions, [tuned(*of, 100) for of in of_p_min], (1, 2, 3)))


def seen() -> None:
    """The conditions that were looked at before."""
    f1 = simulated("seen", SHIPPED | sequences(SEEN), [*METHODS.values()], range(1, 6))
    show(f1)
    gains(f1)


def held_out() -> None:
    """The held-out drives and towns. Run it once."""
    judged = [METHODS[name] for name in (*WITHOUT_GENIE, GENIE)]
    drives = simulated("held_out_drives", sequences(HELD_OUT), judged, range(1, 6))
    f1 = pd.concat([drives, simulated("held_out_towns", TOWNS, judged, range(101, 106))])
    show(f1)
    print(f"all conditions: {interval(*over_all(gains(f1)))}")


def show(f1: pd.DataFrame) -> None:
    """Means over the seeds."""
    print(f1.groupby("condition", sort=False).mean().round(3).T.to_string())


def gains(f1: pd.DataFrame) -> dict[str, pd.Series]:
    """By condition and seed, the Genie less the method without one that is best in the mean."""
    gains = {}
    for name, runs in f1.groupby("condition", sort=False):
        best = runs[list(WITHOUT_GENIE)].mean().idxmax()
        gains[str(name)] = (runs[GENIE] - runs[best]).droplevel("condition")
        print(f"{name}: {interval(*over_seeds(gains[str(name)].tolist()))}, {best}")
    return gains


def over_all(gains: Mapping[str, pd.Series]) -> tuple[float, float]:
    """The mean gain over all conditions, and half of its interval over drives and towns.

    The conditions of one drive are averaged first. Every seed invents a town.
    """
    of_town = [gain for name, gain in gains.items() if name.startswith("town")]
    of_drive: dict[str, list[float]] = {}
    for name, gain in gains.items():
        if not name.startswith("town"):
            of_drive.setdefault(name.partition(",")[0], []).append(gain.mean())
    towns_share = len(of_town) / len(gains)
    drives = [fmean(values) for values in of_drive.values()]
    return stratified(
        [(1 - towns_share, drives), (towns_share, pd.concat(of_town, axis=1).mean(axis=1).tolist())]
    )


def interval(mean: float, half: float) -> str:
    """A mean and its interval as they are printed."""
    return f"{mean:+.3f} ({mean - half:+.3f} to {mean + half:+.3f})"


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


STEPS = {step.__name__: step for step in (traces, choose, second, seen, held_out, towns)}

if __name__ == "__main__":
    STEPS[sys.argv[1]]()
