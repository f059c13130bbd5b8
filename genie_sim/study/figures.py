"""Figures of a sweep: what reuse, response times and correctness do along each axis."""

import itertools
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import style
from genie_sim.analysis.drawing import (
    NotebookFigure,
    character_in,
    finish,
    in_style,
    is_narrow,
    logarithmic_x,
)
from genie_sim.analysis.metric import HEADLINE, SHORT, Metric
from genie_sim.analysis.registry import (
    Words,
    definition,
    is_drawn_logarithmically,
    shown,
    spans_much,
)
from genie_sim.analysis.statistics import has_interval
from genie_sim.analysis.style import PAGE_IN, PLACEMENTS, percent_tick
from genie_sim.analysis.tidy import across_seeds
from genie_sim.base.errors import UserError
from genie_sim.base.text import number_text
from genie_sim.study.design import Axis, Design, Level

if TYPE_CHECKING:
    import pandas as pd

MAX_PLACES = 6  # of the axes beyond the second, each with figures of its own
LEVEL_CHARACTERS = 16  # of a value that is a text
LEVEL_COLOURS = mpl.colormaps["viridis"]  # from dark to light: they keep their order in greyscale
BESIDE = 0.4  # how far the points at a value that is no number lie apart, of its room
LABEL_CHARACTERS, SHORT_LABEL_CHARACTERS = 20, 15  # in a line beside an axis; in a column
MARKER_ROOM = 0.03  # above the highest value, of the panel's height


# means along an axis, and the look of their line
Series: TypeAlias = "tuple[pd.DataFrame, dict[str, Any]]"


class Panel(NamedTuple):
    """What a panel shows: a metric, and lines of it."""

    metric: str
    title: str
    series: "Sequence[Series]"


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

        Along each axis; where there is another, a figure of each headline metric with a line for
        each of its values. Where there are more axes, every combination of their first values has
        figures of its own. Only over values that were drawn is anything averaged, and the figure
        says so.
        """
        for name in self.design.axes:
            others = [other for other in self.design.crossed if other != name]
            for suffix, place, runs in self._places(others[1:]):
                if not others:
                    yield name, self.along(name)
                    continue
                for metric in shown(HEADLINE, runs["metric"]):
                    figure = self._lines(name, others[0], metric, runs, place)
                    yield f"{name}-{metric}{suffix}", figure

    def of(self, metric: str) -> Figure:
        """One metric along the first axis; of two crossed axes with a line for each value of the
        second. Raises ``UserError`` where no method has a value.
        """
        runs = self.runs[(self.runs["metric"] == metric) & (self.runs["component"] == "")]
        if not runs["value"].notna().any():
            raise UserError(f"{metric}: this sweep has no value of it to draw")
        name, *others = self.design.crossed or self.design.axes
        if self.design.crossed and others:
            _, place, runs = next(self._places(others[1:]))
            return self._lines(name, others[0], metric, runs, place)
        return self.along(name, [metric])

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

    def along(self, name: str, metrics: Sequence[str] = ()) -> Figure:
        """Draws means along one axis with their 95 % intervals across seeds, of these ``metrics``,
        by default the short list or, in a column, the headlines.

        Drawn values of a sampled axis are no line but points, for the other sampled axes differ
        from one to the next.
        """
        column, narrow = self.design.columns[name], is_narrow(self.width_in)
        means = self._means(self.runs, [column])
        names = metrics or shown(HEADLINE if narrow else SHORT, means["metric"])
        panels = [
            Panel(metric, "", _by_method(of_metric, self.titles))
            for metric in names
            if len(of_metric := means[means["metric"] == metric])
        ]
        wide = 1 if len(metrics) == 1 else 2 if narrow else 3
        seeds = self.runs["seed"].nunique()
        shows = "means and 95 % intervals across seeds"
        if not has_interval(seeds):
            shows = "means of two seeds" if seeds > 1 else "one seed"
            shows += ", so without intervals"
        return self._facets(name, panels, wide, f"Along {column}: {shows}")

    def _lines(
        self, name: str, other: str, metric: str, runs: "pd.DataFrame", place: str
    ) -> Figure:
        """One metric along an axis with 95 % intervals across seeds, at a ``place`` on the
        remaining ones: a line for each value of the ``other``, a panel for each method, and for its
        Genies on cars and on edges.
        """
        column, other_column = self.design.columns[name], self.design.columns[other]
        means = self._means(runs, [column, other_column])
        means = means[(means["metric"] == metric) & means["value"].notna()]
        levels = list(dict.fromkeys(means[other_column]))
        shades = LEVEL_COLOURS(np.linspace(0.0, 0.85, len(levels)))
        looks = [
            {
                "label": f"{other_column} = {_shortened(level)}",
                "color": shades[number],
                "marker": style.MARKERS[number % len(style.MARKERS)],
            }
            for number, level in enumerate(levels)
        ]
        panels = []
        for (method, placement), of_panel in means.groupby(["method", "placement"], sort=False):
            where = f", {PLACEMENTS[placement]}" if placement in PLACEMENTS else ""
            of_level = [of_panel[of_panel[other_column] == level] for level in levels]
            series = list(zip(of_level, looks, strict=True))
            panels.append(Panel(metric, f"{self.titles[str(method)]}{where}", series))
        wide = 1 if is_narrow(self.width_in) else min(len(panels), 3)
        title = f"{_label(definition(metric, self.words))} along {column}"
        return self._facets(name, panels, wide, title, place)

    def _means(self, runs: "pd.DataFrame", by: Sequence[str]) -> "pd.DataFrame":
        """Means across seeds of what is not of a component."""
        return across_seeds(runs[runs["component"] == ""], by, own=self.words)

    @in_style()
    def _facets(
        self, name: str, panels: "Sequence[Panel]", wide: int, title: str, place: str = ""
    ) -> Figure:
        """Panels along one axis, so many side by side, at a ``place`` on the remaining ones; those
        of one metric have one scale.
        """
        axis, column = self.design.axes[name], self.design.columns[name]
        narrow, rows = is_narrow(self.width_in), max(1, -(-len(panels) // wide))
        abouts = {facet.metric: definition(facet.metric, self.words) for facet in panels}
        titled = any(facet.title for facet in panels)
        row_in = 1.3 if titled else 0.8 if narrow and rows > 1 else 1.8
        figure = NotebookFigure(figsize=(self.width_in, (0.2 if narrow else 0.6) + row_in * rows))
        cells = list(figure.subplots(rows, wide, squeeze=False).flat)
        unused = len(cells) - len(panels)
        end = wide if narrow else len(cells)  # in a column names of ticks stand below the last row
        for panel in cells[end - unused : end]:
            panel.remove()
        del cells[end - unused : end]
        for number, (panel, facet) in enumerate(zip(cells, panels, strict=True)):
            _draw(panel, axis, column, facet.series)
            _explain_filling(panel, facet.series)
            panel.set_title(facet.title)
            if not titled:
                panel.set_ylabel(_wrapped(_label(abouts[facet.metric]), narrow))
            if (titled or narrow) and number + wide < len(panels):
                panel.tick_params(labelbottom=False)
            else:
                panel.set_xlabel(column)
        if titled:
            figure.supylabel(_label(abouts[panels[0].metric]))
        for metric, about in abouts.items():
            _scale(
                about,
                [
                    (panel, facet)
                    for panel, facet in zip(cells, panels, strict=True)
                    if facet.metric == metric
                ],
            )
        _make_room(figure, 1 if titled or narrow else rows)
        columns, crossed = self.design.columns, self.design.crossed
        averaged = [columns[axis] for axis in columns if axis not in crossed]
        notes = [f"averaged over {', '.join(averaged)}"] if averaged and name in crossed else []
        notes += [f"at {place}"] if place else []
        finish(figure, title, self.footer, figure.axes, note="; ".join(notes))
        return figure


def _scale(about: Metric, panels: "Sequence[tuple[Axes, Panel]]") -> None:
    """One scale for panels of a metric: from zero on, or logarithmic where values span decades."""
    means = [means["value"].dropna() for _, facet in panels for means, _ in facet.series]
    values = [value for of_line in means for value in of_line]
    ends = [panel.get_ylim() for panel, _ in panels]
    low, high = min(0.0, *(low for low, _ in ends)), max(high for _, high in ends)
    for panel, _ in panels:
        if about.unit == "%":
            panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        elif is_drawn_logarithmically(about, values):
            _scale_logarithmically(panel, min(values), max(values))
            continue
        panel.set_ylim(low, high + MARKER_ROOM * (high - low))


def _label(about: Metric) -> str:
    """A metric's title with its unit; ticks have the percent sign of shares."""
    return about.title if about.unit == "%" else about.label


def _wrapped(label: str, narrow: bool = False) -> str:
    return textwrap.fill(label, SHORT_LABEL_CHARACTERS if narrow else LABEL_CHARACTERS)


def _name_ticks(panel: Axes, names: Sequence[str]) -> None:
    """Names the places 0, 1, ... of the axis to the right, upright where they are long."""
    panel.set_xticks(range(len(names)), names)
    if len(names) * _longest_in(names) > _width_in(panel):
        for name in panel.get_xticklabels():
            name.set_rotation(90)


def _have_room(panel: Axes, ticks: Sequence[float]) -> bool:
    """Whether the names of these ticks, from low to high, have room on a logarithmic axis."""
    if len(ticks) < 2:
        return True
    apart = np.diff(np.log(ticks))
    room_in = _width_in(panel) * apart.min() / (apart.sum() + math.log(1.25 / 0.8))
    return bool(room_in > _longest_in([_shortened(tick) for tick in ticks]))


def _longest_in(names: Sequence[str]) -> float:
    """The width [in] of the longest name of a tick, and of a gap beside it."""
    return (max(map(len, names), default=0) + 1) * character_in("xtick.labelsize")


def _width_in(panel: Axes) -> float:
    figure = panel.get_figure(root=True)
    assert figure is not None
    return float(panel.get_position().width * figure.get_figwidth())


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


def _by_method(means: "pd.DataFrame", titles: Mapping[str, str]) -> "list[Series]":
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
    series: "Sequence[Series]",
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
        low, high = min(numbers), max(numbers)
        logarithmic_x(panel, 0.8 * low, 1.25 * high, (1, 2, 5) if high < 100 * low else (1,))
        ticks = sorted(numbers)
        if not axis.sampled and _have_room(panel, ticks):
            panel.set_xticks(ticks, [_shortened(tick) for tick in ticks])


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


def _explain_filling(panel: Axes, series: "Sequence[Series]") -> None:
    """Puts what hollow and full markers mean into the legend, where methods have both."""
    methods = {means["method"].iloc[0] for means, _ in series if len(means)}
    if len(methods) > 1 and any(means["placement"].isin(PLACEMENTS).any() for means, _ in series):
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


def _shortened(level: Level) -> str:
    text = level if isinstance(level, str) else number_text(level, digits=4)
    return text if len(text) <= LEVEL_CHARACTERS else f"{text[: LEVEL_CHARACTERS - 1]}…"
