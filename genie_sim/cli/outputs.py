"""Figures and tables of results of every kind, for a paper."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import compare_tables, registry, renderers, summary
from genie_sim.analysis.compare import ComparedRuns, compare
from genie_sim.analysis.seed_runs import ABOUT, SeedRuns, is_seeds_folder, load, with_methods
from genie_sim.analysis.side_by_side import side_by_side
from genie_sim.analysis.style import PAGE_IN
from genie_sim.base.errors import UserError, unknown
from genie_sim.record import provenance
from genie_sim.record.results import Run, checked_label
from genie_sim.report import comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from genie_sim.study.sweep_table import SweepPlots

EVALUATION = "verdicts.json"  # a file that only an evaluation has
IS_EVALUATION = "is an evaluation: its figures and its table are of claims"
IS_SWEEP = "is a sweep, which has the label of 'genie-sim sweep --label'"


@dataclass(frozen=True)
class Results:
    """Result folders of which something is shown. Its methods raise ``UserError``.

    Parameters
    ----------
    folders : sequence of Path
        One of a run, of several seeds, of a sweep or of the evaluation, or several of runs.
    methods : sequence of str
        Only these, in this order; none for all.
    labels : sequence of str
        What the results are called, in their order; none: as they are called.
    allow_changed : bool
        Whether files are read that were changed since.
    """

    folders: Sequence[Path]
    methods: Sequence[str] = ()
    labels: Sequence[str] = ()
    allow_changed: bool = False

    def figures(self, width_in: float | None = None) -> "dict[str, Figure]":
        """Every figure by its name, so wide if that is given; of several runs those of their
        comparison.
        """
        if len(self.folders) > 1:
            return comparison.figures(self._compared(), width_in)
        (folder,) = self.folders
        if self._is_evaluation:
            from genie_sim.paper import figures

            self._refuse("--methods", self.methods, IS_EVALUATION)
            self._refuse("--label", self.labels, IS_EVALUATION)
            return figures.of_evaluation(folder, width_in, self.allow_changed)
        if self._is_sweep:
            self._refuse("--label", self.labels, IS_SWEEP)
            return self._sweep().figures(width_in or PAGE_IN)
        with provenance.of_this_version(folder):
            from genie_sim.analysis import figures as of_runs
            from genie_sim.paper import figures

            run = self._run()
            return of_runs.of_run(run, width_in) | figures.of_run(run, width_in)

    def figure(self, name: str, width_in: float | None = None) -> "Figure":
        """One figure, or the values of one metric; several runs need not be comparable."""
        several = len(self.folders) > 1
        if self._is_sweep:
            self._refuse("--label", self.labels, IS_SWEEP)
            plots = self._sweep()
            if name in {*registry.METRICS, *plots.runs["metric"]} - {*plots.design.axes}:
                return plots.metric(name, width_in or PAGE_IN)
            drawn = plots.figures(width_in or PAGE_IN)
            _check_name(name, drawn)
            return drawn[name]
        if self._is_evaluation or (several and name == "differences"):
            drawn = self.figures(width_in)
            _check_name(name, drawn, has_metrics=not self._is_evaluation)
            return drawn[name]
        from genie_sim.analysis import figures as of_runs
        from genie_sim.analysis.metric_plot import metric_values
        from genie_sim.paper import figures

        with provenance.of_this_version(self.folders[0]):
            runs = [with_methods(run, self.methods) for run in self._loaded()]
            run, footer = side_by_side(runs, self.labels)
            makers = of_runs.makers(run, width_in, footer)
            of_paper = figures.of_run(run, width_in) if name.startswith(figures.PREFIX) else {}
            if name in of_paper:
                return of_paper[name]
            if name not in makers and name in {*registry.METRICS, *_own_metrics(runs)}:
                return metric_values(name, run.measured, run.methods, footer, width_in)
            _check_name(name, makers)
            return makers[name]()

    def table(self, format: str, metrics: Sequence[str] = ()) -> str:
        """The numbers in one of ``renderers.FORMATS``, of all metrics or of these."""
        renderers.checked(format)
        if len(self.folders) > 1:
            return compare_tables.text(self._compared(metrics), format)
        (folder,) = self.folders
        if self._is_evaluation:
            self._refuse("--methods", self.methods, IS_EVALUATION)
            self._refuse("--label", self.labels, IS_EVALUATION)
            self._refuse("--metrics", metrics, IS_EVALUATION)
            from genie_sim.paper import printed as printed_paper

            return printed_paper.table(printed_paper.read_rows(folder), format)
        if self._is_sweep:
            self._refuse("--label", self.labels, IS_SWEEP)
            from genie_sim.study import printed

            return printed.table_of(folder, format, self.methods, metrics, self.allow_changed)
        with provenance.of_this_version(folder):
            return summary.table(self._run(), format, metrics)

    @property
    def _is_evaluation(self) -> bool:
        return len(self.folders) == 1 and (self.folders[0] / EVALUATION).is_file()

    @property
    def _is_sweep(self) -> bool:
        (folder, *others) = self.folders
        return not others and (folder / ABOUT).is_file() and not is_seeds_folder(folder)

    def _loaded(self) -> list[Run | SeedRuns]:
        return [load(folder, allow_changed=self.allow_changed) for folder in self.folders]

    def _run(self) -> Run | SeedRuns:
        """That of the one folder, with the methods and the label that are asked for."""
        (run,) = self._loaded()
        if len(self.labels) > 1:
            raise UserError(f"--label: {len(self.labels)} labels for one result")
        label = checked_label(self.labels[0], "--label") if self.labels else run.label
        return with_methods(replace(run, label=label), self.methods)

    def _compared(self, metrics: Sequence[str] = ()) -> ComparedRuns:
        runs = self._loaded()
        return compare(
            runs, self.methods, self.labels, registry.checked(metrics, _own_metrics(runs))
        )

    def _sweep(self) -> "SweepPlots":
        """What draws a sweep's figures."""
        from genie_sim.study.sweep_table import SweepPlots

        (folder,) = self.folders
        plots = SweepPlots.read(folder, self.allow_changed)
        if not self.methods:
            return plots
        known = list(dict.fromkeys(plots.runs["method"].dropna()))
        for name in self.methods:
            if name not in known:
                raise UserError(f"--methods: {folder}: {unknown('method', name, known)}")
        return replace(plots, runs=plots.runs[plots.runs["method"].isin(self.methods)])

    def _refuse(self, option: str, given: Sequence[str], why: str) -> None:
        """Raises ``UserError`` where the user chose what these results do not let choose."""
        if given:
            raise UserError(f"{option}: {self.folders[0]} {why}")


def _own_metrics(runs: Sequence[Run | SeedRuns]) -> set[str]:
    """Metrics of the user's own that runs have."""
    names = {metric.metric for run in runs for metric in run.measured}
    return names - registry.METRICS.keys()


def _check_name(name: str, known: Iterable[str], has_metrics: bool = True) -> None:
    """Raises ``UserError`` unless it is one of the figures."""
    if name not in known:
        text = unknown("figure", name, known)
        if has_metrics:
            near = "".join(f", such as {metric}" for metric in registry.near(name)[:1])
            text += f"; or a metric of 'genie-sim list metrics'{near}"
        raise UserError(f"--only: {text}")
