"""One figure per axis of a sweep: what reuse, boost and response times do along it."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.experiment.figures import LINE_IN, METHOD_LINES, PAGE_IN, ROLE_LINES, STYLE
from genie_sim.experiment.sweep.design import Axis
from genie_sim.experiment.sweep.tables import across_seeds

if TYPE_CHECKING:
    import pandas as pd

LOGARITHMIC_FROM = 20.0  # a list that spans so much, largest to smallest
MOST_TICKS = 8
TITLE_CHARACTERS = 100
PANELS: tuple[tuple[str, str, dict[str, dict[str, Any]]], ...] = (
    ("image_reuse", "image reuse", ROLE_LINES),
    ("object_reuse", "object reuse", ROLE_LINES),
    ("confidence_boost", "confidence boost", ROLE_LINES),
    ("first_answer_mean", "first answer, mean [ms]", METHOD_LINES),
    ("fresh_answer_mean", "fresh answer, mean [ms]", METHOD_LINES),
    ("under_deadline_share", "answered in 33 ms", METHOD_LINES),
)
SHARES = ("image_reuse", "object_reuse", "under_deadline_share")
MARKERS = {"local": "o", "remote": "s", "genie": "^"}


@style.context(["default", STYLE])
def along(axis: Axis, column: str, runs: pd.DataFrame, footer: str, others: Sequence[str] = ()) -> Figure:
    """Means along one axis with their 95 % intervals across seeds; over the other axes it is averaged, seed by seed.

    Drawn values of a sampled axis are no line but points, for the other sampled axes differ from one to the next.
    ``runs`` is ``tables.of_runs``.
    """
    means = across_seeds(runs.dropna(subset=["metric"]), [column])
    shown = [panel for panel in PANELS if (means["metric"] == panel[0]).any()]
    height_in = 1.3 + 1.9 * max(1, -(-len(shown) // 3))
    figure = Figure(figsize=(PAGE_IN, height_in))
    averaged = f", averaged over {', '.join(others)}" if others else ""
    title = f"Along {column}: means and 95 % intervals across seeds{averaged}"
    figure.suptitle(textwrap.fill(title, TITLE_CHARACTERS), x=0.01, ha="left")
    figure.text(0.01, 0.01, footer, ha="left", va="bottom", color="0.35")
    grid = figure.subplots(max(1, -(-len(shown) // 3)), 3, squeeze=False)
    for panel, (metric, label, looks) in zip(grid.flat, shown, strict=False):
        _draw(panel, axis, column, means[means["metric"] == metric], looks)
        panel.set_ylabel(label)
        panel.set_xlabel(column)
        if metric in SHARES:
            panel.yaxis.set_major_formatter(FuncFormatter(_percent))
        panel.set_ylim(min(0.0, panel.get_ylim()[0]), None)
    for panel in list(grid.flat)[len(shown) :]:
        panel.remove()
    legends = [zip(*one.get_legend_handles_labels(), strict=True) for one in figure.axes]
    handles = {label: handle for legend in legends for handle, label in legend}
    if handles:
        legend = figure.legend(list(handles.values()), list(handles), loc="lower center", ncols=len(handles))
        legend.set_bbox_to_anchor((0.5, LINE_IN / height_in))
    below = 2.6 * LINE_IN / height_in
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))
    return figure


def _draw(panel: Axes, axis: Axis, column: str, means: pd.DataFrame, looks: dict[str, dict[str, Any]]) -> None:
    levels = list(dict.fromkeys(means[column]))
    numbers = [level for level in levels if isinstance(level, float)]
    numeric = len(numbers) == len(levels)
    for role, look in looks.items():
        mine = means[means["role"] == role]
        if numeric:
            mine = mine.sort_values(column)
        if mine["value"].notna().sum() == 0:
            continue
        x = mine[column].to_numpy(float) if numeric else [levels.index(level) for level in mine[column]]
        ends = [mine["value"] - mine["low"], mine["high"] - mine["value"]]
        line = look | ({} if numeric and not axis.sampled else {"linestyle": "none"})
        panel.errorbar(x, mine["value"], yerr=ends, marker=MARKERS[role], markersize=3.5, capsize=2, **line)
    if not numeric:
        panel.set_xticks(range(len(levels)), [str(level) for level in levels])
        panel.tick_params(axis="x", labelrotation=0 if sum(len(str(level)) for level in levels) < 24 else 30)
        panel.set_xlim(-0.5, len(levels) - 0.5)
    elif _logarithmic(axis, numbers):
        panel.set_xscale("log")
        if len(numbers) <= MOST_TICKS and not axis.sampled:
            panel.set_xticks(numbers, [f"{number:g}" for number in numbers])
            panel.xaxis.set_minor_locator(NullLocator())


def _logarithmic(axis: Axis, numbers: Sequence[float]) -> bool:
    if axis.span is not None:
        return axis.span.scale == "log"
    return min(numbers) > 0 and max(numbers) / min(numbers) >= LOGARITHMIC_FROM


def _percent(share: float, _place: object) -> str:
    return f"{100 * share:.4g} %"
