"""One figure per axis of a sweep: what reuse, boost and response times do along it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.analysis.statistics import across_seeds
from genie_sim.analysis.style import PAGE_IN, PLACEMENTS, percent_tick
from genie_sim.sweep.design import Axis

if TYPE_CHECKING:
    import pandas as pd

LOGARITHMIC_FROM = 20.0  # a list that spans so much, largest to smallest
MOST_TICKS = 8
LEVEL_CHARACTERS = 16  # of a value that is a text, as in the page
PANELS = {  # metric -> label of its panel
    "image_reuse": "image reuse",
    "object_reuse": "object reuse",
    "confidence_boost": "confidence boost",
    "first_answer_mean": "first answer, mean [ms]",
    "fresh_answer_mean": "fresh answer, mean [ms]",
    "under_deadline_share": "answered in 33 ms",
    "fresh_answered_share": "with a fresh answer",
    "ghost_share": "ghost share",
    "object_recall": "object recall",
}
SHARES = (
    "image_reuse", "object_reuse", "under_deadline_share", "fresh_answered_share", "ghost_share", "object_recall"
)  # fmt: skip
MARKER_ROOM = 0.03  # above the highest value, of the panel's height


@in_style()
def along(axis: Axis, column: str, runs: pd.DataFrame, footer: str, others: Sequence[str] = ()) -> Figure:
    """Means along one axis with their 95 % intervals across seeds; over ``others`` it is averaged, seed by seed.

    Drawn values of a sampled axis are no line but points, for the other sampled axes differ from one to the next.
    ``runs`` is ``tables.of_runs``.
    """
    means = across_seeds(runs.dropna(subset=["metric"]), [column])
    methods = list(dict.fromkeys(means["method"]))
    shown = [panel for panel in PANELS.items() if (means["metric"] == panel[0]).any()]
    rows = max(1, -(-len(shown) // 3))
    figure = Figure(figsize=(PAGE_IN, 1.3 + 1.9 * rows))
    averaged = f", averaged over {', '.join(others)}" if others else ""
    several = runs["seed"].nunique() > 1
    shows = "means and 95 % intervals across seeds" if several else "one seed, so without intervals"
    title = f"Along {column}: {shows}{averaged}"
    grid = figure.subplots(rows, 3, squeeze=False)
    for panel, (metric, label) in zip(grid.flat, shown, strict=False):
        _draw(panel, axis, column, means[means["metric"] == metric], methods)
        panel.set_ylabel(label)
        panel.set_xlabel(f"{column}, logarithmic" if panel.get_xscale() == "log" else column)
        if metric in SHARES:
            panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        low, high = panel.get_ylim()
        low = min(0.0, low)
        panel.set_ylim(low, high + MARKER_ROOM * (high - low))
    for panel in list(grid.flat)[len(shown) :]:
        panel.remove()
    finish(figure, title, footer, figure.axes)
    return figure


def _draw(panel: Axes, axis: Axis, column: str, means: pd.DataFrame, methods: Sequence[str]) -> None:
    levels = list(dict.fromkeys(means[column]))
    numbers = [level for level in levels if isinstance(level, float)]
    numeric = len(numbers) == len(levels)
    for (method, placement), mine in means.groupby(["method", "placement"], sort=False):
        if numeric:
            mine = mine.sort_values(column)
        if mine["value"].notna().sum() == 0:
            continue
        x = mine[column].to_numpy(float) if numeric else [levels.index(level) for level in mine[column]]
        ends = [mine["value"] - mine["low"], mine["high"] - mine["value"]]
        line = _look(str(method), str(placement), methods, alone=means["method"].nunique() == 1)
        if not numeric or axis.sampled:
            line["linestyle"] = "none"
        panel.errorbar(x, mine["value"], yerr=ends, markersize=3.5, capsize=2, **line)
    if not numeric:
        names = [_shortened(str(level)) for level in levels]
        panel.set_xticks(range(len(names)), names)
        if sum(map(len, names)) >= 24:
            for name in panel.get_xticklabels():
                name.set(rotation=30, horizontalalignment="right", rotation_mode="anchor")
        panel.set_xlim(-0.5, len(levels) - 0.5)
    elif _logarithmic(axis, numbers):
        panel.set_xscale("log")
        given = len(numbers) <= MOST_TICKS and not axis.sampled
        ticks = numbers if given else _round_ticks(min(numbers), max(numbers))
        panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        panel.xaxis.set_minor_locator(NullLocator())


def _look(method: str, placement: str, methods: Sequence[str], alone: bool) -> dict[str, Any]:
    """A method's line, or that of its Genies on cars or edges; of these in grey where no other method has any."""
    position = methods.index(method)
    marker = {"marker": style.MARKERS[position % len(style.MARKERS)]}
    if placement not in PLACEMENTS:
        return style.method_line(position) | marker | {"label": method}
    line, where = style.placement_line(placement), PLACEMENTS[placement]
    if alone:
        return line | {"label": f"Genies {where}", "marker": style.MARKERS[list(PLACEMENTS).index(placement)]}
    return line | marker | {"label": f"{method}, {where}", "color": style.method_line(position)["color"]}


def _logarithmic(axis: Axis, numbers: Sequence[float]) -> bool:
    if axis.span is not None:
        return axis.span.scale == "log"
    return min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def _round_ticks(low: float, high: float) -> list[float]:
    """Powers of ten from ``low`` to ``high``; 2 and 5 times them as well where they are few."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    few = len(powers) <= 3
    ticks = [digit * 10.0**power for power in powers for digit in ((1, 2, 5) if few else (1,))]
    return [tick for tick in ticks if low <= tick <= high] or [low, high]


def _shortened(text: str) -> str:
    return text if len(text) <= LEVEL_CHARACTERS else f"{text[: LEVEL_CHARACTERS - 1]}…"

