"""A run, or several seeds, or a comparison as a piece of HTML for a notebook: text is text."""

from dataclasses import replace

from genie_sim.analysis import compare_tables, renderers, screen, summary
from genie_sim.analysis.compare import ComparedRuns
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.verdict import verdicts
from genie_sim.record.results import Run


def run_html(run: Run | SeedRuns) -> str:
    """What was run, and the main table."""
    about = summary.about_seeds(run) if isinstance(run, SeedRuns) else summary.ABOUT_INTERVALS
    table = summary.main_table(run)
    return renderers.html(replace(table, title=screen.header(run), notes=[about]))


def comparison_html(comparison: ComparedRuns) -> str:
    """Who is better, and the table of differences."""
    notes, title = [compare_tables.about(comparison)], " ".join(verdicts(comparison))
    return renderers.html(replace(compare_tables.pairs(comparison), title=title, notes=notes))
