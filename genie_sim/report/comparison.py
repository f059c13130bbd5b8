"""A comparison as figures, and as a folder of them with tables and a page."""

from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import compare_tables, renderers
from genie_sim.analysis.compare import ComparedRuns, as_metrics
from genie_sim.base.errors import UserError
from genie_sim.base.paths import usable
from genie_sim.record import folders, provenance
from genie_sim.record.columns import Columns, concat
from genie_sim.record.results import NOT_ONE_RUN
from genie_sim.report import pages, template

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
    if any(row.difference is not None for row in comparison.rows):
        drawn["differences"] = differences(comparison, comparison.by, width_in)
    if frames:
        seeds = [concat(of_seed) for of_seed in frames.values()]
        drawn["latency_cdf"] = latency_cdf(seeds, *about)
    if drawable(metrics):
        drawn["latency_accuracy"] = latency_accuracy(metrics, *about)
    return drawn


def write(comparison: ComparedRuns, folder: Path) -> Path:
    """Writes the table in all formats into a folder, then the figures and the page; returns the
    page's path. Raises ``UserError``, ``NotDerivedError`` where the table is there.
    """
    from genie_sim.analysis.figures import save_all

    if any((folder / about).exists() for about in ("run.json", *NOT_ONE_RUN)):
        raise UserError(f"{folder}: a result is in that folder, with figures; say where else")
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for name, suffix in renderers.FORMATS.items():
        renderers.write(folder / f"table{suffix}", compare_tables.text(comparison, name), name)
    drawn: dict[str, Figure] = {}
    page = folder / "compare.html"
    with folders.derived(folder) as attempt:
        with attempt("figures"):
            drawn = figures(comparison)
            save_all(drawn, provenance.contained(folder, "figures"), ("svg", "png"))
        with attempt(page.name):
            template.write(page, pages.of_comparison(comparison, drawn))
    return page
