"""The four kinds of results, as they are read from their folders."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from genie_sim.analysis import seed_runs
from genie_sim.analysis.registry import METRICS
from genie_sim.analysis.seed_runs import SeedRuns, with_methods
from genie_sim.base.errors import Suggesting, UserError
from genie_sim.base.progress import Progress
from genie_sim.record import provenance, results
from genie_sim.report.result import Comparison, Result, named

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from genie_sim.scenario.scenario import Scenario


class _OfRuns(Result):
    """What one run and several seeds have in common."""

    @cached_property
    def metrics(self) -> "pd.DataFrame":
        """One row per metric: metric, method, placement, component, value, unit, low, high, n; see
        ``MetricValue``. Of several seeds ``value`` is the mean, ``low`` and ``high`` the ends of
        its 95 % t interval, and ``n`` the number of runs that define it.
        """
        import pandas as pd

        return pd.DataFrame(self._self.measured, columns=results.METRIC_FIELDS)

    @property
    def _self(self) -> "Run | Runs":
        assert isinstance(self, Run | Runs)
        return self

    def table(self) -> "pd.DataFrame":
        """The values of ``metrics`` with a column a method, and a row for each metric, placement
        and component, in the order of the metrics and methods.
        """
        index = ["metric", "placement", "component"]
        wide = self.metrics.pivot(index=index, columns="method", values="value")
        places = self.metrics[index].drop_duplicates().itertuples(index=False, name=None)
        names = [method.name for method in self._self.methods]
        return wide.reindex(index=list(places), columns=names)

    def chosen(self, methods: Sequence[str] = (), label: str = "") -> "Run | Runs":
        """See ``Result``. Tables stay as they are."""
        chosen = with_methods(replace(self._self, label=label or self._self.label), methods)
        assert isinstance(chosen, Run | Runs)
        return chosen

    def figures(self, width_in: float | None = None) -> "Mapping[str, Figure]":
        """Those of ``analysis.figures``, and of a run of the paper those of its panels."""
        with provenance.of_this_version(self.folder):
            from genie_sim.analysis import figures as of_runs
            from genie_sim.paper import figures as of_paper

            return of_runs.of_run(self._self, width_in) | of_paper.of_run(self._self, width_in)

    def figure(
        self, name: str, width_in: float | None = None, *, ax: "Axes | None" = None
    ) -> "Figure":
        """One figure, or the values of one metric; with ``ax``, drawn into that panel of yours."""
        with provenance.of_this_version(self.folder):
            from genie_sim.analysis import figures as of_runs
            from genie_sim.analysis.points import metric_values
            from genie_sim.paper import figures as of_paper

            run = self._self
            if ax is not None and name.startswith(("differences", of_paper.PREFIX)):
                raise UserError(f"ax: {name} has panels of its own")
            makers = of_runs.makers(run, width_in)
            if name.startswith(of_paper.PREFIX):
                drawn = of_paper.of_run(run, width_in)
                if name in drawn:
                    return drawn[name]
            if name not in makers and name in {*METRICS, *(row.metric for row in run.measured)}:
                shown = run.measured, run.methods, run.footer, width_in
                return metric_values(name, *shown, own=run.words, ax=ax)
            draw = named(name, makers)
            return draw() if ax is None else draw(ax=ax)

    def text(self, format: str = "markdown", metrics: Sequence[str] = ()) -> str:
        """See ``Result``."""
        from genie_sim.analysis import summary

        with provenance.of_this_version(self.folder):
            return summary.table(self._self, format, metrics)

    def _repr_html_(self) -> str:
        from genie_sim.analysis import renderers, screen, summary

        run = self._self
        table, notes = summary.main_table(run), [summary.about_intervals(run)]
        return renderers.html(replace(table, title=screen.header(run), notes=notes))


@dataclass(frozen=True, eq=False, repr=False)
class Run(results.Run, _OfRuns):
    """A finished run in hand: its tables (see ``record.results.Run``), metrics, figures and
    page.
    """

    @classmethod
    def read(cls, folder: Path) -> "Run":
        """See ``Result``."""
        return cls.of(seed_runs.load_run(folder))

    @classmethod
    def of(cls, run: results.Run) -> "Run":
        """A run, with what this class adds."""
        return cls(**{field.name: getattr(run, field.name) for field in fields(run)})

    @cached_property
    def scenario(self) -> "Scenario":
        """The scenario as it was run."""
        from genie_sim.runs import folder as run_folder

        return run_folder.scenario_of(self.facts, self.name)

    def page(self, start_ns: int = 0) -> str:
        """The text of its page, with a replay from ``start_ns`` on."""
        from genie_sim.analysis import figures as of_runs
        from genie_sim.report import pages

        with provenance.of_this_version(self.folder):
            return pages.of_run(self, of_runs.makers(self), start_ns)

    def rerun(self, progress: Progress | None = None) -> Iterator[str]:
        """A line for each file: ``identical``, ``equal`` or ``DIFFERENT``. Raises ``UserError``."""
        from genie_sim.runs import folder as run_folder

        if self.folder is None:
            raise UserError("rerun: the result has no folder")
        files = run_folder.rerun(self.folder, progress)
        for name, how in files.items():
            yield f"{name}: {how}"
        if run_folder.DIFFERENT in files.values():
            raise UserError(f"{self.folder}: the run does not reproduce its own result")
        how = "byte for byte" if {*files.values()} == {run_folder.IDENTICAL} else "by contents"
        yield f"{self.folder}: reproduced, {how}"


@dataclass(frozen=True, eq=False, repr=False)
class Runs(Suggesting, SeedRuns, _OfRuns):
    """Runs with several seeds in hand. ``runs`` are the single ones; metrics, tables and figures
    are means over them, with 95 % intervals.
    """

    runs: Sequence[Run]

    @classmethod
    def read(cls, folder: Path) -> "Runs":
        """See ``Result``."""
        return cls.of(seed_runs.load_seeds(folder))

    @classmethod
    def of(cls, runs: SeedRuns) -> "Runs":
        """Runs, with what this class adds."""
        return cls([Run.of(run) for run in runs.runs], runs.folder, runs.label)

    @cached_property
    def every_run(self) -> "pd.DataFrame":
        """One row per metric and seed."""
        import pandas as pd

        return pd.concat([run.metrics.assign(seed=run.seed) for run in self.runs])

    def page(self) -> str:
        """The text of the page about all runs."""
        from genie_sim.analysis import figures as of_runs
        from genie_sim.report import pages

        with provenance.of_this_version(self.folder):
            return pages.of_seeds(self, of_runs.makers(self))

    def rerun(self, progress: Progress | None = None) -> Iterator[str]:
        """Those lines of each run."""
        for run in self.runs:
            yield from run.rerun(progress)


def load(folder: Path) -> Result:
    """What a result folder holds. Raises ``UserError`` for any other folder."""
    if seed_runs.is_seeds_folder(folder):  # a sweep without axes
        return Runs.read(folder)
    if (folder / "verdicts.json").is_file():
        from genie_sim.paper.reproduce import Reproduction

        return Reproduction.read(folder)
    if (folder / seed_runs.SWEEP_FILE).is_file():
        from genie_sim.study.sweep import Sweep

        return Sweep.read(folder)
    return Run.read(folder)


def shown(
    folders: Sequence[Path], methods: Sequence[str], labels: Sequence[str]
) -> Result | Comparison:
    """What result folders hold, of these methods and called by these labels; several compared.
    Raises ``UserError``.
    """
    loaded = [load(folder) for folder in folders]
    if len(loaded) > 1:
        return Comparison(loaded, methods, labels)
    if len(labels) > 1:
        raise UserError(f"labels: {len(labels)} labels for one result")
    label = results.checked_label(labels[0], "--label") if labels else ""
    return loaded[0].chosen(methods, label)
