"""Where a Genie pays: the study behind docs/where-it-pays.md.

    GENIE_SIM_KITTI=... python -m benchmarks.where_it_pays choose|second|seen|held_out|curves

Declared before any of it was run:

- **Conditions**: the 13 of the shipped sweep ``where_it_pays`` (drive 2011_09_26/0005 and a town)
  and the tracking sequences of ``SEEN`` over two links. They, or the prototype of this Genie on
  them, were looked at before, so they show where a Genie pays and prove nothing. The held-out
  conditions (``HELD_OUT`` over the same two links, the town under ``HELD_OUT_SEEDS``) are run
  once, after everything else is fixed.
- **Methods**: those of the sweep. Each of ``local_tracker``, ``remote_tracker``,
  ``paced_tracker`` and ``genie_recommended`` has a ``p_min`` and a ``tau`` of its own, chosen
  from ``P_MINS`` and ``TAUS_MS`` on the tuning set: drive 0005 over Ethernet with raw and over 5G
  with JPEG 80 pictures, the sequences of ``TUNING`` over both links (seed 1), and 4 s of the town
  over 5G (seeds 1 and 2). The pair with the best mean of streaming F1 over the conditions is
  chosen; the default (tracker: .8, 0; Genie: .7, 100 ms) stays if it is within .005 of the best.
  All use the same laws of detectors, which were measured on other drives. ``genie_former`` is the
  former recommendation and keeps its p_min of .8.
- **Second stage.** The first stage chose .9 for the Genie. The seen conditions showed that this
  costs much where few looks come: the tuning set lacked thin uplinks. Declared then, before any
  held-out result was read: the tuning set is extended by the other eight conditions of drive 0005
  (seed 1), over which the Genie's ``p_min`` (tau 100 ms) and each tracker's default and first
  choice are compared; the best mean over all 25 conditions is chosen, by the same rule. Departed
  from for the trackers, which keep their first choices: the remote one would have returned to its
  default for .001, and been weaker wherever its uplink suffices.
- **Variants**, judged beside and chosen by nothing: ``genie_p90``, the choice of the first stage;
  ``genie_prototype`` with the settings before any choice (p_min .7, assumed laws, every message
  costs the Genie time of the device); and in the town ``genie_alone`` and
  ``genie_prototype_alone``, ``genie_p90`` and ``genie_prototype`` where edges tell nothing.
- **Seeds** 1 to 5; in the held-out town 101 to 105. The first report had seeds 1 to 3, and two of
  either town (1 and 2, 101 and 102), for lack of computing time. The others were added after
  everything was chosen and reported, with nothing else changed, and so was the prototype in the
  seen town.
  Differences are paired by seed, and intervals are t intervals. Those of means over
  conditions are over the drives and, in the town, over the towns (each seed invents one): the
  conditions of one drive are averaged first. The former Genie and the variants do not run in the
  held-out towns.
- **Curves** of the goals that were missed, run after everything else and chosen by nothing: F1 by
  ``p_min`` on sequence ``MISSED``, of the Genie and of the remote tracker (tau 100 ms, seed 1); F1
  in each of three laps by ``p_min`` and by the pause between the laps (seeds 1 to 3). Likewise F1
  by ``p_min`` in the town, and in the smaller one of ``town_recommended`` (seeds 1 to 3); and of
  trackers with the ``p_min`` that was best there in the town's other conditions.
- **Judged by** streaming F1, then ghosts, recall, mean first answer, bytes up, time of the edges'
  accelerators, and F1 in each lap.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from genie_sim import runner
from genie_sim.analysis import metrics
from genie_sim.recording.results import Metric
from genie_sim.scenario.scenario import load_scenario
from genie_sim.study.design import Design, load_design, read_design
from genie_sim.study.setups import StudySetup, measured, run_id_of
from genie_sim.study.tasks import Shared

OUT = Path("results/where_it_pays")
SEEN = ("0006", "0017", "0015")
TUNING = ("0003", "0005", "0007", "0009", "0014", "0016", "0019")
TUNING_LINKS = ("Ethernet, raw", "5G, JPEG 80")  # of drive 0005 in the first stage
FIRST_CONDITIONS = 17  # those, the sequences of TUNING over two links, and the town
HELD_OUT = ("0002", "0004", "0008", "0010")
SEEDS, HELD_OUT_SEEDS = (1, 2, 3, 4, 5), (101, 102, 103, 104, 105)
MISSED = "0008"  # the sequence on which the Genie lost most
PAUSES = ("1 s", "10 s", "60 s")  # between laps
P_MINS = (0.5, 0.6, 0.7, 0.8, 0.9)
TAUS_MS = (0, 100)
NEAR_BEST = 0.005
WORKERS = 3
CAMERA = {"name": "camera_02", "recording": "02"}
WITHOUT_GENIE = ("local_tracker", "remote_tracker", "paced_tracker")
GENIE = "genie_recommended"
DEFAULTS = {**dict.fromkeys(WITHOUT_GENIE, (0.8, 0)), GENIE: (0.7, 100)}
ASSUMED = {"name": "recommended", "p_min": 0.7, "tau": "100 ms", "measured": False}
PROTOTYPE: dict[str, Any] = {
    "name": "genie_prototype",
    "method": "genie",
    "genie": {
        "algorithm": "recommended",
        "pass_time": None,
        "object_map": {"freshness": ASSUMED},
    },
}
PROTOTYPE_ALONE = {
    "name": "genie_prototype_alone",
    "method": "genie",
    "genie": {**PROTOTYPE["genie"], "looks": {"edge": "none", "told": None}},
}
FIRST_CHOICE = {"freshness": {"name": "recommended", "p_min": 0.9, "tau": "100 ms"}}
P90 = {
    "name": "genie_p90",
    "method": "genie",
    "genie": {"algorithm": "recommended", "object_map": FIRST_CHOICE},
}
ALONE = {
    "name": "genie_alone",
    "method": "genie",
    "genie": {"algorithm": "recommended", "looks": {"told": None}, "object_map": FIRST_CHOICE},
}
SHOWN = (
    "streaming_f1",
    "ghost_share",
    "object_recall",
    "object_recall_static",
    "object_recall_moving",
    "first_answer_mean",
    "uplink_bytes",
    "edge_busy_s",
    "lap_f1",
)


@dataclass(frozen=True, slots=True)
class ConditionRun:
    """A condition under one seed.

    Parameters
    ----------
    condition : str
        Its name.
    scenario : str
        The shipped scenario.
    overrides : tuple of str
        Settings to change, as ``path=value``.
    seed : int
        The seed.
    """

    condition: str
    scenario: str
    overrides: tuple[str, ...]
    seed: int

    @property
    def run_id(self) -> str:
        return run_id_of(self.scenario, self.overrides, self.seed)

    @property
    def frames(self) -> float:
        """About how many, by which tasks are made: a few runs each."""
        return 20_000.0

    @property
    def place(self) -> str:
        return f"{self.condition}, seed {self.seed}"

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[Metric]]:
        """The metrics of every method."""
        prepared = runner.prepare(load_scenario(self.scenario, self.overrides, self.seed))
        tables = {name: table.columns() for name, table in runner.simulate(prepared).items()}
        names = runner.methods_of(prepared)
        computed = metrics.compute(names, tables, intervals=False)
        wanted = [
            metric
            for metric in computed
            if metric.metric in SHOWN and not metric.component.startswith("zero")
        ]
        for method in names:
            used = [
                metric.value or 0.0
                for metric in computed
                if metric.metric == "utilization"
                and (metric.method, metric.placement) == (method.name, "edge")
                and metric.component.endswith(".accelerator")
            ]
            up = int(tables["frames"].where(method=method.name)["bytes_up"].sum())
            place = method.name, "all", ""
            wanted.append(Metric("uplink_bytes", *place, value=float(up), unit="B"))
            wanted.append(Metric("edge_busy_s", *place, value=sum(used), unit="s/s"))
        return {self.run_id: wanted}


def trace(sequence: str) -> str:
    """The trace of a tracking sequence, with its truth beside it. It is made and not kept."""
    path = OUT / "traces" / f"tracking_{sequence}.parquet"
    if not path.is_file():
        drive = f"tracking/{sequence}"
        command = [sys.executable, "-m", "genie_sim"]
        perceive = ["perceive", "--drive", drive, "--detector", "pointrcnn", "--out", str(path)]
        subprocess.run([*command, *perceive], check=True)
        subprocess.run([*command, "truth", "--drive", drive, "--trace", str(path)], check=True)
    return str(path)


def sequences(numbers: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The conditions of tracking sequences: one camera a car, two links."""
    links = {f"cars[{car}].link": "nr5g" for car in range(3)}
    conditions: dict[str, dict[str, Any]] = {}
    for number in numbers:
        recorded = {"perception.trace": trace(number)}
        conditions[f"{number}, Ethernet, raw"] = recorded | {"cameras": [CAMERA]}
        small = {"cameras": [CAMERA | {"size": "86 kB"}]}
        conditions[f"{number}, 5G, 86 kB"] = recorded | small | links
    return conditions


def design(
    conditions: Mapping[str, dict[str, Any]], methods: Sequence[Any], seeds: Sequence[int]
) -> Design:
    """A study of these conditions."""
    record = ["held", "resources"]
    data = {
        "name": "where_it_pays",
        "scenario": "3car_hetero",
        "set": {"methods": list(methods), "record": record},
        "seeds": list(seeds),
        "axes": {"condition": {"list": dict(conditions)}},
    }
    return read_design(data, "where_it_pays")


def setups(study: Design) -> Iterator[StudySetup]:
    """Its runs."""
    for point, seed in product(list(study.points()), study.seeds):
        (condition,) = point.levels
        run = ConditionRun(str(condition), point.scenario, point.overrides, seed)
        yield StudySetup({"condition": condition, "seed": seed}, run)


def simulated(studies: Sequence[Design]) -> pd.DataFrame:
    """One row for each condition, seed and method, with what is shown of it."""
    runs = [setup for study in studies for setup in setups(study)]
    table = measured(runs, WORKERS, OUT / "runs", progress=tell)
    laps = table["metric"].where(table["component"] == "", table["component"])
    table = table.assign(metric=table["metric"].where(table["metric"] != "lap_f1", laps))
    keys = ["condition", "seed", "method"]
    wide = table.pivot_table(index=keys, columns="metric", values="value", sort=False)
    names = [name for name in SHOWN if name in wide]
    lap_names = sorted(name for name in wide if name.startswith("lap "))
    return wide[[*names, *lap_names]].reset_index().round(4)


def tell(done: float, total: float, note: str) -> None:
    """How far a study is, on standard error."""
    print(f"{done:.0f} of {total:.0f} runs {note}", file=sys.stderr, flush=True)


def tuned(name: str, p_min: float, tau_ms: int) -> dict[str, Any]:
    """A method with these settings."""
    entry = next(
        dict(entry)
        for entry in load_design("where_it_pays").settings["methods"]
        if entry["name"] == name
    )
    if name == GENIE:
        freshness = {"name": "recommended", "p_min": p_min, "tau": f"{tau_ms} ms"}
        entry["genie"] = {"algorithm": "recommended", "object_map": {"freshness": freshness}}
    else:
        entry["consumer"] = {"name": "tracker", "p_min": p_min, "tau": f"{tau_ms} ms"}
    return entry | {"name": f"{name}-{p_min:g}-{tau_ms}"}


def choose() -> None:
    """Writes the means over the tuning set."""
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    recorded = {name: shipped[name] for name in TUNING_LINKS} | sequences(TUNING)
    town = {"town, 5G": shipped["town, 5G"] | {"perception.duration": "4 s"}}
    pairs = product(DEFAULTS, P_MINS, TAUS_MS)
    methods = [tuned(name, p_min, tau_ms) for name, p_min, tau_ms in pairs]
    table = simulated([design(recorded, methods, (1,)), design(town, methods, (1, 2))])
    by_condition = table.groupby(["condition", "method"], sort=False).mean(numeric_only=True)
    means = by_condition.groupby("method", sort=False).mean().round(4)
    names_of = pd.DataFrame([str(name).split("-") for name in means.index], index=means.index)
    names_of.columns = pd.Index(["method", "p_min", "tau_ms"])
    columns = ["streaming_f1", "ghost_share", "object_recall"]
    pd.concat([names_of, means[columns]], axis=1).to_csv(OUT / "choose.csv", index=False)


def both_stages(means: pd.DataFrame, second_stage: pd.DataFrame, name: str) -> pd.Series[float]:
    """Mean of a method's streaming F1 over the conditions of both stages, by p_min and tau."""
    keys = ["p_min", "tau_ms"]
    first = means[means["method"] == name].set_index(keys)["streaming_f1"]
    added = second_stage[
        (second_stage["method"] == name) & ~second_stage["condition"].isin(TUNING_LINKS)
    ].groupby(keys)["streaming_f1"]
    sums, counts = added.sum(), added.count()
    before = first.reindex(sums.index)
    return (before * FIRST_CONDITIONS + sums) / (FIRST_CONDITIONS + counts)


def chosen(means: pd.DataFrame, second_stage: pd.DataFrame, name: str) -> tuple[float, int]:
    """The p_min and tau [ms] of a method: a tracker's of the first stage, the Genie's of both."""
    if name == GENIE:
        f1 = both_stages(means, second_stage, name)
    else:
        f1 = means[means["method"] == name].set_index(["p_min", "tau_ms"])["streaming_f1"]
    p_min, tau_ms = f1.idxmax()
    default = DEFAULTS[name]
    return default if f1[default] >= f1.max() - NEAR_BEST else (float(p_min), int(tau_ms))


def shown() -> list[Any]:
    """The methods of the sweep."""
    methods: list[Any] = load_design("where_it_pays").settings["methods"]
    return methods


def of_town(conditions: Mapping[str, Any]) -> dict[str, Any]:
    """The conditions in the town."""
    return {name: case for name, case in conditions.items() if name.startswith("town")}


def seen() -> None:
    """The conditions that were looked at before."""
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    town = of_town(shipped)
    drive = {name: case for name, case in shipped.items() if name not in town}
    studies = [
        design(drive | sequences(SEEN), [*shown(), P90, PROTOTYPE], SEEDS),
        design(town, [*shown(), P90, PROTOTYPE, ALONE, PROTOTYPE_ALONE], SEEDS),
    ]
    simulated(studies).to_csv(OUT / "seeds.csv", index=False)


def second() -> None:
    """Streaming F1 in every condition of drive 0005, under seed 1: of the Genie by p_min, of each
    tracker with its default and with the best of the first stage.
    """
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    drive = {name: case for name, case in shipped.items() if name not in of_town(shipped)}
    pairs = [(GENIE, p_min, 100) for p_min in P_MINS]
    means = pd.read_csv(OUT / "choose.csv")
    for name in WITHOUT_GENIE:
        best = means.loc[means[means["method"] == name]["streaming_f1"].idxmax()]
        pairs += [(name, *DEFAULTS[name]), (name, float(best["p_min"]), int(best["tau_ms"]))]
    table = simulated([design(drive, [tuned(*pair) for pair in pairs], (1,))])
    words = pd.DataFrame(table["method"].str.split("-").tolist())
    table = table.assign(method=words[0], p_min=words[1].astype(float), tau_ms=words[2].astype(int))
    columns = ["condition", "method", "p_min", "tau_ms", *SHOWN[:3]]
    table[columns].to_csv(OUT / "second.csv", index=False)


def held_out() -> None:
    """The held-out drives and towns. Run it once."""
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    judged = [entry for entry in shown() if entry["name"] in DEFAULTS]
    studies = [
        design(sequences(HELD_OUT), [*shown(), P90], SEEDS),
        design(of_town(shipped), [*judged, P90], HELD_OUT_SEEDS),
    ]
    simulated(studies).to_csv(OUT / "held_out.csv", index=False)


def curves() -> None:
    """How what was missed depends on the settings that it depends on most."""
    shipped = load_design("where_it_pays").axes["condition"].cases
    assert isinstance(shipped, dict)
    laps = {
        f"three laps, {pause}": shipped["three laps"]
        | {f"cars[{car}].route.pause": pause for car in range(3)}
        for pause in PAUSES
    }
    by_p_min = [tuned(GENIE, p_min, 100) for p_min in P_MINS]
    remote = [tuned("remote_tracker", p_min, 100) for p_min in P_MINS]
    twelve = {"town of twelve, 5G": {"scenario": "town_recommended"}}
    towns = {"town, 5G": shipped["town, 5G"]} | twelve
    thin = {name: case for name, case in of_town(shipped).items() if name not in towns}
    in_town = [tuned(GENIE, 0.8, 100), tuned("remote_tracker", 0.5, 100)]
    in_town += [tuned("local_tracker", p_min, 100) for p_min in P_MINS[:2]]
    studies = [
        design(sequences([MISSED]), [*by_p_min, *remote], (1,)),
        design(laps, by_p_min[2:], (1, 2, 3)),
        design(towns, [*by_p_min, *remote], (1, 2, 3)),
        design(thin, in_town, (1, 2, 3)),
    ]
    table = simulated(studies)
    words = pd.DataFrame(table["method"].str.split("-").tolist())
    table = table.assign(method=words[0], p_min=words[1].astype(float))
    columns = ["condition", "seed", "method", "p_min", *SHOWN[:3], "lap 1", "lap 2", "lap 3"]
    table[columns].to_csv(OUT / "curves.csv", index=False)


if __name__ == "__main__":
    steps = (choose, seen, second, held_out, curves)
    {step.__name__: step for step in steps}[sys.argv[1]]()
