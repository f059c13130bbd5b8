"""The figures of a run, or of several seeds, by name: ``run.plot.latency_cdf()``."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.style import SAME_COLOUR
from genie_sim.base.errors import Suggesting, UserError
from genie_sim.record.results import MethodInfo, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Plots(Suggesting):
    """Each method gives a matplotlib ``Figure``, which is imported only then; with ``ax`` it draws
    into that panel of yours and gives its figure. Of several seeds, figures show means with 95 %
    intervals. Curves and points of several runs in one panel are named by their runs' labels.
    """

    _run: Run | SeedRuns

    def latency_cdf(self, of: str = "published", *, ax: "Axes | None" = None) -> "Figure":
        """Distribution of response times, as shares of the ``published`` or of the ``answered``
        frames.
        """
        from genie_sim.analysis.latency_cdf import latency_cdf

        panels = {self._run.title: self._tables("frames")}
        with self._beside(ax) as methods:
            return latency_cdf(panels, methods, self._run.footer, of=of, ax=ax)

    def latency_accuracy(self, *, ax: "Axes | None" = None) -> "Figure":
        """Mean time to first answer against streaming F1, or against the proxy where the truth is
        not known. Raises ``UserError`` where neither is known.
        """
        from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy

        numbers = {self._run.title: self._run.measured}
        if drawable(numbers) is None:
            raise UserError("latency_accuracy: the run has no accuracy: its scenario records none")
        with self._beside(ax) as methods:
            return latency_accuracy(numbers, methods, self._run.footer, ax=ax)

    def time_parts(self) -> "Figure":
        """Where the time of answers goes; it has two panels, and a figure of its own."""
        from genie_sim.analysis.breakdown import parts_of, time_parts

        if not parts_of(self._run.measured, self._run.methods):
            raise UserError("time_parts: the run has no steps: its scenario does not record them")
        return time_parts(self._run.measured, self._run.methods, self._run.footer)

    def image_reuse(self, *, ax: "Axes | None" = None) -> "Figure":
        """Hits / requests of the message caches, on cars and on edges."""
        return self._bars("image_reuse", ax)

    def object_reuse(self, *, ax: "Axes | None" = None) -> "Figure":
        """Object look-ups answered by an object with C >= C_T, on cars and on edges."""
        return self._bars("object_reuse", ax)

    def confidence_boost(self, *, ax: "Axes | None" = None) -> "Figure":
        """Confidence added so far by the object maps, over the objects that they then store."""
        with self._beside(ax) as methods:
            return self._of_lookups("confidence_boost", methods, ax)

    def resource_use(self) -> "Figure":
        """Utilization of the busiest devices and links; it has a figure of its own."""
        from genie_sim.analysis.figures import resource_use

        return resource_use(self._run.measured, self._run.methods, self._run.footer)

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
        from genie_sim.analysis.registry import METRICS, unknown_metric

        known = dict.fromkeys((*METRICS, *(metric.metric for metric in self._run.measured)))
        if name not in known:
            raise UserError(f"metric: {unknown_metric(name, known)}")
        run = self._run
        return metric_values(name, run.measured, run.methods, run.footer, ax=ax)

    def _bars(self, name: str, ax: "Axes | None") -> "Figure":
        if ax is not None and _drawn_in(ax):
            raise UserError(f"{name}: bars of two runs need a panel each")
        with self._beside(ax) as methods:
            return self._of_lookups(name, methods, ax)

    def _of_lookups(self, name: str, methods: Sequence[MethodInfo], ax: "Axes | None") -> "Figure":
        from genie_sim.analysis import figures

        draw: Any = getattr(figures, name)
        panels = {self._run.title: self._tables("lookups")}
        figure: Figure = draw(panels, methods, self._run.footer, ax=ax)
        return figure

    @contextmanager
    def _beside(self, ax: "Axes | None") -> Iterator[Sequence[MethodInfo]]:
        """The methods to draw within, into ``ax`` beside those of runs that it holds: these come
        first, as often as a colour has dashes, so that no two have one colour. Afterwards all are
        named by their runs.
        """
        if ax is None:
            yield self._run.methods
            return
        from genie_sim.analysis.drawing import finish_axes
        from genie_sim.analysis.latency_cdf import DEADLINE_LABEL, FRESH_LABEL

        drawn = _drawn_in(ax)
        before = ax.get_legend_handles_labels()[0]
        earlier = [
            replace(method, name=f"{number} {place}: {method.name}")
            for number, part in enumerate(drawn)
            for method in part.run.methods
            for place in range(SAME_COLOUR)
        ]
        yield [*earlier, *self._run.methods]
        labels = {
            handle: label
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
            if handle not in before and label not in (DEADLINE_LABEL, FRESH_LABEL)
        }
        drawn.append(_Drawn(self._run, labels))
        names = _names([part.run for part in drawn])
        if len(set(names)) > 1:
            for name, part in zip(names, drawn, strict=True):
                for handle, label in part.labels.items():
                    handle.set_label(f"{name}: {label}")
            finish_axes(ax)

    def _tables(self, name: str) -> list[Any]:
        return [run.tables[name] for run in self._run.runs]


class _Drawn(NamedTuple):
    """A run in a panel, and its labels there by what they name."""

    run: Run | SeedRuns
    labels: Mapping[Any, str]


def _drawn_in(ax: "Axes") -> list[_Drawn]:
    """The runs in a panel; none where it was cleared since."""
    drawn: list[_Drawn] = vars(ax).setdefault("genie_sim_runs", [])
    there = ax.get_legend_handles_labels()[0]
    drawn[:] = [part for part in drawn if any(handle in there for handle in part.labels)]
    return drawn


def _names(runs: Sequence[Run | SeedRuns]) -> list[str]:
    """What runs in one panel are called: by their titles, with their ids where two have one."""
    ids = {run.runs[0].run_id: run.title for run in runs}
    apart = len(set(ids.values())) == len(ids)
    return [run.title if apart else f"{run.title} {run.runs[0].run_id[:6]}" for run in runs]
