"""The page of an evaluation: verdicts with their evidence, the paper's figures, and all numbers."""

import base64
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.metric import ZERO_DELAY
from genie_sim.analysis.registry import METRICS, component_title
from genie_sim.analysis.result_table import ResultTable
from genie_sim.paper import claims, printed
from genie_sim.paper.checks import ALL, CASE
from genie_sim.paper.evidence import MIN_SEEDS, Evidence, interval
from genie_sim.paper.numbers import METHODS, Number
from genie_sim.record import provenance
from genie_sim.report import html_page

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from genie_sim.paper.reproduce import Reproduction

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


def page(made: "Reproduction") -> str:
    """The page about an evaluation. Raises ``UserError``."""
    with provenance.of_this_version(made.folder):
        elsewhere = "The verdicts are also in verdicts.json beside it."
        data, scripts = page_data(made), ("evaluation.js",)
        return html_page.assemble(
            "evaluation.html", scripts, TITLE, data, elsewhere=elsewhere, pictures="data:"
        )


def page_data(made: "Reproduction") -> dict[str, Any]:
    """Everything on the page, as plain JSON values; nothing of when, where and how fast it was
    made.
    """
    about, rows = made.about, made.rows
    evidence = Evidence(made.numbers)
    judged = accuracy(evidence)
    return {
        "about": {
            "name": TITLE,
            "description": "",
            "warning": provenance.warning(made.changed),
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
        "figures": list(_figures(made.figures())),
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


def _figures(drawn: "Mapping[str, Figure]") -> Iterator[dict[str, str]]:
    """The figures, as text for the source of a picture, where scripts in them would not run."""
    from genie_sim.analysis.figures import svg

    for name, figure in drawn.items():
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
