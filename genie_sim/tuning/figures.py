"""Figures of a search: the front, parallel coordinates of its designs, and what mattered."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style, logarithmic_x
from genie_sim.analysis.registry import METRICS, is_drawn_logarithmically
from genie_sim.text import number_text
from genie_sim.tuning.design import Objective, SearchDesign, Target

if TYPE_CHECKING:
    import pandas as pd

PANEL_IN = 2.2
ROW_IN = 0.16  # of a bar of importance
ENDS = ("", " low", " high")


def of_search(
    design: SearchDesign,
    designs: "pd.DataFrame",
    importance: "pd.DataFrame",
    titles: Mapping[str, str],
) -> Iterator[tuple[str, Figure]]:
    """Every figure with the name of its file.

    Parameters
    ----------
    design : SearchDesign
        The search.
    designs, importance : DataFrame
        Its tables.
    titles : mapping
        What figures call each method, tuned and as it is in the scenario.
    """
    footer = f"search {design.name}, held-out seeds {len(design.held_out.seeds)}"
    if len(design.objectives.all) > 1:
        yield "front", front(design, designs, titles, footer)
    for method in design.methods:
        tuned = designs[(designs["method"] == method) & designs["tuned"]]
        if len(tuned):
            yield f"parallel-{method}", parallel(design, tuned, f"{footer}, {titles[method]}")
        explained = importance[importance["method"] == method]
        if len(explained):
            yield f"importance-{method}", bars(design, explained, f"{footer}, {titles[method]}")


@in_style()
def front(
    design: SearchDesign, designs: "pd.DataFrame", titles: Mapping[str, str], footer: str
) -> Figure:
    """The first objective against each other one, held-out means with intervals; hollow marks are
    methods as they are in the scenario.
    """
    first, *others = design.objectives.all
    figure = Figure(figsize=(style.PAGE_IN, PANEL_IN))
    axes = np.atleast_1d(figure.subplots(1, len(others), sharey=True))
    names = list(dict.fromkeys(zip(designs["method"], designs["tuned"], strict=True)))
    methods = list(dict.fromkeys(designs["method"]))
    looks = dict(zip(methods, style.method_looks(methods), strict=True))
    for axis, other in zip(axes, others, strict=True):
        for method, tuned in names:
            rows = designs[(designs["method"] == method) & (designs["tuned"] == tuned)]
            x, x_reach = _points(rows, other.target)
            y, y_reach = _points(rows, first.target)
            colour = style.method_colour(looks[method])
            axis.errorbar(
                x,
                y,
                xerr=x_reach,
                yerr=y_reach,
                label=titles[method] if tuned else f"{titles[method]}, as it is",
                linestyle="",
                marker=style.method_marker(looks[method]),
                markerfacecolor=colour if tuned else "white",
                markersize=4,
                color=colour,
                elinewidth=0.6,
            )
        axis.set_xlabel(_label(other))
        values = designs[other.target.text].dropna()
        if is_drawn_logarithmically(other.target.metric, values.tolist()):
            axis.set_xlabel(f"{_label(other)}, logarithmic")
            logarithmic_x(axis, 0.8 * values.min(), 1.25 * values.max())
        elif min(axis.get_xlim()) <= 0 or axis.get_xlim()[0] < 0.2 * axis.get_xlim()[1]:
            axis.set_xlim(left=0)
    axes[0].set_ylabel(_label(first))
    finish(figure, "The front on the held-out set", footer, axes)
    return figure


@in_style()
def parallel(design: SearchDesign, designs: "pd.DataFrame", footer: str) -> Figure:
    """A line per design across its parameters and objectives; darker is better in the first
    objective. A line has a gap where a parameter does not count.
    """
    columns = _parameters(design, designs) + [target.text for target in _targets(design)]
    figure = Figure(figsize=(style.PAGE_IN, 2.8))
    axis = figure.subplots()
    scaled = np.array([_scaled(designs[column]) for column in columns])
    first = design.objectives.all[0]
    values = -first.sign * designs[first.target.text].to_numpy(dtype=float)
    order = np.argsort(values, kind="stable")
    for rank, place in enumerate(order):
        shade = str(round(0.8 - 0.8 * (rank + 1) / len(order), 3))
        axis.plot(range(len(columns)), scaled[:, place], color=shade, linewidth=1.0, marker=".")
    labels = {objective.target.text: _label(objective) for objective in design.objectives.all}
    texts = [labels.get(column, column) for column in columns]
    axis.set_xticks(range(len(columns)), texts, rotation=30, ha="right")
    axis.set_yticks([0, 1], ["", ""])
    factors = {target.text: METRICS[target.metric].factor for target in design.targets}
    for place, column in enumerate(columns):
        low, high = _ends(designs[column], factors.get(column, 1))
        axis.text(place, -0.03, low, ha="center", va="top", fontsize=6)
        axis.text(place, 1.03, high, ha="center", va="bottom", fontsize=6)
    axis.set_ylim(-0.12, 1.12)
    finish(figure, "Designs of the front", footer)
    return figure


@in_style()
def bars(design: SearchDesign, explained: "pd.DataFrame", footer: str) -> Figure:
    """The share of each objective's variance that each parameter explains by itself."""
    objectives = design.objectives.all
    parameters = list(dict.fromkeys(explained["parameter"]))
    height = 0.9 + ROW_IN * len(parameters)
    figure = Figure(figsize=(style.PAGE_IN, height))
    axes = np.atleast_1d(figure.subplots(1, len(objectives), sharey=True))
    for axis, objective in zip(axes, objectives, strict=True):
        rows = explained[explained["metric"] == objective.target.text].set_index("parameter")
        rows = rows.reindex(parameters)
        value, low, high = (rows[name].to_numpy(dtype=float) for name in ("value", "low", "high"))
        reach = np.array([np.maximum(value - low, 0), np.maximum(high - value, 0)])
        axis.barh(range(len(parameters)), value, xerr=reach, color="0.7", ecolor="0.2")
        axis.set_xlim(0, 1)
        axis.set_title(objective.target.title, wrap=True)
        axis.xaxis.set_major_formatter(style.percent_tick)
    axes[0].set_yticks(range(len(parameters)), parameters)
    axes[0].invert_yaxis()
    figure.supxlabel("explained variance over the points that were tried", fontsize=8)
    finish(figure, "What mattered", footer)
    return figure


def _points(rows: "pd.DataFrame", target: Target) -> tuple[Any, Any]:
    """Values as they are shown, and how far their intervals reach below and above."""
    factor = METRICS[target.metric].factor
    value, low, high = (factor * rows[f"{target.text}{end}"].to_numpy(dtype=float) for end in ENDS)
    return value, np.array([value - low, high - value])


def _label(objective: Objective) -> str:
    unit = METRICS[objective.target.metric].unit
    return f"{objective.target.title} [{unit}]" if unit else objective.target.title


def _targets(design: SearchDesign) -> Sequence[Target]:
    return [objective.target for objective in design.objectives.all]


def _parameters(design: SearchDesign, designs: "pd.DataFrame") -> list[str]:
    """The columns of parameters that some design has, and that differ."""
    known = {target.text for target in design.targets}
    last = max(list(designs.columns).index(f"{name} high") for name in known)
    return [
        str(column)
        for column in designs.columns[last + 1 :]
        if designs[column].notna().any() and designs[column].nunique() > 1
    ]


def _scaled(values: "pd.Series[Any]") -> Any:
    """From 0 to 1 within the column; texts by their order in the alphabet."""
    numbers = _as_numbers(values)
    low, high = np.nanmin(numbers), np.nanmax(numbers)
    return (numbers - low) / (high - low) if high > low else np.where(numbers == low, 0.5, np.nan)


def _as_numbers(values: "pd.Series[Any]") -> Any:
    if all(isinstance(value, float) for value in values):
        return values.to_numpy(dtype=float)
    levels = sorted({str(value) for value in values.dropna()})
    places = {level: float(place) for place, level in enumerate(levels)}
    return np.array([places.get(str(value), np.nan) for value in values])


def _ends(values: "pd.Series[Any]", factor: int) -> tuple[str, str]:
    """The least and the greatest value of a column as text, numbers times ``factor``."""
    if all(isinstance(value, float) for value in values):
        ends = float(values.min()), float(values.max())
        return number_text(factor * ends[0]), number_text(factor * ends[1])
    levels = sorted({str(value) for value in values.dropna()})
    return levels[0], levels[-1]
