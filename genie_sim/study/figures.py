"""Figures of a sweep: what reuse, response times and correctness do along each axis, and over two
axes at once.
"""

import itertools
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import style
from genie_sim.analysis.drawing import character_in, finish, in_style, is_narrow
from genie_sim.analysis.metric import HEADLINE, SHORT
from genie_sim.analysis.registry import (
    Words,
    definition,
    is_drawn_logarithmically,
    shown,
    spans_much,
)
from genie_sim.analysis.statistics import thinned
from genie_sim.analysis.style import PAGE_IN, PLACEMENTS, percent_tick
from genie_sim.analysis.tidy import across_seeds
from genie_sim.base.errors import UserError
from genie_sim.base.text import number_text
from genie_sim.study.design import Axis, Design, Level

if TYPE_CHECKING:
    import pandas as pd

MAX_TICKS = 8
MAX_COLUMNS = 4  # of panels, side by side
MAX_PLACES = 6  # of the axes beyond the second, each with figures of its own
LEVEL_CHARACTERS = 16  # of a value that is a text
HEAT_COLOURS = mpl.colormaps["Blues"]
LEVEL_COLOURS = mpl.colormaps["viridis"]  # from dark to light: they keep their order in greyscale
BESIDE = 0.4  # how far the points at a value that is no number lie apart, of its room
LABEL_CHARACTERS, SHORT_LABEL_CHARACTERS = 20, 15  # in a line beside an axis; in a column
MARKER_ROOM = 0.03  # above the highest value, of the panel's height


@dataclass(frozen=True)
class SweepFigures:
    """The figures of a sweep.

    Parameters
    ----------
    design : Design
        The sweep.
    runs : DataFrame
        ``tables.of_runs``.
    titles : mapping of str to str
        What figures call each method.
    footer : str
        Says below the panels what was run.
    width_in : float
        Of a page or a column.
    words : mapping
        What is said of metrics of the user's own.
    """

    design: Design
    runs: "pd.DataFrame"
    titles: Mapping[str, str]
    footer: str
    width_in: float = PAGE_IN
    words: Words = field(default_factory=dict)

    def drawn(self) -> Iterator[tuple[str, Figure]]:
        """Every figure with the name of its file.

        Along each axis, with a column of panels for each value of one other axis; a heat map of the
        first two crossed axes. In the width of a column two crossed axes give a figure of each
        headline metric: along the first axis, with a line for each value of the second. Where there
        are more axes, every combination of their first values has figures of its own. Only over
        values that were drawn is anything averaged, and the figure says so.
        """
        columns, crossed = self.design.columns, self.design.crossed
        if len(crossed) > 1 and is_narrow(self.width_in):
            for metric in shown(HEADLINE, self.runs["metric"]):
                for suffix, place, runs in self._places(crossed[2:]):
                    yield f"{crossed[0]}-{metric}{suffix}", self._lines(metric, runs, place)
            return
        sampled_columns = [column for name, column in columns.items() if name not in crossed]
        for name, axis in self.design.axes.items():
            remaining = [axis_name for axis_name in crossed if axis_name != name]
            averaged = [] if axis.sampled else sampled_columns
            for suffix, place, runs in self._places(remaining[1:]):
                beside = columns[remaining[0]] if remaining else None
                figure = self.along(name, runs, beside=beside, averaged=averaged, place=place)
                yield f"{name}{suffix}", figure
        if len(crossed) > 1:
            for suffix, place, runs in self._places(crossed[2:]):
                yield f"{crossed[0]}-{crossed[1]}{suffix}", self._heat(runs, place)

    def of(self, metric: str) -> Figure:
        """One metric along the first axis; of two crossed axes as a heat map or, in a column, with
        a line for each value of the second. Raises ``UserError`` where no method has a value.
        """
        runs = self.runs[(self.runs["metric"] == metric) & (self.runs["component"] == "")]
        if not runs["value"].notna().any():
            raise UserError(f"{metric}: this sweep has no value of it to draw")
        columns, crossed = self.design.columns, self.design.crossed
        if len(crossed) > 1:
            _, place, runs = next(self._places(crossed[2:]))
            if is_narrow(self.width_in):
                return self._lines(metric, runs, place)
            return self._heat(runs, place, [metric])
        name = (*crossed, *self.design.axes)[0]
        averaged = [columns[other] for other in self.design.axes if crossed and other != name]
        return self.along(name, self.runs, averaged=averaged, metrics=[metric])

    def _label(self, metric: str) -> str:
        """A metric's title with its unit; ticks have the percent sign of shares."""
        about = definition(metric, self.words)
        return about.title if about.unit == "%" else about.label

    def _is_share(self, metric: str) -> bool:
        return definition(metric, self.words).unit == "%"

    def _places(self, axes: Sequence[str]) -> "Iterator[tuple[str, str, pd.DataFrame]]":
        """The runs at every combination of values of these axes, with a suffix for file names and
        words for titles.
        """
        columns = [self.design.columns[name] for name in axes]
        values = [list(dict.fromkeys(self.runs[column])) for column in columns]
        places = itertools.islice(itertools.product(*values), MAX_PLACES)
        for number, levels in enumerate(places, start=1):
            selected, words = self.runs, []
            for column, level in zip(columns, levels, strict=True):
                selected = selected[selected[column] == level]
                words.append(f"{column} = {_shortened(level)}")
            yield (f"-{number}" if columns else ""), ", ".join(words), selected

    @in_style()
    def along(
        self,
        name: str,
        runs: "pd.DataFrame",
        *,
        beside: str | None = None,
        averaged: Sequence[str] = (),
        place: str = "",
        metrics: Sequence[str] = (),
    ) -> Figure:
        """Draws means along one axis with their 95 % intervals across seeds, a row of panels a
        metric.

        Drawn values of a sampled axis are no line but points, for the other sampled axes differ
        from one to the next.

        Parameters
        ----------
        name : str
            The axis.
        runs : DataFrame
            All runs, or those at ``place``.
        beside : str, optional
            The column of another axis, each of whose values has a column of panels.
        averaged : sequence of str
            Columns of axes that are averaged over, for the note above the panels.
        place : str
            Where on the remaining axes the runs are, for the same note.
        metrics : sequence of str
            Which; by default the short list or, in a column or with ``beside``, the headlines.
        """
        axis, column = self.design.axes[name], self.design.columns[name]
        levels: Sequence[Any] = list(dict.fromkeys(runs[beside])) if beside else [None]
        shown_levels = [levels[place] for place in thinned(len(levels), MAX_COLUMNS)]
        means = across_seeds(
            runs[runs["component"] == ""], [column, *([beside] if beside else [])], own=self.words
        )
        narrow = is_narrow(self.width_in)
        tier = SHORT if beside is None and not narrow else HEADLINE
        names = metrics or shown(tier, means["metric"])
        shown_metrics = [
            (metric, self._label(metric)) for metric in names if (means["metric"] == metric).any()
        ]
        wide = (2 if narrow else 3) if beside is None else len(shown_levels)
        if len(metrics) == 1:
            wide = len(shown_levels)
        rows = (
            max(1, -(-len(shown_metrics) // wide)) if beside is None else max(1, len(shown_metrics))
        )
        row_in = 0.8 if narrow and rows > 1 else 1.8 if beside is None else 1.3
        figure = Figure(figsize=(self.width_in, (0.2 if narrow else 0.6) + row_in * rows))
        grid = figure.subplots(rows, wide, squeeze=False, sharey=False if beside is None else "row")
        panels = [
            (metric, label, level) for metric, label in shown_metrics for level in shown_levels
        ]
        unused = grid.size - len(panels)
        places = list(range(grid.size - unused))
        if narrow and unused:  # in the first row, so that names of ticks stand below the last one
            places = [*range(wide - unused), *range(wide, grid.size)]
        for place_of_panel, (metric, label, level) in zip(places, panels, strict=True):
            panel = grid.flat[place_of_panel]
            of_panel = means[means["metric"] == metric]
            if level is not None:
                of_panel = of_panel[of_panel[beside] == level]
            _draw(panel, axis, column, _by_method(of_panel, self.titles))
            _explain_filling(panel, of_panel)
            spot = panel.get_subplotspec()
            panel.set_ylabel(
                _wrapped(label, narrow) if beside is None or spot.is_first_col() else ""
            )
            is_lowest = place_of_panel + wide not in places
            if (beside is None and not narrow) or is_lowest:
                panel.set_xlabel(column)
            if (level is not None or narrow) and not is_lowest:
                panel.tick_params(labelbottom=False)
            if level is not None and spot.is_first_row():
                panel.set_title(f"{beside} = {_shortened(level)}")
            of_metric = means["value"][means["metric"] == metric]
            if self._is_share(metric):
                panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
            elif is_drawn_logarithmically(
                definition(metric, self.words), values := of_metric.dropna().tolist()
            ):
                _scale_logarithmically(panel, min(values), max(values))
        for number in set(range(grid.size)) - set(places):
            grid.flat[number].remove()
        # after all are drawn, for a row shares its limits
        for panel in figure.axes if beside is None else grid[:, 0]:
            if panel.get_yscale() == "log":
                continue
            low, high = panel.get_ylim()
            low = min(0.0, low)
            panel.set_ylim(low, high + MARKER_ROOM * (high - low))
        _make_room(figure, 1 if beside is not None or narrow else rows)
        notes = []
        if len(shown_levels) < len(levels):
            notes.append(f"{len(shown_levels)} of {len(levels)} values of {beside}")
        if averaged:
            notes.append(f"averaged over {', '.join(averaged)}")
        if place:
            notes.append(f"at {place}")
        several = "means and 95 % intervals across seeds"
        shows = several if runs["seed"].nunique() > 1 else "one seed, so without intervals"
        finish(figure, f"Along {column}: {shows}", self.footer, figure.axes, note="; ".join(notes))
        return figure

    @in_style()
    def _lines(self, metric: str, runs: "pd.DataFrame", place: str) -> Figure:
        """One metric along the first crossed axis with 95 % intervals across seeds, at a ``place``
        on the remaining ones: a line for each value of the second, a panel for each method, and for
        its Genies on cars and on edges.
        """
        name, other = self.design.crossed[:2]
        column, other_column = self.design.columns[name], self.design.columns[other]
        means = across_seeds(runs[runs["component"] == ""], [column, other_column], own=self.words)
        means = means[(means["metric"] == metric) & means["value"].notna()]
        panels = list(means.groupby(["method", "placement"], sort=False))
        levels = list(dict.fromkeys(means[other_column]))
        shades = LEVEL_COLOURS(np.linspace(0.0, 0.85, len(levels)))
        figure = Figure(figsize=(self.width_in, 0.2 + 1.3 * len(panels)))
        grid = figure.subplots(max(1, len(panels)), 1, squeeze=False, sharex=True, sharey=True)
        for panel, (method_and_place, of_panel) in zip(grid[:, 0], panels, strict=True):
            method, placement = map(str, method_and_place)
            where = f", {PLACEMENTS[placement]}" if placement in PLACEMENTS else ""
            panel.set_title(f"{self.titles[method]}{where}")
            looks = [
                {
                    "label": f"{other_column} = {_shortened(level)}",
                    "color": shades[number],
                    "marker": style.MARKERS[number % len(style.MARKERS)],
                }
                for number, level in enumerate(levels)
            ]
            of_level = [of_panel[of_panel[other_column] == level] for level in levels]
            _draw(panel, self.design.axes[name], column, list(zip(of_level, looks, strict=True)))
            if self._is_share(metric):
                panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        figure.supylabel(self._label(metric))
        grid[-1, 0].set_xlabel(column)
        if means["value"].min() >= 0:
            grid[0, 0].set_ylim(bottom=0)
        _make_room(figure, 1)
        note = f"at {place}" if place else ""
        finish(figure, f"{self._label(metric)} along {column}", self.footer, figure.axes, note=note)
        return figure

    @in_style()
    def _heat(self, runs: "pd.DataFrame", place: str, metrics: Sequence[str] = ()) -> Figure:
        """Means across seeds over the first two crossed axes, the first upwards, at a ``place`` on
        the remaining ones: a row of panels a metric (by default the headlines), a column a method.

        Darker is more, on one scale a metric, which is logarithmic where values span decades. Of
        Genies' metrics those on cars are shown. Methods on which neither axis has an effect are
        left out where it has one on another, and named above the panels.
        """
        first, second = (self.design.columns[name] for name in self.design.crossed[:2])
        means = across_seeds(runs[runs["component"] == ""], [first, second], own=self.words)
        metrics = metrics or shown(HEADLINE, means["metric"])
        means = means[
            means["placement"].isin(("all", "car"))
            & means["metric"].isin(metrics)
            & means["value"].notna()
        ]
        of_methods = means.groupby("method", sort=False)
        varying = [
            method
            for method, of_method in of_methods
            if of_method.groupby("metric")["value"].nunique().max() > 1
        ]
        methods = varying or [method for method, _ in of_methods]
        constant = [self.titles[str(method)] for method, _ in of_methods if method not in methods]
        metrics = [metric for metric in metrics if (means["metric"] == metric).any()]
        up, right = ([*dict.fromkeys(runs[column])] for column in (first, second))
        height_in = 0.5 + len(metrics) * (0.8 + 0.22 * len(up))
        figure = Figure(figsize=(self.width_in, max(2.0, height_in)))
        grid = figure.subplots(max(1, len(metrics)), max(1, len(methods)), squeeze=False)
        for row, metric in zip(grid, metrics, strict=False):
            of_metric = means[(means["metric"] == metric) & means["method"].isin(methods)]
            values = of_metric["value"].tolist()
            scale = (LogNorm if spans_much(values) else Normalize)(min(values), max(values))
            maps: list[Axes] = []
            for panel, method in zip(row, methods, strict=True):
                cells = of_metric[of_metric["method"] == method].pivot_table(
                    index=first, columns=second, values="value", sort=False
                )
                if cells.empty:
                    panel.remove()
                    continue
                cells = cells.reindex(index=up, columns=right)
                _heat_map(panel, cells, scale, percent=self._is_share(metric))
                panel.set_title(self.titles[str(method)])
                panel.set_xlabel(second)
                panel.set_ylabel("" if maps else first)
                maps.append(panel)
            shades = ScalarMappable(norm=scale, cmap=HEAT_COLOURS)
            bar = figure.colorbar(shades, ax=maps, label=_wrapped(self._label(metric)), pad=0.01)
            if isinstance(scale, LogNorm):
                ticks = _round_ticks(min(values), max(values))
                bar.set_ticks(ticks, labels=[number_text(tick) for tick in ticks])
                bar.ax.yaxis.set_minor_locator(NullLocator())
            elif self._is_share(metric):
                bar.formatter = FuncFormatter(percent_tick)
        title = f"Over {first} and {second}: means across seeds"
        _make_room(figure, len(metrics))
        notes = [f"at {place}"] if place else []
        if constant:
            notes.append(f"the same everywhere: {', '.join(constant)}")
        finish(figure, title, self.footer, note="; ".join(notes))
        return figure


def _wrapped(label: str, narrow: bool = False) -> str:
    return textwrap.fill(label, SHORT_LABEL_CHARACTERS if narrow else LABEL_CHARACTERS)


def _heat_map(panel: Axes, cells: "pd.DataFrame", scale: Normalize, percent: bool) -> None:
    values = cells.to_numpy(float)
    panel.imshow(values, cmap=HEAT_COLOURS, norm=scale, aspect="auto", origin="lower")
    panel.grid(False)
    _name_ticks(panel, [_shortened(level) for level in cells.columns])
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


def _name_ticks(panel: Axes, names: Sequence[str]) -> None:
    """Names the places 0, 1, ... of the axis to the right, upright where they are long."""
    panel.set_xticks(range(len(names)), names)
    figure = panel.get_figure(root=True)
    assert figure is not None
    room_in = panel.get_position().width * figure.get_figwidth()
    if sum(len(name) + 2 for name in names) * character_in("xtick.labelsize") > room_in:
        for name in panel.get_xticklabels():
            name.set_rotation(90)


def _make_room(figure: Figure, rows: int) -> None:
    """Makes the figure higher where names of ticks stand upright below so many rows of panels."""
    upright = [
        len(name.get_text())
        for panel in figure.axes
        for name in panel.get_xticklabels()
        if name.get_rotation()
    ]
    more_in = max(upright, default=0) * character_in("xtick.labelsize")
    figure.set_figheight(figure.get_figheight() + rows * more_in)


def _by_method(
    means: "pd.DataFrame", titles: Mapping[str, str]
) -> "list[tuple[pd.DataFrame, dict[str, Any]]]":
    """The means of each method, and of its Genies on cars and on edges, with the look of its
    line.
    """
    alone = means["method"].nunique() == 1
    return [
        (of_line, _look(str(method), str(placement), titles, alone))
        for (method, placement), of_line in means.groupby(["method", "placement"], sort=False)
        if of_line["value"].notna().any()
    ]


def _draw(
    panel: Axes,
    axis: Axis,
    column: str,
    series: "Sequence[tuple[pd.DataFrame, dict[str, Any]]]",
) -> None:
    """Means along an axis with their intervals, each series in its look."""
    levels = list(dict.fromkeys(level for means, _ in series for level in means[column]))
    numbers = [level for level in levels if isinstance(level, float)]
    numeric = len(numbers) == len(levels)
    for number, (means, look) in enumerate(series):
        if numeric:
            means = means.sort_values(column)
        x = (
            means[column].to_numpy(float)
            if numeric
            else [
                levels.index(level) + BESIDE * (number - (len(series) - 1) / 2) / len(series)
                for level in means[column]
            ]
        )
        ends = [means["value"] - means["low"], means["high"] - means["value"]]
        line = {"linestyle": "none"} if not numeric or axis.sampled else {}
        panel.errorbar(x, means["value"], yerr=ends, markersize=3.5, capsize=2, **(look | line))
    if not numeric:
        names = [_shortened(level) for level in levels]
        _name_ticks(panel, names)
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
    line = style.PLACEMENT_LINES[placement] | _filling(placement)
    if alone:
        return line | {
            "label": f"Genies {PLACEMENTS[placement]}",
            "marker": style.MARKERS[list(PLACEMENTS).index(placement)],
        }
    return line | marker | {"label": titles[method], "color": style.method_colour(style_number)}


def _filling(placement: str) -> dict[str, Any]:
    """Markers of Genies on cars are hollow."""
    return {"markerfacecolor": "white"} if placement == "car" else {}


def _explain_filling(panel: Axes, means: "pd.DataFrame") -> None:
    """Puts what hollow and full markers mean into the legend, where methods have both."""
    placements = set(means["placement"]) & set(PLACEMENTS)
    if placements and means["method"].nunique() > 1:
        for placement, where in PLACEMENTS.items():
            look: dict[str, Any] = {"color": "0.4", "marker": "o", "linestyle": "none"}
            panel.plot(
                [], [], label=f"Genies {where}", markersize=3.5, **look, **_filling(placement)
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
