"""The one table of the paper as text: in Markdown, for a terminal, as CSV, for a notebook."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.statistics import has_interval
from genie_sim.paper import table1
from genie_sim.paper.claims import KINDS, SECTIONS, differing, sentences, total
from genie_sim.record import provenance

VERDICTS, DOCUMENT = "verdicts.json", "verdicts.md"
HEADINGS = ["", "the paper says", "paper", "here", "verdict", "why", "shown by"]
OF_ALL = "genie-sim reproduce --quick"  # shows every row; not said again in each
IN_SHORT = ("C1", "C3", "C11", "C12", "C26")  # the rows of the README

Row = Mapping[str, Any]
ABOUT_ACCURACY = (
    "The paper does not measure it. Against KITTI's labels: what the consumer holds at each "
    "instant, mean over the six scenarios, in brackets its 95 % interval; the zero-delay detector "
    "is the detector's own answer without any delay."
)


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """The verdicts of a result folder. Raises ``UserError``, also for an earlier version's."""
    read_about(folder)
    rows: list[dict[str, Any]] = provenance.read_json(provenance.contained(folder, VERDICTS))
    return rows


def read_about(folder: Path) -> dict[str, Any]:
    """What an evaluation says of itself. Raises ``UserError``, also for an earlier version's."""
    path = provenance.contained(folder, "run.json")
    about = provenance.read_mapping(path)
    provenance.check_format(path, about)
    return about


def number(row: Row) -> str:
    """The number with its unit and interval: ``85.3 % (84.9 to 85.7)``; an interval whose ends
    round to the number is left out.
    """
    if row["value"] is None:
        return "not run"
    unit = f" {row['unit']}" if row["unit"] else ""
    sign = "+" if row["unit"] == "points" else ""
    value = _digits(row["value"], sign)
    if row["low"] is None:
        return f"{value}{unit}"
    low, high = _digits(row["low"], sign), _digits(row["high"], sign)
    return f"{value}{unit}" if low == value == high else f"{value}{unit} ({low} to {high})"


def _digits(value: float, sign: str) -> str:
    return f"{value:{sign}.3g}" if abs(value) < 1000 else f"{value:{sign},.0f}"


def verdict(row: Row) -> str:
    """The verdict, and that of the last full run where it differs."""
    if row["full_run"] and row["verdict"] != row["full_run"]:
        return f"{row['verdict']} (full run: {row['full_run']})"
    return str(row["verdict"])


def reason(row: Row) -> str:
    return "; ".join(filter(None, [row["why"], row["note"]]))


def _says(row: Row) -> str:
    """The sentence; an input is marked."""
    mark = f" *({row['kind']})*" if "input" in row["kind"] else ""
    return f"{row['claim']}{mark}"


def in_markdown(rows: Sequence[Row]) -> str:
    """The three sentences, and the table section by section."""
    parts = [*(f"- {sentence}" for sentence in sentences(rows)), ""]
    parts += [f"`{OF_ALL}` shows all rows in a minute; *shown by*: what shows one sooner.", ""]
    for section in SECTIONS:
        section_rows = [row for row in rows if row["section"] == section]
        if section_rows:
            parts += [f"### {section[0].upper()}{section[1:]}", "", _markdown(section_rows), ""]
    return "\n".join([*parts, *notes(rows)]).rstrip()


def _markdown(rows: Sequence[Row]) -> str:
    lines = [
        [
            row["id"],
            _says(row),
            row["paper"],
            f"{number(row)}: {row['ours']}",
            f"**{verdict(row)}**",
            reason(row),
            "" if row["command"] == OF_ALL else f"`{row['command']}`",
        ]
        for row in rows
    ]
    return renderers.markdown_rows([HEADINGS, *lines], [False] * 6)


def in_short(rows: Sequence[Row]) -> str:
    """The five rows of the README, and how many of all claims hold."""
    lines = [
        [_says(row), row["paper"], number(row), f"**{verdict(row)}**", row["why"]]
        for row in rows
        if row["id"] in IN_SHORT
    ]
    table = renderers.markdown_rows([HEADINGS[1:-1], *lines], [False] * 4)
    return f"{table}\n\n{total(rows)}"


def notes(rows: Sequence[Row]) -> list[str]:
    """What so few seeds cannot decide, and what is different from the full run."""
    seeds = max(row["n"] for row in rows)
    lines = []
    if not has_interval(seeds):
        lines.append(
            f"{seeds} seed{'s' * (seeds > 1)}: no intervals; genie-sim reproduce runs ten."
        )
    differ = [*differing(rows)]
    if differ and all(row["full_run"] for row in rows):
        lines.append(f"Other verdicts than in the full run: {', '.join(differ)}.")
    return lines


def text(rows: Sequence[Row], width: int) -> str:
    """The table for a terminal of ``width`` columns."""
    return "\n".join(_text_lines(rows, width))


def _text_lines(rows: Sequence[Row], width: int) -> Iterator[str]:
    section = ""
    for row in rows:
        if row["section"] != section:
            section = row["section"]
            yield from ("", section.upper())
        kind = f" ({row['kind']})" if "input" in row["kind"] else ""
        yield from textwrap.wrap(
            f"{row['id']:4}{verdict(row):7} {row['claim']}{kind}",
            width,
            subsequent_indent=" " * 12,
        )
        text = f"paper {row['paper']}; here {number(row)}, {row['ours']}. {reason(row)}"
        indent = " " * 12
        yield from textwrap.wrap(text, width, initial_indent=indent, subsequent_indent=indent)
    yield ""
    for sentence in (*notes(rows), *sentences(rows), total(rows)):
        yield from textwrap.wrap(sentence, width, subsequent_indent="  ")


def html(rows: Sequence[Row]) -> str:
    """The table for a notebook."""
    lines = [[row["id"], row["claim"], row["paper"], number(row), verdict(row)] for row in rows]
    headings = ["", "the paper says", "paper", "here", "verdict"]
    table = ResultTable.of_texts(headings, lines)
    return renderers.html(table)


def document(rows: Sequence[Row], accuracy: ResultTable) -> str:
    """The whole account beside the results: the table, each claim's test, Table I, accuracy."""
    parts = ["# What of the paper holds here", ""]
    parts += [in_markdown(rows), "", "## Tests", ""]
    parts += [f"- **{row['id']}** ({row['where']}; {row['kind']}): {row['test']}" for row in rows]
    kinds = "; ".join(f"*{kind}*: {meaning}" for kind, meaning in KINDS.items())
    parts += ["", f"Kinds: {kinds}.", "", "## Table I", "", table1.markdown(), ""]
    parts += ["## How accurate the answers are", "", ABOUT_ACCURACY, ""]
    parts += [renderers.markdown(accuracy).rstrip()]
    return "\n".join(parts) + "\n"
