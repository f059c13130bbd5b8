"""The page of an evaluation: verdicts with their evidence, the paper's figures, and all numbers."""

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.analysis.metric import ZERO_DELAY
from genie_sim.analysis.registry import METRICS, component_title
from genie_sim.analysis.result_table import ResultTable
from genie_sim.paper import claims, curves, numbers, printed
from genie_sim.paper.checks import ALL, CASE
from genie_sim.paper.evidence import MIN_SEEDS, Evidence, interval
from genie_sim.paper.numbers import METHODS, Number
from genie_sim.record import provenance
from genie_sim.report import html_page

FILES = (numbers.FILE, curves.FILE, printed.VERDICTS)
TITLE = "The paper's evaluation, simulated"
ACCURACY = (
    "object_precision",
    "object_recall_static",
    "object_recall_moving",
    "streaming_f1",
    "ghost_share",
    "gospa",
    "place_error",
)


def page(folder: Path, allow_changed: bool = False) -> str:
    """The page about the evaluation in ``folder``. Raises ``UserError`` for a folder that is not
    whole, and, unless they are allowed, for files that were changed since they were written.
    """
    rows = printed.read_rows(folder)
    with provenance.of_this_version(folder):
        elsewhere = "The verdicts are also in verdicts.md beside it."
        data = page_data(folder, rows, allow_changed)
        scripts = ("evaluation.js",)
        return html_page.assemble(
            "evaluation.html", scripts, TITLE, data, elsewhere=elsewhere, pictures="data:"
        )


def page_data(
    folder: Path, rows: list[dict[str, Any]], allow_changed: bool = False
) -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was
    made.
    """
    about = printed.read_about(folder)
    changed = provenance.changed_files(folder, about.get("digests"), FILES)
    provenance.refuse_changed(folder, changed, allow_changed)
    evidence = Evidence(numbers.read(folder))
    judged = accuracy(evidence)
    return {
        "about": {
            "name": TITLE,
            "description": "",
            "warning": provenance.warning(changed),
            **{name: about[name] for name in ("genie_sim", "quick", "seeds")},
        },
        "methods": [],
        "notes": [*printed.notes(rows), *about["edited"]],
        "sentences": claims.sentences(rows),
        "verdicts": claims.VERDICTS,
        "kinds": claims.KINDS,
        "claims": [
            row
            | {
                "found": printed.number(row),
                "said": printed.verdict(row),
                "reason": printed.reason(row),
            }
            for row in rows
        ],
        "figures": list(_figures(folder, allow_changed)),
        "accuracy": [judged.headings, *judged.texts()],
        "numbers": list(_means(evidence)),
    }


def accuracy(evidence: Evidence) -> ResultTable:
    """How right the objects are that consumers hold, means over the six scenarios: by method, the
    detector without delay one of them.
    """
    names = [*(method.name for method in METHODS), ZERO_DELAY]
    lines = []
    for metric in ACCURACY:
        about = METRICS[metric]
        cells = []
        for name in names:
            number = Number(metric, name)
            if name == ZERO_DELAY:  # judged with the first method
                number = Number(metric, METHODS[0].name, component=ZERO_DELAY)
            values = about.factor * evidence.mean_of(ALL, [number])
            cells.append("-" if np.isnan(values).any() else _with_interval(values))
        lines.append([about.label, *cells])
    return ResultTable.of_texts(["", *(component_title(name, METHODS) for name in names)], lines)


def _with_interval(values: np.ndarray) -> str:
    mean, low, high = interval(values)
    if len(values) < MIN_SEEDS:
        return f"{mean:.3g}"
    return f"{mean:.3g} ({low:.3g} to {high:.3g})"


def _figures(folder: Path, allow_changed: bool) -> Iterator[dict[str, str]]:
    """The figures, as text for the source of a picture, where scripts in them would not run."""
    from genie_sim.analysis.figures import svg
    from genie_sim.paper import figures

    for name, figure in figures.of_evaluation(folder, allow_changed=allow_changed).items():
        title = str(figure.get_label()).partition("\n")[0]
        source = f"data:image/svg+xml;base64,{base64.b64encode(svg(figure)).decode()}"
        yield {"name": name, "title": title, "source": source}


def _means(evidence: Evidence) -> Iterator[list[Any]]:
    """Every number of the scenarios as they are: scenario, name, mean and its 95 % interval."""
    for scenario in (*ALL, CASE):
        for number in evidence.numbers_of(scenario):
            values = evidence.of(scenario, number)
            if not np.isnan(values).any():
                ends = [float(f"{end:.6g}") for end in interval(values)]
                known = ends if len(values) >= MIN_SEEDS else [ends[0], None, None]
                yield [scenario, str(number), *known]
