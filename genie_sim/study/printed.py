"""A finished sweep for a paper: what its figures are drawn from, and its table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import renderers
from genie_sim.analysis.metric import SHORT
from genie_sim.analysis.registry import checked, definition, learn, shown
from genie_sim.analysis.result_table import Cell, ResultTable, Row
from genie_sim.analysis.seed_runs import ABOUT, read_about
from genie_sim.base import parquet
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.text import one_line
from genie_sim.record import provenance
from genie_sim.study.design import Design, read_design

if TYPE_CHECKING:
    import pandas as pd

READ = ("runs.parquet", "table.parquet")  # what is read, besides sweep.json
NEEDED = ("point", "method", "metric", "placement", "component", "value", "unit", "low", "high")
MAX_ROWS = 50  # of a table in LaTeX


def footer_of(design: Design, label: str = "") -> str:
    """Which sweep it is, below a figure."""
    numbers = design.seeds
    few = len(numbers) <= 5
    seeds = f"seeds {', '.join(map(str, numbers))}" if few else f"{len(numbers)} seeds"
    what = f"sweep {design.name} of {design.scenario}"
    points = f"{design.runs // len(numbers)} points"
    return ", ".join(filter(None, [label, what, points, seeds]))


def unique_titles(titles: Mapping[str, str]) -> dict[str, str]:
    """The title of each method on one line; its name, where two have the same title."""
    titles = {name: one_line(title) for name, title in titles.items()}
    of_all = list(titles.values())
    return {name: title if of_all.count(title) == 1 else name for name, title in titles.items()}


def drawn_from(
    folder: Path, allow_changed: bool = False
) -> "tuple[Design, pd.DataFrame, pd.DataFrame, dict[str, str], str]":
    """What the figures of the sweep in a folder are drawn from: the design, its runs and points,
    the methods' titles, and which sweep it is. Raises ``UserError``.
    """
    about, runs, points = _read(folder, allow_changed)
    design = read_design(about["sweep"], str(folder / ABOUT))
    return design, runs, points, _titles(about), footer_of(design, str(about.get("label", "")))


def table_of(
    folder: Path,
    format: str,
    methods: Sequence[str] = (),
    metrics: Sequence[str] = (),
    allow_changed: bool = False,
) -> str:
    """The points of a sweep, of all ``methods`` or of these: in ``csv`` every metric with all
    digits, in ``latex`` the main metrics with their intervals, in ``markdown`` the same without; or
    these ``metrics``. Raises ``UserError``.
    """
    about, _, points = _read(folder, allow_changed)
    known = list(dict.fromkeys(points["method"].dropna()))
    for name in methods:
        if name not in known:
            raise UserError(f"--methods: {folder}: {unknown('method', name, known)}")
    if methods:
        points = points[points["method"].isin(methods)]
    if checked(metrics, points["metric"]):
        points = points[points["metric"].isin(metrics)]
    if format == "csv":
        return renderers.exact(
            list(map(str, points.columns)), points.itertuples(index=False, name=None)
        )
    columns = list(map(str, points.columns[1 : 1 + len(about["sweep"]["axes"])]))
    name = str(about.get("label") or about["sweep"]["name"])
    shown = _columns(points, metrics)
    table = _table(points, columns, shown, _titles(about), f"{name}: {', '.join(columns)}")
    if format == "markdown":
        return renderers.markdown(replace(table, title=""), intervals=False)
    seeds = len(about["sweep"]["seeds"])
    several = f"Means, in brackets their 95 % t intervals, over {seeds} seeds."
    notes = [several if seeds > 1 else "One seed."]
    if len(table.rows) > MAX_ROWS:
        notes.append(f"The first {MAX_ROWS} of {len(table.rows)} rows; all are in table.csv.")
    return renderers.latex(replace(table, rows=table.rows[:MAX_ROWS], notes=notes), name)


def _columns(points: "pd.DataFrame", metrics: Sequence[str]) -> list[tuple[str, str]]:
    """What a table shows: each metric with its placement; by default the main metrics of methods as
    a whole. Raises ``UserError`` for a metric of components alone.
    """
    whole = points[points["component"] == ""]
    there = dict.fromkeys(zip(whole["metric"], whole["placement"], strict=True))
    if not metrics:
        return [(name, "all") for name in shown(SHORT, whole["metric"]) if (name, "all") in there]
    columns = []
    for name in metrics:
        of_metric = [place for place in there if place[0] == name]
        if not of_metric:
            raise UserError(
                f"--metrics: {name}: is not of a method as a whole; --format csv has it"
                if (points["metric"] == name).any()
                else f"--metrics: {name}: this sweep has no value of it"
            )
        columns += of_metric
    return columns


def _table(
    points: "pd.DataFrame",
    columns: list[str],
    shown: Sequence[tuple[str, str]],
    titles: Mapping[str, str],
    title: str,
) -> ResultTable:
    """A row for each point and method, with what is ``shown``: metrics with their placements."""
    whole = points[points["component"] == ""]
    rows = []
    for (_, method), of_row in whole.groupby(["point", "method"], sort=False):
        by_place = of_row.set_index(["metric", "placement"])
        place = ", ".join(_level(of_row.iloc[0][column]) for column in columns)
        cells = [
            definition(key[0]).cell(*(by_place[end][key] for end in ("value", "low", "high")))
            if key in by_place.index
            else Cell()
            for key in shown
        ]
        rows.append(Row(f"{place}: {titles.get(str(method), str(method))}", cells))
    about = [(definition(name), placement) for name, placement in shown]
    labels = [metric.labelled(metric.titled(placement)) for metric, placement in about]
    return ResultTable(labels, rows, title)


def _level(level: object) -> str:
    return f"{level:g}" if isinstance(level, float) else str(level)


def _titles(about: Mapping[str, Any]) -> dict[str, str]:
    return unique_titles(about.get("titles", {}))


def _read(folder: Path, allow_changed: bool) -> "tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]":
    with provenance.of_this_version(folder):
        about, runs, points = _results(folder)
        changed = provenance.changed_files(folder, about.get("digests"), READ)
        provenance.refuse_changed(folder, changed, allow_changed)
        return about, runs, points


def _results(folder: Path) -> "tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]":
    """What ``sweep.json``, ``runs.parquet`` and ``table.parquet`` say."""
    about, found = read_about(folder), []
    for name in READ:
        path = provenance.contained(folder, name)
        if not path.exists():
            raise UserError(
                f"{path}: missing; the sweep is not finished, run it again for the rest"
            )
        table, _ = parquet.read(path, "table of a sweep", partial(_columns_of, path))
        found.append(table.to_pandas())
    learn(about.get("metrics", {}), f"{folder / ABOUT}: metrics")
    return about, found[0], found[1]


def _columns_of(path: Path, schema: Any, _about: object) -> list[str]:
    """All columns of a table of a sweep. Raises ``UserError`` where some are missing."""
    names: list[str] = schema.names
    if missing := [name for name in NEEDED if name not in names]:
        raise UserError(f"{path}: is no table of a sweep: it has no column {missing[0]}")
    return names


def page_of(folder: Path, allow_changed: bool = False) -> str:
    """The text of a page about a sweep: its main metrics, and its figures. Raises ``UserError``."""
    from genie_sim.report import comparison
    from genie_sim.study import figures

    about, runs, points = _read(folder, allow_changed)
    with provenance.of_this_version(folder):
        design = read_design(about["sweep"], str(folder / ABOUT))
        footer = footer_of(design, str(about.get("label", "")))
        drawn = dict(figures.of_sweep(design, runs, _titles(about), footer))
        columns = list(map(str, points.columns[1 : 1 + len(about["sweep"]["axes"])]))
        name = str(about.get("label") or about["sweep"]["name"])
        table = _table(points, columns, _columns(points, ()), _titles(about), name)
        return comparison.page_of_table(table, list(_titles(about).values()), footer, drawn)
