"""One figure: how early the first answers come, versus how right they are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, finish_axes, in_style, logarithmic_x, one_panel
from genie_sim.analysis.metric import ZERO_DELAY
from genie_sim.analysis.registry import METRICS, component_title, title_of
from genie_sim.record.results import MethodInfo, MetricValue

LATENCY = "first_answer_mean"
ACCURACIES = ("streaming_f1", "first_proxy_f1")  # the first of them that every run has is drawn
Numbers = Mapping[str, Sequence[MetricValue]]


def drawable(runs: Numbers) -> str | None:
    """Which accuracy these runs have in common; ``None`` where there is none."""
    defined = [
        {metric.metric for metric in metrics if metric.value is not None}
        for metrics in runs.values()
    ]
    for accuracy in ACCURACIES:
        if all({accuracy, LATENCY} <= names for names in defined):
            return accuracy
    return None


@in_style()
def latency_accuracy(
    runs: Numbers,
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """A point per run and method, with the intervals of both; up and to the left is better.

    ``runs``: metrics by label. Streaming F1 where every run has it, else the proxy; the dotted line
    is the zero-delay detector. ``ax`` is a panel of the user's own to draw into. Raises
    ValueError where the runs have no accuracy in common.
    """
    accuracy = drawable(runs)
    if accuracy is None:
        raise ValueError("runs without a common accuracy")
    figure, axis = one_panel(width_in or style.COLUMN_IN, 2.1, ax)
    styles = style.method_styles([method.name for method in methods])
    for number, (label, metrics) in enumerate(runs.items()):
        numbers = {
            (metric.metric, metric.method, metric.component): metric
            for metric in metrics
            if metric.placement == "all" and metric.value is not None
        }
        for style_number, method in zip(styles, methods, strict=True):
            x = numbers.get((LATENCY, method.name, ""))
            y = numbers.get((accuracy, method.name, ""))
            if x is not None and y is not None:
                name = method.title if len(runs) == 1 else f"{label}: {method.title}"
                marker = style.method_marker(number if len(runs) > 1 else style_number)
                colour = style.method_colour(style_number)
                _draw_point(axis, x, y, label=name, color=colour, marker=marker)
        bounds = [
            metric.value
            for (name, _, component), metric in numbers.items()
            if (name, component) == (accuracy, ZERO_DELAY) and metric.value is not None
        ]
        if bounds:
            line: dict[str, Any] = {"color": "0.4", "linewidth": 0.9, "linestyle": ":"}
            axis.axhline(bounds[0], label=component_title(ZERO_DELAY), **line)
    axis.set_xscale("log")
    logarithmic_x(axis, *axis.get_xlim())
    axis.set_ylim(0, 1.02)
    axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    axis.set_xlabel(f"{METRICS[LATENCY].label}, logarithmic")
    axis.set_ylabel(title_of(accuracy))
    if ax is not None:
        finish_axes(ax)
        return figure
    title = f"Accuracy versus latency: {title_of(accuracy)}, with 95 % intervals"
    finish(figure, title, footer, [axis])
    return figure


def _draw_point(axis: Axes, x: MetricValue, y: MetricValue, **drawing: Any) -> None:
    """A mark at the values of two metrics, with a bar along each axis for its interval."""
    assert x.value is not None and y.value is not None
    axis.errorbar(
        x.value, y.value, xerr=_reach(x), yerr=_reach(y), linestyle="", capsize=2, **drawing
    )


def _reach(metric: MetricValue) -> np.ndarray[tuple[int, int], np.dtype[np.float64]] | None:
    """How far the interval reaches below and above the value."""
    if metric.value is None or metric.low is None or metric.high is None:
        return None
    return np.array([[max(metric.value - metric.low, 0.0)], [max(metric.high - metric.value, 0.0)]])
