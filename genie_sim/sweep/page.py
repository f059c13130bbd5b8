"""The page of a sweep: a table of its points, and curves along each axis, of whichever metric."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim import report
from genie_sim.analysis.statistics import across_seeds
from genie_sim.errors import UserError
from genie_sim.recording import provenance

if TYPE_CHECKING:
    import pandas as pd

STYLES = ("page.css", "many.css")
SCRIPTS = ("charts.js", "many.js", "sweep.js")
MAIN = (
    "image_reuse", "object_reuse", "confidence_boost", "first_answer_mean", "fresh_answer_mean",
    "under_deadline_share", "fresh_answered_share", "ghost_share", "object_recall",
)  # fmt: skip
BY = ["metric", "role"]
ENDS = ["value", "low", "high"]
MOST_NUMBERS = 500_000  # in the page, a few bytes each
MOST_LEVELS = 300  # on one axis
MOST_LINES = 8  # an axis of more levels is not offered to tell lines apart
LOGARITHMIC_FROM = 20.0  # a list that spans so much, largest to smallest


def write(path: Path, folder: Path) -> None:
    """Writes the page about the sweep in ``folder``. Raises ``UserError``."""
    report.write_text(path, page(folder))


def page(folder: Path) -> str:
    """The text of the page. Raises ``UserError`` for a sweep that is not finished."""
    with provenance.of_this_version(folder):
        data = page_data(folder)
        return report.assemble("sweep.html", STYLES, SCRIPTS, f"{data['about']['name']}, a sweep", data)


def page_data(folder: Path) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was made."""
    about, runs, points = _read(folder)
    notes: list[str] = []
    settings, by_name = about["sweep"], about["sweep"]["axes"]
    columns = [str(name) for name in points.columns[1 : 1 + len(by_name)]]
    axes = {column: by_name[column.partition(" [")[0]] for column in columns}  # JSON sorts them by name
    found = points.dropna(subset=["metric"])
    kept = _chosen(found, runs, columns, notes)
    return {
        "about": {
            "name": settings["name"],
            "description": settings["description"],
            "scenario": settings["scenario"],
            "set": settings["set"],
            "seeds": settings["seeds"],
            "points": about["points"],
            "runs": about["runs"],
            "genie_sim": about["genie_sim"],
        },
        "axes": [
            {"column": column, "of": axis["set"], "sampled": _sampled(axis)}
            for column, axis in axes.items()
        ],
        "metrics": [
            {"name": name, "unit": unit, "roles": list(dict.fromkeys(group["role"])), "main": name in MAIN}
            for (name, unit), group in kept.groupby(["metric", "unit"], sort=False)
        ],
        "table": _table(points, kept, columns, notes),
        "curves": list(_curves(runs, kept, axes, notes)),
        "notes": list(dict.fromkeys(notes)),
    }


def _read(folder: Path) -> tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]:
    """What ``sweep.json``, ``runs.parquet`` and ``table.parquet`` say."""
    import pandas as pd

    path = folder / "sweep.json"
    try:
        about = provenance.read_json(path)
        if not isinstance(about, dict) or "sweep" not in about:
            raise UserError(f"{path}: cannot be read: not what a sweep says of itself")
        path = folder / "runs.parquet"
        with path.open("rb") as file:  # of a path pandas makes a URI
            runs = pd.read_parquet(file)
        path = folder / "table.parquet"
        with path.open("rb") as file:
            points = pd.read_parquet(file)
    except FileNotFoundError:
        raise UserError(f"{path}: missing; the sweep is not finished, run it again for the rest") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {error}") from error
    return about, _with_role(runs), _with_role(points)


def _with_role(table: pd.DataFrame) -> pd.DataFrame:
    """With a column ``role``: the baseline of an improvement, where Genies run, else the method."""
    placed = table["placement"].map({"car": "local", "edge": "remote"})
    return table.assign(role=table["component"].where(table["component"] != "", placed.fillna(table["method"])))


def _chosen(points: pd.DataFrame, runs: pd.DataFrame, columns: Sequence[str], notes: list[str]) -> pd.DataFrame:
    """The rows of all metrics, or of the main ones where all would be too much for a page."""
    levels = sum(min(runs[column].nunique(), MOST_LEVELS) for column in columns)
    series = len(points[BY].drop_duplicates())
    if (len(points) + series * levels * MOST_LINES) * len(ENDS) <= MOST_NUMBERS:
        return points
    notes.append("The page shows the main metrics only; all are in table.csv and table.parquet beside it.")
    return points[points["metric"].isin(MAIN)]


def _table(points: pd.DataFrame, kept: pd.DataFrame, columns: Sequence[str], notes: list[str]) -> dict[str, Any]:
    """The points' levels, column by column, and each metric's values in the same order."""
    places = points[["point", *columns]].drop_duplicates("point")
    series = max(len(kept[BY].drop_duplicates()), 1)
    most = max(MOST_NUMBERS // (series * len(ENDS)), 1)
    if len(places) > most:
        notes.append(f"The table shows the first {most:,} of {len(places):,} points; all are in table.csv beside it.")
        places = places[:most]
    return {
        "points": [int(number) for number in places["point"]],
        "levels": [_levels(places[column]) for column in columns],
        "values": _values(kept, "point", places["point"].tolist()),
    }


def _curves(
    runs: pd.DataFrame, kept: pd.DataFrame, axes: Mapping[str, Mapping[str, Any]], notes: list[str]
) -> Iterator[dict[str, Any]]:
    """Along each axis: averages over all other axes, and the same at each level of another crossed axis."""
    of_kept = runs[runs["metric"].isin(kept["metric"].unique())]
    for column, axis in axes.items():
        levels = list(dict.fromkeys(of_kept[column]))
        numeric = all(isinstance(level, float) for level in levels)
        levels = sorted(levels) if numeric else levels
        if len(levels) > MOST_LEVELS:
            notes.append(f"Along {column}, {MOST_LEVELS} of its {len(levels):,} values are drawn, evenly chosen.")
            last = len(levels) - 1
            levels = [levels[last * place // (MOST_LEVELS - 1)] for place in range(MOST_LEVELS)]
        shown = of_kept[of_kept[column].isin(levels)]
        lines: list[dict[str, Any]] = [
            {"by": None, "level": None, "values": _values(_with_role(across_seeds(shown, [column])), column, levels)}
        ]
        for other in () if _sampled(axis) else axes:
            cases = list(dict.fromkeys(shown[other]))
            if other == column or _sampled(axes[other]) or len(cases) > MOST_LINES:
                continue
            means = _with_role(across_seeds(shown, [other, column]))
            lines += [
                {"by": other, "level": level, "values": _values(means[means[other] == level], column, levels)}
                for level in cases
            ]
        yield {
            "column": column, "sampled": _sampled(axis), "numeric": numeric,
            "log": numeric and _logarithmic(axis, levels), "levels": levels, "lines": lines,
        }  # fmt: skip


def _values(means: pd.DataFrame, key: str, places: list[Any]) -> dict[str, dict[str, list[list[float | None]]]]:
    """By metric and role, three columns in the order of ``places``: value, low, high; ``None`` where not defined."""
    made: dict[str, dict[str, list[list[float | None]]]] = {}
    for (metric, role), group in means.dropna(subset=BY).groupby(BY, sort=False):
        rows = group.set_index(key)[ENDS].reindex(places)
        made.setdefault(str(metric), {})[str(role)] = [[_round(value) for value in rows[end]] for end in ENDS]
    return made


def _levels(values: pd.Series[Any]) -> list[float | str]:
    return [value if isinstance(value, str) else float(value) for value in values]


def _sampled(axis: Mapping[str, Any]) -> bool:
    return axis["random"] is not None or axis["latin_hypercube"] is not None


def _logarithmic(axis: Mapping[str, Any], levels: Sequence[float]) -> bool:
    span = axis["grid"] or axis["random"] or axis["latin_hypercube"]
    if span is not None:
        return bool(span["scale"] == "log")
    return min(levels) > 0 and max(levels) / min(levels) >= LOGARITHMIC_FROM


def _round(value: float) -> float | None:
    """Five significant digits; what is not finite is ``None``."""
    return None if not math.isfinite(value) else float(f"{value:.5g}")
