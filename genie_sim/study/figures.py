"""Figures of a sweep: what reuse, response times and correctness do along each axis, and over two
axes at once.
"""

import itertools
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style, is_narrow
from genie_sim.analysis.metric import HEADLINE, SHORT
from genie_sim.analysis.registry import (
    definition,
    is_drawn_logarithmically,
    shown,
    spans_much,
)
from genie_sim.analysis.statistics import across_seeds, thinned
from genie_sim.analysis.style import PAGE_IN, PLACEMENTS, percent_tick
from genie_sim.base.errors import UserError
from genie_sim.base.text import number_text, percent_text
from genie_sim.study.design import Axis, Design, Level

if TYPE_CHECKING:
    import pandas as pd

MAX_TICKS = 8
MAX_COLUMNS = 4  # of panels, side by side
MAX_PLACES = 6  # of the axes beyond the second, each with figures of its own
LEVEL_CHARACTERS = 16  # of a value that is a text
HEAT_COLOURS = mpl.colormaps["Blues"]
BESIDE = 0.4  # how far the points at a value that is no number lie apart, of its room
MAX_SHADES = 9
MAX_STEP = 0.1  # of a share, between two shades
MAX_SCALE_TICKS = 5
LABEL_CHARACTERS, SHORT_LABEL_CHARACTERS = 20, 15  # in a line beside an axis; in a column
MARKER_ROOM = 0.03  # above the highest value, of the panel's height


def of_sweep(
    design: Design,
    runs: "pd.DataFrame",
    titles: Mapping[str, str],
    footer: str,
    width_in: float = PAGE_IN,
) -> Iterator[tuple[str, Figure]]:
    """Every figure with the name of its file.

    Parameters
    ----------
    design : Design
        The sweep.
    runs : DataFrame
        ``tables.of_runs``.
    titles : mapping of str to str
        What figures call each method.
    footer : str
        What was run.
    width_in : float
        Of a page or a column; maps and panels of two axes need a page. Raises ``UserError``.

    Along each axis, with a column of panels for each value of one other axis; a heat map of the
    first two crossed axes. Where there are more axes, every combination of their first values has
    figures of its own. Only over values that were drawn is anything averaged, and the figure says
    so.
    """
    columns, crossed = design.columns, design.crossed
    for name, axis in design.axes.items():
        remaining = [columns[axis_name] for axis_name in crossed if axis_name != name]
        drawn = [column for axis_name, column in columns.items() if axis_name not in crossed]
        beside = remaining[0] if remaining else None
        for suffix, place, selected in _places(runs, remaining[1:]):
            figure = along(
                axis,
                columns[name],
                selected,
                titles=titles,
                footer=footer,
                beside=beside,
                averaged=[] if axis.sampled else drawn,
                place=place,
                width_in=width_in,
            )
            yield f"{name}{suffix}", figure
    if len(crossed) > 1:
        first, second = crossed[:2]
        for suffix, place, selected in _places(runs, [columns[name] for name in crossed[2:]]):
            pair = columns[first], columns[second]
            figure = heat(
                *pair, selected, titles=titles, footer=footer, place=place, width_in=width_in
            )
            yield f"{first}-{second}{suffix}", figure


def of_metric(
    metric: str,
    design: Design,
    runs: "pd.DataFrame",
    *,
    titles: Mapping[str, str],
    footer: str,
    width_in: float = PAGE_IN,
) -> Figure:
    """One metric: a heat map of the first two crossed axes, or along the first axis. What it is
    given is that of ``of_sweep``. Raises ``UserError`` where no method has a value.
    """
    has_value = (runs["metric"] == metric) & (runs["component"] == "") & runs["value"].notna()
    if not has_value.any():
        raise UserError(f"{metric}: this sweep has no value of it to draw")
    columns, crossed = design.columns, design.crossed
    if len(crossed) > 1:
        pair = columns[crossed[0]], columns[crossed[1]]
        _, place, selected = next(_places(runs, [columns[name] for name in crossed[2:]]))
        return heat(
            *pair,
            selected,
            titles=titles,
            footer=footer,
            place=place,
            width_in=width_in,
            metrics=[metric],
        )
    name = (*crossed, *design.axes)[0]
    return along(
        design.axes[name],
        columns[name],
        runs,
        titles=titles,
        footer=footer,
        averaged=[columns[other] for other in design.axes if crossed and other != name],
        width_in=width_in,
        metrics=[metric],
    )


def _places(
    runs: "pd.DataFrame", columns: Sequence[str]
) -> "Iterator[tuple[str, str, pd.DataFrame]]":
    """The runs at every combination of values of these columns, with a suffix for file names and
    words for titles.
    """
    values = [list(dict.fromkeys(runs[column])) for column in columns]
    for number, place in enumerate(
        itertools.islice(itertools.product(*values), MAX_PLACES), start=1
    ):
        selected = runs
        for column, value in zip(columns, place, strict=True):
            selected = selected[selected[column] == value]
        place_text = ", ".join(
            f"{column} = {_shortened(value)}" for column, value in zip(columns, place, strict=True)
        )
        yield (f"-{number}" if columns else ""), place_text, selected


@in_style()
def along(
    axis: Axis,
    column: str,
    runs: "pd.DataFrame",
    *,
    titles: Mapping[str, str],
    footer: str,
    beside: str | None = None,
    averaged: Sequence[str] = (),
    place: str = "",
    width_in: float = PAGE_IN,
    metrics: Sequence[str] = (),
) -> Figure:
    """Draws means along one axis with their 95 % intervals across seeds, a row of panels a metric.

    Drawn values of a sampled axis are no line but points, for the other sampled axes differ from
    one to the next.

    Parameters
    ----------
    axis : Axis
        The axis.
    column : str
        Its column in the runs.
    runs : DataFrame
        ``tables.of_runs``, or a part of it.
    titles : mapping of str to str
        What the figure calls each method.
    footer : str
        Says below the panels what was run.
    beside : str, optional
        The column of another axis, each of whose values has a column of panels.
    averaged : sequence of str
        Columns of axes that are averaged over, for the note above the panels.
    place : str
        Where on the remaining axes the runs are, for the same note.
    width_in : float
        The figure's width in inches; that of a page with ``beside``, or ``UserError`` is raised.
    metrics : sequence of str
        Which; by default the short list or, in a column or with ``beside``, the headlines.
    """
    if beside is not None:
        _refuse_narrow(width_in)
    levels: Sequence[Any] = list(dict.fromkeys(runs[beside])) if beside else [None]
    shown_levels = [levels[place] for place in thinned(len(levels), MAX_COLUMNS)]
    means = across_seeds(runs[runs["component"] == ""], [column, *([beside] if beside else [])])
    narrow = is_narrow(width_in)
    tier = SHORT if beside is None and not narrow else HEADLINE
    names = metrics or shown(tier, means["metric"])
    shown_metrics = [
        (metric, _label(metric)) for metric in names if (means["metric"] == metric).any()
    ]
    wide = (2 if narrow else 3) if beside is None else len(shown_levels)
    if len(metrics) == 1:
        wide = len(shown_levels)
    rows = max(1, -(-len(shown_metrics) // wide)) if beside is None else max(1, len(shown_metrics))
    row_in = 0.8 if narrow and rows > 1 else 1.8 if beside is None else 1.3
    figure = Figure(figsize=(width_in, (0.2 if narrow else 0.6) + row_in * rows))
    grid = figure.subplots(rows, wide, squeeze=False, sharey=False if beside is None else "row")
    panels = [(metric, label, level) for metric, label in shown_metrics for level in shown_levels]
    for panel, (metric, label, level) in zip(grid.flat, panels, strict=False):
        of_panel = means[means["metric"] == metric]
        if level is not None:
            of_panel = of_panel[of_panel[beside] == level]
        _draw(panel, axis, column, means=of_panel, titles=titles)
        spot = panel.get_subplotspec()
        panel.set_ylabel(_wrapped(label, narrow) if beside is None or spot.is_first_col() else "")
        if (beside is None and not narrow) or spot.is_last_row():
            panel.set_xlabel(f"{column}, logarithmic" if panel.get_xscale() == "log" else column)
        if level is not None and spot.is_first_row():
            panel.set_title(f"{beside} = {_shortened(level)}")
        of_metric = means["value"][means["metric"] == metric]
        if _is_share(metric):
            panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        elif is_drawn_logarithmically(metric, values := of_metric.dropna().tolist()):
            _scale_logarithmically(panel, min(values), max(values))
    for panel in list(grid.flat)[len(panels) :]:
        panel.remove()
    # after all are drawn, for a row shares its limits
    for panel in figure.axes if beside is None else grid[:, 0]:
        if panel.get_yscale() == "log":
            continue
        low, high = panel.get_ylim()
        low = min(0.0, low)
        panel.set_ylim(low, high + MARKER_ROOM * (high - low))
    notes = []
    if len(shown_levels) < len(levels):
        notes.append(f"{len(shown_levels)} of {len(levels)} values of {beside}")
    if averaged:
        notes.append(f"averaged over {', '.join(averaged)}")
    if place:
        notes.append(f"at {place}")
    several = "means and 95 % intervals across seeds"
    shows = several if runs["seed"].nunique() > 1 else "one seed, so without intervals"
    finish(figure, f"Along {column}: {shows}", footer, figure.axes, note="; ".join(notes))
    return figure


@in_style()
def heat(
    first: str,
    second: str,
    runs: "pd.DataFrame",
    *,
    titles: Mapping[str, str],
    footer: str,
    place: str = "",
    width_in: float = PAGE_IN,
    metrics: Sequence[str] = (),
) -> Figure:
    """Means across seeds over two axes, a row of panels a metric, a column a method.

    Darker is more, on one scale a metric. A step of the scale is as wide as the median 95 %
    interval of a cell, so cells that differ by less look alike or nearly so, but no step of a share
    is wider than ``MAX_STEP``. Of Genies' metrics those on cars are shown.

    Parameters
    ----------
    first, second : str
        The columns of the axes: ``first`` upwards, ``second`` to the right.
    runs : DataFrame
        ``tables.of_runs``, or a part of it.
    titles : mapping of str to str
        What the figure calls each method.
    footer : str
        Says below the panels what was run.
    place : str
        Where on the remaining axes the runs are, for the note above the panels.
    width_in : float
        The figure's width in inches, that of a page, or ``UserError`` is raised.
    metrics : sequence of str
        Which; by default the headlines.
    """
    _refuse_narrow(width_in)
    means = across_seeds(runs[runs["component"] == ""], [first, second])
    metrics = metrics or shown(HEADLINE, means["metric"])
    means = means[
        means["placement"].isin(("all", "car"))
        & means["metric"].isin(metrics)
        & means["value"].notna()
    ]
    methods = list(dict.fromkeys(means["method"]))
    metrics = [metric for metric in metrics if (means["metric"] == metric).any()]
    up, right = ([*dict.fromkeys(runs[column])] for column in (first, second))
    height_in = 0.5 + len(metrics) * (0.8 + 0.22 * len(up))
    figure = Figure(figsize=(width_in, max(2.0, height_in)))
    grid = figure.subplots(max(1, len(metrics)), max(1, len(methods)), squeeze=False)
    for row, metric in zip(grid, metrics, strict=False):
        of_metric = means[means["metric"] == metric]
        scale, drawn = _scale(of_metric, _is_share(metric)), list[Axes]()
        for panel, method in zip(row, methods, strict=True):
            cells = of_metric[of_metric["method"] == method].pivot_table(
                index=first, columns=second, values="value", sort=False
            )
            if cells.empty:
                panel.remove()
                continue
            cells = cells.reindex(index=up, columns=right)
            _heat_map(panel, cells, scale, percent=_is_share(metric))
            panel.set_title(titles[method])
            panel.set_xlabel(second)
            panel.set_ylabel("" if drawn else first)
            drawn.append(panel)
        shades = ScalarMappable(norm=scale, cmap=HEAT_COLOURS)
        bar = figure.colorbar(shades, ax=drawn, label=_wrapped(_label(metric)), pad=0.01)
        ticks = scale.boundaries[:: -(-len(scale.boundaries) // MAX_SCALE_TICKS)].tolist()
        text = partial(percent_text, digits=3) if _is_share(metric) else number_text
        bar.set_ticks(ticks, labels=[text(tick) for tick in ticks])
    title = f"Over {first} and {second}: means across seeds, darker is more"
    finish(figure, title, footer, note=f"at {place}" if place else "")
    return figure


def _label(metric: str) -> str:
    """A metric's title with its unit; ticks have the percent sign of shares."""
    info = definition(metric)
    return info.title if _is_share(metric) else info.label


def _is_share(metric: str) -> bool:
    return definition(metric).unit == "%"


def _refuse_narrow(width_in: float) -> None:
    """Raises ``UserError`` for the width of a column."""
    if is_narrow(width_in):
        raise UserError("figures of two axes need a page: leave --width out, or name a page's")


def _wrapped(label: str, narrow: bool = False) -> str:
    return textwrap.fill(label, SHORT_LABEL_CHARACTERS if narrow else LABEL_CHARACTERS)


def _scale(cells: "pd.DataFrame", share: bool = False) -> BoundaryNorm:
    """Steps from the least to the greatest value, none narrower than the median interval, and of a
    ``share`` none wider than ``MAX_STEP``; equal ratios where the values span decades.
    """
    columns = cells[["value", "low", "high"]]
    logarithmic = spans_much(cells["value"].tolist())
    numbers = columns.to_numpy(float)
    values, lows, highs = (np.log(numbers) if logarithmic else numbers).T
    low, high = values.min(), values.max()
    widths = (highs - lows)[np.isfinite(highs - lows)]
    width = float(np.median(widths)) if len(widths) else 0.0
    steps = MAX_SHADES if width == 0 else min(max(int((high - low) / width), 1), MAX_SHADES)
    if share and not logarithmic:
        steps = max(steps, math.ceil((high - low) / MAX_STEP))
    if high == low:
        low, high = low - 0.5, high + 0.5
    high += 1e-9 * (high - low)  # the greatest value is in the last step, not beyond it
    boundaries = np.linspace(low, high, steps + 1)
    return BoundaryNorm(np.exp(boundaries) if logarithmic else boundaries, HEAT_COLOURS.N)


def _heat_map(panel: Axes, cells: "pd.DataFrame", scale: BoundaryNorm, percent: bool) -> None:
    values = cells.to_numpy(float)
    panel.imshow(values, cmap=HEAT_COLOURS, norm=scale, aspect="auto", origin="lower")
    panel.grid(False)
    panel.set_xticks(range(values.shape[1]), [_shortened(level) for level in cells.columns])
    panel.set_yticks(range(values.shape[0]), [_shortened(level) for level in cells.index])
    for (y, x), value in [
        (place, values[place]) for place in itertools.product(*map(range, values.shape))
    ]:
        if not math.isnan(value):
            text = f"{100 * value:.0f} %" if percent else number_text(value)
            panel.text(
                x,
                y,
                text,
                ha="center",
                va="center",
                color="white" if _is_dark(HEAT_COLOURS(scale(value))) else "black",
                fontsize=7,
            )


def _is_dark(colour: Sequence[float]) -> bool:
    """Whether white is read better on it than black."""
    red, green, blue = colour[:3]
    return 0.3 * red + 0.59 * green + 0.11 * blue < 0.5


def _draw(
    panel: Axes, axis: Axis, column: str, *, means: "pd.DataFrame", titles: Mapping[str, str]
) -> None:
    levels = list(dict.fromkeys(means[column]))
    numbers = [level for level in levels if isinstance(level, float)]
    numeric = len(numbers) == len(levels)
    lines = means.groupby(["method", "placement"], sort=False)
    for number, ((method, placement), line_means) in enumerate(lines):
        if numeric:
            line_means = line_means.sort_values(column)
        if line_means["value"].notna().sum() == 0:
            continue
        x = (
            line_means[column].to_numpy(float)
            if numeric
            else [
                levels.index(level) + BESIDE * (number - (lines.ngroups - 1) / 2) / lines.ngroups
                for level in line_means[column]
            ]
        )
        ends = [line_means["value"] - line_means["low"], line_means["high"] - line_means["value"]]
        line = _look(str(method), str(placement), titles, alone=means["method"].nunique() == 1)
        if not numeric or axis.sampled:
            line["linestyle"] = "none"
        panel.errorbar(x, line_means["value"], yerr=ends, markersize=3.5, capsize=2, **line)
    if not numeric:
        names = [_shortened(level) for level in levels]
        panel.set_xticks(range(len(names)), names)
        if sum(map(len, names)) >= 24:
            for name in panel.get_xticklabels():
                name.set(rotation=30, horizontalalignment="right", rotation_mode="anchor")
        panel.set_xlim(-0.5, len(levels) - 0.5)
    elif _logarithmic(axis, numbers):
        panel.set_xscale("log")
        few_values = len(numbers) <= MAX_TICKS and not axis.sampled
        ticks = numbers if few_values else _round_ticks(min(numbers), max(numbers))
        panel.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        panel.xaxis.set_minor_locator(NullLocator())


def _look(method: str, placement: str, titles: Mapping[str, str], alone: bool) -> dict[str, Any]:
    """A method's line, or that of its Genies on cars or edges; of these in grey where no other
    method has any.
    """
    style_number = dict(zip(titles, style.method_styles(list(titles)), strict=True))[method]
    marker = {"marker": style.method_marker(style_number)}
    if placement not in PLACEMENTS:
        return style.method_line(style_number) | marker | {"label": titles[method]}
    line, where = style.PLACEMENT_LINES[placement], PLACEMENTS[placement]
    if alone:
        return line | {
            "label": f"Genies {where}",
            "marker": style.MARKERS[list(PLACEMENTS).index(placement)],
        }
    return (
        line
        | marker
        | {"label": f"{titles[method]}, {where}", "color": style.method_colour(style_number)}
    )


def _scale_logarithmically(panel: Axes, low: float, high: float) -> None:
    """Values over a logarithmic axis, from below the least to above the greatest."""
    low, high = 0.7 * low, 1.4 * high
    panel.set_yscale("log")
    panel.set_ylim(low, high)
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [digit * 10.0**power for power in powers for digit in (1, 3)]
    ticks = [tick for tick in ticks if low <= tick <= high]
    panel.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    panel.yaxis.set_minor_locator(NullLocator())


def _logarithmic(axis: Axis, numbers: Sequence[float]) -> bool:
    if axis.span is not None:
        return axis.span.scale == "log"
    return spans_much(numbers)


def _round_ticks(low: float, high: float) -> list[float]:
    """Powers of ten from ``low`` to ``high``; 2 and 5 times them as well where they are few."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    few = len(powers) <= 3
    ticks = [digit * 10.0**power for power in powers for digit in ((1, 2, 5) if few else (1,))]
    return [tick for tick in ticks if low <= tick <= high] or [low, high]


def _shortened(level: Level) -> str:
    text = level if isinstance(level, str) else f"{level:g}"
    return text if len(text) <= LEVEL_CHARACTERS else f"{text[: LEVEL_CHARACTERS - 1]}…"
