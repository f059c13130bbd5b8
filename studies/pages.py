"""Writes the tables and the picture of docs/results.md from the committed tables of the studies.

    python -m studies.pages

Nothing is simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from genie_sim.analysis.renderers import markdown_rows
from genie_sim.study.design import load_design
from genie_sim.study.figures import SweepFigures
from tools.page_tables import filled

RESULTS, PAGE = Path("results"), Path("docs/results.md")
PICTURE = Path("docs/images/two_streets.png")
METHODS = {
    "local": "local",
    "local_tracker": "local, tracker",
    "remote": "remote",
    "remote_tracker": "remote, tracker",
    "paced_tracker": "paced remote, tracker",
    "genie": "Genie",
    "recommended": "recommended Genie",
    "sim_lru": "SimLRU",
    "genie_recommended": "recommended Genie",
}


class Shown(NamedTuple):
    """A metric in the rows of a table."""

    title: str
    metric: str
    factor: float = 1


def points_of(study: str) -> pd.DataFrame:
    """The means of a sweep's points."""
    points = pd.read_csv(RESULTS / study / "points.csv", keep_default_na=False)
    return points[points["placement"] == "all"]


def found(points: pd.DataFrame, **where: Any) -> list[float]:
    """The values where every column is as given."""
    for column, text in where.items():
        points = points[points[column] == text]
    return points["value"].tolist()


def value(points: pd.DataFrame, component: str = "", **where: Any) -> float:
    """The one value where every column is as given."""
    if "component" in points:
        where["component"] = component
    (one,) = found(points, **where)
    return one


def by_metric(
    study: str,
    metrics: Sequence[Shown],
    methods: Sequence[str],
    columns: Mapping[str, Mapping[str, Any]],
) -> str:
    """A row for each metric and method, a column for each point of a sweep."""
    points = points_of(study)
    rows = []
    for shown in metrics:
        for method in methods:
            numbers = [
                shown.factor * value(points, metric=shown.metric, method=method, **where)
                for where in columns.values()
            ]
            rows.append(
                [f"{shown.title}, {METHODS[method]}", *(f"{number:.3g}" for number in numbers)]
            )
    return markdown_rows([["", *columns], *rows], [True] * len(columns))


F1 = Shown("streaming F1 [%]", "streaming_f1", 100)
ENERGY = Shown("energy per frame [J]", "energy_per_frame")
WITH_TRACKERS = ("local", "local_tracker", "remote", "remote_tracker", "genie", "recommended")


def batching() -> str:
    servings = ("one by one", "a queue for each camera", "in fours")
    methods = ("remote", "remote_tracker", "genie", "recommended")
    columns = {name: {"serving": name} for name in servings}
    return by_metric("batching", (F1, ENERGY), methods, columns)


def shared_uplink() -> str:
    links = {"`nr5g`": "nr5g, not shared", "`cell`": "cell of 25 MHz"}
    columns: dict[str, dict[str, Any]] = {
        f"{cars} cars, {title}": {"cars": cars, "link": link}
        for cars in (30, 80)
        for title, link in links.items()
    }
    return by_metric("shared_uplink", (F1,), WITH_TRACKERS, columns)


def two_streets() -> str:
    streets = ("drive 0005", "drive 0013")
    columns: dict[str, dict[str, Any]] = {
        f"{uplink}, {street}": {"uplink": uplink, "street": street}
        for street in streets
        for uplink in ("5G, raw", "5G, JPEG", "Ethernet, raw")
    }
    return by_metric("two_streets", (F1,), (*WITH_TRACKERS[:5], "genie_recommended"), columns)


def streets_picture() -> Figure:
    """Streaming F1 on each street with each uplink, a panel for each method."""
    points = points_of("two_streets").query("component == ''").assign(seed=0)
    titles = {method: METHODS[method] for method in points["method"]}
    return SweepFigures(load_design("two_streets"), points, titles, "").of("streaming_f1")


def failing_edge() -> str:
    faults = ("no fault", "crash, cold", "five times slower")
    columns = {fault: {"fault": fault, "component": "during"} for fault in faults}
    recall = (Shown("recall [%]", "fault_recall", 100),)
    return by_metric("failing_edge", recall, (*WITH_TRACKERS, "sim_lru"), columns)


def gain(row: Mapping[Any, Any]) -> str:
    """A gain with its interval."""
    return f"{row['gain']:+.3f} ({row['low']:+.3f} to {row['high']:+.3f})"


def where_it_pays() -> str:
    """The towns with settings chosen on all conditions, and the means over drives and towns."""
    rows = []
    for row in pd.read_csv(RESULTS / "where_it_pays" / "reported_gains.csv").to_dict("records"):
        if not isinstance(row["best"], str):
            rows.append([f"**{row['condition']}**", "", "", "", f"**{gain(row)}**", ""])
        elif row["condition"].startswith("town"):
            best = METHODS[row["best"].removesuffix("_for_towns")]
            numbers = [f"{row['best_f1']:.3f}", f"{row['genie_f1']:.3f}", gain(row)]
            prices = (row[f"{what}_of_remote"] for what in ("bytes", "edge_time", "energy"))
            rows.append([row["condition"], best, *numbers, ", ".join(f"{p:.0%}" for p in prices)])
    header = ["condition", "best without a Genie", "its F1", "Genie's F1", "difference", "costs"]
    return markdown_rows([header, *rows], [False, True, True, True, True])


def baselines() -> str:
    points = pd.read_csv(RESULTS / "baselines" / "cold.csv", keep_default_na=False)
    points = points[points["case"] == "as in the scenario"]
    shown = ("local", "remote", "genie", "central", "sim_lru-0.05", "sim_lru-0.1", "rnd_lru-0.1")
    shown += ("potluck-100", "foggycache-0.1-0.9", "cachier-2ms", "deadline-300ms", "oracle")
    percent = "{:.0%}".format
    columns: dict[str, tuple[str, str, str, Callable[[float], str]]] = {
        "streaming F1, newest answer": ("streaming_f1", "newest", "all", "{:.2f}".format),
        "streaming F1, tracker": ("streaming_f1", "tracker", "all", "{:.2f}".format),
        "first answer, ms": ("first_answer_mean", "newest", "all", "{:.0f}".format),
        "hits, cars": ("image_reuse", "newest", "car", percent),
        "hits, edges": ("image_reuse", "newest", "edge", percent),
        "wrong hits": ("wrong_hit_share", "newest", "all", percent),
        "kB up": ("bytes_up_per_frame", "newest", "all", lambda number: f"{number / 1000:.0f}"),
    }
    rows = []
    for method in shown:
        cells = []
        for metric, consumer, placement, form in columns.values():
            of = {"method": method, "metric": metric, "consumer": consumer, "placement": placement}
            numbers = found(points, **of)
            cells.append(form(numbers[0]) if numbers else "-")
        rows.append([f"`{method}`", *cells])
    return markdown_rows([["method", *columns], *rows], [True] * len(columns))


TABLES: Mapping[str, Callable[[], str]] = {
    "where_it_pays": where_it_pays,
    "baselines": baselines,
    "batching": batching,
    "two_streets": two_streets,
    "shared_uplink": shared_uplink,
    "failing_edge": failing_edge,
}


if __name__ == "__main__":
    streets_picture().savefig(PICTURE, dpi=200, metadata={"Software": None})
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(filled(page, {name: made() for name, made in TABLES.items()}), encoding="utf-8")
