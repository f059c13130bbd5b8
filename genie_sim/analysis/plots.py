"""The figures of a run, or of several seeds, by name: ``run.plot.latency_cdf()``."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.base.errors import UserError, unknown
from genie_sim.record.results import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Plots:
    """Each method gives a matplotlib ``Figure``, which is imported only then; with ``ax`` it draws
    into that panel of yours and gives its figure. Of several seeds, figures show means with 95 %
    intervals.
    """

    _run: Run | SeedRuns

    def latency_cdf(self, of: str = "published", *, ax: "Axes | None" = None) -> "Figure":
        """Distribution of response times, as shares of the ``published`` or of the ``answered``
        frames.
        """
        from genie_sim.analysis.latency_cdf import latency_cdf

        panels = {self._run.title: self._tables("frames")}
        return latency_cdf(panels, self._run.methods, self._run.footer, of=of, ax=ax)

    def latency_accuracy(self, *, ax: "Axes | None" = None) -> "Figure":
        """Mean time to first answer against streaming F1, or against the proxy where the truth is
        not known. Raises ``UserError`` where neither is known.
        """
        from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy

        numbers = {self._run.title: self._run.measured}
        if drawable(numbers) is None:
            raise UserError("latency_accuracy: the run has no accuracy: its scenario records none")
        return latency_accuracy(numbers, self._run.methods, self._run.footer, ax=ax)

    def time_parts(self) -> "Figure":
        """Where the time of answers goes; it has two panels, and a figure of its own."""
        from genie_sim.analysis.breakdown import parts_of, time_parts

        if not parts_of(self._run.measured, self._run.methods):
            raise UserError("time_parts: the run has no steps: its scenario does not record them")
        return time_parts(self._run.measured, self._run.methods, self._run.footer)

    def image_reuse(self, *, ax: "Axes | None" = None) -> "Figure":
        """Hits / requests of the message caches, on cars and on edges."""
        return self._of_lookups("image_reuse", ax)

    def object_reuse(self, *, ax: "Axes | None" = None) -> "Figure":
        """Object look-ups answered by an object with C >= C_T, on cars and on edges."""
        return self._of_lookups("object_reuse", ax)

    def confidence_boost(self, *, ax: "Axes | None" = None) -> "Figure":
        """Running mean of C_new - C_old over the updates of the object maps."""
        return self._of_lookups("confidence_boost", ax)

    def resource_use(
        self,
        *,
        ax: "Axes | None" = None,
        kind: str = "accelerator",
        method: str | None = None,
    ) -> "Figure":
        """Use of devices and links, and queues, over simulated time. Into a panel of yours goes one
        ``kind`` (accelerator, cpu, link or queue) under one ``method``, by default the last.
        """
        from genie_sim.analysis import figures

        names = [method.name for method in self._run.methods]
        chosen = names[-1] if method is None else method
        if chosen not in names:
            raise UserError(f"resource_use: {unknown('method', chosen, names)}")
        if kind not in figures.RESOURCE_KINDS:
            raise UserError(f"resource_use: {unknown('kind', kind, figures.RESOURCE_KINDS)}")
        resources = self._tables("resources")
        if ax is not None:
            return figures.resource_panel(resources, kind, chosen, ax=ax)
        return figures.resource_use(resources, self._run.methods, self._run.footer)

    def differences(self) -> "Figure":
        """Paired differences of the methods from the first one, with intervals and a line at
        zero.
        """
        from genie_sim.analysis.compare import compare
        from genie_sim.analysis.difference_plot import differences

        return differences(compare([self._run]), self._run.footer)

    def metric(self, name: str, *, ax: "Axes | None" = None) -> "Figure":
        """The values of a metric of ``genie-sim list metrics``, or of your own, under each method,
        with their intervals. Raises ``UserError`` where the run has none.
        """
        from genie_sim.analysis.metric_plot import metric_values
        from genie_sim.analysis.registry import METRICS

        known = dict.fromkeys((*METRICS, *(metric.metric for metric in self._run.measured)))
        if name not in known:
            raise UserError(f"metric: {unknown('metric', name, known)}")
        run = self._run
        return metric_values(name, run.measured, run.methods, run.footer, ax=ax)

    def _of_lookups(self, name: str, ax: "Axes | None") -> "Figure":
        from genie_sim.analysis import figures

        draw: Any = getattr(figures, name)
        panels = {self._run.title: self._tables("lookups")}
        figure: Figure = draw(panels, self._run.methods, self._run.footer, ax=ax)
        return figure

    def _tables(self, name: str) -> list[Any]:
        return [run.tables[name] for run in self._run.runs]
