"""The table and the figure of docs/baselines.md, out of the sweep ``baselines``.

    genie-sim sweep baselines
    python benchmarks/baselines.py

Writes results/baselines/numbers.csv and latency_accuracy.png beside the sweep's table, and prints the page's tables.
Bytes and utilization, which a sweep does not keep, come from runs of the scenario with the sweep's seeds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

import genie_sim as gs
from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.sweeps.design import load_design

SEEDS = (1, 2, 3)
KEPT = (
    "first_answer_mean", "fresh_answer_mean", "fresh_answer_p95", "answered_share", "fresh_answered_share",
    "image_reuse", "coalesced_share", "wrong_hit_share", "first_proxy_f1", "object_recall", "ghost_share",
    "streaming_f1",
)  # fmt: skip
SHOWN = ("first_answer_mean", "fresh_answer_mean", "fresh_answered_share", "hits", "wrong_hit_share", "object_recall",
         "ghost_share", "streaming_f1")  # fmt: skip
HEADS = ("first ms", "fresh ms", "answered", "hits", "wrong hits", "recall", "ghosts", "streaming F1", "kB up",
         "edges busy")  # fmt: skip
IN_SHORT = (
    "remote", "genie", "central", "sim_lru-0.05", "sim_lru-0.1", "rnd_lru-0.1", "potluck-0.8", "foggycache-0.9",
    "cachier-2ms", "deadline-300ms", "oracle",
)  # fmt: skip
PANELS = ("as in the scenario", "LTE", "10 cars on one edge")
Table = pd.DataFrame


def numbers(folder: Path) -> Table:
    """The metrics that are kept, one row per case, method and placement, with t intervals over the seeds."""
    table = pd.read_parquet(folder / "table.parquet")
    kept = table[table["metric"].isin(KEPT) & (table["component"] == "")]
    return kept[["case", "method", "metric", "placement", "unit", "value", "low", "high", "runs"]]


def of_case(table: Table, case: str) -> Table:
    """Methods by metrics; ``hits`` are those on cars, or where there is no cache on cars those on edges."""
    mine = table[table["case"] == case]
    wide = mine[mine["placement"] == "all"].pivot_table(
        index="method", columns="metric", values="value", sort=False
    )
    reuse = mine[mine["metric"] == "image_reuse"].pivot_table(
        index="method", columns="placement", values="value"
    )
    return wide.assign(hits=reuse["car"].fillna(reuse["edge"])).reindex(mine["method"].unique())


def text(metric: str, value: float) -> str:
    if pd.isna(value):
        return "-"
    if metric.endswith("_mean"):
        return f"{value:.0f}"
    return f"{value:.2f}" if metric == "streaming_f1" else f"{100 * value:.0f} %"


def print_case(table: Table, case: str, more: dict[str, list[str]]) -> None:
    """As a Markdown table."""
    print(f"| method | {' | '.join(HEADS)} |\n|---|{'---:|' * len(HEADS)}")
    for method, row in of_case(table, case).iterrows():
        cells = [text(metric, row.get(metric)) for metric in SHOWN]
        print(f"| `{method}` | {' | '.join(cells + more[str(method)])} |")


def loads(methods: list[Any]) -> dict[str, list[str]]:
    """Of each method: kilobytes that cars send up a frame, and how busy the edges' accelerators are; means of seeds."""
    found: list[Table] = []
    for seed in SEEDS:
        run = gs.run("baselines", {"methods": methods, "record": ["resources"]}, seed=seed)
        metrics = run.metrics[run.metrics["metric"] == "utilization"]
        edges = metrics[metrics["component"].str.match(r"edge\d+\.accelerator")]
        sent = run.frames.groupby("method", observed=True)["bytes_up"].mean() / 1000
        found.append(
            pd.DataFrame(
                {"sent": sent, "busy": edges.groupby("method", observed=True)["value"].mean()}
            )
        )
    means = pd.concat(found).groupby(level=0).mean()
    return {
        str(row.Index): [f"{row.sent:.0f}", f"{100 * row.busy:.0f} %"] for row in means.itertuples()
    }


@in_style()
def figure(table: Table) -> Figure:
    """Latency against accuracy: a line for each method, its points are the values of its dial."""
    drawn = Figure(figsize=(1.2 * style.PAGE_IN, 3.4))
    axes = drawn.subplots(1, len(PANELS), sharey=True)
    for axis, case in zip(axes, PANELS, strict=True):
        mine = table[(table["case"] == case) & (table["placement"] == "all")]
        wide = {metric: rows.set_index("method") for metric, rows in mine.groupby("metric")}
        names = [
            name
            for name in mine["method"].unique()
            if name not in ("sim_lru-world", "sim_lru-yolox_gap")
        ]
        kinds = list(dict.fromkeys(name.partition("-")[0] for name in names))
        for position, kind in enumerate(kinds):
            dial = [name for name in names if name.partition("-")[0] == kind]
            x, y = (wide[one].loc[dial] for one in ("fresh_answer_mean", "streaming_f1"))
            look = {
                "color": style.COLOURS[position % 8],
                "marker": style.MARKERS[position % 8],
                "markersize": 4,
            }
            look |= {"label": kind, "linewidth": 0.9, "capsize": 2}
            look |= {"markerfacecolor": "none"} if position >= 8 else {}
            axis.errorbar(
                x["value"], y["value"], [y["value"] - y["low"], y["high"] - y["value"]], **look
            )
        axis.set_xscale("log")
        axis.set_xticks([3, 10, 30, 100, 300])
        axis.xaxis.set_major_formatter(ScalarFormatter())
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_title(case)
        axis.set_xlabel("mean time to fresh answer [ms]")
    axes[0].set_ylabel("streaming F1")
    axes[-1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    footer = f"sweep baselines, {int(table['runs'].max())} seeds, 95 % intervals over them"
    finish(drawn, "Latency against accuracy; up and to the left is better", footer)
    return drawn


def print_cases(table: Table) -> None:
    """As a Markdown table: of each case and method, streaming F1 and the mean time to the fresh answer."""
    print(
        f"\n| case | {' | '.join(f'`{name}`' for name in IN_SHORT)} |\n|---|{'---:|' * len(IN_SHORT)}"
    )
    for case in table["case"].unique():
        wide = of_case(table, case)
        cells = [
            f"{wide['streaming_f1'][name]:.2f}, {wide['fresh_answer_mean'][name]:.0f} ms"
            for name in IN_SHORT
        ]
        print(f"| {case} | {' | '.join(cells)} |")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results/baselines")
    table = numbers(folder)
    table.to_csv(folder / "numbers.csv", index=False, float_format="%.6g")
    figure(table).savefig(folder / "latency_accuracy.png")
    print_case(table, PANELS[0], loads(load_design("baselines").settings["methods"]))
    print_cases(table)


if __name__ == "__main__":
    main()
