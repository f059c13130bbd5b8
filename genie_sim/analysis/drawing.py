"""What all figures share: their style and legend."""

import io
import textwrap
from collections.abc import Iterable, Sequence
from functools import partial
from string import ascii_lowercase
from typing import Any, Literal

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.style import context
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from genie_sim.analysis import style
from genie_sim.analysis.style import CHARACTER_IN, COLUMN_IN, LINE_IN

BAND_OPACITY = 0.22
MAX_LEGEND = 0.2  # of the figure's height, if a column leaves room for it
# height of a figure in a column, and of its panels, all of them and a row
MAX_COLUMN_IN, MIN_PANELS_IN, MIN_ROW_IN = 3.2, 1.3, 0.9
MANY_LABELS = 6  # in a legend
COLOUR_BAR = "<colorbar>"  # matplotlib's label of its axes
# Within it, and in a function that it decorates, matplotlib draws in this style, whatever the
# user's is.
in_style = partial(context, ["default", style.RC])


class NotebookFigure(Figure):
    """A figure that a notebook shows, also where matplotlib has not been set up for it."""

    def _repr_png_(self) -> bytes:
        png = io.BytesIO()
        self.savefig(png, format="png")
        return png.getvalue()


def is_narrow(width_in: float | None) -> bool:
    """Whether a width is that of a column and not of a page."""
    return width_in is not None and width_in <= COLUMN_IN


def one_panel(width_in: float, height_in: float, ax: Axes | None) -> tuple[Figure, Axes]:
    """A figure with one panel, or the user's own panel ``ax``."""
    if ax is not None:
        return _figure_of(ax), ax
    figure = NotebookFigure(figsize=(width_in, height_in))
    return figure, figure.subplots()


def _figure_of(ax: Axes) -> Figure:
    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def finish_panel(axis: Axes, ax: Axes | None, title: str, footer: str) -> Figure:
    """The figure of one panel, finished; a user's own panel ``ax`` gets its legend inside it, and
    its figure is left alone.
    """
    figure = _figure_of(axis)
    if ax is None:
        finish(figure, title, footer, [axis])
    elif named := handles([ax]):
        ax.legend(list(named.values()), list(named))
    return figure


def draw_point(
    axis: Axes,
    x: tuple[float, float | None, float | None],
    y: tuple[float, float | None, float | None],
    style_number: int,
    label: str = "",
) -> None:
    """The mark of a method at two values, each with the ends of its interval where it has one."""
    reach = [
        None if low is None or high is None else [[max(value - low, 0.0)], [max(high - value, 0.0)]]
        for value, low, high in (x, y)
    ]
    axis.errorbar(
        x[0],
        y[0],
        xerr=reach[0],
        yerr=reach[1],
        color=style.method_colour(style_number),
        marker=style.method_marker(style_number),
        markersize=4,
        capsize=2.5,
        linestyle="",
        label=label or None,
    )


def name_rows(axis: Axes, names: Sequence[str]) -> None:
    """Rows of points, the first at the top, by these names."""
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(max(len(names), 1) - 0.5, -0.5)
    axis.grid(axis="y", visible=False)


def draw_band(axis: Axes, x: Any, low: Any, high: Any, *, colour: str, step: Any = None) -> None:
    """A light band from ``low`` to ``high``: the interval of a curve."""
    look: dict[str, Any] = {"color": colour, "alpha": BAND_OPACITY, "linewidth": 0}
    axis.fill_between(x, low, high, step=step, **look)


def finish(
    figure: Figure, title: str, footer: str, axes: Iterable[Axes] = (), note: str = ""
) -> None:
    """Draws the common legend below the panels, for which the figure grows, and names the figure.
    The panels grow, too, if the legend were more than ``MAX_LEGEND`` of the figure. Several panels
    side by side in a column, and one with a long legend, have small text.

    The title, and which run it is, stand in the file alone: a paper has its own caption.

    Parameters
    ----------
    figure : Figure
        With its panels drawn.
    title, footer : str
        What it shows, and of which run.
    axes : iterable of Axes
        The panels whose labels make up the legend.
    note : str
        What the panels do not show; it stands above them.
    """
    axes = list(axes)
    side_by_side = any(axis.get_position().x0 > 0.3 for axis in figure.axes)
    is_crowded = side_by_side or len(handles(axes)) > MANY_LABELS
    if is_narrow(figure.get_figwidth()) and is_crowded:
        with context(style.SMALL):
            for text in figure.findobj(Text):
                text.set_fontsize(min(text.get_fontsize(), style.SMALL_POINTS))
            _finish(figure, title, footer, axes, note=note)
    else:
        _finish(figure, title, footer, axes, note=note)


def _finish(figure: Figure, title: str, footer: str, axes: Iterable[Axes], *, note: str) -> None:
    """Note, letters, sizes of ticks, legend and layout, with text as the style in force has it."""
    width_in, height_in = figure.get_size_inches()
    if note:
        characters = int((width_in - 0.1) / character_in("figure.titlesize"))
        figure.suptitle(textwrap.fill(note, characters), x=0.01, ha="left")
    letter_panels(figure)
    figure.set_label(f"{title}\n{footer}")
    for axis in figure.axes:  # ticks that are made later, too
        axis.tick_params(labelsize=rcParams["xtick.labelsize"])
    below, named = 0.0, handles(axes)
    if named:
        columns = _columns(list(named), width_in)
        figure.legend(list(named.values()), list(named), loc="lower center", ncols=columns)
        legend_in = (-(-len(named) // columns) + 0.4) * line_in("legend.fontsize")
        height_in = max(height_in, (1 / MAX_LEGEND - 1) * legend_in)
        if is_narrow(width_in):
            spots = [spot for axis in figure.axes if (spot := axis.get_subplotspec()) is not None]
            rows = max((spot.get_gridspec().nrows for spot in spots), default=1)
            least_in = max(MIN_PANELS_IN, MIN_ROW_IN * rows)
            height_in = min(height_in, max(MAX_COLUMN_IN - legend_in, least_in))
        figure.set_figheight(height_in + legend_in)
        below = legend_in / (height_in + legend_in)
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))


def character_in(text: str) -> float:
    """About the width [in] of a character of a kind of text, such as ``legend.fontsize``."""
    return CHARACTER_IN * _points(text) / style.TEXT_POINTS


def line_in(text: str) -> float:
    """The height [in] of a line of a kind of text."""
    return LINE_IN * _points(text) / style.TEXT_POINTS


def _points(text: str) -> float:
    parameters: Any = rcParams
    return float(parameters[text])


def letter_panels(figure: Figure) -> None:
    """Puts (a), (b) and so on before the titles of several panels."""
    panels = [axis for axis in figure.axes if axis.get_label() != COLOUR_BAR]
    for number, panel in enumerate(panels if len(panels) > 1 else ()):
        letters = ascii_lowercase[number % 26] * (number // 26 + 1)
        side: Literal["center", "left"] = "center" if panel.get_title() else "left"
        panel.set_title(f"({letters}) {panel.get_title(loc=side)}".rstrip(), loc=side)


def _columns(labels: Sequence[str], width_in: float) -> int:
    """As many columns of a legend as fit the figure, each as wide as its longest label, and no more
    than its rows need.
    """
    character, handle_in = character_in("legend.fontsize"), 2.5 * line_in("legend.fontsize")
    for columns in range(len(labels), 1, -1):
        parts = np.array_split([len(label) for label in labels], columns)  # as matplotlib does
        if sum(part.max() * character + handle_in for part in parts) <= width_in - 0.1:
            rows = -(-len(labels) // columns)
            return -(-len(labels) // rows)
    return 1


def handles(axes: Iterable[Axes]) -> dict[str, Any]:
    """What stands in the legends of these panels, each label once; of points with error bars the
    marker alone, so that it is seen.
    """
    return {
        label: _marker_alone(handle)
        for axis in axes
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }


def _marker_alone(handle: Any) -> Any:
    has_marker = isinstance(handle, ErrorbarContainer) and handle[0].get_marker() != "None"
    return handle[0] if has_marker else handle


def logarithmic_x(axis: Axes, low: float, high: float, digits: Sequence[int] = (1, 2, 5)) -> None:
    """A logarithmic axis with ticks at these multiples of each power of ten, written out."""
    ticks = [digit * 10.0**power for power in range(-6, 12) for digit in digits]
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    axis.xaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
