"""A comparison as a table of text, and as one page for a browser, without a script."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import text_table
from genie_sim.analysis.compare import BLOCKS, COMPARED, Comparison, Difference, as_metrics
from genie_sim.paths import atomic_write
from genie_sim.recording.columns import concat

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "compare.html"
HEADINGS = ("metric", "of", "value", "against", "difference", "95 % interval", "paired by", "pairs")
ONE_RUN = (
    "Blocks of one second tell how sure a difference is inside these runs; other seeds and drives may differ by more."
)
STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:1rem 0}td,th{padding:.2rem .7rem;border-bottom:1px solid #ddd;text-align:left}
td.n{text-align:right;font-variant-numeric:tabular-nums}img{max-width:100%}code{overflow-wrap:anywhere}"""


def text(comparison: Comparison, format: str = "markdown") -> str:
    """The table of metrics; markdown and LaTeX round, csv does not. Raises UserError for another format."""
    if text_table.checked(format) == "csv":
        return text_table.exact(Difference._fields, comparison.rows)
    return text_table.rounded(format, HEADINGS, map(_cells, comparison.rows), "llrlrrlr")


def figures(comparison: Comparison) -> dict[str, Figure]:
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
    """The HTML of the page; the figures are in it."""
    pictures = "".join(
        f'<p><img alt="{escape(name)}" src="data:image/svg+xml;base64,{base64.b64encode(_svg(one)).decode()}"></p>\n'
        for name, one in figures(comparison).items()
    )
    settings = [(path, *values) for path, values in comparison.settings.items()]
    differ = (
        f"<h2>Settings that differ</h2>\n{_table(('setting', *comparison.names), settings, 9)}"
        if settings
        else "<p>The settings are the same.</p>"
    )
    numbers = _table(HEADINGS, [_cells(row) for row in comparison.rows], 2)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<title>{escape(" and ".join(comparison.names))}</title><style>{STYLE}</style></head><body>
<h1>{escape(" and ".join(comparison.names))}</h1>
<p>{escape(note(comparison))}</p>
{differ}
<h2>Figures</h2>
{pictures}<h2>Metrics</h2>
{numbers}
</body></html>
"""


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
    with atomic_write(folder / PAGE) as beside:
        beside.write_text(page(comparison), encoding="utf-8")
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
    return [row.metric, row.arm, value, row.against or "-", gap, ends, row.by or "-", str(row.n or "-")]


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]], first_number: int) -> str:
    head = "".join(f"<th>{escape(one)}</th>" for one in headings)
    lines = (
        "<tr>"
        + "".join(f"<td{' class=n' if i >= first_number else ''}>{escape(x)}</td>" for i, x in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>\n" + "\n".join(lines) + "\n</table>"


def _svg(figure: Figure) -> bytes:
    from genie_sim.analysis.figures import svg

    return svg(figure)
