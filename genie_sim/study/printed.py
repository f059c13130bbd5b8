"""A finished sweep for a paper: what its figures are drawn from, and its table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import latex, text_table
from genie_sim.analysis.latex import Number, NumberRow
from genie_sim.analysis.registry import METRICS
from genie_sim.errors import UserError, unknown
from genie_sim.recording import provenance
from genie_sim.study import page
from genie_sim.study.design import Design, read_design

if TYPE_CHECKING:
    import pandas as pd

PRINTED = ("first_answer_mean", "fresh_answered_share", "streaming_f1", "ghost_share")
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
    """The title of each method; its name, where two have the same title."""
    of_all = list(titles.values())
    return {name: title if of_all.count(title) == 1 else name for name, title in titles.items()}


def drawn_from(
    folder: Path, allow_changed: bool = False
) -> "tuple[Design, pd.DataFrame, dict[str, str], str]":
    """What the figures of the sweep in a folder are drawn from: the design, its runs, the methods'
    titles, and which sweep it is. Raises ``UserError``.
    """
    about, runs, _ = _read(folder, allow_changed)
    design = read_design(about["sweep"], str(folder / page.ABOUT))
    return design, runs, _titles(about), footer_of(design, str(about.get("label", "")))


def table_of(
    folder: Path, format: str, methods: Sequence[str] = (), allow_changed: bool = False
) -> str:
    """The points of a sweep, of all ``methods`` or of these: in ``csv`` every metric with all
    digits, in ``latex`` the main metrics with their intervals, in ``markdown`` the same without.
    Raises ``UserError``.
    """
    about, _, points = _read(folder, allow_changed)
    known = list(dict.fromkeys(points["method"].dropna()))
    for name in methods:
        if name not in known:
            raise UserError(f"--methods: {folder}: {unknown('method', name, known)}")
    if methods:
        points = points[points["method"].isin(methods)]
    if format == "csv":
        return text_table.exact(
            list(map(str, points.columns)), points.itertuples(index=False, name=None)
        )
    columns = list(map(str, points.columns[1 : 1 + len(about["sweep"]["axes"])]))
    metrics = [name for name in PRINTED if (points["metric"] == name).any()]
    headings = [METRICS[name].label for name in metrics]
    rows = _rows(points, columns, metrics, _titles(about))
    if format == "markdown":
        texts = [
            [row.label, *("-" if number is None else number.value for number in row.numbers)]
            for row in rows
        ]
        return text_table.rounded("markdown", ["", *headings], texts, "l" + "r" * len(headings))
    seeds = len(about["sweep"]["seeds"])
    several = f"Means, in brackets their 95 % t intervals, over {seeds} seeds."
    notes = [several if seeds > 1 else "One seed."]
    if len(rows) > MAX_ROWS:
        notes.append(f"The first {MAX_ROWS} of {len(rows)} rows; all are in table.csv.")
    name = str(about.get("label") or about["sweep"]["name"])
    return latex.table(
        headings,
        rows[:MAX_ROWS],
        caption=f"{name}: {', '.join(columns)}",
        label=f"tab:{latex.key(name)}",
        notes=notes,
    )


def _rows(
    points: "pd.DataFrame",
    columns: list[str],
    metrics: list[str],
    titles: Mapping[str, str],
) -> list[NumberRow]:
    """A row for each point and method, with the metrics of the method as a whole."""
    whole = points[(points["placement"] == "all") & (points["component"] == "")]
    rows = []
    for (_, method), of_row in whole.groupby(["point", "method"], sort=False):
        by_metric = of_row.set_index("metric")
        first = of_row.iloc[0]
        place = ", ".join(_level(first[column]) for column in columns)
        numbers = [
            _number(name, by_metric.loc[name]) if name in by_metric.index else None
            for name in metrics
        ]
        rows.append(NumberRow(f"{place}: {titles.get(str(method), str(method))}", numbers))
    return rows


def _number(metric: str, row: Any) -> Number | None:
    factor = METRICS[metric].factor
    value, low, high = (float(row[name]) * factor for name in ("value", "low", "high"))
    if value != value:
        return None
    ends = None if low != low else (latex.printed(low), latex.printed(high))
    return Number(latex.printed(value), ends)


def _level(level: object) -> str:
    return f"{level:g}" if isinstance(level, float) else str(level)


def _titles(about: Mapping[str, Any]) -> dict[str, str]:
    return unique_titles(about.get("titles", {}))


def _read(folder: Path, allow_changed: bool) -> "tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]":
    with provenance.of_this_version(folder):
        about, runs, points = page.read(folder)
        changed = provenance.changed_files(folder, about.get("digests"), page.READ)
        provenance.refuse_changed(folder, changed, allow_changed)
        return about, runs, points
