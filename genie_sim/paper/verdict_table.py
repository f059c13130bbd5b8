"""The verdicts as Markdown: the tables in the README and the docs, and the document beside the results."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from genie_sim.paper import table1
from genie_sim.paper.arms import Arms
from genie_sim.paper.claims import VERDICTS, Verdict
from genie_sim.paper.evidence import Finding
from genie_sim.recording import provenance
from genie_sim.scenario.yaml_input import parse

ENOUGH_SEEDS = 10
MOST_NAMED = 4  # variants named beside a claim

Row = Mapping[str, Any]


def row(verdict: Verdict, arms: Arms | None = None) -> dict[str, Any]:
    """A verdict as plain data. ``arms``: the other readings and values, told of where the claim is not reproduced."""
    finding = verdict.finding or Finding(None, None, None, 0, "1", False, False)
    numbers = (finding.value, finding.low, finding.high) if finding.known else (None, None, None)
    names, tried = arms.holding(verdict.claim) if arms and verdict.verdict in VERDICTS[1:3] else (None, None)
    return {
        **asdict(verdict.claim),
        **dict(zip(("value", "low", "high"), map(_rounded, numbers), strict=True)),
        "unit": finding.unit,
        "n": finding.n,
        "note": finding.note,
        "verdict": verdict.verdict,
        "marginal": verdict.marginal,
        "holds_under": names,
        "tried_under": tried,
    }


def table(rows: Sequence[Row]) -> str:
    """Claim, kind, what was found and the verdict, one line each, and the count of each verdict."""
    lines = ["| | the paper says | kind | found (95 % interval) | verdict |", "|---|---|---|---|---|"]
    for one in rows:
        said = f"{one['verdict']}{' (marginal)' if one['marginal'] else ''}"
        lines.append(f"| {one['id']} | {one['claim']} | {one['kind'].replace('_', ' ')} | {_found(one)} | {said} |")
    return "\n".join([*lines, "", _counts(rows)])


def counts_table(rows: Sequence[Row]) -> str:
    """How many claims of each kind have each verdict."""
    counts = Counter((one["kind"], one["verdict"]) for one in rows)
    kinds = list(dict.fromkeys(one["kind"] for one in rows))
    said = [verdict for verdict in VERDICTS if any(counts[kind, verdict] for kind in kinds)]
    lines = [f"| claims | {' | '.join(said)} |", f"|---|{'---|' * len(said)}"]
    for kind in kinds:
        cells = [str(counts[kind, verdict] or "") for verdict in said]
        lines.append(f"| {kind.replace('_', ' ')} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", _counts(rows)])


def text(rows: Sequence[Row], width: int) -> str:
    """Verdict, claim and what was found, for a terminal of ``width`` columns; the counts below."""
    lines = []
    for one in rows:
        said = f"{one['verdict']}{' (marginal)' if one['marginal'] else ''}"
        line = f"{one['id']:4} {said:38} {_found(one):28} {one['claim']}"
        lines.append(line if len(line) <= width else f"{line[: max(width - 3, 0)]}...")
    return "\n".join([*lines, "", _counts(rows)])


def document(rows: Sequence[Row], settings: Sequence[str], worth: Sequence[Row]) -> str:
    """The whole account beside the results: the table, each claim's test, and what the answers are worth."""
    parts = ["# What of the paper holds here", "", f"Calibrated: {', '.join(settings)}.", "", table(rows), ""]
    parts += ["## Each claim", ""]
    for one in rows:
        parts.append(f"**{one['id']}** ({one['where']}): {one['claim']}. *{one['verdict']}*; kind: {one['kind']}.")
        parts.append(f"Test: {one['test']}. Found: {_found(one)}{'; ' + one['note'] if one['note'] else ''}.")
        if one["holds_under"] is not None:
            parts.append(_elsewhere(one))
        parts.append("")
    parts += ["## Table I", "", table1.markdown(), "", "## What the answers are worth", "", worth_table(worth)]
    return "\n".join(parts) + "\n"


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
    names = list(dict.fromkeys(one["name"] for one in rows))
    found = {(one["method"], one["name"]): one for one in rows}
    lines = [f"| | {' | '.join(methods)} |", f"|---|{'---|' * len(methods)}"]
    for name in names:
        mine = [found.get((one, name)) for one in methods]
        cells = ["-" if one is None else "{value:.2f} ({low:.2f} to {high:.2f})".format_map(one) for one in mine]
        unit = next((f" [{one['unit']}]" for one in mine if one and one.get("unit", "1") != "1"), "")
        lines.append(f"| {name.replace('_', ' ')}{unit} | {' | '.join(cells)} |")
    return "\n".join(lines)


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """The verdicts of a result folder. Raises ``UserError``."""
    rows: list[dict[str, Any]] = provenance.read_json(folder / "verdicts.json")
    return rows


def sentences() -> list[dict[str, Any]]:
    """What Section V says, in its order, each with the claims that it makes and the figure that shows it."""
    path = Path(__file__).with_name("section_v.yaml")
    found: list[dict[str, Any]] = parse(path.read_text(encoding="utf-8"), str(path))
    return found


def _counts(rows: Sequence[Row]) -> str:
    counts = Counter(one["verdict"] for one in rows)
    summary = "; ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
    marginal = sum(one["marginal"] for one in rows)
    said = f"{len(rows)} claims: {summary}. Marginal, another set of seeds could say otherwise: {marginal}."
    return "\n".join(filter(None, [said, few_seeds(rows)]))


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
    if one["value"] is None:
        return "-"
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    if one["n"] == 1 and one["low"] is not None:
        return f"{one['value']:.3g}{unit} (one seed)"
    if one["low"] is None or one["low"] == one["high"]:
        return f"{one['value']:.3g}{unit}"
    return f"{one['value']:.3g}{unit} ({one['low']:.3g} to {one['high']:.3g})"


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")
