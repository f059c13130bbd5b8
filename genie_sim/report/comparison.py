"""A comparison as figures, and as one page for a browser."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.analysis import compare_tables, renderers, summary
from genie_sim.analysis.compare import ComparedRuns, as_metrics, compared
from genie_sim.analysis.result_table import ResultTable
from genie_sim.analysis.seed_runs import SeedRuns, seeds_text
from genie_sim.analysis.style import COLUMN_IN
from genie_sim.analysis.verdict import verdicts
from genie_sim.base.paths import atomic_write
from genie_sim.record import provenance
from genie_sim.record.columns import Columns, concat
from genie_sim.report import html_page
from genie_sim.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = "compare.html"


def figures(comparison: ComparedRuns, width_in: float | None = None) -> "dict[str, Figure]":
    """The paired differences, overlaid distributions of first answers, and accuracy versus latency
    where the arms have an accuracy in common; ``width_in`` wide, if that is given.
    """
    from genie_sim.analysis.difference_plot import differences
    from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy
    from genie_sim.analysis.latency_cdf import latency_cdf

    metrics, methods = as_metrics(comparison)
    frames: dict[int, list[Columns]] = {}  # by seed
    for arm in comparison.arms:
        for seed, run in arm.runs.items():
            if not run.tables:
                continue
            of_method = run.tables["frames"].where(method=arm.method.name)
            frames.setdefault(seed, []).append(of_method.assign(method=arm.label))
    title = " and ".join(comparison.names)
    footer = comparison.by
    drawn = {}
    if frames:
        seeds = [concat(of_seed) for of_seed in frames.values()]
        drawn["latency_cdf"] = latency_cdf({title: seeds}, methods, footer, width_in)
    if any(row.difference is not None for row in comparison.rows):
        drawn = {"differences": differences(comparison, footer, width_in), **drawn}
    if drawable({title: metrics}):
        drawn["latency_accuracy"] = latency_accuracy({title: metrics}, methods, footer, width_in)
    return drawn


def page(comparison: ComparedRuns) -> str:
    """The text of the page; the figures are in it."""
    name = " and ".join(comparison.names)
    data = _page_data(comparison, figures(comparison)) | {
        "origin": "the result folders that were given. "
        "All numbers are in table.csv beside this page."
    }
    return html_page.assemble(
        "compare.html",
        ("compare.js",),
        f"{name}, compared",
        data,
        elsewhere="The numbers are also in table.md and table.csv beside it.",
        pictures="data:",
    )


def seeds_page(runs: SeedRuns) -> str:
    """The text of the page about runs with several seeds: their means, the differences between
    their methods, their figures, and the way to the page of each run. Raises ``UserError``.
    """
    from genie_sim.analysis.figures import of_run

    with provenance.of_this_version(runs.folder):
        comparison = compared([runs])
        drawn = figures(comparison) | of_run(runs)
        means = summary.main_table(runs)
        data = _page_data(comparison, drawn)
        seeds = seeds_text(runs.seeds)
        about = data["about"] | {
            "name": runs.title,
            "description": runs.runs[0].facts["scenario"]["description"],
            "seeds": seeds,
        }
        data |= {
            "about": about,
            "means": {
                "headings": means.headings,
                "rows": means.texts(),
                "note": summary.about_seeds(runs),
            },
            "runs": [
                [f"seed {run.seed}", run.run_id, f"runs/{run.folder.name}/{html_page.NAME}"]
                for run in runs.runs
                if run.folder is not None and (run.folder / html_page.NAME).is_file()
            ],
            "origin": "the runs in the folder 'runs' beside this page.",
        }
        return html_page.assemble(
            "compare.html",
            ("compare.js",),
            f"{runs.title}, {seeds}",
            data,
            elsewhere="The numbers are also in summary.md and table.csv beside it.",
            pictures="data:",
        )


def _page_data(comparison: ComparedRuns, drawn: "Mapping[str, Figure]") -> dict[str, Any]:
    name, table = " and ".join(comparison.names), compare_tables.pairs(comparison)
    return {
        "about": {
            "genie_sim": VERSION,
            "name": name,
            "description": "Runs that saw the same frames, side by side.",
            "names": list(comparison.names),
            "arms": [arm.title for arm in comparison.arms],
            "warning": comparison.warning,
        },
        "methods": [],
        "verdicts": verdicts(comparison),
        "about_rows": compare_tables.about(comparison),
        "headings": table.headings,
        "rows": table.texts(),
        "settings": [[path, *values] for path, values in comparison.settings.items()],
        "figures": _pictures(drawn),
        "means": None,
        "runs": [],
        "notes": [],
    }


def _pictures(drawn: "Mapping[str, Figure]") -> list[dict[str, Any]]:
    return [
        {
            "name": file,
            "title": str(figure.get_label()).partition("\n")[0],
            "wide": bool(figure.get_figwidth() > COLUMN_IN),
            "source": _picture(figure),
        }
        for file, figure in drawn.items()
    ]


def page_of_table(
    table: ResultTable, arms: Sequence[str], about: str, drawn: "Mapping[str, Figure]"
) -> str:
    """The text of a page about one table, whose title is the page's, and its figures: ``about``
    says what it is of, ``arms`` are the titles of the methods.
    """
    data = {
        "about": {
            "genie_sim": VERSION,
            "name": table.title,
            "description": about,
            "names": [],
            "arms": list(arms),
            "warning": "",
        },
        "methods": [],
        "verdicts": [],
        "about_rows": "",
        "headings": ["", *table.headings],
        "rows": table.texts(),
        "settings": [],
        "figures": _pictures(drawn),
        "means": None,
        "runs": [],
        "notes": [],
        "origin": "the runs of the sweep. All numbers are in table.csv beside this page.",
    }
    return html_page.assemble(
        "compare.html",
        ("compare.js",),
        table.title,
        data,
        elsewhere="The numbers are also in table.csv beside it.",
        pictures="data:",
    )


def write(comparison: ComparedRuns, folder: Path) -> Path:
    """Writes the page, the table in all formats and the figures into a folder; returns the page's
    path.
    """
    from genie_sim.analysis.figures import save

    (folder / "figures").mkdir(parents=True, exist_ok=True)
    for name, suffix in renderers.FORMATS.items():
        with atomic_write(folder / f"table{suffix}") as beside:
            beside.write_text(compare_tables.text(comparison, name), encoding="utf-8")
    for name, figure in figures(comparison).items():
        save(figure, folder / "figures", name)
    html_page.write_text(folder / PAGE, page(comparison))
    return folder / PAGE


def _picture(figure: "Figure") -> str:
    from genie_sim.analysis.figures import svg

    return f"data:image/svg+xml;base64,{base64.b64encode(svg(figure)).decode()}"
