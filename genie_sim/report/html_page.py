"""The page about a run: what it comes to, its numbers, figures, replay and settings."""

from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import screen, style, summary
from genie_sim.analysis.compare import compared
from genie_sim.analysis.verdict import verdicts
from genie_sim.record import provenance
from genie_sim.report import template
from genie_sim.report.replay import replay_data
from genie_sim.report.template import Page, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from genie_sim.analysis.seed_runs import SeedRuns
    from genie_sim.record.results import Run


def write(path: Path, run: "Run", start_ns: int = 0) -> None:
    """Writes the page about ``run``. A long run is replayed from ``start_ns`` on, as far as the
    page's size allows.

    Raises ``UserError`` if ``path`` cannot be written.
    """
    template.write(path, page(run, start_ns))


def shown(
    results: "Run | SeedRuns", kind: str, drawn: "Mapping[str, Figure] | None"
) -> "dict[str, Figure]":
    """The figures that this kind of page shows, of those that there are. Figures that were
    ``drawn`` are not drawn again.
    """
    names = [name for name, kinds in style.RUN_FIGURES.items() if kind in kinds]
    if drawn is None:
        from genie_sim.analysis.figures import makers  # imports matplotlib

        drawn = {name: draw() for name, draw in makers(results).items() if name in names}
    return {name: drawn[name] for name in names if name in drawn}


def page(run: "Run", start_ns: int = 0, drawn: "Mapping[str, Figure] | None" = None) -> str:
    """The text of the page about ``run``. Figures that were ``drawn`` are not drawn again. Raises
    ``UserError`` for a run from a folder that this version did not write.
    """
    with provenance.of_this_version(run.folder):
        notes: list[str] = []
        replay = replay_data(run, start_ns, notes)
        main = summary.main_table(run)
        several = len(run.methods) > 1
        description = str(run.facts["scenario"]["description"])
        return Page(
            kind="one run",
            name=run.title,
            title=f"{run.title}, run {run.run_id}",
            about=[*filter(None, [description]), f"{screen.header(run)}."],
            sections=[
                Section(
                    "In short", [template.listed(verdicts(compared([run])) if several else [])]
                ),
                Section("Results", [template.table(main), template.note(summary.ABOUT_INTERVALS)]),
                Section("Figures", [template.figures(shown(run, style.RUN, drawn))]),
                # its title makes the id that replay.js scrolls to
                Section("Replay", [template.part("replay.html")] if replay is not None else []),
                Section("All tables", [*map(template.table, summary.tables(run))], folded=True),
                Section("Settings", [f'<pre tabindex="0">{escape(run.yaml)}</pre>'], folded=True),
            ],
            notes=[*notes, *filter(None, [summary.about_laws(run)])],
            origin=f"run {run.run_id}. Versions, digests and the sources of the traces are in "
            "run.json beside this page, the numbers also in metrics.json and summary.md.",
            replay=replay,
        ).text()
