"""The verdicts as Markdown: the tables in the README and the docs, and the document beside the
results.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from genie_sim.analysis import renderers
from genie_sim.analysis.registry import component_title, title_of
from genie_sim.analysis.result_table import ResultTable
from genie_sim.paper import table1
from genie_sim.paper.claims import VERDICTS, Verdict
from genie_sim.paper.evidence import Finding, rounded
from genie_sim.paper.facts import METHODS
from genie_sim.paper.readings import DEFAULT
from genie_sim.record import provenance
from genie_sim.scenario.yaml_input import parse

ENOUGH_SEEDS = 10
MARKS = dict(zip(VERDICTS, "+~-?=", strict=True))  # one-character codes for narrow tables

REPRODUCED = VERDICTS[0]

Row = Mapping[str, Any]


def row(verdict: Verdict, reading: str = DEFAULT, plain: Verdict | None = None) -> dict[str, Any]:
    """A verdict as plain data. ``plain``: the verdict by the default's metrics, where the reading
    means others.
    """
    finding = verdict.finding or Finding(None, None, None, 0, "1", False, False)
    return {
        "reading": reading,
        **asdict(verdict.claim),
        **_numbers(finding),
        "unit": finding.unit,
        "n": finding.n,
        "note": finding.note,
        "verdict": verdict.verdict,
        "marginal": verdict.marginal,
        "by_default_metrics": plain and {"verdict": plain.verdict, **_numbers(plain.finding)},
    }


def by_claim(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """The rows of each claim by reading."""
    grouped: dict[str, dict[str, Row]] = {}
    for row in rows:
        grouped.setdefault(row["id"], {})[row["reading"]] = row
    return grouped


def table(rows: Sequence[Row]) -> ResultTable:
    """The claims in words, with what was found and the verdict under each reading."""
    readings = _readings(rows)
    lines = []
    for claim, by_reading in by_claim(rows).items():
        cells = [
            f"{_verdict(by_reading[name])}: {_interval_text(by_reading[name])}" for name in readings
        ]
        first = by_reading[readings[0]]
        lines.append([claim, first["claim"], _words(first["kind"]), *cells])
    return ResultTable.of_texts(["", "the paper says", "kind", *readings], lines)


def marks_table(rows: Sequence[Row], says: str) -> ResultTable:
    """The claims with a mark and the number found under each reading, and what the marks mean;
    ``says``: what stands beside a claim's id, ``claim`` or ``kind``.
    """
    readings = _readings(rows)
    lines = [
        [
            f"{claim} {_words(by_reading[readings[0]][says])}",
            *(_marked(by_reading[name]) for name in readings),
        ]
        for claim, by_reading in by_claim(rows).items()
    ]
    marks = ", ".join(f"{mark} {verdict}" for verdict, mark in MARKS.items())
    legend = f"{marks}; * marginal, another set of seeds could say otherwise."
    title = "Claims of the paper; verdicts.md says them in words"
    return replace(ResultTable.of_texts(["claim", *readings], lines, title), notes=[legend])


def printed(rows: Sequence[Row], format: str) -> str:
    """The claims for a paper, in ``markdown`` or ``latex``; in ``csv`` with all digits."""
    if format == "csv":
        names = ("reading", "id", "kind", "verdict", "marginal", "value", "low", "high", "unit")
        return renderers.exact(names, ([row[name] for name in names] for row in rows))
    if format == "markdown":
        return in_markdown(rows)
    return renderers.latex(marks_table(rows, "kind"), "claims")


def in_markdown(rows: Sequence[Row]) -> str:
    """The claims in words, and the counts below."""
    return "\n".join([renderers.markdown(table(rows)), *counts(rows), ""])


def text(rows: Sequence[Row], width: int) -> str:
    """Each claim with its verdict and number under each reading, for a terminal of ``width``
    columns.
    """
    found = marks_table(rows, "claim")
    return renderers.terminal(replace(found, notes=[*found.notes, *counts(rows)]), width).rstrip()


def _marked(row: Row) -> str:
    """Mark and number."""
    return f"{MARKS[row['verdict']]}{'*' if row['marginal'] else ''} {_number(row)}"


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
    """Verdict, number and note; where the reading means other metrics, by the default's too."""
    text = f"*{_verdict(row)}*: {_interval_text(row)}"
    if row["note"]:
        text += f"; {row['note']}"
    plain = row["by_default_metrics"]
    if plain:
        text += f"; by the default's metrics {plain['verdict']}: {_interval_text({**row, **plain})}"
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
            else "-"
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
    """For each reading how many claims have each verdict, and of what kinds those are that are
    reproduced.
    """
    lines = []
    for reading in _readings(rows):
        claims = [row for row in rows if row["reading"] == reading]
        verdicts = Counter(row["verdict"] for row in claims)
        kinds = Counter(row["kind"] for row in claims if row["verdict"] == REPRODUCED)
        of_kinds = ", ".join(f"{count} {_words(kind)}" for kind, count in kinds.items())
        text = f"of {len(claims)} claims {verdicts[REPRODUCED]} reproduced ({of_kinds})"
        for verdict in VERDICTS[1:]:
            if verdicts[verdict]:
                text += f"; {verdicts[verdict]} {verdict}"
        text += f"; {sum(row['marginal'] for row in claims)} marginal."
        plain = [row["by_default_metrics"] for row in claims if row["by_default_metrics"]]
        if plain:
            count = sum(verdict["verdict"] == REPRODUCED for verdict in plain)
            text += f" Measured with the default's metrics, {count} are reproduced."
        lines.append(f"- {reading}: {text}")
    warning = few_seeds(rows)
    return [*lines, "", warning] if warning else lines


def _readings(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["reading"] for row in rows))


def _verdict(row: Row) -> str:
    return f"{row['verdict']} (marginal)" if row["marginal"] else str(row["verdict"])


def _numbers(finding: Finding | None) -> dict[str, float | None]:
    if finding is None or not finding.known:
        return {"value": None, "low": None, "high": None}
    ends = {"value": finding.value, "low": finding.low, "high": finding.high}
    return {name: None if end is None else rounded(end) for name, end in ends.items()}


def _words(name: str) -> str:
    return name.replace("_", " ")


def _number(row: Row) -> str:
    if row["value"] is None:
        return "-"
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
