"""A comparison as figures, and as one page for a browser."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import compare_tables, renderers, seed_runs, style, summary
from genie_sim.analysis.compare import ComparedRuns, as_metrics, compared
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.verdict import verdicts
from genie_sim.base.errors import UserError
from genie_sim.base.paths import usable
from genie_sim.record import folders, provenance
from genie_sim.record.columns import Columns, concat
from genie_sim.report import html_page, template
from genie_sim.report.template import Page, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "compare.html"


def figures(comparison: ComparedRuns, width_in: float | None = None) -> "dict[str, Figure]":
    """The paired differences, overlaid distributions of first answers, and accuracy versus latency
    where the arms have an accuracy in common; ``width_in`` wide, if that is given.
    """
    from genie_sim.analysis.latency_cdf import latency_cdf
    from genie_sim.analysis.points import differences, drawable, latency_accuracy

    metrics, methods = as_metrics(comparison)
    frames: dict[int, list[Columns]] = {}  # by seed
    for arm in comparison.arms:
        for seed, run in arm.runs.items():
            if not run.tables:
                continue
            of_method = run.tables["frames"].where(method=arm.method.name)
            frames.setdefault(seed, []).append(of_method.assign(method=arm.label))
    about = methods, comparison.by, width_in
    drawn = {}
    if frames:
        seeds = [concat(of_seed) for of_seed in frames.values()]
        drawn["latency_cdf"] = latency_cdf(seeds, *about)
    if any(row.difference is not None for row in comparison.rows):
        drawn = {"differences": differences(comparison, *about[1:]), **drawn}
    if drawable(metrics):
        drawn["latency_accuracy"] = latency_accuracy(metrics, *about)
    return drawn


def page(comparison: ComparedRuns, drawn: "Mapping[str, Figure]") -> str:
    """The text of the page, with the figures of the comparison."""
    headings = ["setting", *comparison.names]
    settings = ResultTable.of_texts(
        headings, [[path, *values] for path, values in comparison.settings.items()]
    )
    same = "" if settings.rows else "None: the methods of one setting are compared."
    name = " and ".join(comparison.names)
    return Page(
        kind="a comparison",
        name=name,
        title=f"{name}, compared",
        about=["Runs that saw the same frames, side by side."],
        sections=[
            Section("In short", [template.listed(verdicts(comparison))]),
            Section("Figures", [template.figures(drawn)]),
            _differences(comparison),
            Section("Settings that differ", [template.table(settings), template.note(same)]),
        ],
        origin="the result folders that were given. All numbers are in table.csv beside this page.",
    ).text()


def _differences(comparison: ComparedRuns) -> Section:
    rows = template.table(compare_tables.pairs(comparison), filtered=True)
    about = template.note(compare_tables.about(comparison))
    return Section("Differences", [about, rows] if rows else [])


def seeds_page(runs: SeedRuns, drawn: "Mapping[str, Figure] | None" = None) -> str:
    """The text of the page about runs with several seeds: their means, the differences between
    their methods, their figures, and the way to the page of each run. Figures that were ``drawn``
    are not drawn again. Raises ``UserError``.
    """
    with provenance.of_this_version(runs.folder):
        comparison, seeds = compared([runs]), seeds_text(runs.seeds)
        pages = [
            f'<li><a href="runs/{escape(run.folder.name)}/{template.NAME}">seed {run.seed}, run '
            f"{run.run_id}</a></li>"
            for run in runs.runs
            if run.folder is not None and (run.folder / template.NAME).is_file()
        ]
        links = f"<ul>{''.join(pages)}</ul>" if pages else ""
        description = str(runs.runs[0].facts["scenario"]["description"])
        return Page(
            kind="a run with several seeds",
            name=runs.title,
            title=f"{runs.title}, {seeds}",
            about=[*filter(None, [description]), f"{seeds[0].upper()}{seeds[1:]}."],
            sections=[
                Section("In short", [template.listed(verdicts(comparison))]),
                Section(
                    "Means",
                    [
                        template.note(summary.about_seeds(runs)),
                        template.table(summary.main_table(runs)),
                    ],
                ),
                Section("Figures", [template.figures(html_page.shown(runs, style.SEEDS, drawn))]),
                _differences(comparison),
                Section("Each run", [links]),
            ],
            origin="the runs in the folder 'runs' beside this page. The numbers are also in "
            "summary.md and table.csv.",
        ).text()


def page_of_table(
    table: ResultTable, arms: Sequence[str], about: str, drawn: "Mapping[str, Figure]"
) -> str:
    """The text of a page about one table, whose title is the page's, and its figures: ``about``
    says what it is of, ``arms`` are the titles of the methods.
    """
    untitled = ResultTable(table.columns, table.rows, notes=table.notes, corner=table.corner)
    return Page(
        kind="a sweep",
        name=table.title,
        about=[about, f"Methods: {', '.join(arms)}."],
        sections=[
            Section("Figures", [template.figures(drawn)]),
            Section("Numbers", [template.table(untitled, filtered=True)]),
        ],
        origin="the runs of the sweep. All numbers are in table.csv beside this page.",
    ).text()


def write(comparison: ComparedRuns, folder: Path) -> Path:
    """Writes the table in all formats into a folder, then the figures and the page; returns the
    page's path. Raises ``UserError``, ``NotDerivedError`` where the table is there.
    """
    from genie_sim.analysis.figures import save_all

    if any((folder / about).exists() for about in ("run.json", seed_runs.SWEEP_FILE)):
        raise UserError(f"{folder}: a result is in that folder, with figures; say where else")
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for name, suffix in renderers.FORMATS.items():
        renderers.write(folder / f"table{suffix}", compare_tables.text(comparison, name), name)
    drawn: dict[str, Figure] = {}
    with folders.derived(folder) as attempt:
        with attempt("figures"):
            drawn = figures(comparison)
            save_all(drawn, provenance.contained(folder, "figures"), ("svg", "png"))
        with attempt(PAGE):
            template.write(folder / PAGE, page(comparison, drawn))
    return folder / PAGE
