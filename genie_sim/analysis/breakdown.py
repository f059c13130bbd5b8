"""One figure: where the time of answers goes."""

import math
import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import NotebookFigure, finish, in_style
from genie_sim.analysis.frame_metrics import PART
from genie_sim.analysis.style import TITLE_CHARACTERS
from genie_sim.base.text import number_text
from genie_sim.record.results import MethodInfo, MetricValue

MAX_BARS = 12  # of both panels together
MAX_SHORT = 0.25  # of the longest bar: one below can hardly be read beside it

Parts = Mapping[str, float]  # mean time [ms] by part


def parts_of(
    metrics: Sequence[MetricValue], methods: Sequence[MethodInfo]
) -> Mapping[str, Mapping[str, float]]:
    """The parts [ms] of the mean first answer under each method, by label, and of the mean fresh
    result where that differs.
    """
    bars: dict[str, Parts] = {}
    for method in methods:
        first, fresh = (_parts(metrics, metric, method.name) for metric in PART.values())
        if first == fresh:
            bars[method.title] = first
        else:
            bars[f"{method.title}, first"] = first
            bars[f"{method.title}, fresh"] = fresh
    return {label: parts for label, parts in bars.items() if parts}


def _parts(metrics: Sequence[MetricValue], name: str, method: str) -> Parts:
    return {
        metric.component: metric.value
        for metric in metrics
        if metric.metric == name and metric.method == method and metric.value is not None
    }


@in_style()
def time_parts(
    metrics: Sequence[MetricValue],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
) -> Figure:
    """A bar for each method's mean response time, made of what it went into; below, again and on a
    scale of their own, those that are short beside the longest.
    """
    bars = parts_of(metrics, methods)
    whole = {label: math.fsum(parts.values()) for label, parts in bars.items()}
    longest = max(whole.values())
    short = {label: parts for label, parts in bars.items() if whole[label] < MAX_SHORT * longest}
    panels = [bars, short] if short and len(bars) + len(short) <= MAX_BARS else [bars]
    rows = [max(len(panel), 1) for panel in panels]
    figure = NotebookFigure(
        figsize=(width_in or style.COLUMN_IN, 0.45 * len(rows) + 0.2 * sum(rows))
    )
    axes = list(figure.subplots(len(rows), squeeze=False, height_ratios=rows).flat)
    for axis, panel in zip(axes, panels, strict=True):
        _draw_parts(axis, panel)
    axes[-1].set_xlabel("mean over answered frames [ms]")
    finish(figure, "Where the time goes: parts of the mean response time", footer, axes)
    return figure


def _draw_parts(axis: Axes, bars: Mapping[str, Mapping[str, float]]) -> None:
    """Stacked, with the sum at the end of each."""
    places, left = range(len(bars)), np.zeros(len(bars))
    for part, (name, look) in style.PARTS.items():
        widths = np.array([parts.get(part, 0.0) for parts in bars.values()])
        if widths.any():
            axis.barh(
                places, widths, 0.68, left, label=name, edgecolor="black", linewidth=0.5, **look
            )
            left = left + widths
    for place, whole in zip(places, left, strict=True):
        axis.annotate(
            number_text(whole), (whole, place), (3, 0), textcoords="offset points", va="center"
        )
    axis.set_yticks(places, [textwrap.fill(title, TITLE_CHARACTERS) for title in bars])
    axis.invert_yaxis()
    axis.set_xlim(0, 1.14 * max(left, default=0.0) or 1.0)
    axis.grid(axis="y", visible=False)
