"""The page of a sweep: a table of its points, and curves along each axis, of whichever metric."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim import report
from genie_sim.analysis.statistics import across_seeds
from genie_sim.errors import UserError, first_line
from genie_sim.recording import provenance
from genie_sim.report.data import rounded
from genie_sim.sweeps.design import PANELS, spans_much

if TYPE_CHECKING:
    import pandas as pd

    Series = Mapping[
        str, list[tuple[str, ...]]
    ]  # by metric: what it is of, as method, placement and component

OF = ["method", "placement", "component"]
BY = ["metric", *OF]
ENDS = ["value", "low", "high"]
MOST_NUMBERS = 500_000  # in the page, a few bytes each
MOST_LEVELS = 300  # on one axis
MOST_LINES = 8  # an axis of more levels is not offered to tell lines apart


def page(folder: Path) -> str:
    """The page about the sweep in ``folder``. Raises ``UserError`` for one that is not finished."""
    with provenance.of_this_version(folder):
        data = page_data(folder)
        title, elsewhere = (
            f"{data['about']['name']}, a sweep",
            "The numbers are also in table.csv beside it.",
        )
        return report.assemble("sweep.html", ("many.js", "sweep.js"), title, data, elsewhere)


def page_data(folder: Path) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was made."""
    about, runs, points = _read(folder)
    notes: list[str] = []
    settings, by_name, titles = about["sweep"], about["sweep"]["axes"], about.get("titles", {})
    columns = [str(name) for name in points.columns[1 : 1 + len(by_name)]]
    axes = {
        column: by_name[column.partition(" [")[0]] for column in columns
    }  # JSON sorts them by name
    found = points.dropna(subset=["metric"])
    kept = _chosen(found, runs, columns, notes)
    metrics: Any = kept.groupby(["metric", "unit"], sort=False)
    of = {
        str(name): list(dict.fromkeys(map(tuple, group[OF].to_numpy().tolist())))
        for (name, _), group in metrics
    }
    return {
        "about": {
            **{
                name: settings[name] for name in ("name", "description", "scenario", "set", "seeds")
            },
            **{name: about[name] for name in ("points", "runs", "genie_sim")},
        },
        "axes": [
            {"column": name, "of": axis["set"], "sampled": _sampled(axis)}
            for name, axis in axes.items()
        ],
        "methods": [
            {"name": name, "title": titles.get(name, name)}
            for name in dict.fromkeys(found["method"])
        ],
        "metrics": [
            {"name": name, "unit": unit, "of": of[name], "main": name in PANELS}
            for name, unit in metrics.groups
        ],
        "table": _table(points, kept, columns, of, notes),
        "curves": list(_curves(runs, kept, axes, of, notes)),
        "notes": list(dict.fromkeys(notes)),
    }


def _read(folder: Path) -> "tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]":
    """What ``sweep.json``, ``runs.parquet`` and ``table.parquet`` say."""
    import pandas as pd

    path = folder / "sweep.json"
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
    levels = sum(min(runs[column].nunique(), MOST_LEVELS) for column in columns)
    series = len(points[BY].drop_duplicates())
    if (len(points) + series * levels * MOST_LINES) * len(ENDS) <= MOST_NUMBERS:
        return points
    notes.append(
        "The page shows the main metrics only; all are in table.csv and table.parquet beside it."
    )
    return points[points["metric"].isin(PANELS)]


def _table(
    points: "pd.DataFrame",
    kept: "pd.DataFrame",
    columns: Sequence[str],
    of: "Series",
    notes: list[str],
) -> dict[str, Any]:
    """The points' levels, column by column, and each metric's values in the same order."""
    places = points[["point", *columns]].drop_duplicates("point")
    series = max(len(kept[BY].drop_duplicates()), 1)
    most = max(MOST_NUMBERS // (series * len(ENDS)), 1)
    if len(places) > most:
        notes.append(
            f"The table shows the first {most:,} of {len(places):,} points; all are in table.csv beside it."
        )
        places = places[:most]
    return {
        "points": [int(number) for number in places["point"]],
        "levels": [
            [one if isinstance(one, str) else float(one) for one in places[column]]
            for column in columns
        ],
        "values": _values(kept, of, "point", places["point"].tolist()),
    }


def _curves(
    runs: "pd.DataFrame",
    kept: "pd.DataFrame",
    axes: Mapping[str, Mapping[str, Any]],
    of: "Series",
    notes: list[str],
) -> Iterator[dict[str, Any]]:
    """Along each axis: averages over all other axes, and the same at each level of another crossed axis."""
    of_kept = runs[runs["metric"].isin(kept["metric"].unique())]
    for column, axis in axes.items():
        levels = list(dict.fromkeys(of_kept[column]))
        numeric = all(isinstance(level, float) for level in levels)
        levels = sorted(levels) if numeric else levels
        if len(levels) > MOST_LEVELS:
            notes.append(
                f"Along {column}, {MOST_LEVELS} of its {len(levels):,} values are drawn, evenly chosen."
            )
            last = len(levels) - 1
            levels = [levels[last * place // (MOST_LEVELS - 1)] for place in range(MOST_LEVELS)]
        shown = of_kept[of_kept[column].isin(levels)]
        lines: list[dict[str, Any]] = [
            {
                "by": None,
                "level": None,
                "values": _values(across_seeds(shown, [column]), of, column, levels),
            }
        ]
        for other in () if _sampled(axis) else axes:
            cases = list(dict.fromkeys(shown[other]))
            if other == column or _sampled(axes[other]) or len(cases) > MOST_LINES:
                continue
            means = across_seeds(shown, [other, column])
            lines += [
                {
                    "by": other,
                    "level": level,
                    "values": _values(means[means[other] == level], of, column, levels),
                }
                for level in cases
            ]
        yield {
            "column": column, "sampled": _sampled(axis), "numeric": numeric,
            "log": numeric and _logarithmic(axis, levels), "levels": levels, "lines": lines,
        }  # fmt: skip


def _values(
    means: "pd.DataFrame", of: "Series", key: str, places: list[Any]
) -> dict[str, list[Any]]:
    """By metric and what it is of, three columns in the order of ``places``: value, low, high; ``None`` where not
    defined."""
    made: dict[str, list[Any]] = {name: [None] * len(series) for name, series in of.items()}
    groups: Any = means.dropna(subset=BY).groupby(BY, sort=False)
    for (metric, *which), group in groups:
        rows = group.set_index(key)[ENDS].reindex(places)
        made[metric][of[metric].index(tuple(which))] = [
            [rounded(value, 5) for value in rows[end]] for end in ENDS
        ]
    return made


def _sampled(axis: Mapping[str, Any]) -> bool:
    return axis["random"] is not None or axis["latin_hypercube"] is not None


def _logarithmic(axis: Mapping[str, Any], levels: Sequence[float]) -> bool:
    span = axis["grid"] or axis["random"] or axis["latin_hypercube"]
    if span is not None:
        return bool(span["scale"] == "log")
    return spans_much(levels)
