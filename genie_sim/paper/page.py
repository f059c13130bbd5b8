"""The page of an evaluation: verdicts with their evidence, the paper's figures, and what the open parameters do."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from genie_sim import report
from genie_sim.analysis.metrics import DEADLINE_MS
from genie_sim.errors import UserError
from genie_sim.paper import verdict_table
from genie_sim.paper.checks import AT_LEAST, AT_MOST
from genie_sim.paper.claims import VERDICTS
from genie_sim.paper.facts import METHODS
from genie_sim.recording import provenance
from genie_sim.report.data import rounded

TITLE = "The paper's evaluation, simulated"
MOST_FIGURE_BYTES = 4_000_000  # of all figures together; as text in the page they take a third more

FIGURES = {  # in the paper's order, then ours
    "latency_cdf": "Response times of answered frames",
    "latency_cdf_of_published": "Response times, as shares of all published frames",
    "image_reuse": "Image reuse",
    "object_reuse": "Object reuse",
    "confidence_boost": "Confidence boost",
    "case_study": "Vision-assisted driving: a car without cameras",
    "calibration": "Calibration",
    "sensitivity": "Sensitivity",
    "worth": "What the answers are worth",
}
CLAIMED = (
    "id",
    "where",
    "claim",
    "test",
    "expect",
    "tolerance",
    "kind",
)  # kind: that of the first reading
COMPARED = [method.name for method in METHODS]
BASELINES = [method.name for method in METHODS if method.baseline]
ANSWERS: tuple[tuple[str, str, str, str, list[str]], ...] = (  # title, unit, first, fresh, the methods they are of
    ("Mean", "ms", "first_answer_mean", "fresh_answer_mean", COMPARED),
    ("95th percentile", "ms", "first_answer_p95", "fresh_answer_p95", COMPARED),
    (
        f"Share of published frames answered in {DEADLINE_MS} ms", "1",
        "under_deadline_share", "fresh_under_deadline_share", COMPARED,
    ),
    ("Share of published frames answered at all", "1", "answered_share", "fresh_answered_share", COMPARED),
    (
        "Improvement of Genie's mean over local and remote", "1",
        "improvement_first_answer", "improvement_fresh_answer", BASELINES,
    ),
)  # fmt: skip


def page(folder: Path) -> str:
    """The page about the evaluation in ``folder``. Raises ``UserError`` for a folder that is not whole."""
    with provenance.of_this_version(folder):
        elsewhere = "The verdicts are also in verdicts.md beside it, and the figures in figures/."
        scripts, data = ("many.js", "evaluation.js"), page_data(folder)
        return report.assemble("evaluation.html", scripts, TITLE, data, elsewhere, pictures=True)


def page_data(folder: Path) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was made."""
    rows = verdict_table.read_rows(folder)
    notes = list(filter(None, [verdict_table.few_seeds(rows)]))
    about, readings, every = (
        _read(folder / name) for name in ("run.json", "readings.json", "metrics.json")
    )
    metrics = {
        (one["scenario"], one["name"]): one
        for one in every
        if one["reading"] == readings[0]["name"]
    }
    names = ("genie_sim", "quick", "seeds", "calibration", "trace")
    return {
        "about": {"name": TITLE, "description": "", **{name: about[name] for name in names}},
        "methods": [asdict(method) for method in METHODS],
        "verdicts": VERDICTS,
        "readings": readings,
        "claims": list(_claims(rows)),
        "improvement": [
            _of(metrics, "all", f"improvement_{answer}") for answer in ("first", "fresh")
        ],
        "answers": list(_answers(metrics)),
        "metrics": [
            [*(one[name] for name in ("reading", "scenario", "name")), *_interval(one), one["n"]]
            for one in every
        ],
        "figures": list(_figures(folder / "figures", notes)),
        "calibration": _calibration(_read(folder / "calibration.json", may_be_missing=True)),
        "sensitivity": _sensitivity(_read(folder / "sensitivity.json", may_be_missing=True)),
        "worth": _read(folder / "quality.json"),
        "drives": _read(folder / "drives.json", may_be_missing=True),
        "notes": notes,
    }


def _claims(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Each claim with what came out under each reading, the sentences of Section V that make it, and their figure."""
    sentences = verdict_table.sentences()
    for claim, found in verdict_table.by_claim(rows).items():
        mine = [one for one in sentences if claim in one["claims"]]
        first = next(iter(found.values()))
        yield {
            **{name: first[name] for name in CLAIMED},
            "bound": _bound(first),
            "says": [[one["part"], one["says"]] for one in mine],
            "figures": list(dict.fromkeys(one["figure"] for one in mine if one["figure"])),
            "found": {name: _finding(one) for name, one in found.items()},
        }


def _bound(row: Mapping[str, Any]) -> tuple[str, float]:
    """What the number found is compared with where it is no match."""
    sign = "\u2265" if row["id"] in AT_LEAST else "\u2264" if row["id"] in AT_MOST else ">"
    return sign, 0.0 if sign == ">" else row["expect"]


def _finding(row: Mapping[str, Any]) -> dict[str, Any]:
    """What came out under one reading: all of a row that is not said of the claim itself."""
    plain = row["by_default_metrics"]
    shown = {name: value for name, value in row.items() if name not in (*CLAIMED[:-1], "reading")}
    by = plain and {"verdict": plain["verdict"], "found": _interval(plain)}
    return shown | {"found": _interval(row), "by_default_metrics": by}


def _answers(metrics: Mapping[tuple[str, str], Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The same measure of the first and of the fresh answer, scenario by scenario."""
    scenarios = list(dict.fromkeys(scenario for scenario, _ in metrics if scenario != "all"))
    for title, unit, first, fresh, methods in ANSWERS:
        found = {
            answer: {of: [_of(metrics, one, f"{name}:{of}") for one in scenarios] for of in methods}
            for answer, name in (("first", first), ("fresh", fresh))
        }
        yield {"title": title, "unit": unit, "scenarios": scenarios, "methods": methods} | found


def _figures(folder: Path, notes: list[str]) -> Iterator[dict[str, str]]:
    """The figures there are, as text for the source of a picture, where scripts in them would not run."""
    room = MOST_FIGURE_BYTES
    for name, title in FIGURES.items():
        path = folder / f"{name}.svg"
        if not path.is_file():
            continue
        picture = path.read_bytes()
        if len(picture) > room:
            notes.append(
                f"The figure {name} is too large for this page; see figures/{name}.svg beside it."
            )
            continue
        room -= len(picture)
        source = f"data:image/svg+xml;base64,{base64.b64encode(picture).decode()}"
        yield {"name": name, "title": title, "source": source}


def _calibration(found: Mapping[str, Any] | None) -> dict[str, Any] | None:
    if found is None:
        return None
    names = ("overlap", "gate_m", "object_reuse", "image_reuse", "ratio")
    best = dict(found["best"])
    best["ratio"] = best["object_reuse"] / best["image_reuse"] if best["image_reuse"] else None
    return {
        "reached": found["reached"],
        "targets": found["targets"],
        "best": {name: rounded(best[name]) for name in names},
        "tried": [[rounded(point[name]) for name in names] for point in found["tried"]],
    }


def _sensitivity(found: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """The sweeps, and each variant with how many of the claims' tests hold under it."""
    if found is None:
        return None
    measures = ("object_reuse", "image_reuse", "first_answer_ms", "fresh_answer_ms")
    sweeps = [
        {name: row[name] for name in ("parameter", "title", "unit", "paper", "used")}
        | {"values": [point["value"] for point in row["points"]]}
        | {
            name: [[rounded(end) for end in point[name]] for point in row["points"]]
            for name in measures
        }
        for row in found["sweeps"]
    ]
    ordered = sorted(
        found["claims_that_hold_under"].items(), key=lambda one: (len(one[0]), one[0])
    )  # C2 before C10
    variants = [
        {
            "name": name,
            "plausible": one["plausible"],
            "holds": [claim for claim, under in ordered if name in under],
        }
        | {measure: [rounded(end) for end in one[measure]] for measure in measures}
        for name, one in found["variants"].items()
    ]
    return {"sweeps": sweeps, "variants": variants}


def _of(
    metrics: Mapping[tuple[str, str], Mapping[str, Any]], *key: str
) -> list[float | None] | None:
    metric = metrics.get((key[0], key[1]))
    return None if metric is None else _interval(metric)


def _interval(metric: Mapping[str, Any]) -> list[float | None]:
    return [rounded(metric[name]) for name in ("value", "low", "high")]


def _read(path: Path, may_be_missing: bool = False) -> Any:
    """A file's JSON, or ``None``. Raises ``UserError``."""
    if path.exists():
        return provenance.read_json(path)
    if not may_be_missing:
        raise UserError(f"{path}: missing; the evaluation is not whole")
    return None
