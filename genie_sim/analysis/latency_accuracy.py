"""One figure: how early the first answers come, against how right they are."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.correctness import FLOOR
from genie_sim.analysis.drawing import finish, in_style, logarithmic_ms
from genie_sim.recording.results import MethodInfo, Metric

LATENCY = "first_answer_mean"
ACCURACY = {  # the first of them that every method has, and what is said of it
    "streaming_f1": ("streaming F1", " of what the consumer holds"),
    "first_proxy_f1": ("F1 of first answers", " against the detector's own"),
}
Numbers = Mapping[str, Sequence[Metric]]


def drawable(runs: Numbers) -> str | None:
    """Which accuracy these runs have in common; ``None`` where there is none."""
    found = [
        {one.metric for one in measured if one.value is not None} for measured in runs.values()
    ]
    return next(
        (name for name in ACCURACY if all({name, LATENCY} <= names for names in found)), None
    )


@in_style()
def latency_accuracy(
    runs: Numbers, methods: Sequence[MethodInfo], footer: str = "", width_in: float | None = None
) -> Figure:
    """A point per run and method, with the intervals of both; up and to the left is better.

    ``runs``: metrics by label. Streaming F1 where every run has it, else the proxy; the dotted line is the detector's
    own answer without delay. Raises ValueError where the runs have no accuracy in common.
    """
    accuracy = drawable(runs)
    if accuracy is None:
        raise ValueError("runs without a common accuracy")
    figure = Figure(figsize=(width_in or style.COLUMN_IN, 2.1))
    axis = figure.subplots()
    for number, (label, measured) in enumerate(runs.items()):
        found = {
            (one.metric, one.method, one.component): one
            for one in measured
            if one.placement == "all"
        }
        for position, method in enumerate(methods):
            x, y = found.get((LATENCY, method.name, "")), found.get((accuracy, method.name, ""))
            if x is None or y is None or x.value is None or y.value is None:
                continue
            name = method.title if len(runs) == 1 else f"{label}: {method.title}"
            mark = style.method_marker(number if len(runs) > 1 else position)
            look: dict[str, Any] = {
                "color": style.COLOURS[position % len(style.COLOURS)],
                "marker": mark,
            }
            axis.errorbar(
                x.value, y.value, _ends(y), _ends(x), linestyle="", capsize=2, label=name, **look
            )
        floors = [
            one.value for (name, _, part), one in found.items() if (name, part) == (accuracy, FLOOR)
        ]
        if floors and floors[0] is not None:
            axis.axhline(
                floors[0], color="0.4", linewidth=0.9, linestyle=":", label="detector without delay"
            )
    axis.set_xscale("log")
    logarithmic_ms(axis, *axis.get_xlim())
    axis.set_ylim(0, 1.02)
    axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    axis.set_xlabel("mean time to first answer [ms], logarithmic")
    axis.set_ylabel(ACCURACY[accuracy][0])
    finish(figure, f"Latency against accuracy: {''.join(ACCURACY[accuracy])}", footer, [axis])
    return figure


def _ends(metric: Metric) -> np.ndarray[tuple[int, int], np.dtype[np.float64]] | None:
    """How far the interval reaches below and above the value."""
    if metric.value is None or metric.low is None or metric.high is None:
        return None
    return np.array([[max(metric.value - metric.low, 0.0)], [max(metric.high - metric.value, 0.0)]])
