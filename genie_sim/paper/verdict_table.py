"""The verdicts as Markdown: the tables in the README and the docs, and the document beside the
results.
"""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.analysis.registry import component_title, title_of
from genie_sim.analysis.result_table import ResultTable
from genie_sim.paper import table1
from genie_sim.paper.claims import CALIBRATED, IN_PART, REPRODUCED, VERDICTS, Verdict
from genie_sim.paper.evidence import Finding, rounded
from genie_sim.paper.facts import METHODS
from genie_sim.paper.readings import Reading
from genie_sim.record import provenance
from genie_sim.scenario.yaml_input import parse

ENOUGH_SEEDS = 10
# what the simulator could have contradicted; all other kinds are counted apart from these
FREE_KINDS = ("retrodicted", "prediction")

Row = Mapping[str, Any]


def row(verdict: Verdict, reading: Reading, plain: Verdict | None = None) -> dict[str, Any]:
    """A verdict as plain data. ``plain``: the verdict by the metrics of a run, where the reading
    means others.
    """
    finding = verdict.finding or Finding(
        None, None, None, n=0, unit="1", holds=False, direction=False
    )
    return {
        "reading": reading.name,
        "column": reading.title_of_column,
        **asdict(verdict.claim),
        **_numbers(finding),
        "unit": finding.unit,
        "n": finding.n,
        "note": finding.note,
        "legs": [leg._asdict() for leg in finding.legs],
        "verdict": verdict.verdict,
        "marginal": verdict.marginal,
        "same_as": verdict.same_as,
        "by_run_metrics": plain and {"verdict": plain.verdict, **_numbers(plain.finding)},
    }


def by_claim(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """The rows of each claim by reading."""
    grouped: dict[str, dict[str, Row]] = {}
    for row in rows:
        grouped.setdefault(row["id"], {})[row["reading"]] = row
    return grouped


def table(rows: Sequence[Row], says: str = "claim") -> ResultTable:
    """The claims: what the paper says, and under each reading what was found, with its interval,
    and the verdict. ``says``: what stands beside a claim's id, ``claim`` or ``kind``.
    """
    columns = {row["reading"]: row["column"] for row in rows}
    lines = []
    for claim, by_reading in by_claim(rows).items():
        first = next(iter(by_reading.values()))
        cells = [f"{_interval_text(row)} {_verdict(row)}" for row in by_reading.values()]
        lines.append(
            [f"{claim} {_words(first[says])}", _words(first["kind"]), first["paper"], *cells]
        )
    return ResultTable.of_texts(["claim", "kind", "the paper", *columns.values()], lines)


def printed(rows: Sequence[Row], format: str) -> str:
    """The claims for a paper, in ``markdown`` or ``latex``; in ``csv`` with all digits."""
    if format == "csv":
        names = ["reading", "id", "kind", "paper", "verdict", "marginal"]
        names += ["value", "low", "high", "unit"]
        return renderers.exact(names, ([row[name] for name in names] for row in rows))
    if format == "markdown":
        return in_markdown(rows)
    title = "Claims of the paper; verdicts.md says them in words"
    notes = [line.removeprefix("- ") for line in counts(rows)]
    return renderers.latex(replace(table(rows, "id"), title=title, notes=notes), "claims")


def in_markdown(rows: Sequence[Row]) -> str:
    """The claims in words, and the counts below."""
    return "\n".join([renderers.markdown(table(rows)), *counts(rows), ""])


def text(rows: Sequence[Row], width: int) -> str:
    """The claims for a terminal of ``width`` columns: a claim with what the paper says, and below
    it a line for each reading.
    """
    columns = {row["reading"]: row["column"] for row in rows}
    indent = max(map(len, columns.values())) + 4
    lines = []
    for claim, by_reading in by_claim(rows).items():
        first = next(iter(by_reading.values()))
        about = f"{claim} {first['claim']} ({_words(first['kind'])}; the paper: {first['paper']})"
        lines += textwrap.wrap(about, width, subsequent_indent="  ")
        for name, row in by_reading.items():
            found = f"{_interval_text(row)} {_verdict(row)}"
            head = f"  {columns[name]}:".ljust(indent)
            lines += textwrap.wrap(head + found, width, subsequent_indent=" " * indent)
    for note in counts(rows):
        lines += textwrap.wrap(note, width, subsequent_indent="  ") or [""]
    return "\n".join(lines)


def document(rows: Sequence[Row], readings: Sequence[Row], quality: Sequence[Row]) -> str:
    """The whole account beside the results: the table, the readings, each claim's test, the quality
    of the answers.
    """
    parts = [
        "# What of the paper holds here",
        "",
        in_markdown(rows),
        "## The readings",
        "",
        readings_text(readings),
        "",
    ]
    parts += ["## Each claim", ""]
    for claim, by_reading in by_claim(rows).items():
        first = next(iter(by_reading.values()))
        kind = _words(first["kind"])
        parts.append(f"**{claim}** ({first['where']}): {first['claim']}. Kind: {kind}.")
        parts.append(f"Test: {first['test']}.")
        parts += [f"- {name}: {_finding_text(row)}." for name, row in by_reading.items()]
        parts.append("")
    parts += [
        "## Table I",
        "",
        table1.markdown(),
        "",
        "## How accurate the answers are",
        "",
        map_quality_table(quality),
    ]
    return "\n".join(parts) + "\n"


def _finding_text(row: Row) -> str:
    """Verdict, number and note; where the reading means other metrics, by a run's too."""
    text = f"*{_verdict(row)}*: {_interval_text(row)}"
    if row["note"]:
        text += f"; {row['note']}"
    plain = row["by_run_metrics"]
    if plain:
        text += f"; by the metrics of a run {plain['verdict']}: {_interval_text({**row, **plain})}"
    return text


def readings_text(readings: Sequence[Row]) -> str:
    """What each reading sets, why, and what was known of its outcomes; below, what each means by
    the metrics.
    """
    parts = []
    for reading in readings:
        parts += [f"**{reading['name']}**: {reading['title']}. {reading['why']}", ""]
        parts += [f"*Known when it was written.* {reading['known']}", ""]
        for choice in reading["choices"]:
            parts.append(f'- `{", ".join(choice["set"])}`: "{choice["quote"]}". {choice["why"]}')
        parts += [""] if reading["choices"] else []
    meanings = [
        [_words(metric), *(reading["metrics"][metric]["says"] for reading in readings)]
        for metric in readings[0]["metrics"]
    ]
    headings = ["what is meant by", *(reading["name"] for reading in readings)]
    meant = renderers.markdown(ResultTable.of_texts(headings, meanings))
    return "\n".join([*parts, meant.rstrip()])


def map_quality_table(rows: Sequence[Row]) -> str:
    """Precision, recall, ghosts and age of what consumers hold, by method; ``rows`` as
    ``quality.summarise`` makes them.
    """
    methods = list(dict.fromkeys(row["method"] for row in rows))
    by_name: dict[str, dict[str, Row]] = {}
    for row in rows:
        by_name.setdefault(row["name"], {})[row["method"]] = row
    lines = []
    for name, by_method in by_name.items():
        unit = next(iter(by_method.values()))["unit"]
        heading = title_of(name) + ("" if unit == "1" else f" [{unit}]")
        cells = [
            "{value:.2f} ({low:.2f} to {high:.2f})".format_map(by_method[method])
            if method in by_method
            else "not defined"
            for method in methods
        ]
        lines.append([heading, *cells])
    headings = ["", *(component_title(method, METHODS) for method in methods)]
    return renderers.markdown(ResultTable.of_texts(headings, lines)).rstrip()


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """The verdicts of a result folder. Raises ``UserError``."""
    rows: list[dict[str, Any]] = provenance.read_json(folder / "verdicts.json")
    return rows


def sentences() -> list[dict[str, Any]]:
    """What Section V says, in its order, each with the claims that it makes and the figure that
    shows it.
    """
    path = Path(__file__).with_name("section_v.yaml")
    sentences_of_section: list[dict[str, Any]] = parse(path.read_text(encoding="utf-8"), str(path))
    return sentences_of_section


def counts(rows: Sequence[Row]) -> list[str]:
    """For each reading how many claims hold: first of those that the simulator could have
    contradicted, then, never added to them, of each other kind.
    """
    lines = []
    for reading in dict.fromkeys(row["reading"] for row in rows):
        of_reading = [row for row in rows if row["reading"] == reading]
        counted = [row for row in of_reading if row["same_as"] is None]
        free = [row for row in counted if row["kind"] in FREE_KINDS]
        word = "retrodicted" if any(row["kind"] == "retrodicted" for row in free) else "predicted"
        text = f"{_held(free)} {word} claims hold"
        for verdict in VERDICTS:
            count = sum(row["verdict"] == verdict for row in free)
            if count and verdict != REPRODUCED:
                text += f", {count} {verdict}"
        kinds = dict.fromkeys(row["kind"] for row in counted if row["kind"] not in FREE_KINDS)
        beside = [
            f"{_held([row for row in counted if row['kind'] == kind])} {_words(kind)}"
            for kind in kinds
        ]
        if beside:
            text += f". Apart from these: {', '.join(beside)}"
        text += f". {sum(row['marginal'] for row in of_reading)} verdicts are marginal."
        plain = [row["by_run_metrics"] for row in free if row["by_run_metrics"]]
        if plain:
            count = sum(verdict["verdict"] == REPRODUCED for verdict in plain)
            text += f" By the metrics of a run {count} of the {len(plain)} hold."
        lines.append(f"- {of_reading[0]['column']}: {text}")
        once = [
            f"{row['id']} is the number of {row['same_as']}" for row in of_reading if row["same_as"]
        ]
        if once:
            lines[-1] += f" Counted once: {'; '.join(once)}."
    warning = few_seeds(rows)
    return [*lines, "", warning] if warning else lines


def _held(rows: Sequence[Row]) -> str:
    """How many of some claims hold; what was fitted holds where the fit succeeded."""
    return f"{sum(row['verdict'] in (REPRODUCED, CALIBRATED) for row in rows)} of {len(rows)}"


def _verdict(row: Row) -> str:
    """The verdict in words; of a claim in part, which of its legs hold."""
    words = str(row["verdict"])
    if row["verdict"] == IN_PART:
        legs = (f"{leg['name']} {leg['held']} of {leg['effects']}" for leg in row["legs"])
        words += f" ({', '.join(legs)})"
    if row["same_as"]:
        words += f", the number of {row['same_as']}"
    return f"{words}, marginal" if row["marginal"] else words


def _numbers(finding: Finding | None) -> dict[str, float | None]:
    if finding is None or not finding.known:
        return {"value": None, "low": None, "high": None}
    ends = {"value": finding.value, "low": finding.low, "high": finding.high}
    return {name: None if end is None else rounded(end) for name, end in ends.items()}


def _words(name: str) -> str:
    return name.replace("_", " ")


def _number(row: Row) -> str:
    if row["value"] is None:
        return "not measured:"
    number = f"{row['value']:.3g}"
    return number if row["unit"] == "1" else f"{number} {row['unit']}"


def few_seeds(rows: Sequence[Row]) -> str:
    """What so few seeds cannot decide; nothing where there are enough."""
    n = max(row["n"] for row in rows)
    if n == 1:
        return "One seed has no interval: every verdict on a simulated number is marginal."
    if n < ENOUGH_SEEDS:
        return (
            f"{n} seeds do not decide what lies near a threshold: of such a claim another {n} "
            "say otherwise in one case of three."
        )
    return ""


def _interval_text(row: Row) -> str:
    if row["n"] == 1 and row["low"] is not None:
        return f"{_number(row)} (one seed)"
    if row["low"] is None or row["low"] == row["high"]:
        return _number(row)
    return f"{_number(row)} ({row['low']:.3g} to {row['high']:.3g})"
