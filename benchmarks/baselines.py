"""Other caches beside Genie: the study behind docs/baselines.md, its tables and its figure.

    python benchmarks/baselines.py run|show

The cases and the methods are those of the sweep ``baselines``. Declared before the study was run:

- Every method has the consumer that holds the newest answers, and the one that tracks objects.
- *Cold*: every car drives its window once, with empty caches. *Warm*, in the first case: it drives
  the window twice, and the first lap does not count.
- Every method that looks pictures up pays for its key. ``genie`` and ``central`` pay as much as the
  others, and the objects in their maps take from their capacity: `capacity` less 400 bytes for each
  object of the largest map in a run with the whole capacity (seed 1, the scenario's cars).
  ``genie_free`` pays for neither.
- Potluck learns after 10, 30 or 100 entries (``warm``); FoggyCache's neighbours are within 0.1, 0.2
  or 0.3 (``radius``), each with two values of ``theta``.
- The first case has all methods; the others those of ``IN_SHORT``. Three seeds, t intervals over
  them: they say nothing of other streets, for there is one recording.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from benchmarks.speed_page import DOCS, filled
from genie_sim import plugins
from genie_sim.analysis import metrics, style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.analysis.statistics import across_seeds
from genie_sim.messages import OBJECT_BYTES
from genie_sim.methods import METHODS
from genie_sim.methods.central import Central
from genie_sim.methods.genie import Genie
from genie_sim.parallel import workers_here
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import Metric
from genie_sim.runner import methods_of, prepare, simulate
from genie_sim.scenario.scenario import Scenario, load_scenario
from genie_sim.sim.method import HostConfig, HostContext
from genie_sim.study.design import load_design
from genie_sim.study.setups import StudySetup, measured, run_id_of
from genie_sim.study.tasks import Shared

OUT = Path("results/baselines")
SEEDS = (1, 2, 3)
FIRST_CASE = "as in the scenario"
STARTS = {"cold": 1, "warm": 2}  # laps, of which the last one counts
CONSUMERS = ("newest", "tracker")
CAPACITY_BYTES = 1_000_000
RECORDED = ("lookups", "answers", "held", "resources")
KEPT = (
    "first_answer_mean",
    "fresh_answer_mean",
    "fresh_answered_share",
    "image_reuse",
    "wrong_hit_share",
    "object_recall",
    "ghost_share",
    "streaming_f1",
    "kilobytes_up",
    "edges_busy",
)
HEADS = {
    "first_answer_mean": "first ms",
    "fresh_answer_mean": "answer ms",
    "fresh_answered_share": "answered",
    "hits": "hits",
    "wrong_hit_share": "wrong hits",
    "object_recall": "recall",
    "ghost_share": "ghosts",
    "streaming_f1": "streaming F1",
    "kilobytes_up": "kB up",
    "edges_busy": "edges busy",
}
IN_SHORT = (
    "local",
    "remote",
    "genie",
    "central",
    "sim_lru-0.05",
    "sim_lru-0.1",
    "rnd_lru-0.1",
    "potluck-10",
    "foggycache-0.1-0.9",
    "cachier-2ms",
    "deadline-300ms",
    "oracle",
)
PANELS = (FIRST_CASE, "LTE", "10 cars on one edge")
BY = ["case", "start", "consumer"]
Table = pd.DataFrame


class PayingGenie(Genie):
    """Genie, whose look-ups cost as much as those of the methods that compare pictures."""

    title = "Genie, key paid"

    def on_car(self, host: HostContext) -> HostConfig | None:
        config = super().on_car(host)
        return None if config is None else replace(config, key="hsv")

    def on_edge(self, host: HostContext) -> HostConfig:
        return replace(super().on_edge(host), key="hsv")


class PayingCentral(Central):
    """The central cache, whose look-ups cost as much as those of the others."""

    title = "central cache, key paid"

    def on_edge(self, host: HostContext) -> HostConfig:
        config = super().on_edge(host)
        return config if config.interceptor is None else replace(config, key="hsv")


@dataclass(frozen=True, slots=True)
class LapRun:
    """All methods of a scenario with a seed; only the last lap of each car counts."""

    case: str
    scenario: Scenario

    @property
    def run_id(self) -> str:
        return run_id_of(self.case, self.scenario.to_yaml())

    @property
    def frames(self) -> float:
        cars = [car.route.laps for car in self.scenario.cars]
        return 180.0 * sum(cars) * len(self.scenario.methods)

    @property
    def place(self) -> str:
        return f"{self.case}, seed {self.scenario.seed}"

    def measure(self, shared: Shared, folder: Path) -> Mapping[str, Sequence[Metric]]:
        """Metrics of the last lap. An answer is fresh as in the paper: not out of a map alone."""
        prepared = prepare(self.scenario)
        tables = {name: table.columns() for name, table in simulate(prepared).items()}
        frames = tables["frames"]
        last = frames.rows(frames["lap"] == frames["lap"].max())
        begins_ns = {car: rows["stamp_ns"].min() for car, rows in last.groups("car")}
        counted = {
            name: since(tables[name], begins_ns) for name in ("frames", "lookups", "answers")
        }
        counted["held"] = since(tables["held"], begins_ns)
        methods = methods_of(prepared)
        rows = metrics.compute(methods, counted, fresh="answer")
        stamps_ns = counted["frames"]["stamp_ns"]
        span_ns = int(stamps_ns.min()), int(stamps_ns.max())
        for method in methods:
            sent = counted["frames"].where(method=method.name)["bytes_up"].mean() / 1000
            busy = utilization(tables["resources"].where(method=method.name), span_ns)
            rows.append(Metric("kilobytes_up", method.name, "all", "", float(sent), "kB"))
            rows.append(Metric("edges_busy", method.name, "all", "", busy, "1"))
        return {self.run_id: [row for row in rows if row.metric in KEPT]}


def since(table: Columns, begins_ns: Mapping[str, int]) -> Columns:
    """The rows of frames that were taken from these times on, one for each car."""
    cars = table["car"]
    begin_ns = np.array([begins_ns.get(name, 0) for name in cars.names])
    return table.rows((cars.codes >= 0) & (table["stamp_ns"] >= begin_ns[cars.codes]))


def utilization(resources: Columns, span_ns: tuple[int, int]) -> float:
    """The mean over the edges' accelerators of the share of a span of time that they are busy."""
    shares = []
    for name, samples in resources.groups("resource"):
        if name.startswith("edge") and name.endswith(".accelerator"):
            ordered = samples.rows(
                (samples["t_ns"] >= span_ns[0]) & (samples["t_ns"] <= span_ns[1])
            ).by("t_ns")
            times_ns, busy_ns = ordered["t_ns"], ordered["busy_ns"]
            shares.append((busy_ns[-1] - busy_ns[0]) / (times_ns[-1] - times_ns[0]))
    return float(np.mean(shares)) if shares else 0.0


def entries(names: Sequence[str] | None, map_bytes: int) -> list[Any]:
    """The methods of the sweep, or those of these names; Genie and the central cache pay."""
    methods = load_design("baselines").settings["methods"]
    own = "benchmarks.baselines"
    charged = {"genie": {"capacity": f"{CAPACITY_BYTES - map_bytes} B"}}
    paying = [
        {"name": "genie", "method": f"{own}:PayingGenie", **charged},
        {"name": "genie_free", "method": "genie"},
        {"name": "central", "method": f"{own}:PayingCentral", **charged},
    ]
    others = [entry for entry in methods if entry not in ("genie", "central")]
    every = [*others[:2], *paying, *others[2:]]
    return [
        entry
        for entry in every
        if names is None or (entry if isinstance(entry, str) else entry["name"]) in names
    ]


def setups(map_bytes: int) -> list[StudySetup]:
    """Every case, start, consumer and seed."""
    design = load_design("baselines")
    cases: Mapping[str, Mapping[str, Any]] = design.axes["case"].cases
    lines = []
    for case, overrides in cases.items():
        for start, laps in STARTS.items():
            if laps > 1 and case != FIRST_CASE:
                continue
            names = None if case == FIRST_CASE else IN_SHORT
            for consumer in CONSUMERS:
                settings = {
                    **overrides,
                    "methods": entries(names, map_bytes),
                    "record": list(RECORDED),
                    "consumer": consumer,
                }
                scenario = scenario_with(settings)
                cars = tuple(
                    replace(car, route=replace(car.route, laps=laps)) for car in scenario.cars
                )
                for seed in SEEDS:
                    levels = {"case": case, "start": start, "consumer": consumer, "seed": seed}
                    run = LapRun(f"{case}, {start}", replace(scenario, cars=cars, seed=seed))
                    lines.append(StudySetup(levels, run))
    return lines


def scenario_with(settings: Mapping[str, Any]) -> Scenario:
    """The scenario with other settings, by their paths."""
    overrides = [f"{path}={json.dumps(value)}" for path, value in settings.items()]
    return load_scenario("baselines", overrides)


def bytes_of_largest_map() -> int:
    """What the objects of the largest map take, in a run of Genie as in the scenario."""
    settings = {"methods": ["genie"], "record": ["lookups"]}
    tables = simulate(prepare(scenario_with(settings)))
    lookups = tables["lookups"].columns()
    objects = lookups.rows(lookups["kind"] != "image")
    return OBJECT_BYTES * int(objects["entries"].max())


def run() -> None:
    """Runs the study; a run that is in the folder is not run again."""
    map_bytes = bytes_of_largest_map()
    print(f"the largest map takes {map_bytes:,} bytes")

    def tell(done: int, count: int, text: str) -> None:
        print(f"{done} of {count} runs {text}", file=sys.stderr, flush=True)

    table = measured(setups(map_bytes), workers_here(), OUT, progress=tell)
    means = across_seeds(table, BY)
    means[means["component"] == ""].drop(columns="component").to_csv(
        OUT / "numbers.csv", index=False, float_format="%.6g"
    )


def of_case(table: Table, case: str, start: str = "cold", consumer: str = "newest") -> Table:
    """Methods by metrics; ``hits`` are those on cars, or where there is no cache on cars those on
    edges.
    """
    levels = (table["case"] == case) & (table["start"] == start) & (table["consumer"] == consumer)
    rows = table[levels]
    wide = rows[rows["placement"] == "all"].pivot_table(
        index="method", columns="metric", values="value", sort=False
    )
    reuse = rows[rows["metric"] == "image_reuse"].pivot_table(
        index="method", columns="placement", values="value"
    )
    hits = reuse["car"].fillna(reuse["edge"])
    return wide.assign(hits=hits).reindex(rows["method"].unique())


def text(metric: str, value: float) -> str:
    if pd.isna(value):
        return "-"
    if metric.endswith("_mean") or metric == "kilobytes_up":
        return f"{value:.0f}"
    return f"{value:.2f}" if metric == "streaming_f1" else f"{100 * value:.0f} %"


def blocks(table: Table) -> dict[str, str]:
    """Sentences and tables of the page, by the name of their place."""
    return {
        "in-short": sentences(table),
        "methods": methods_table(table),
        "starts": starts_table(table),
        "cases": cases_table(table),
    }


def sentences(table: Table) -> str:
    """What came out, in words with numbers."""
    ways = {
        (start, consumer): of_case(table, FIRST_CASE, start, consumer)
        for start in STARTS
        for consumer in CONSUMERS
    }
    f1 = {way: wide["streaming_f1"] for way, wide in ways.items()}
    cold, tracked, warm_tracked = (
        f1[way] for way in (("cold", "newest"), ("cold", "tracker"), ("warm", "tracker"))
    )
    caches = [name for name in cold.index if name not in ("local", "remote", "oracle")]
    caches = [name for name in caches if not name.startswith("deadline")]
    first = ways["cold", "newest"]
    hits, wrong = first["hits"][caches], first["wrong_hit_share"][caches]
    near = sum(tracked[caches] >= tracked["remote"] - 0.02)
    lines = [
        f"- Without a tracker `remote` holds {cold['remote']:.2f}; the best cache is "
        f"`{cold[caches].idxmax()}` with {cold[caches].max():.2f}.",
        f"- With a tracker `remote` holds {tracked['remote']:.2f} and `local` "
        f"{tracked['local']:.2f}; {near} of {len(caches)} caches are within "
        f"0.02 of `remote`, the best with {tracked[caches].max():.2f}; `genie` holds "
        f"{tracked['genie']:.2f}.",
        f"- Of all hits {100 * wrong.min():.0f} to {100 * wrong.max():.0f} % are wrong; caches "
        f"replay for {100 * hits.min():.0f} to {100 * hits.max():.0f} % of the frames.",
        f"- Paying for its key and its map costs `genie` "
        f"{cold['genie_free'] - cold['genie']:.3f} in streaming F1.",
        "- Potluck replays for "
        + ", ".join(f"{100 * hits[f'potluck-{warm}']:.0f}" for warm in (10, 30, 100))
        + " % of the frames where it learns after 10, 30 and 100 entries, at a streaming F1 of "
        + ", ".join(f"{cold[f'potluck-{warm}']:.2f}" for warm in (10, 30, 100))
        + ".",
        "- Of FoggyCache's hits at `theta` 0.9 "
        + ", ".join(f"{100 * wrong[f'foggycache-{radius}-0.9']:.0f}" for radius in (0.1, 0.2, 0.3))
        + " % are wrong with neighbours within 0.1, 0.2 and 0.3; of SIM-LRU's at 0.1 "
        f"{100 * wrong['sim_lru-0.1']:.0f} %, of RND-LRU's {100 * wrong['rnd_lru-0.1']:.0f} %.",
        f"- Warm, with a tracker, `sim_lru-0.1` holds {warm_tracked['sim_lru-0.1']:.2f}, `genie` "
        f"{warm_tracked['genie']:.2f}, `remote` {warm_tracked['remote']:.2f}.",
        f"- The oracle replays for {100 * first['hits']['oracle']:.0f} % of the frames and holds "
        f"{cold['oracle']:.2f}, with a tracker {tracked['oracle']:.2f}.",
    ]
    crowded, crowded_tracked = (
        of_case(table, PANELS[2], "cold", consumer)["streaming_f1"] for consumer in CONSUMERS
    )
    few = [name for name in IN_SHORT if name in caches]
    lines.append(
        f"- With {PANELS[2]} `remote` holds {crowded['remote']:.2f}, with a tracker "
        f"{crowded_tracked['remote']:.2f}; the best cache is `{crowded[few].idxmax()}` with "
        f"{crowded[few].max():.2f}, with a tracker `{crowded_tracked[few].idxmax()}` with "
        f"{crowded_tracked[few].max():.2f}."
    )
    return "\n".join(lines)


def methods_table(table: Table) -> str:
    """The first case, cold, without a tracker."""
    lines = [f"| method | {' | '.join(HEADS.values())} |", f"|---|{'---:|' * len(HEADS)}"]
    for method, row in of_case(table, FIRST_CASE).iterrows():
        cells = [text(metric, row.get(metric)) for metric in HEADS]
        lines.append(f"| `{method}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def starts_table(table: Table) -> str:
    """The first case, cold and warm, with and without a tracker."""
    ways = [(start, consumer) for start in STARTS for consumer in CONSUMERS]
    heads = [f"{start}, {consumer}" for start, consumer in ways]
    heads += ["hits, cold", "hits, warm", "wrong, cold", "wrong, warm"]
    lines = [f"| method | {' | '.join(heads)} |", f"|---|{'---:|' * len(heads)}"]
    wide = {start: of_case(table, FIRST_CASE, start) for start in STARTS}
    for method in wide["cold"].index:
        cells = [interval_text(table, FIRST_CASE, way, str(method)) for way in ways]
        for metric in ("hits", "wrong_hit_share"):
            cells += [text(metric, wide[start][metric][method]) for start in STARTS]
        lines.append(f"| `{method}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def cases_table(table: Table) -> str:
    """Every case, cold, with and without a tracker."""
    names = " | ".join(f"`{name}`" for name in IN_SHORT)
    lines = [f"| case | {names} |", f"|---|{'---:|' * len(IN_SHORT)}"]
    for case in table["case"].unique():
        newest, tracked = (of_case(table, case, "cold", consumer) for consumer in CONSUMERS)
        cells = [
            f"{newest['streaming_f1'][name]:.2f}, {tracked['streaming_f1'][name]:.2f}, "
            f"{newest['fresh_answer_mean'][name]:.0f} ms"
            for name in IN_SHORT
        ]
        lines.append(f"| {case} | {' | '.join(cells)} |")
    return "\n".join(lines)


def interval_text(table: Table, case: str, way: tuple[str, str], method: str) -> str:
    """Streaming F1 and its interval over the seeds."""
    rows = table[
        (table["case"] == case)
        & (table["start"] == way[0])
        & (table["consumer"] == way[1])
        & (table["method"] == method)
        & (table["metric"] == "streaming_f1")
    ]
    row = rows.iloc[0]
    return f"{row['value']:.2f} ({row['low']:.2f} to {row['high']:.2f})"


@in_style()
def figure(table: Table) -> Figure:
    """Latency against accuracy: a line for each method, its points are the values of its
    parameters.
    """
    drawn = Figure(figsize=(style.PAGE_IN, 2.8))
    axes = drawn.subplots(1, len(PANELS), sharey=True)
    rows = table[
        (table["placement"] == "all")
        & (table["start"] == "cold")
        & (table["consumer"] == "newest")
        & ~table["method"].isin(("sim_lru-world", "sim_lru-yolox_gap"))
    ]
    kinds = list(dict.fromkeys(name.partition("-")[0] for name in rows["method"].unique()))
    looks = dict(zip(kinds, style.method_looks(kinds), strict=True))
    for axis, case in zip(axes, PANELS, strict=True):
        of_panel = rows[rows["case"] == case]
        wide = {metric: group.set_index("method") for metric, group in of_panel.groupby("metric")}
        for kind in kinds:
            names = [name for name in of_panel["method"].unique() if name.split("-")[0] == kind]
            if not names:
                continue
            x, y = (wide[metric].loc[names] for metric in ("fresh_answer_mean", "streaming_f1"))
            axis.errorbar(
                x["value"],
                y["value"],
                [y["value"] - y["low"], y["high"] - y["value"]],
                color=style.method_colour(looks[kind]),
                marker=style.method_marker(looks[kind]),
                markersize=4,
                label=_title(kind),
                linewidth=0.9,
                capsize=2,
            )
        axis.set_xscale("log")
        axis.set_xticks([3, 10, 30, 100, 300])
        axis.xaxis.set_major_formatter(ScalarFormatter())
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_title(case)
        axis.set_xlabel("mean time to answer [ms]")
    axes[0].set_ylabel("streaming F1")
    footer = f"cold start, {int(table['runs'].max())} seeds, 95 % intervals over them"
    finish(drawn, "Latency against accuracy; up and to the left is better", footer, axes)
    return drawn


def _title(method: str) -> str:
    if method == "genie_free":
        return "Genie, free"
    return str(plugins.resolve("method", method, METHODS).title)


def show() -> None:
    """Draws the figure and fills the page."""
    table = pd.read_csv(OUT / "numbers.csv")
    figure(table).savefig(DOCS / "images" / "baselines.png", metadata={"Software": None})
    page = DOCS / "baselines.md"
    content = page.read_text(encoding="utf-8")
    for name, block in blocks(table).items():
        content = filled(content, name, block, str(page))
    page.write_text(content, encoding="utf-8")


if __name__ == "__main__":
    {"run": run, "show": show}[sys.argv[1]]()
