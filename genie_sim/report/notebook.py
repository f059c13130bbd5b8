"""A run, or several seeds, or a comparison as a piece of HTML for a notebook: text is text."""

from collections.abc import Iterable, Sequence
from html import escape

from genie_sim.analysis import screen, summary
from genie_sim.analysis.compare import ComparedRuns
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.verdict import verdicts
from genie_sim.recording.results import Run
from genie_sim.report import comparison as tables


def run_html(run: Run | SeedRuns) -> str:
    """What was run, and the main table."""
    headings, rows = summary.cells(run)
    notes = [summary.about_seeds(run) if isinstance(run, SeedRuns) else summary.ABOUT_INTERVALS]
    return _html(screen.header(run), headings, rows, [*notes, run.warning])


def comparison_html(comparison: ComparedRuns) -> str:
    """Who is better, and the table of differences."""
    headings, rows = tables.page_rows(comparison)
    sentences = verdicts(comparison)
    return _html(" ".join(sentences), headings, rows, [tables.note(comparison), comparison.warning])


def _html(
    title: str, headings: Sequence[str], rows: Iterable[Sequence[str]], notes: Iterable[str]
) -> str:
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    body = "".join(
        f"<tr><th>{escape(label)}</th>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
        for label, *cells in rows
    )
    below = "".join(f"<p><small>{escape(note)}</small></p>" for note in notes if note)
    return (
        f"<p><b>{escape(title)}</b></p>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{below}"
    )
