"""Figures and tables of results of every kind, for a paper.

A result folder is that of a run, of several seeds, of a sweep or of the evaluation; several folders
are a comparison.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import compare_tables, renderers, summary
from genie_sim.analysis import figures as of_runs
from genie_sim.analysis.compare import ComparedRuns, compare
from genie_sim.analysis.seed_runs import ABOUT, is_seeds_folder, load, with_methods
from genie_sim.analysis.style import PAGE_IN, WIDTHS
from genie_sim.base.errors import UserError
from genie_sim.record import provenance
from genie_sim.report import comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EVALUATION = "verdicts.json"  # a file that only an evaluation has


def figures(
    folders: Sequence[Path], width: str | None = None, allow_changed: bool = False
) -> "dict[str, Figure]":
    """The figures of results, by name, as wide as one of ``style.WIDTHS``; by default as fits each.
    Raises ``UserError``.
    """
    from genie_sim.study.sweep_table import SweepPlots

    width_in = None if width is None else WIDTHS[width]
    if len(folders) > 1:
        return comparison.figures(_compared(folders, allow_changed), width_in)
    (folder,) = folders
    if _is_evaluation(folder):
        from genie_sim.paper import paper_figures

        return paper_figures.of_evaluation(folder, width_in, allow_changed)
    if _is_sweep(folder):
        return SweepPlots.read(folder, allow_changed).figures(width_in or PAGE_IN)
    run = load(folder, allow_changed=allow_changed)
    with provenance.of_this_version(folder):
        return of_runs.of_run(run, width_in)


def table(
    folders: Sequence[Path],
    format: str,
    methods: Sequence[str] = (),
    allow_changed: bool = False,
    metrics: Sequence[str] = (),
) -> str:
    """The numbers of results in one of ``renderers.FORMATS``, of all ``methods`` or of these in
    this order; of a run all rows or those of these ``metrics``. Raises ``UserError``.
    """
    from genie_sim.paper import verdict_table
    from genie_sim.study import printed

    renderers.checked(format)
    if metrics and (len(folders) > 1 or _is_evaluation(folders[0]) or _is_sweep(folders[0])):
        raise UserError("--metrics: chooses the rows of one run, or of several seeds of it")
    if len(folders) > 1:
        return compare_tables.text(_compared(folders, allow_changed, methods), format)
    (folder,) = folders
    if _is_evaluation(folder):
        if methods:
            raise UserError(f"--methods: {folder} is an evaluation: its table is one of claims")
        return verdict_table.printed(provenance.read_json(folder / EVALUATION), format)
    if _is_sweep(folder):
        return printed.table_of(folder, format, methods, allow_changed)
    run = with_methods(load(folder, allow_changed=allow_changed), methods)
    with provenance.of_this_version(folder):
        return summary.table(run, format, metrics)


def _compared(
    folders: Sequence[Path], allow_changed: bool, methods: Sequence[str] = ()
) -> ComparedRuns:
    return compare([load(folder, allow_changed=allow_changed) for folder in folders], methods)


def _is_evaluation(folder: Path) -> bool:
    return (folder / EVALUATION).is_file()


def _is_sweep(folder: Path) -> bool:
    return (folder / ABOUT).is_file() and not is_seeds_folder(folder)
