"""The page of a search: three designs in words, the front, parallel coordinates, what mattered."""

import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim import report
from genie_sim.analysis.registry import is_drawn_logarithmically
from genie_sim.analysis.style import method_looks
from genie_sim.errors import UserError, first_line
from genie_sim.recording import provenance
from genie_sim.report.data import metric_info
from genie_sim.text import finite
from genie_sim.tuning.design import Target

if TYPE_CHECKING:
    import pandas as pd

READ = ("designs.parquet", "importance.parquet", "differences.parquet")
MAX_DIFFERENCES = 20_000  # rows in the page
DIGITS = 5


def page(folder: Path, allow_changed: bool = False) -> str:
    """The page about the search in ``folder``. Raises ``UserError`` for one that is not finished,
    and, unless they are allowed, for tables that were changed since they were written.
    """
    with provenance.of_this_version(folder):
        data = page_data(folder, allow_changed)
        return report.assemble(
            "search.html",
            ("many.js", "search.js"),
            f"{data['about']['name']}, a search",
            data,
            elsewhere="The numbers are also in designs.csv beside it.",
        )


def page_data(folder: Path, allow_changed: bool = False) -> dict[str, Any]:
    """Everything on the page, as plain JSON values."""
    about, tables = _read(folder)
    changed = provenance.changed_files(folder, about.get("digests"), READ)
    provenance.refuse_changed(folder, changed, allow_changed)
    search = about["search"]
    designs = tables["designs"]
    objectives = [
        {
            "name": name,
            "metric": (target := Target.expand(name)).metric,
            "title": target.title,
            "better": better,
            "log": is_drawn_logarithmically(target.metric, designs[name].dropna().tolist()),
        }
        for better, key in (("higher", "maximize"), ("lower", "minimize"))
        for name in search["objectives"][key]
    ]
    names = {objective["name"] for objective in objectives}
    last = max(list(designs.columns).index(f"{name} high") for name in names)
    constraints = [text.split(" ")[0] for text in search["subject_to"]]
    last = max([last, *(list(designs.columns).index(f"{name} high") for name in constraints)])
    parameters = [str(column) for column in designs.columns[last + 1 :]]
    methods = list(dict.fromkeys(designs["method"]))
    return {
        "about": {
            **{name: search[name] for name in ("name", "description", "scenario", "points")},
            "genie_sim": about["genie_sim"],
            "warning": provenance.warning(changed),
            "seeds": about["seeds"],
            "drives": about["drives"],
            "subject_to": search["subject_to"],
            "set": search["set"],
            "tried": about["tried"],
        },
        "methods": [
            {"name": name, "title": about["titles"].get(name, name), "look": look}
            for name, look in zip(methods, method_looks(methods), strict=True)
        ],
        "metric_info": metric_info(objective["metric"] for objective in objectives),
        "objectives": objectives,
        "picks": about["picks"],
        "parameters": parameters,
        "designs": [_design(row, names, parameters) for row in designs.to_dict("records")],
        "importance": _rows(tables["importance"]),
        "differences": _differences(tables["differences"]),
        "notes": _notes(about, len(tables["differences"])),
    }


def _notes(about: dict[str, Any], differences: int) -> list[str]:
    notes = [
        "All numbers are of the held-out set, which the search has not seen, with 95 % intervals; "
        "designs were chosen by the tuning set.",
        "Intervals are pointwise: about one in twenty excludes zero by chance.",
    ]
    if len(about["drives"]["held_out"]) == 1:
        notes.append(
            "There is one drive: intervals are over its seeds and say nothing about other streets."
        )
    if differences > MAX_DIFFERENCES:
        notes.append("Paired differences are in differences.csv; there are too many for a page.")
    return notes


def _read(folder: Path) -> "tuple[dict[str, Any], dict[str, pd.DataFrame]]":
    import pandas as pd

    path = folder / "search.json"
    try:
        about = provenance.read_json(path)
        if not isinstance(about, dict) or "search" not in about:
            raise UserError(f"{path}: cannot be read: not what a search says of itself")
        tables = {}
        for name in READ:
            path = provenance.contained(folder, name)
            with path.open("rb") as file:
                tables[path.stem] = pd.read_parquet(file, use_threads=False)
    except FileNotFoundError:
        raise UserError(
            f"{path}: missing; the search is not finished, run it again for the rest"
        ) from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {first_line(error)}") from error
    return about, tables


def _design(
    row: Mapping[Any, Any], names: Collection[str], parameters: Sequence[str]
) -> dict[str, Any]:
    values = {
        name: [finite(row[f"{name}{end}"], DIGITS) for end in ("", " low", " high")]
        for name in names
    }
    return {
        "name": row["design"],
        "method": row["method"],
        "tuned": bool(row["tuned"]),
        "within": bool(row["within_constraints"]),
        "group": row["group"],
        "equal": row["equal_to"],
        "dominated": row["dominated_by"],
        "values": values,
        "parameters": [_level(row[name]) for name in parameters],
    }


def _level(value: Any) -> Any:
    """A parameter's value; ``None`` where it does not count."""
    if isinstance(value, str):
        return value
    return None if value is None else finite(float(value), DIGITS)


def _rows(table: "pd.DataFrame") -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = json.loads(table.to_json(orient="records", double_precision=6))
    return rows


def _differences(table: "pd.DataFrame") -> list[dict[str, Any]]:
    return _rows(table) if len(table) <= MAX_DIFFERENCES else []
