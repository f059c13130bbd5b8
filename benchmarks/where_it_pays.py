"""Where a Genie pays: makes the traces, runs the sweeps, and writes tables and a figure to results/where_it_pays.

    GENIE_SIM_KITTI=... python benchmarks/where_it_pays.py choose|run|ttl|keep|show

``choose`` compares p_min on the choosing half of the drives, ``run`` runs the shipped sweep ``where_it_pays`` and the
same methods on the reporting half, ``ttl`` is the second stage, ``keep`` keeps one table of it all, and ``show`` prints
the tables of docs/where-it-pays.md. Traces of tracking sequences are computed on the way and not kept.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.statistics import across_seeds
from genie_sim.sweeps.design import load_design

OUT = Path("results/where_it_pays")
CHOOSING = ("0003", "0005", "0007", "0009", "0014", "0016", "0019")
REPORTING = ("0002", "0004", "0006", "0008", "0010", "0015", "0017")
P_MINS = (0.5, 0.65, 0.8, 0.9, 0.95)
TTLS_MS = (100, 300, 1000)
CARS = range(3)
ONE_CAMERA = {"name": "camera_02", "recording": "02"}
SMALL = {**ONE_CAMERA, "size": "86 kB"}
WITHOUT = ("local", "remote", "local_tracker", "remote_tracker")
GENIE = "genie_recommended"
SHOWN = (
    "streaming_f1",
    "ghost_share",
    "object_recall_static",
    "object_recall_moving",
    "first_answer_p50",
)


def command(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "genie_sim", *arguments], check=True)


def trace(sequence: str) -> str:
    """The trace of a tracking sequence, with its truth beside it."""
    path = OUT / "traces" / f"tracking_{sequence}.parquet"
    if not path.is_file():
        command(
            "perceive",
            "--drive",
            f"tracking/{sequence}",
            "--detector",
            "pointrcnn",
            "--out",
            str(path),
        )
        command("truth", "--drive", f"tracking/{sequence}", "--trace", str(path))
    return str(path)


def links(link: str) -> dict[str, Any]:
    return {f"cars[{i}].link": link for i in CARS}


def drives(sequences: tuple[str, ...]) -> dict[str, dict[str, Any]]:
    """The cases of these sequences under three links."""
    cases = {}
    for one in sequences:
        own = {"perception.trace": trace(one)}
        cases[f"{one}, Ethernet, raw"] = {**own, "cameras": [ONE_CAMERA]}
        cases[f"{one}, 5G, 86 kB"] = {**own, **links("nr5g"), "cameras": [SMALL]}
        cases[f"{one}, 5G, raw"] = {**own, **links("nr5g"), "cameras": [ONE_CAMERA]}
    return cases


def sweep(name: str, cases: dict[str, dict[str, Any]], methods: list[Any]) -> None:
    design = {
        "name": name, "scenario": "3car_hetero", "set": {"methods": methods, "record": ["held"]}, "seeds": 5,
        "axes": {"condition": {"list": cases}},
    }  # fmt: skip
    path = OUT / f"{name}.yaml"
    path.write_text(yaml.safe_dump(design, sort_keys=False))
    command("sweep", str(path), "--out", str(OUT))


def choose() -> None:
    """Prints the mean of streaming F1 over the choosing drives, by p_min."""
    cases = {key: case for key, case in drives(CHOOSING).items() if not key.endswith("5G, raw")}
    cases["drive, Ethernet, raw"] = {}
    cases["drive, 5G, JPEG 80"] = {**links("nr5g"), "image_encoding": "jpeg80"}
    rules = [
        {"object_map": {"freshness": {"name": "recommended", "p_min": p_min}}} for p_min in P_MINS
    ]
    names = [f"p{round(100 * p_min)}" for p_min in P_MINS]
    entries = [
        {"name": name, "method": "genie", "genie": rule}
        for name, rule in zip(names, rules, strict=True)
    ]
    sweep("choose", cases, entries)
    runs = pd.read_parquet(OUT / "choose" / "runs.parquet")
    means_of(runs).to_csv(OUT / "choose.csv")


def ttl_entry(ttl_ms: int) -> dict[str, Any]:
    """The recommended Genie that forgets pictures after so long."""
    rules = {"object_map": {"freshness": "recommended"}, "eviction": "ttl", "ttl": f"{ttl_ms} ms"}
    return {"name": f"genie_ttl_{ttl_ms}", "method": "genie", "genie": rules}


def ttl() -> None:
    """The second stage: a time to live of stored pictures, chosen and reported as p_min was."""
    ethernet = {
        key: case for key, case in drives(CHOOSING).items() if key.endswith("Ethernet, raw")
    }
    sweep(
        "choose_ttl",
        {**ethernet, "drive, Ethernet, raw": {}},
        [ttl_entry(ttl_ms) for ttl_ms in TTLS_MS],
    )
    runs = pd.read_parquet(OUT / "choose_ttl" / "runs.parquet")
    table = means_of(runs)
    table.to_csv(OUT / "choose_ttl.csv")
    best = str(table["streaming_f1"].idxmax())
    cases = {key: case for key, case in drives(REPORTING).items() if not key.endswith("5G, raw")}
    sweep("drives_ttl", cases, [ttl_entry(int(best.rpartition("_")[2]))])


def means_of(runs: pd.DataFrame) -> pd.DataFrame:
    """The means of what is shown, by method."""
    kept = runs[runs["metric"].isin(SHOWN) & (runs["component"] == "")]
    return kept.pivot_table(index="method", columns="metric", values="value", sort=False).round(4)


def run() -> None:
    """Both sweeps, and the numbers of the page."""
    methods = load_design("where_it_pays").settings["methods"]
    sweep("drives", drives(REPORTING), methods)
    command("sweep", "where_it_pays", "--out", str(OUT))


def keep() -> None:
    """Keeps what the page shows of every run: one row for each condition, seed and method."""
    names = ("where_it_pays", "drives", "drives_ttl")
    found = pd.concat([pd.read_parquet(OUT / name / "runs.parquet") for name in names])
    kept = found[found["metric"].isin(SHOWN) & (found["component"] == "")]
    keys = ["condition", "seed", "method"]
    wide = kept.pivot_table(index=keys, columns="metric", values="value", sort=False).reset_index()
    wide[[*keys, *SHOWN]].round(4).to_csv(OUT / "seeds.csv", index=False)


def differences(seeds: pd.DataFrame, genie: str = GENIE) -> pd.DataFrame:
    """Streaming F1 of a Genie less that of the best method without one, by condition: mean and interval over the seeds.
    The best is that of the mean over the seeds."""
    f1 = seeds.pivot_table(
        index=["condition", "seed"], columns="method", values="streaming_f1", sort=False
    )
    rows = []
    for condition, mine in f1.dropna(subset=[genie]).groupby("condition", sort=False):
        best = mine[list(WITHOUT)].mean().idxmax()
        for (_, seed), value in (mine[genie] - mine[best]).items():
            rows.append({"condition": condition, "seed": seed, "best": best, "value": value})
    table = pd.DataFrame(rows).assign(
        metric="difference", method=genie, placement="all", component="", unit="1"
    )
    return across_seeds(table, ["condition", "best"])


def show() -> None:
    """The tables of the page, and its figure."""
    seeds = pd.read_csv(OUT / "seeds.csv")
    means = seeds.groupby(["condition", "method"], sort=False)[list(SHOWN)].mean()
    second = next(method for method in seeds["method"].unique() if method.startswith("genie_ttl"))
    methods = [method for method in seeds["method"].unique() if method != second]
    found = differences(seeds).set_index("condition")
    print(
        "| | "
        + " | ".join(methods)
        + " | Genie less the best without | ghosts: best, Genie | first answer, ms |"
    )
    for condition, one in found.iterrows():
        row = means.loc[condition]
        f1 = " | ".join(f"{row.loc[method, 'streaming_f1']:.2f}" for method in methods)
        ghosts, first = both(row, one, "ghost_share", 2), both(row, one, "first_answer_p50", 0)
        print(f"| {condition} | {f1} | {gain(one)} | {ghosts} | {first} |")
    for condition, one in differences(seeds, second).set_index("condition").iterrows():
        row = means.loc[(condition, second)]
        print(
            f"| {condition} | {row['streaming_f1']:.2f} | {gain(one)} | {row['ghost_share']:.2f} |"
        )
    figure = drawn(found, means, methods)
    figure.savefig(
        "docs/images/where_it_pays.png", dpi=100, bbox_inches="tight", metadata={"Software": None}
    )


def gain(one: Any) -> str:
    """A difference with its interval, and to whom."""
    return f"{one['value']:+.3f} ({one['low']:+.3f} to {one['high']:+.3f}), {one['best'].replace('_', ' + ')}"


def both(row: pd.DataFrame, one: Any, metric: str, digits: int) -> str:
    """A metric of the best method without a Genie, and of the recommended Genie."""
    return f"{row.loc[one['best'], metric]:.{digits}f}, {row.loc[GENIE, metric]:.{digits}f}"


def drawn(found: pd.DataFrame, means: pd.DataFrame, methods: list[str]) -> Figure:
    """Streaming F1 of every method, and the difference that a Genie makes, by condition."""
    conditions = list(found.index)
    figure = Figure(figsize=(9, 0.21 * len(conditions) + 1))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
    for position, method in enumerate(methods):
        f1 = [means.loc[(condition, method), SHOWN[0]] for condition in conditions]
        look = {
            "color": style.method_line(position)["color"],
            "marker": style.MARKERS[position % len(style.MARKERS)],
        }
        left.plot(f1, range(len(conditions)), linestyle="none", markersize=4, label=method, **look)
    ends = [found["value"] - found["low"], found["high"] - found["value"]]
    right.errorbar(
        found["value"],
        range(len(conditions)),
        xerr=ends,
        fmt="o",
        markersize=3,
        capsize=2,
        color="black",
    )
    right.axvline(0, color="grey", linewidth=0.8)
    left.set_yticks(range(len(conditions)), conditions, fontsize=7)
    left.invert_yaxis()
    left.set_xlabel("streaming F1")
    right.set_xlabel("recommended Genie less the best without, 95 %")
    left.legend(fontsize=6, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    for panel in (left, right):
        panel.grid(axis="x", alpha=0.3)
    return figure


if __name__ == "__main__":
    {"choose": choose, "run": run, "ttl": ttl, "keep": keep, "show": show}[sys.argv[1]]()
