"""The verdicts as Markdown: the tables in the README and the docs, and the document beside the results."""

import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from genie_sim.analysis.text_table import markdown
from genie_sim.paper import table1
from genie_sim.paper.arms import Arms
from genie_sim.paper.claims import VERDICTS, Verdict
from genie_sim.paper.evidence import Finding, rounded
from genie_sim.paper.readings import DEFAULT
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import parse

ENOUGH_SEEDS = 10
MOST_NAMED = 4  # variants named beside a claim
MARKS = dict(zip(VERDICTS, "+~-?=", strict=True))  # where there is little room

Row = Mapping[str, Any]


def row(
    verdict: Verdict, arms: Arms | None = None, reading: str = DEFAULT, plain: Verdict | None = None
) -> dict[str, Any]:
    """A verdict as plain data. ``arms``: the other values, told of where the claim is not reproduced. ``plain``: the
    verdict by the default's metrics, where the reading means others."""
    finding = verdict.finding or Finding(None, None, None, 0, "1", False, False)
    names, tried = (
        arms.holding(verdict.claim) if arms and verdict.verdict in VERDICTS[1:3] else (None, None)
    )
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
        "holds_under": names,
        "tried_under": tried,
    }


def by_claim(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """The rows of each claim by reading."""
    found: dict[str, dict[str, Row]] = {}
    for one in rows:
        found.setdefault(one["id"], {})[one["reading"]] = one
    return found


def table(rows: Sequence[Row]) -> str:
    """The claims, one line each, with what was found and the verdict under each reading; the counts below."""
    readings = _readings(rows)
    lines = []
    for claim, found in by_claim(rows).items():
        cells = [f"{_verdict(found[one])}: {_found(found[one])}" for one in readings]
        lines.append(
            [claim, found[readings[0]]["claim"], _words(found[readings[0]]["kind"]), *cells]
        )
    return "\n".join(
        [markdown(["", "the paper says", "kind", *readings], lines), "", *counts(rows)]
    )


def text(rows: Sequence[Row], width: int) -> str:
    """Each claim with its verdict and number under each reading, for a terminal of ``width`` columns."""
    readings = _readings(rows)
    lines = [f"{'':4} {' '.join(f'{name:18}' for name in readings)}"]
    for claim, found in by_claim(rows).items():
        mine = [found[name] for name in readings]
        cells = " ".join(
            f"{MARKS[one['verdict']]}{'* '[not one['marginal']]} {_number(one):15}" for one in mine
        )
        line = f"{claim:4} {cells} {mine[0]['claim']}"
        lines.append(line if len(line) <= width else f"{line[: max(width - 3, 0)]}...")
    marks = ", ".join(f"{mark} {verdict}" for verdict, mark in MARKS.items())
    legend = f"{marks}; * marginal, another set of seeds could say otherwise"
    return "\n".join([*lines, "", *textwrap.wrap(legend, width), "", *counts(rows)])


def document(rows: Sequence[Row], readings: Sequence[Row], worth: Sequence[Row]) -> str:
    """The whole account beside the results: the table, the readings, each claim's test, what the answers are worth."""
    parts = [
        "# What of the paper holds here",
        "",
        table(rows),
        "",
        "## The readings",
        "",
        readings_text(readings),
        "",
    ]
    parts += ["## Each claim", ""]
    for claim, found in by_claim(rows).items():
        first = next(iter(found.values()))
        parts.append(
            f"**{claim}** ({first['where']}): {first['claim']}. Kind: {_words(first['kind'])}."
        )
        parts.append(f"Test: {first['test']}.")
        for name, one in found.items():
            note = f"; {one['note']}" if one["note"] else ""
            plain = one["by_default_metrics"]
            by = (
                f"; by the default's metrics {plain['verdict']}: {_found(one | plain)}"
                if plain
                else ""
            )
            parts.append(f"- {name}: *{_verdict(one)}*: {_found(one)}{note}{by}.")
        parts += [_elsewhere(one) for one in found.values() if one["holds_under"] is not None]
        parts.append("")
    parts += [
        "## Table I",
        "",
        table1.markdown(),
        "",
        "## What the answers are worth",
        "",
        worth_table(worth),
    ]
    return "\n".join(parts) + "\n"


def readings_text(readings: Sequence[Row]) -> str:
    """What each reading sets, why, and what was known of its outcomes; below, what each means by the metrics."""
    parts = []
    for one in readings:
        parts += [f"**{one['name']}**: {one['title']}. {one['why']}", ""]
        parts += [f"*Known when it was written.* {one['known']}", ""]
        for choice in one["choices"]:
            parts.append(f'- `{", ".join(choice["set"])}`: "{choice["quote"]}". {choice["why"]}')
        parts += [""] if one["choices"] else []
    said = [
        [_words(name), *(one["metrics"][name]["says"] for one in readings)]
        for name in readings[0]["metrics"]
    ]
    return "\n".join(
        [*parts, markdown(["what is meant by", *(one["name"] for one in readings)], said)]
    )


def _elsewhere(one: Row) -> str:
    """Whether a claim would hold under another reading; that it does not, and that nobody tried, are two answers."""
    named, tried = one["holds_under"], one["tried_under"]
    if not tried:
        return "Not tried under any other reading or value: their runs lack what the test needs."
    where = f"of the {tried} other readings and values that were tried, {one['n']} seeds each"
    if not named:
        return f"Holds under none {where}."
    more = f", and {len(named) - 2 * MOST_NAMED} more" if len(named) > 2 * MOST_NAMED else ""
    return f"Holds under {len(named)} {where}: {', '.join(named[: 2 * MOST_NAMED])}{more}."


def worth_table(rows: Sequence[Row]) -> str:
    """Precision, recall, ghosts and age by method."""
    methods = list(dict.fromkeys(one["method"] for one in rows))
    found = {(one["method"], one["name"]): one for one in rows}
    lines = []
    for name in dict.fromkeys(one["name"] for one in rows):
        mine = [found.get((one, name)) for one in methods]
        cells = [
            "-" if one is None else "{value:.2f} ({low:.2f} to {high:.2f})".format_map(one)
            for one in mine
        ]
        unit = next(
            (f" [{one['unit']}]" for one in mine if one and one.get("unit", "1") != "1"), ""
        )
        lines.append([_words(name) + unit, *cells])
    return markdown(["", *methods], lines)


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """The verdicts of a result folder. Raises ``UserError``."""
    rows: list[dict[str, Any]] = provenance.read_json(folder / "verdicts.json")
    return rows


def sentences() -> list[dict[str, Any]]:
    """What Section V says, in its order, each with the claims that it makes and the figure that shows it."""
    path = Path(__file__).with_name("section_v.yaml")
    found: list[dict[str, Any]] = parse(path.read_text(encoding="utf-8"), str(path))
    return found


def counts(rows: Sequence[Row]) -> list[str]:
    """For each reading how many claims have each verdict, and of what kinds those are that are reproduced."""
    said = []
    for name in _readings(rows):
        mine = [one for one in rows if one["reading"] == name]
        verdicts = Counter(one["verdict"] for one in mine)
        kinds = Counter(one["kind"] for one in mine if one["verdict"] == VERDICTS[0])
        of_kinds = ", ".join(f"{count} {_words(kind)}" for kind, count in kinds.items())
        others = "".join(
            f"; {verdicts[verdict]} {verdict}" for verdict in VERDICTS[1:] if verdicts[verdict]
        )
        plain = [
            one["by_default_metrics"]["verdict"] == VERDICTS[0]
            for one in mine
            if one["by_default_metrics"]
        ]
        by = f" By the default's metrics {sum(plain)} are." if plain else ""
        marginal = sum(one["marginal"] for one in mine)
        reproduced = f"of {len(mine)} claims {verdicts[VERDICTS[0]]} reproduced ({of_kinds})"
        said.append(f"- {name}: {reproduced}{others}; {marginal} marginal.{by}")
    return [*said, *filter(None, ["", few_seeds(rows)])]


def _readings(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(one["reading"] for one in rows))


def _verdict(one: Row) -> str:
    return f"{one['verdict']}{' (marginal)' if one['marginal'] else ''}"


def _numbers(finding: Finding | None) -> dict[str, float | None]:
    if finding is None or not finding.known:
        return {"value": None, "low": None, "high": None}
    ends = {"value": finding.value, "low": finding.low, "high": finding.high}
    return {name: None if end is None else rounded(end) for name, end in ends.items()}


def _words(name: str) -> str:
    return name.replace("_", " ")


def _number(one: Row) -> str:
    return (
        "-"
        if one["value"] is None
        else f"{one['value']:.3g}{'' if one['unit'] == '1' else ' ' + one['unit']}"
    )


def few_seeds(rows: Sequence[Row]) -> str:
    """What so few seeds cannot decide; nothing where there are enough."""
    n = max(one["n"] for one in rows)
    if n == 1:
        return "One seed has no interval: every verdict on a simulated number is marginal."
    if n < ENOUGH_SEEDS:
        said = f"{n} seeds do not decide what lies near a threshold"
        return f"{said}: of such a claim another {n} say otherwise in one case of three."
    return ""


def _found(one: Row) -> str:
    if one["n"] == 1 and one["low"] is not None:
        return f"{_number(one)} (one seed)"
    if one["low"] is None or one["low"] == one["high"]:
        return _number(one)
    return f"{_number(one)} ({one['low']:.3g} to {one['high']:.3g})"
