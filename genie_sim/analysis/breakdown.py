"""One figure: where the time of answers goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.analysis.metrics import PART
from genie_sim.recording.results import MethodInfo, Metric


def parts_of(measured: Sequence[Metric], methods: Sequence[MethodInfo]) -> Mapping[str, Mapping[str, float]]:
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
        if first and first == fresh:
            found[method.title] = first
        else:
            told = {f"{method.title}, first": first, f"{method.title}, fresh": fresh}
            found |= {label: parts for label, parts in told.items() if parts}
    return found


@in_style()
def time_parts(
    measured: Sequence[Metric], methods: Sequence[MethodInfo], footer: str = "", width_in: float | None = None
) -> Figure:
    """A bar for each method's mean response time, made of what it went into."""
    bars = parts_of(measured, methods)
    figure = Figure(figsize=(width_in or style.COLUMN_IN, 0.45 + 0.2 * max(len(bars), 1)))
    axis = figure.subplots()
    places = range(len(bars))
    left = np.zeros(len(bars))
    for part, (name, look) in style.PARTS.items():
        widths = np.array([parts.get(part, 0.0) for parts in bars.values()])
        if widths.any():
            axis.barh(places, widths, 0.68, left, label=name, edgecolor="black", linewidth=0.5, **look)
            left = left + widths
    for place, whole in zip(places, left, strict=True):
        axis.annotate(f"{whole:.3g}", (whole, place), (3, 0), textcoords="offset points", va="center")
    axis.set_yticks(places, list(bars))
    axis.invert_yaxis()
    axis.margins(x=0.14)
    axis.set_xlim(0, None)
    axis.grid(axis="y", visible=False)
    axis.set_xlabel("mean response time of answered frames [ms]")
    finish(figure, "Where the time goes: parts of the mean response time", footer, [axis])
    return figure
