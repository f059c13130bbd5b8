"""The page of an evaluation: verdicts with their evidence, the paper's figures, and all numbers."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from genie_sim.analysis.metric import DEADLINE_MS, ZERO_DELAY
from genie_sim.analysis.registry import component_title
from genie_sim.analysis.style import method_styles
from genie_sim.base.errors import UserError
from genie_sim.base.text import finite
from genie_sim.paper import verdict_table
from genie_sim.paper.checks import AT_LEAST, AT_MOST
from genie_sim.paper.claims import VERDICTS
from genie_sim.paper.definitions import Definitions, meant
from genie_sim.paper.facts import METHODS, Fact
from genie_sim.record import provenance
from genie_sim.report import html_page
from genie_sim.report.data import metric_info

# rows of metrics.json by scenario and fact
Measured = Mapping[tuple[str, Fact], Mapping[str, Any]]

TITLE = "The paper's evaluation, simulated"

FIGURES = {  # in the paper's order, then ours
    "latency_cdf": "Response times of answered frames",
    "latency_cdf_of_published": "Response times, as shares of all published frames",
    "image_reuse": "Image reuse",
    "object_reuse": "Object reuse",
    "confidence_boost": "Confidence boost",
    "case_study": "Vision-assisted driving: a car without cameras",
    "worth": "How accurate the answers are",
}
NUMBERS = ("verdicts", "readings", "metrics", "quality")  # the files that hold them
# kind: that of the first reading
CLAIMED = ("id", "where", "claim", "test", "paper", "expect", "tolerance", "kind")
COMPARED = [method.name for method in METHODS]
BASELINES = [method.name for method in METHODS if method.baseline]
# title, unit, first answer, result, the methods they are of
ANSWERS: tuple[tuple[str, str, str, str, list[str]], ...] = (
    ("Mean", "ms", "first_answer_mean", "result_answer_mean", COMPARED),
    ("95th percentile", "ms", "first_answer_p95", "result_answer_p95", COMPARED),
    (
        f"Share of published frames answered in {DEADLINE_MS} ms",
        "1",
        "under_deadline_share",
        "result_under_deadline_share",
        COMPARED,
    ),
    (
        "Share of published frames answered at all",
        "1",
        "answered_share",
        "result_answered_share",
        COMPARED,
    ),
    (
        "Improvement of Genie's mean over local and remote",
        "1",
        "improvement_first_answer",
        "improvement_result_answer",
        BASELINES,
    ),
)


def files_of(folder: Path) -> list[str]:
    """The files of an evaluation that its page is made of, besides ``run.json``."""
    names = [f"{name}.json" for name in NUMBERS]
    names += [f"figures/{name}.svg" for name in FIGURES]
    return [name for name in names if (folder / name).exists()]


def page(folder: Path, allow_changed: bool = False) -> str:
    """The page about the evaluation in ``folder``. Raises ``UserError`` for a folder that is not
    whole, and, unless they are allowed, for files that were changed since they were written.
    """
    with provenance.of_this_version(folder):
        elsewhere = "The verdicts are also in verdicts.md beside it, and the figures in figures/."
        scripts, data = ("many.js", "evaluation.js"), page_data(folder, allow_changed)
        return html_page.assemble(
            "evaluation.html", scripts, TITLE, data, elsewhere=elsewhere, pictures="data:"
        )


def page_data(folder: Path, allow_changed: bool = False) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was
    made.
    """
    rows = verdict_table.read_rows(folder)
    notes = list(filter(None, [verdict_table.few_seeds(rows)]))
    about, readings, measured = (
        _read(folder / name) for name in ("run.json", "readings.json", "metrics.json")
    )
    notes += about["edited"]
    changed = provenance.changed_files(folder, about.get("digests"), files_of(folder))
    provenance.refuse_changed(folder, changed, allow_changed)
    metrics = {
        (row["scenario"], _fact(row)): row
        for row in measured
        if row["reading"] == readings[0]["name"]
    }
    definitions = Definitions(
        **{metric: defined["definition"] for metric, defined in readings[0]["metrics"].items()}
    )
    names = ("genie_sim", "quick", "seeds", "trace")
    worth = _read(folder / "quality.json")
    return {
        "about": {
            "name": TITLE,
            "description": "",
            "warning": provenance.warning(changed),
            **{name: about[name] for name in names},
        },
        "methods": [
            asdict(method) | {"look": style}
            for style, method in zip(
                method_styles([method.name for method in METHODS]), METHODS, strict=True
            )
        ],
        "verdicts": VERDICTS,
        "readings": readings,
        "claims": list(_claims(rows)),
        "improvement": [
            _of(metrics, "all", Fact(meant(f"improvement_{answer}_answer", definitions)))
            for answer in ("first", "result")
        ],
        "answers": list(_answers(metrics, definitions)),
        "metrics": [
            [row["reading"], row["scenario"], str(_fact(row)), *_interval(row), row["n"]]
            for row in measured
        ],
        "figures": list(_figures(folder / "figures")),
        "worth": worth,
        "metric_info": metric_info(row["name"] for row in worth),
        "zero_delay": {"component": ZERO_DELAY, "title": component_title(ZERO_DELAY)},
        "notes": notes,
    }


def _claims(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Each claim with what came out under each reading, the sentences of Section V that make it,
    and their figure.
    """
    sentences = verdict_table.sentences()
    for claim, by_reading in verdict_table.by_claim(rows).items():
        making_it = [sentence for sentence in sentences if claim in sentence["claims"]]
        first = next(iter(by_reading.values()))
        yield {
            **{name: first[name] for name in CLAIMED},
            "bound": _bound(first),
            "says": [[sentence["part"], sentence["says"]] for sentence in making_it],
            "figures": list(
                dict.fromkeys(sentence["figure"] for sentence in making_it if sentence["figure"])
            ),
            "found": {name: _finding(row) for name, row in by_reading.items()},
        }


def _bound(row: Mapping[str, Any]) -> tuple[str, float]:
    """What the number found is compared with where it is no match."""
    sign = "\u2265" if row["id"] in AT_LEAST else "\u2264" if row["id"] in AT_MOST else ">"
    return sign, 0.0 if sign == ">" else row["expect"]


def _finding(row: Mapping[str, Any]) -> dict[str, Any]:
    """What came out under one reading: all of a row that is not said of the claim itself."""
    plain = row["by_run_metrics"]
    shown = {name: value for name, value in row.items() if name not in (*CLAIMED[:-1], "reading")}
    by = plain and {"verdict": plain["verdict"], "found": _interval(plain)}
    return shown | {"found": _interval(row), "by_run_metrics": by}


def _fact(row: Mapping[str, Any]) -> Fact:
    return Fact(*(row[name] for name in Fact._fields))


def _answers(metrics: Measured, definitions: Definitions) -> Iterator[dict[str, Any]]:
    """The same measure of the first answer and of the result, scenario by scenario."""
    scenarios = list(dict.fromkeys(scenario for scenario, _ in metrics if scenario != "all"))
    for title, unit, first, result, methods in ANSWERS:
        intervals = {
            answer: {
                of: [
                    _of(metrics, scenario, _answer(meant(metric, definitions), of))
                    for scenario in scenarios
                ]
                for of in methods
            }
            for answer, metric in (("first", first), ("result", result))
        }
        yield {"title": title, "unit": unit, "scenarios": scenarios, "methods": methods} | intervals


def _answer(metric: str, of: str) -> Fact:
    """An improvement is Genie's over a baseline; everything else is of a method."""
    return Fact(metric, component=of) if metric.startswith("improvement") else Fact(metric, of)


def _figures(folder: Path) -> Iterator[dict[str, str]]:
    """The figures there are, as text for the source of a picture, where scripts in them would not
    run.
    """
    for name, title in FIGURES.items():
        path = folder / f"{name}.svg"
        if path.is_file():
            picture = base64.b64encode(path.read_bytes()).decode()
            source = f"data:image/svg+xml;base64,{picture}"
            yield {"name": name, "title": title, "source": source}


def _of(metrics: Measured, scenario: str, fact: Fact) -> list[float | None] | None:
    metric = metrics.get((scenario, fact))
    return None if metric is None else _interval(metric)


def _interval(metric: Mapping[str, Any]) -> list[float | None]:
    return [finite(metric[name]) for name in ("value", "low", "high")]


def _read(path: Path) -> Any:
    """A file's JSON. Raises ``UserError``."""
    if not path.exists():
        raise UserError(f"{path}: missing; the evaluation is not whole")
    return provenance.read_json(path)
