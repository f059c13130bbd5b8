"""Other caches beside Genie: the study behind docs/results.md, which has the results.

    python -m studies.baselines cold|warm

``cold`` runs the cases and the methods of the shipped sweep ``baselines``, with a consumer that
holds the newest answers and with one that tracks. ``warm`` has every car of the first case drive
its window twice: the metric ``lap_f1`` of ``lap 2`` counts. Tables and pages are in
``results/studies/baselines``, and what is there already is not simulated again; the metrics of
``KEPT`` go to ``results/baselines/cold.csv`` and ``warm.csv``.

Declared before any of it was run: two real cameras a car; three seeds; methods with parameters at
the points of the sweep. Nothing is chosen here, and there is one street: the study says how the
methods work, not which is best elsewhere.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import genie_sim as gs
from genie_sim.core.messages import OBJECT_BYTES
from genie_sim.methods.central import Central
from genie_sim.methods.genie import Genie
from genie_sim.sim.method import Costs, HostConfig, HostContext
from genie_sim.study.design import load_design

OUT = Path("results/studies/baselines")
FIRST_CASE = "as in the scenario"
CAPACITY_BYTES = 1_000_000  # of every cache
CONSUMERS = {"set": "consumer", "list": ["newest", "tracker"]}
HSV = Costs(key="hsv")  # of a look-up, as of the methods that compare pictures
RECORD = ["lookups", "answers", "held", "resources"]
KEPT = (
    "streaming_f1",
    "lap_f1",
    "object_recall",
    "ghost_share",
    "first_answer_mean",
    "fresh_answered_share",
    "image_reuse",
    "wrong_hit_share",
    "bytes_up_per_frame",
    "energy_per_frame",
)


class PayingGenie(Genie):
    """Genie, whose look-ups cost as much as those of the methods that compare pictures."""

    title = "Genie, key paid"

    def on_car(self, host: HostContext) -> HostConfig | None:
        config = super().on_car(host)
        return None if config is None else replace(config, costs=HSV)

    def on_edge(self, host: HostContext) -> HostConfig:
        return replace(super().on_edge(host), costs=HSV)


class PayingCentral(Central):
    """The central cache, whose look-ups cost as much as those of the others."""

    title = "central cache, key paid"

    def on_edge(self, host: HostContext) -> HostConfig:
        config = super().on_edge(host)
        return config if config.interceptor is None else replace(config, costs=HSV)


def methods(map_bytes: int) -> list[Any]:
    """Those of the sweep; Genie and the central cache pay for their keys, Genie for its map too."""
    shipped = load_design("baselines").settings["methods"]
    others = [entry for entry in shipped if entry not in ("genie", "central")]
    own = "studies.baselines"
    return [
        *others,
        {
            "name": "genie",
            "method": f"{own}:PayingGenie",
            "genie": {"capacity": f"{CAPACITY_BYTES - map_bytes} B"},
        },
        {"name": "genie_free", "method": "genie"},
        {"name": "central", "method": f"{own}:PayingCentral"},
    ]


def bytes_of_largest_map() -> int:
    """What the objects of the largest map take in a run of Genie as in the scenario."""
    run = gs.run("baselines", {"methods": ["genie"], "record": ["lookups"]})
    objects = run.lookups[run.lookups["kind"] != "image"]
    return OBJECT_BYTES * int(objects["entries"].max())


def simulated(start: str, cases: dict[str, Any], laps: int) -> None:
    """Simulates these cases, and prints the main metrics of each method."""
    settings: dict[str, Any] = {"methods": methods(bytes_of_largest_map()), "record": RECORD}
    if laps > 1:
        settings["cars[*].route.laps"] = laps
    axes = {"case": {"list": cases}, "consumer": CONSUMERS}
    table = gs.sweep("baselines", axes, settings, seeds=3, out=OUT / start).metrics
    table = table[table["metric"].isin(KEPT) & table["component"].isin(["", "lap 2"])]
    columns = ["case", "consumer", "metric", "method", "placement", "unit"]
    kept = Path(f"results/baselines/{start}.csv")
    kept.parent.mkdir(parents=True, exist_ok=True)
    table[[*columns, "value", "low", "high", "n"]].round(4).to_csv(kept, index=False)
    of_all = table[table["placement"] == "all"]
    print(of_all.pivot_table("value", [*columns[:2], "method"], "metric", sort=False).round(3))


def main(start: str) -> None:
    """Runs one part of the study."""
    cases: Any = load_design("baselines").axes["case"].cases
    if start == "warm":
        simulated(start, {FIRST_CASE: cases[FIRST_CASE]}, laps=2)
    else:
        simulated(start, cases, laps=1)


if __name__ == "__main__":
    main(sys.argv[1])
