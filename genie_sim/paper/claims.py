"""The paper's claims, and what the simulation says of each: a row of one table."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.statistics import has_interval
from genie_sim.paper.evidence import (
    CONTRARY,
    HELD,
    NEGLIGIBLE,
    Effects,
    Values,
    interval,
)
from genie_sim.record import provenance
from genie_sim.scenario.yaml_input import parse

HERE = Path(__file__).parent
HOLDS, PARTLY, NO, NOT_RUN = VERDICTS = ("holds", "partly", "no", "not run")
SECTIONS = (  # in the paper's order
    "latency",
    "images",
    "objects",
    "confidence",
    "case study",
    "design",
    "Table I",
)
KINDS = {
    "input": "true by construction",
    "near input": "follows closely from what was put in",
    "outcome": "the simulator could have contradicted it",
    "invariant": "must hold in every run",
    "table": "arithmetic on the paper's own table",
}

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Claim:
    """One line of ``claims.yaml``, which says what each field is."""

    id: str
    section: str
    where: str
    kind: str
    claim: str
    paper: str
    ours: str
    unit: str
    expect: float
    test: str
    why: str
    command: str
    minutes: float
    tolerance: float = 0.0
    near: float | None = None
    also: float = 0.0
    about: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """What the test of a claim found: its verdict, and the number that the table shows, one value
    a seed, or one of no seed. ``note``: what stands beside the verdict.
    """

    verdict: str
    values: Values
    note: str = ""


@cache
def load_claims() -> tuple[Claim, ...]:
    """The paper's claims, in its order."""
    path = HERE / "claims.yaml"
    return tuple(Claim(**line) for line in parse(path.read_text(encoding="utf-8"), str(path)))


@cache
def full_run() -> dict[str, str]:
    """The verdict of each claim in the last full evaluation, which ``results/paper`` holds."""
    verdicts: dict[str, str] = provenance.read_json(HERE / "full_run.json")
    return verdicts


# Verdicts


def within(
    claim: Claim,
    values: Values,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    shown: Values | None = None,
    note: str = "",
) -> Finding:
    """The claim holds where the whole interval lies within the bounds, and partly where it lies on
    the claimed side of ``near``. ``shown``: the number of the table, if it is another one.
    """
    _, least, most = interval(values)
    near = claim.near
    if low <= least and most <= high:
        verdict = HOLDS
    elif near is not None and (least > near if claim.expect > near else most < near):
        verdict = PARTLY
    else:
        verdict = NO
    return Finding(verdict, values if shown is None else shown, note)


def matches(
    claim: Claim, values: Values, *, shown: Values | None = None, note: str = ""
) -> Finding:
    """Equivalence: the whole interval lies within the tolerance of what is expected."""
    low, high = claim.expect - claim.tolerance, claim.expect + claim.tolerance
    return within(claim, values, low, high, shown=shown, note=note)


def all_positive(shown: Values, *legs: Effects, note: str = "") -> Finding:
    """Several effects that are all claimed to be positive: each must hold (``Effect.state``).

    The claim holds partly where one of several ``legs`` holds whole, or where no effect is contrary
    and either most of them hold or their average does. The note names those that do not.
    """
    effects = {name: effect for leg in legs for name, effect in leg.items()}
    states = {name: effect.state for name, effect in effects.items()}
    held = sum(state == HELD for state in states.values())
    if held == len(effects):
        return Finding(HOLDS, shown, note)
    failures = _missing({name: state for name, state in states.items() if state != HELD})
    counts = f"{held} of {len(effects)} effects hold, the others: {failures}"
    note = "; ".join(filter(None, [note, counts]))
    legs_held = (all(states[name] == HELD for name in leg) for leg in legs)
    relative = [effect.effect / effect.scale for effect in effects.values()]
    _, low, _ = interval(np.mean(relative, axis=0))
    most = low > NEGLIGIBLE or 2 * held > len(effects)
    partly = (len(legs) > 1 and any(legs_held)) or (most and CONTRARY not in states.values())
    return Finding(PARTLY if partly else NO, shown, note)


def _missing(states: Mapping[str, str]) -> str:
    """The effects that do not hold; of many their number."""
    if len(states) <= 3:
        return ", ".join(f"{name} ({state})" for name, state in states.items())
    return ", ".join(f"{count} {state}" for state, count in Counter(states.values()).items())


def in_every_run(claim: Claim, values: Values, *, at_most: bool = False, note: str = "") -> Finding:
    """An invariant: what is expected is a bound that no run may miss. The value is the worst
    run's.
    """
    worst = np.max(values) if at_most else np.min(values)
    holds = worst <= claim.expect if at_most else worst >= claim.expect
    return Finding(HOLDS if holds else NO, np.array([worst]), note)


def arithmetic(holds: bool, value: float, note: str = "") -> Finding:
    """What needs no run."""
    return Finding(HOLDS if holds else NO, np.array([value]), note)


# Rows of the table


def row(claim: Claim, finding: Finding | None, full: str) -> dict[str, Any]:
    """A claim and what was found as plain data; ``full``: its verdict in the last full run.

    ``value`` is the mean over ``n`` seeds, in ``unit``; ``low`` and ``high`` are its 95 % interval,
    ``None`` of fewer than three. Shares are in percent.
    """
    value = low = high = None
    n = 0 if finding is None else len(finding.values)
    if finding is not None and not np.isnan(finding.values).any():
        factor = 100.0 if claim.unit in ("%", "points") else 1.0
        value, low, high = (_rounded(factor * end) for end in interval(finding.values))
        if not has_interval(n):
            low = high = None
    verdict = NOT_RUN if finding is None or value is None else finding.verdict
    return {
        "id": claim.id,
        "section": claim.section,
        "where": claim.where,
        "kind": claim.kind,
        "about": claim.about,
        "claim": claim.claim,
        "paper": claim.paper,
        "ours": claim.ours,
        "value": value,
        "low": low,
        "high": high,
        "unit": claim.unit,
        "n": n,
        "verdict": verdict,
        "full_run": full,
        "note": "" if finding is None else finding.note,
        "why": claim.why,
        "test": claim.test,
        "command": claim.command,
        "minutes": claim.minutes,
    }


def _rounded(value: float) -> float:
    """Six digits, as they are written down."""
    return float(f"{value:.6g}")


def sentences(rows: Sequence[Row]) -> list[str]:
    """What of the paper holds, in three sentences."""
    return [
        f"{name}: {_counts(section_rows)}{more}."
        for name, section_rows, more in (
            ("Latency", [row for row in rows if row["section"] == "latency"], _of_inputs(rows)),
            ("Levels of reuse and confidence", _about(rows, "level"), _average(rows)),
            (
                "Peaks, and trends over the number of cars",
                _about(rows, "trend"),
                "; the rest goes another way, or is too small to count",
            ),
        )
    ]


def total(rows: Sequence[Row]) -> str:
    """How many of all claims hold, partly or not, in a sentence."""
    counts = Counter(row["verdict"] for row in rows)
    held = f"{counts[HOLDS]} hold, {counts[PARTLY]} partly, {counts[NO]} do not"
    missing = f", {counts[NOT_RUN]} not run" if counts[NOT_RUN] else ""
    return f"Of all {len(rows)} claims {held}{missing}."


def _about(rows: Sequence[Row], subject: str) -> list[Row]:
    return [row for row in rows if row["about"] == subject]


def _counts(rows: Sequence[Row]) -> str:
    counts = Counter(row["verdict"] for row in rows)
    parts = [f"{counts[HOLDS]} of {len(rows)} claims hold"]
    parts += [f"{counts[verdict]} {verdict}" for verdict in (PARTLY, NOT_RUN) if counts[verdict]]
    return ", ".join(parts)


def _of_inputs(rows: Sequence[Row]) -> str:
    of_latency = [row for row in rows if row["section"] == "latency"]
    put_in = sum("input" in row["kind"] for row in of_latency)
    return f"; {put_in} of the {len(of_latency)} follow from what was put in"


def _average(rows: Sequence[Row]) -> str:
    """The mean object reuse beside the paper's."""
    for found in rows:
        if found["id"] == "C11" and found["value"] is not None:
            return (
                f"; objects are reused {found['value']:.0f} % of the time (paper: {found['paper']})"
            )
    return ""


def differing(rows: Sequence[Row]) -> Iterator[str]:
    """The ids of claims with another verdict than in the last full run."""
    return (row["id"] for row in rows if row["verdict"] != row["full_run"])
