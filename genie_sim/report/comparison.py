"""A comparison as a table of text, and as one page for a browser."""

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import genie_sim
from genie_sim import report
from genie_sim.analysis import text_table
from genie_sim.analysis.compare import BLOCKS, COMPARED, Comparison, Difference, as_metrics
from genie_sim.paths import atomic_write
from genie_sim.recording.columns import concat

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "compare.html"
HEADINGS = ("metric", "of", "value", "against", "difference", "95 % interval", "paired by", "pairs")
ONE_RUN = "Blocks of one second tell how sure a difference is inside these runs; other seeds and drives may differ by more."
PAGE_HEADINGS = (
    "metric",
    "of",
    "value",
    "against",
    "its value",
    "difference",
    "95 % interval",
    "pairs",
)


def text(comparison: Comparison, format: str = "markdown") -> str:
    """The table of metrics; markdown and LaTeX round, csv does not. Raises UserError for another format."""
    if text_table.checked(format) == "csv":
        return text_table.exact(Difference._fields, comparison.rows)
    return text_table.rounded(format, HEADINGS, map(_cells, comparison.rows), "llrlrrlr")


def figures(comparison: Comparison) -> "dict[str, Figure]":
    """Overlaid distributions of first answers, and latency against accuracy where the arms have one in common."""
    from genie_sim.analysis import figures as of_runs
    from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy

    measured, methods = as_metrics(comparison)
    parts = [
        run.tables["frames"].where(method=arm.method.name).assign(method=arm.label)
        for arm in comparison.arms
        for run in arm.runs.values()
    ]
    title = " and ".join(comparison.names)
    made = {"latency_cdf": of_runs.latency_cdf({title: concat(parts)}, methods)}
    if drawable({title: measured}):
        made["latency_accuracy"] = latency_accuracy({title: measured}, methods)
    return made


def page(comparison: Comparison) -> str:
    """The text of the page; the figures are in it."""
    name = " and ".join(comparison.names)
    data = {
        "about": {
            "genie_sim": genie_sim.__version__,
            "name": name,
            "description": "Runs that saw the same frames, side by side.",
            "names": list(comparison.names),
            "arms": [arm.label for arm in comparison.arms],
        },
        "methods": [],
        "about_rows": note(comparison),
        "headings": PAGE_HEADINGS,
        "rows": list(_rows(comparison)),
        "settings": [[path, *values] for path, values in comparison.settings.items()],
        "figures": [
            {
                "name": name,
                "title": str(figure.get_label()).partition("\n")[0],
                "source": _picture(figure),
            }
            for name, figure in figures(comparison).items()
        ],
        "notes": [],
    }
    elsewhere = "The numbers are also in table.md and table.csv beside it."
    return report.assemble(
        "compare.html", ("compare.js",), f"{name}, compared", data, elsewhere, pictures=True
    )


def _rows(comparison: Comparison) -> Iterator[list[str]]:
    """Of the page: each arm that is compared, with the value of what it is compared with."""
    cells = {(row.metric, row.arm): _cells(row) for row in comparison.rows}
    for row in comparison.rows:
        if row.against:
            metric, arm, value, against, gap, ends, _, pairs = cells[row.metric, row.arm]
            theirs = cells.get((metric, against))
            yield [metric, arm, value, against, theirs[2] if theirs else "-", gap, ends, pairs]


def note(comparison: Comparison) -> str:
    """What the intervals are over."""
    said = comparison.by[0].upper() + comparison.by[1:] + "."
    return f"{said} {ONE_RUN}" if any(row.by == BLOCKS for row in comparison.rows) else said


def write(comparison: Comparison, folder: Path) -> Path:
    """Writes the page, the table in all formats and the figures into a folder; returns the page's path."""
    from genie_sim.analysis.figures import save

    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for name, suffix in text_table.FORMATS.items():
        with atomic_write(folder / f"table{suffix}") as beside:
            beside.write_text(text(comparison, name), encoding="utf-8")
    for name, figure in figures(comparison).items():
        save(figure, folder / "figures", name)
    report.write_text(folder / PAGE, page(comparison))
    return folder / PAGE


def _cells(row: Difference) -> list[str]:
    share = COMPARED[row.metric][0] == "1"
    factor, unit = (100, "%") if share else (1, row.unit)
    difference = "percentage points" if share else row.unit

    def number(value: float | None, sign: str = "") -> str:
        return "-" if value is None else f"{factor * value:{sign}.3g}"

    ends = "-" if row.low is None else f"{number(row.low, '+')} to {number(row.high, '+')}"
    gap = "-" if row.difference is None else f"{number(row.difference, '+')} {difference}"
    value = "-" if row.value is None else f"{number(row.value)} {unit}"
    return [
        row.metric,
        row.arm,
        value,
        row.against or "-",
        gap,
        ends,
        row.by or "-",
        str(row.n or "-"),
    ]


def _picture(figure: "Figure") -> str:
    from genie_sim.analysis.figures import svg

    return f"data:image/svg+xml;base64,{base64.b64encode(svg(figure)).decode()}"
