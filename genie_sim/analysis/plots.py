"""The figures of a run, or of several seeds, by name: ``run.plot.latency_cdf()``."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.style import RUN_FIGURES
from genie_sim.base.errors import UserError, no_attribute
from genie_sim.record.results import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Plots:
    """Each figure that ``genie-sim figures`` draws, by its name: ``latency_cdf()``, and so on
    (``dir`` has them all). It is a matplotlib ``Figure``; with ``ax`` it is drawn into that panel
    of yours, unless it has several (``differences``). Of several seeds, figures
    show means with 95 % intervals.
    """

    _run: Run | SeedRuns

    def __getattr__(self, name: str) -> "Callable[..., Figure]":
        if name not in RUN_FIGURES:
            raise no_attribute(self, name)
        return partial(self._draw, name)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *RUN_FIGURES]

    def _draw(self, name: str, **panel: "Axes | None") -> "Figure":
        from genie_sim.analysis.figures import makers  # imports matplotlib

        known = makers(self._run)
        if name not in known:
            raise UserError(
                f"{name}: these results have nothing that it shows; known: {', '.join(known)}"
            )
        return known[name](**panel)

    def metric(self, name: str, *, ax: "Axes | None" = None) -> "Figure":
        """The values of a metric of ``genie-sim list metrics``, or of your own, under each method,
        with their intervals. Raises ``UserError`` where the run has none.
        """
        from genie_sim.analysis.points import metric_values
        from genie_sim.analysis.registry import METRICS, unknown_metric

        run = self._run
        known = dict.fromkeys((*METRICS, *(metric.metric for metric in run.measured)))
        if name not in known:
            raise UserError(f"metric: {unknown_metric(name, known)}")
        return metric_values(name, run.measured, run.methods, run.footer, own=run.words, ax=ax)
