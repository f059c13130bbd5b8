"""One figure: where the time of answers goes."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.analysis.metrics import PART
from genie_sim.recording.results import MethodInfo, Metric

SHORT = 0.25  # of the longest bar: one below can hardly be read beside it


def parts_of(
    measured: Sequence[Metric], methods: Sequence[MethodInfo]
) -> Mapping[str, Mapping[str, float]]:
    """The parts [ms] of the mean first answer under each method, and of the fresh one where that differs, by label."""
    found: dict[str, dict[str, float]] = {}
    for method in methods:
        first, fresh = (
            {
                one.component: one.value
                for one in measured
                if (one.metric, one.method) == (metric, method.name) and one.value is not None
            }
            for metric in PART.values()
        )
        both = {f"{method.title}, first": first, f"{method.title}, fresh": fresh}
        told = {method.title: first} if first == fresh else both
        found |= {label: parts for label, parts in told.items() if parts}
    return found


@in_style()
def time_parts(
    measured: Sequence[Metric],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
) -> Figure:
    """A bar for each method's mean response time, made of what it went into; below, again and on a scale of
    their own, those that are short beside the longest."""
    bars = parts_of(measured, methods)
    whole = {label: sum(parts.values()) for label, parts in bars.items()}
    short = {
        label: parts for label, parts in bars.items() if whole[label] < SHORT * max(whole.values())
    }
    panels = [bars, short] if short else [bars]
    rows = [max(len(one), 1) for one in panels]
    figure = Figure(figsize=(width_in or style.COLUMN_IN, 0.45 * len(rows) + 0.2 * sum(rows)))
    axes = list(figure.subplots(len(rows), squeeze=False, height_ratios=rows).flat)
    for axis, shown in zip(axes, panels, strict=True):
        _draw_parts(axis, shown)
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
            f"{whole:.3g}", (whole, place), (3, 0), textcoords="offset points", va="center"
        )
    axis.set_yticks(places, list(bars))
    axis.invert_yaxis()
    axis.set_xlim(0, 1.14 * max(left, default=0.0) or 1.0)
    axis.grid(axis="y", visible=False)
