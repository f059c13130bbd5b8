"""Results under one protocol, whether of a run, of several seeds, of a sweep or of the evaluation;
and several of them, compared.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeVar

from genie_sim.analysis import registry
from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import expanded
from genie_sim.base.progress import Progress
from genie_sim.base.python_values import typed
from genie_sim.record.results import Run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from genie_sim.analysis.compare import Comparable, ComparedRuns

Value = TypeVar("Value")


class Result(ABC):
    """What a result folder holds: its numbers, figures, tables and page."""

    folder: Path | None

    @classmethod
    @abstractmethod
    def read(cls, folder: Path) -> Self:
        """That of a folder. Raises ``UserError`` for one that is not whole, that another version
        wrote, or of which files were changed since.
        """

    @property
    @abstractmethod
    def metrics(self) -> "pd.DataFrame":
        """One row a number: what it is of, and the columns of ``MetricValue``."""

    @property
    @abstractmethod
    def cells(self) -> Mapping[str, Mapping[int, Run]]:
        """By its name each setting that was simulated, as runs by seed; one that is all there is
        has no name.
        """

    @abstractmethod
    def chosen(self, methods: Sequence[str] = (), label: str = "") -> "Result":
        """The same of these methods alone, in this order (none: all), called by this label (empty:
        by its own). Raises ``UserError`` for a method that is not there.
        """

    @abstractmethod
    def figures(self, width_in: float | None = None) -> "Mapping[str, Figure]":
        """Every figure by its name, so wide if that is given. Raises ``UserError``."""

    def figure(self, name: str, width_in: float | None = None) -> "Figure":
        """One figure. Raises ``UserError``."""
        return named(name, self.figures(width_in), has_metrics=False)

    @abstractmethod
    def text(self, format: str = "markdown", metrics: Sequence[str] = ()) -> str:
        """The numbers in one of ``renderers.FORMATS``, of the main metrics or of these; ``csv`` has
        all digits, and by default every metric. Raises ``UserError``.
        """

    @abstractmethod
    def page(self) -> str:
        """The text of a page for a browser. Raises ``UserError``."""

    @abstractmethod
    def rerun(self, progress: Progress | None = None) -> Iterator[str]:
        """Simulates everything in the folder again, and tells what reproduces, line by line. Raises
        ``UserError`` for what does not, and without a folder.
        """

    @typed
    def report(self, path: str | Path | None = None) -> Path:
        """Writes the page; default: ``report.html`` in the folder. Raises ``UserError``."""
        if path is None and self.folder is None:
            raise UserError(
                "report: a result without a folder needs a path, such as .report('report.html')"
            )
        from genie_sim.report import template

        where = (self.folder or Path()) / template.NAME if path is None else expanded(path)
        template.PAGE.check(where)  # before anything is drawn
        template.write(where, self.page())
        return where

    def compare(self, methods: Sequence[str] = ()) -> "Comparison":
        """The paired differences between the methods, seed by seed."""
        return Comparison([self], methods)


class Comparison:
    """Results compared: ``table`` and ``settings`` for pandas, ``text()``, figures and a page. Runs
    that differ in nothing but the seed are one result.

    Parameters
    ----------
    results : sequence of Comparable
        What is compared; the first is what the others are compared with. Of one alone, see
        ``analysis.compare.compare``.
    methods : sequence of str
        Which, in this order; by default all.
    labels : sequence of str
        What the results are called, in their order; by default as they are.
    metrics : sequence of str
        Which; by default those that matter most.
    """

    def __init__(
        self,
        results: "Sequence[Comparable]",
        methods: Sequence[str] = (),
        labels: Sequence[str] = (),
        metrics: Sequence[str] = (),
    ) -> None:
        self._results, self._methods, self._labels = results, methods, labels
        self._metrics = metrics

    def __repr__(self) -> str:
        return f"<Comparison of {', '.join(self.compared.names)}: {len(self.table):,} rows>"

    @cached_property
    def compared(self) -> "ComparedRuns":
        """What the tables show. Raises ``UserError`` for results that cannot be compared."""
        return self._of(self._metrics)

    def _of(self, metrics: Sequence[str]) -> "ComparedRuns":
        from genie_sim.analysis.compare import compare

        if metrics:
            cells = [cell for result in self._results for cell in result.cells.values()]
            runs = [run for by_seed in cells for run in by_seed.values()]
            registry.checked(metrics, (row.metric for run in runs for row in run.measured))
        return compare(self._results, self._methods, self._labels, metrics)

    @cached_property
    def table(self) -> "pd.DataFrame":
        """One row a number, and one a difference; see ``analysis.compare_tables.tidy_rows``."""
        import pandas as pd

        from genie_sim.analysis import compare_tables

        return pd.DataFrame(compare_tables.tidy_rows(self.compared), columns=compare_tables.FIELDS)

    @cached_property
    def settings(self) -> "pd.DataFrame":
        """What differs: a row per setting, a column per result."""
        import pandas as pd

        settings, names = dict(self.compared.settings), list(self.compared.names)
        return pd.DataFrame.from_dict(settings, orient="index", columns=names)

    @property
    def verdicts(self) -> list[str]:
        """A sentence for each arm that is compared with another: in what it is better or worse, by
        how much, and how sure that is.
        """
        from genie_sim.analysis.verdict import verdicts

        return verdicts(self.compared)

    def figures(self, width_in: float | None = None) -> "Mapping[str, Figure]":
        """The differences with their intervals, overlaid distributions of response times, and
        latency against accuracy.
        """
        from genie_sim.report import comparison

        return comparison.figures(self.compared, width_in)

    def figure(self, name: str, width_in: float | None = None) -> "Figure":
        """One figure, or the values of one metric. Raises ``UserError``."""
        from genie_sim.analysis.compare import as_metrics
        from genie_sim.analysis.points import metric_values

        comparison = self.compared
        metrics, methods = as_metrics(comparison, [name])
        if metrics or name in registry.METRICS:
            about = methods, comparison.by, width_in
            return metric_values(name, metrics, *about, own=comparison.words)
        return named(name, self.figures(width_in))

    def text(self, format: str = "markdown", metrics: Sequence[str] = ()) -> str:
        """The table as ``markdown``, ``csv`` or ``latex``."""
        from genie_sim.analysis import compare_tables

        return compare_tables.text(self._of(metrics) if metrics else self.compared, format)

    @typed
    def report(self, folder: str | Path) -> Path:
        """Writes a page, figures and tables into a folder."""
        from genie_sim.report import comparison

        return comparison.write(self.compared, expanded(folder))

    def _repr_html_(self) -> str:
        from genie_sim.analysis import compare_tables, renderers

        table, notes = compare_tables.pairs(self.compared), [compare_tables.about(self.compared)]
        return renderers.html(replace(table, title=" ".join(self.verdicts), notes=notes))


def named(name: str, known: Mapping[str, Value], *, has_metrics: bool = True) -> Value:
    """What goes by this name. Raises ``UserError`` where no figure does."""
    if name not in known:
        text = unknown("figure", name, known)
        if has_metrics:
            near = "".join(f", such as {metric}" for metric in registry.near(name)[:1])
            text += f"; or a metric of 'genie-sim list metrics'{near}"
        raise UserError(text)
    return known[name]
