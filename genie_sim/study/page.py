"""The page of a sweep: a table of its points, and curves along each axis, of whichever metric."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis.registry import is_drawn_logarithmically, spans_much
from genie_sim.analysis.statistics import across_seeds
from genie_sim.analysis.style import method_styles
from genie_sim.base.errors import UserError, first_line
from genie_sim.base.text import finite
from genie_sim.record import provenance
from genie_sim.report import html_page
from genie_sim.report.data import metric_info, zero_delay
from genie_sim.study.design import PANELS

if TYPE_CHECKING:
    import pandas as pd

    # by metric: what it is of, as method, placement and component
    Series = Mapping[str, list[tuple[str, ...]]]

OF = ["method", "placement", "component"]
BY = ["metric", *OF]
ENDS = ["value", "low", "high"]
MAX_NUMBERS = 500_000  # in the page, a few bytes each
MAX_LEVELS = 300  # on one axis
MAX_LINES = 8  # an axis of more levels is not offered to tell lines apart


ABOUT = "sweep.json"
READ = ("runs.parquet", "table.parquet")  # what the page is made of, besides sweep.json


def page(folder: Path, allow_changed: bool = False) -> str:
    """The page about the sweep in ``folder``. Raises ``UserError`` for one that is not finished,
    and, unless they are allowed, for tables that were changed since they were written.
    """
    with provenance.of_this_version(folder):
        data = page_data(folder, allow_changed)
        title, elsewhere = (
            f"{data['about']['name']}, a sweep",
            "The numbers are also in table.csv beside it.",
        )
        return html_page.assemble(
            "sweep.html", ("many.js", "sweep.js"), title, data, elsewhere=elsewhere
        )


def page_data(folder: Path, allow_changed: bool = False) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was
    made.
    """
    about, runs, points = read(folder)
    changed = provenance.changed_files(folder, about.get("digests"), READ)
    provenance.refuse_changed(folder, changed, allow_changed)
    notes: list[str] = []
    settings, by_name, titles = about["sweep"], about["sweep"]["axes"], about.get("titles", {})
    columns = [str(name) for name in points.columns[1 : 1 + len(by_name)]]
    # JSON sorts them by name
    axes = {column: by_name[column.partition(" [")[0]] for column in columns}
    defined = points.dropna(subset=["metric"])
    methods = list(dict.fromkeys(defined["method"]))
    chosen = _chosen(defined, runs, columns, notes)
    metrics: Any = chosen.groupby(["metric", "unit"], sort=False)
    series = {
        str(name): list(dict.fromkeys(map(tuple, group[OF].to_numpy().tolist())))
        for (name, _), group in metrics
    }
    return {
        "about": {
            **{
                name: settings[name] for name in ("name", "description", "scenario", "set", "seeds")
            },
            **({"name": str(about["label"])} if about.get("label") else {}),
            **{name: about[name] for name in ("points", "runs", "genie_sim")},
            "warning": provenance.warning(changed),
        },
        "axes": [
            {"column": name, "of": axis["set"], "sampled": _sampled(axis)}
            for name, axis in axes.items()
        ],
        "methods": [
            {"name": name, "title": titles.get(name, name), "look": style}
            for name, style in zip(methods, method_styles(methods), strict=True)
        ],
        "zero_delay": zero_delay(),
        "metric_info": metric_info(name for name, _ in metrics.groups),
        "metrics": [
            {
                "name": name,
                "unit": unit,
                "of": series[name],
                "main": name in PANELS,
                "log": is_drawn_logarithmically(str(name), of_metric["value"].dropna().tolist()),
            }
            for (name, unit), of_metric in metrics
        ],
        "table": _table(points, chosen, columns=columns, series=series, notes=notes),
        "curves": list(_curves(runs, chosen, axes=axes, series=series, notes=notes)),
        "notes": list(dict.fromkeys(notes)),
    }


def read(folder: Path) -> "tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]":
    """What ``sweep.json``, ``runs.parquet`` and ``table.parquet`` say."""
    import pandas as pd

    path = folder / ABOUT
    try:
        about = provenance.read_json(path)
        if not isinstance(about, dict) or "sweep" not in about:
            raise UserError(f"{path}: cannot be read: not what a sweep says of itself")
        read = []
        for path in (folder / "runs.parquet", folder / "table.parquet"):
            with path.open("rb") as file:  # of a path pandas makes a URI
                read.append(pd.read_parquet(file, use_threads=False))  # see parquet.read
    except FileNotFoundError:
        raise UserError(
            f"{path}: missing; the sweep is not finished, run it again for the rest"
        ) from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {first_line(error)}") from error
    return about, read[0], read[1]


def _chosen(
    points: "pd.DataFrame", runs: "pd.DataFrame", columns: Sequence[str], notes: list[str]
) -> "pd.DataFrame":
    """The rows of all metrics, or of the main ones where all would be too much for a page."""
    levels = sum(min(runs[column].nunique(), MAX_LEVELS) for column in columns)
    series = len(points[BY].drop_duplicates())
    if (len(points) + series * levels * MAX_LINES) * len(ENDS) <= MAX_NUMBERS:
        return points
    notes.append(
        "The page shows the main metrics only; all are in table.csv and table.parquet beside it."
    )
    return points[points["metric"].isin(PANELS)]


def _table(
    points: "pd.DataFrame",
    chosen: "pd.DataFrame",
    *,
    columns: Sequence[str],
    series: "Series",
    notes: list[str],
) -> dict[str, Any]:
    """The points' levels, column by column, and each metric's values in the same order."""
    places = points[["point", *columns]].drop_duplicates("point")
    count = max(len(chosen[BY].drop_duplicates()), 1)
    max_points = max(MAX_NUMBERS // (count * len(ENDS)), 1)
    if len(places) > max_points:
        notes.append(
            f"The table shows the first {max_points:,} of {len(places):,} points; "
            "all are in table.csv beside it."
        )
        places = places[:max_points]
    return {
        "points": [int(number) for number in places["point"]],
        "levels": [
            [level if isinstance(level, str) else float(level) for level in places[column]]
            for column in columns
        ],
        "values": _values(chosen, series, "point", places["point"].tolist()),
    }


def _curves(
    runs: "pd.DataFrame",
    chosen: "pd.DataFrame",
    *,
    axes: Mapping[str, Mapping[str, Any]],
    series: "Series",
    notes: list[str],
) -> Iterator[dict[str, Any]]:
    """Along each axis: averages over all other axes, and the same at each level of another crossed
    axis.
    """
    metric_runs = runs[runs["metric"].isin(chosen["metric"].unique())]
    for column, axis in axes.items():
        levels = list(dict.fromkeys(metric_runs[column]))
        numeric = all(isinstance(level, float) for level in levels)
        levels = sorted(levels) if numeric else levels
        if len(levels) > MAX_LEVELS:
            notes.append(
                f"Along {column}, {MAX_LEVELS} of its {len(levels):,} values are drawn, "
                "evenly chosen."
            )
            last = len(levels) - 1
            levels = [levels[last * place // (MAX_LEVELS - 1)] for place in range(MAX_LEVELS)]
        axis_runs = metric_runs[metric_runs[column].isin(levels)]
        lines: list[dict[str, Any]] = [
            {
                "by": None,
                "level": None,
                "values": _values(across_seeds(axis_runs, [column]), series, column, levels),
            }
        ]
        for crossing in () if _sampled(axis) else axes:
            cases = list(dict.fromkeys(axis_runs[crossing]))
            if crossing == column or _sampled(axes[crossing]) or len(cases) > MAX_LINES:
                continue
            means = across_seeds(axis_runs, [crossing, column])
            lines += [
                {
                    "by": crossing,
                    "level": level,
                    "values": _values(means[means[crossing] == level], series, column, levels),
                }
                for level in cases
            ]
        yield {
            "column": column,
            "sampled": _sampled(axis),
            "numeric": numeric,
            "log": numeric and _logarithmic(axis, levels),
            "levels": levels,
            "lines": lines,
        }


def _values(
    means: "pd.DataFrame", series: "Series", key: str, places: list[Any]
) -> dict[str, list[Any]]:
    """By metric and what it is of, three columns in the order of ``places``: value, low, high;
    ``None`` where not defined.
    """
    columns: dict[str, list[Any]] = {name: [None] * len(names) for name, names in series.items()}
    place_of = {place: number for number, place in enumerate(places)}
    rows = means.dropna(subset=BY)
    # Row by row: pandas would take as long for each of the many small groups as for a whole table.
    for metric, *which, place, value, low, high in zip(
        *(rows[name].tolist() for name in (*BY, key, *ENDS)), strict=True
    ):
        of_metric, number = columns[metric], series[metric].index(tuple(which))
        if of_metric[number] is None:
            of_metric[number] = [[None] * len(places) for _ in ENDS]
        if place in place_of:
            for column, end in zip(of_metric[number], (value, low, high), strict=True):
                column[place_of[place]] = finite(end, 5)
    return columns


def _sampled(axis: Mapping[str, Any]) -> bool:
    return axis["random"] is not None or axis["latin_hypercube"] is not None


def _logarithmic(axis: Mapping[str, Any], levels: Sequence[float]) -> bool:
    span = axis["grid"] or axis["random"] or axis["latin_hypercube"]
    if span is not None:
        return bool(span["scale"] == "log")
    return spans_much(levels)
