"""One figure: the values of one metric, with their intervals."""

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import (
    MAX_COLUMN_IN,
    finish,
    in_style,
    is_narrow,
    line_in,
    logarithmic_x,
    one_panel,
)
from genie_sim.analysis.registry import (
    component_title,
    definition,
    is_drawn_logarithmically,
)
from genie_sim.base.errors import UserError
from genie_sim.record.results import MethodInfo, MetricValue

BELOW_IN = 0.55  # of the panel: ticks and label

MANY_TICKS = 100  # a logarithmic axis over more than that has a tick for each power of ten alone


@in_style()
def metric_values(
    name: str,
    metrics: Sequence[MetricValue],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """A point with its interval for each method, and for each placement or component of which the
    metric is. Raises ``UserError`` where there is no value, or more than there is room for.

    Parameters
    ----------
    name : str
        The metric.
    metrics : sequence of MetricValue
        The numbers of a run.
    methods : sequence of MethodInfo
        Those that are drawn, the first at the top.
    footer : str
        Names the run.
    width_in : float, optional
        The figure's width in inches; by default a column's.
    ax : Axes, optional
        Where to draw; by default in a figure of its own.
    """
    rows = _rows(name, metrics, methods)
    if not rows:
        raise UserError(f"{name}: these results have no value of it")
    about = definition(name)
    titles = {method.name: method.title for method in methods}
    names = []
    for row in rows:
        whole = about.titled(row.placement, component_title(row.component, methods))
        text = f"{titles[row.method]} {whole.removeprefix(about.title).strip(' ,')}"
        names.append("\n".join(textwrap.wrap(text, style.TITLE_CHARACTERS)))
    lines = sum(label.count("\n") + 1 for label in names)
    height_in = BELOW_IN + 1.15 * lines * line_in("ytick.labelsize")
    if ax is None and height_in > MAX_COLUMN_IN and is_narrow(width_in or style.COLUMN_IN):
        raise UserError(
            f"{name}: {len(rows)} values are too many for a column: name fewer with --methods, or "
            "draw them on a page with --width page"
        )
    figure, axis = one_panel(width_in or style.COLUMN_IN, height_in, ax)
    styles = dict(zip(titles, style.method_styles(list(titles)), strict=True))
    ends = []
    for number, row in enumerate(rows):
        value, low, high = (
            None if end is None else about.factor * end for end in (row.value, row.low, row.high)
        )
        assert value is not None
        reach = None
        if low is not None and high is not None:
            reach = [[max(value - low, 0.0)], [max(high - value, 0.0)]]
        axis.errorbar(
            value,
            number,
            xerr=reach,
            color=style.method_colour(styles[row.method]),
            marker=style.method_marker(styles[row.method]),
            markersize=4,
            capsize=2.5,
            linestyle="",
        )
        ends += [end for end in (value, low, high) if end is not None]
    if is_drawn_logarithmically(name, ends):
        axis.set_xscale("log")
        low, high = 0.8 * min(ends), 1.25 * max(ends)
        logarithmic_x(axis, low, high, (1, 2, 5) if high < MANY_TICKS * low else (1,))
    elif min(ends) >= 0:
        axis.set_xlim(0, 1.08 * max(ends) or 1.0)
    axis.set_yticks(range(len(rows)), names)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.grid(axis="y", visible=False)
    better = "" if not about.better else f", {about.better} is better"
    axis.set_xlabel(f"{about.label}{better}")
    if ax is None:
        finish(figure, f"{about.title}, with intervals", footer)
    return figure


def _rows(
    name: str, metrics: Sequence[MetricValue], methods: Sequence[MethodInfo]
) -> list[MetricValue]:
    """The values of the metric, method by method: those of the whole method where it has them, else
    by placement or component.
    """
    defined = [metric for metric in metrics if metric.metric == name and metric.value is not None]
    whole = [metric for metric in defined if (metric.placement, metric.component) == ("all", "")]
    by_place = [metric for metric in defined if not metric.component]
    chosen = whole or by_place or defined
    return [metric for method in methods for metric in chosen if metric.method == method.name]
