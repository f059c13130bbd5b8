"""The pages about results: of a run, of several seeds, of a sweep, and of a comparison."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import TYPE_CHECKING, TypeAlias

from genie_sim.analysis import compare_tables, screen, style, summary
from genie_sim.analysis.compare import ComparedRuns, compared
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.verdict import verdicts
from genie_sim.report import template
from genie_sim.report.replay import replay_data
from genie_sim.report.template import Page, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from genie_sim.record.results import Run

Makers: TypeAlias = "Mapping[str, Callable[..., Figure]]"  # what draws figures, by their names


def of_run(run: "Run", makers: Makers, start_ns: int = 0) -> str:
    """The text of the page about ``run``, with those figures of ``makers`` that it shows, and a
    replay from ``start_ns`` on, as far as the page's size allows.
    """
    replay, note = replay_data(run, start_ns)
    return Page(
        kind="one run",
        name=run.title,
        title=f"{run.title}, run {run.run_id}",
        about=_about(run),
        sections=[
            Section("In short", [template.listed(verdicts(compared([run])))]),
            Section(
                "Results",
                [template.table(summary.main_table(run)), template.note(summary.ABOUT_INTERVALS)],
            ),
            Section("Figures", [_figures(style.RUN, makers)]),
            # its title makes the id that replay.js scrolls to
            Section("Replay", [template.part("replay.html")] if replay is not None else []),
            Section("All tables", [*map(template.table, summary.tables(run))], folded=True),
            Section("Settings", [f'<pre tabindex="0">{escape(run.yaml)}</pre>'], folded=True),
        ],
        notes=[*filter(None, [note]), *_laws(run)],
        origin=f"run {run.run_id}. In its folder, versions, digests and the sources of the traces "
        "are in run.json, the numbers also in metrics.json and summary.md.",
        replay=replay,
    ).text()


def of_seeds(runs: SeedRuns, makers: Makers) -> str:
    """The text of the page about runs with several seeds: their means, the differences between
    their methods, those figures of ``makers`` that it shows, and the id of each run.
    """
    comparison, seeds = compared([runs]), seeds_text(runs.seeds)
    each = [f"seed {run.seed}: run {run.run_id}" for run in runs.runs]
    return Page(
        kind="a run with several seeds",
        name=runs.title,
        title=f"{runs.title}, {seeds}",
        about=_about(runs),
        sections=[
            Section("In short", [template.listed(verdicts(comparison))]),
            Section(
                "Means",
                [
                    template.note(summary.about_seeds(runs)),
                    template.table(summary.main_table(runs)),
                ],
            ),
            Section("Figures", [_figures(style.SEEDS, makers)]),
            _differences(comparison),
            Section("Each run", [template.listed(each)]),
        ],
        notes=_laws(runs),
        origin="its runs. In the folder of the results, each is in a folder of 'runs', and the "
        "numbers are also in summary.md and table.csv.",
    ).text()


def of_table(
    table: ResultTable, arms: Sequence[str], about: str, drawn: "Mapping[str, Figure]"
) -> str:
    """The text of a page about one table, whose title is the page's, and its figures: ``about``
    says what it is of, ``arms`` are the titles of the methods.
    """
    return Page(
        kind="a sweep",
        name=table.title,
        about=[about, f"Methods: {', '.join(arms)}."],
        sections=[
            Section("Figures", [template.figures(drawn)]),
            Section("Numbers", [template.table(replace(table, title=""), filtered=True)]),
        ],
        origin="its runs. All numbers are in table.csv in the folder of the results.",
    ).text()


def of_comparison(comparison: ComparedRuns, drawn: "Mapping[str, Figure]") -> str:
    """The text of the page, with the figures of the comparison."""
    headings = ["setting", *comparison.names]
    settings = ResultTable.of_texts(
        headings, [[path, *values] for path, values in comparison.settings.items()]
    )
    within = ": methods are compared within a setting" if len(comparison.names) == 1 else ""
    same = "" if settings.rows else f"None{within}."
    name = " and ".join(comparison.names)
    return Page(
        kind="a comparison",
        name=name,
        title=f"{name}, compared",
        about=["Results side by side; differences are of the same seeds."],
        sections=[
            Section("In short", [template.listed(verdicts(comparison))]),
            Section("Figures", [template.figures(drawn)]),
            _differences(comparison),
            Section("Settings that differ", [template.table(settings), template.note(same)]),
        ],
        origin="the result folders that were given. All numbers are in table.csv beside this page.",
    ).text()


def _laws(results: "Run | SeedRuns") -> list[str]:
    """What the detector's laws rest on, where that does not stand below the main table."""
    return [*{summary.about_laws(results)}.difference(["", *summary.findings(results)])]


def _about(results: "Run | SeedRuns") -> list[str]:
    """What the scenario says of itself, and what was run."""
    description = str(results.runs[0].facts["scenario"]["description"])
    return [*filter(None, [description]), f"{screen.header(results)}."]


def _differences(comparison: ComparedRuns) -> Section:
    rows = template.table(compare_tables.pairs(comparison), filtered=True)
    about = template.note(compare_tables.about(comparison))
    return Section("Differences", [about, rows] if rows else [])


def _figures(kind: str, makers: Makers) -> str:
    """The figures that this kind of page shows, of those that there are."""
    names = [name for name, kinds in style.RUN_FIGURES.items() if kind in kinds]
    return template.figures({name: makers[name]() for name in names if name in makers})
