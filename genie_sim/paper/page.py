"""The page of an evaluation: verdicts with their evidence, and the paper's figures."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.registry import METRICS, component_title
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.seed_runs import seeds_text
from genie_sim.analysis.statistics import has_interval
from genie_sim.paper import claims, printed
from genie_sim.paper.checks import ALL
from genie_sim.paper.evidence import Evidence, interval
from genie_sim.paper.numbers import METHODS, Number
from genie_sim.record.records import ZERO_DELAY
from genie_sim.report import template
from genie_sim.report.template import Page, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from genie_sim.paper.reproduce import Reproduction

TITLE = "The paper's evaluation, simulated"
ABOUT_CLAIMS = (
    "he: heterogeneous edges; ho: homogeneous edges. Here: mean over the seeds, in brackets its "
    "95 % interval. The set-ups were chosen with outcomes in sight: what holds describes the paper "
    "and predicts nothing."
)
ACCURACY = (
    "object_recall_static",
    "object_recall_moving",
    "streaming_f1",
    "ghost_share",
)


def page(reproduction: "Reproduction", figures: "Mapping[str, Figure]") -> str:
    """The page about an evaluation, with its figures."""
    about, rows, evidence = reproduction.about, reproduction.rows, Evidence(reproduction.numbers)
    seeds = seeds_text(about["seeds"])
    return Page(
        kind="an evaluation",
        name=TITLE,
        about=[f"{'Quick' if about['quick'] else 'Full'} evaluation: {seeds}."],
        sections=[
            Section(
                "What of the paper holds",
                [
                    *(
                        f"<p>{escape(text)}</p>"
                        for text in (claims.total(rows), *claims.sentences(rows))
                    ),
                    _claims(rows),
                    template.note(ABOUT_CLAIMS),
                ],
            ),
            Section(
                "The paper's figures",
                [template.figures(figures)],
            ),
            Section(
                "How accurate the answers are",
                [template.note(printed.ABOUT_ACCURACY), template.table(accuracy(evidence))],
            ),
        ],
        notes=printed.notes(rows),
        origin="numbers.parquet. Versions and digests are in the run.json of the results, the "
        "verdicts also in verdicts.md.",
    ).text()


def _claims(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table of the claims, each with its test and what shows it, which open on a click."""
    headings = ("the paper says", "the paper", "here", "verdict", "why")
    head = "".join(f'<th scope="col">{heading}</th>' for heading in headings)
    body = "".join(map(_claim, rows))
    table = f"<table><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table>"
    return template.filterable(template.boxed(table, "Claims"))


def _claim(row: Mapping[str, Any]) -> str:
    kind = f" ({row['kind']})" if "input" in row["kind"] else ""
    facts = {
        "Paper": row["where"],
        "Section": row["section"],
        "Kind": f"{row['kind']}: {claims.KINDS[row['kind']]}",
        "Test": row["test"],
        "Shown by": row["command"],
        "Minutes": str(row["minutes"]),
    }
    more = "".join(
        f"<div><dt>{name}</dt><dd>{escape(value)}</dd></div>" for name, value in facts.items()
    )
    cells = [
        f"{escape(row['claim'] + kind)}<details><summary>test</summary><dl>{more}</dl></details>",
        escape(row["paper"]),
        f'{escape(printed.number(row))} <small class="long">{escape(row["ours"])}</small>',
        f'<span class="verdict v{claims.VERDICTS.index(row["verdict"])}">'
        f"{escape(printed.verdict(row))}</span>",
        f'<div class="why">{escape(printed.reason(row))}</div>',
    ]
    columns = "".join(f"<td>{cell}</td>" for cell in cells)
    return f'<tr id="{escape(row["id"])}"><th scope="row">{escape(row["id"])}</th>{columns}</tr>'


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
    if not has_interval(len(values)):
        return f"{mean:.3g}"
    return f"{mean:.3g} ({low:.3g} to {high:.3g})"
