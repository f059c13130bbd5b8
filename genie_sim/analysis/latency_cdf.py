"""One figure: the distribution of response times; of several seeds their mean, with its band."""

import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import (
    Panels,
    draw_band,
    figure_grid,
    finish,
    finish_axes,
    in_style,
    is_narrow,
    label_outer,
    logarithmic_x,
    seeds_of,
)
from genie_sim.analysis.frame_metrics import response_ms
from genie_sim.analysis.metric import DEADLINE_MS
from genie_sim.analysis.statistics import mean_bands, thinned
from genie_sim.analysis.style import LINE_IN
from genie_sim.base.text import percent_text
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo

TITLE_CHARACTERS_PER_IN = 15
ANSWERED, FRESH = "answered", "fresh"
FRESH_LABEL, DEADLINE_LABEL = "fresh results", f"{DEADLINE_MS:g} ms deadline"
FRESH_LOOK: dict[str, Any] = {
    "linewidth": 0.9,
    "linestyle": (0, (4, 2)),
    "markerfacecolor": "white",
    "marker": "o",
    "markersize": 3.5,
}
MARKERS_APART = 0.3  # along a curve, in diagonals of the panel

Methods = Sequence[MethodInfo]


@in_style()
def latency_cdf(
    panels: Panels,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    of: str = "published",
    *,
    ax: Axes | None = None,
) -> Figure:
    """Response time under each method, with the 33 ms deadline (paper: Fig. "cdf-time").

    A curve of the published frames ends at the share of answered ones; of the answered frames alone
    that share stands above each panel.
    The fresh result is a thin curve with hollow markers where it differs from the first answer.
    Markers stand at other places on each curve, so equal curves are told apart. Of several seeds a
    curve is the mean of theirs, with a band: the 95 % t interval at each time.

    Parameters
    ----------
    panels : mapping of str to table, or to sequence of table
        The table ``frames`` of each run, or those of its seeds, by its label.
    methods : sequence of MethodInfo
        Those that ran, in the order of their colours.
    footer : str
        Names the run.
    width_in : float, optional
        The figure's width in inches; by default a column's or a page's, whichever fits.
    of : str
        ``published``: a curve ends at the share of frames that were answered at all. ``answered``,
        the paper's way: every curve reaches 1, however many frames were dropped.
    ax : Axes, optional
        Where to draw the one panel that there is; by default in a figure of its own.
    """
    figure, axes = figure_grid(panels, width_in, ax)
    tables = {label: seeds_of(frames) for label, frames in panels.items()}
    low, high = limits_ms(frames for seeds in tables.values() for frames in seeds)
    if ax is not None and ax.lines:  # another run's
        low, high = min(low, ax.get_xlim()[0]), max(high, ax.get_xlim()[1])
    several, title_lines = len(panels) > 1, 0
    for axis, (label, frames) in zip(axes, tables.items(), strict=True):
        curves = list(curves_of(frames, methods))
        for curve in curves:
            label_once = curve.method if curve.answer == ANSWERED else None
            draw(axis, curve, end_ms=high, of=of, label=label_once)
        if any(curve.answer == FRESH and any(map(len, curve.values_ms)) for curve in curves):
            axis.plot([], [], label=FRESH_LABEL, **(FRESH_LOOK | {"color": "0.4"}))
        draw_deadline(axis)
        lines = [label] if several else []
        if of == ANSWERED:
            room = int(axis.get_position().width * figure.get_figwidth() * TITLE_CHARACTERS_PER_IN)
            lines += _share_lines(curves, room)
        axis.set_title("\n".join(lines))
        title_lines = max(title_lines, len(lines))
        axis.set_ylim(0, 1.02)
        logarithmic_x(axis, low, high, (1,) if several and is_narrow(width_in) else (1, 2, 5))
    label_outer(axes, "response time [ms], logarithmic", f"share of {of} frames")
    title = f"Response time from the camera's stamp to the first answer, share of {of} frames"
    seeds = max(map(len, tables.values()))
    if seeds > 1:
        title += f"; means of {seeds} seeds with 95 % intervals"
    if ax is None:
        spot = axes[0].get_subplotspec()
        assert spot is not None, "a panel of its own figure"
        titles_in = LINE_IN * title_lines * spot.get_gridspec().nrows
        figure.set_figheight(figure.get_figheight() + titles_in)
        finish(figure, title, footer, axes)
    else:
        finish_axes(ax)
    return figure


def draw_deadline(axis: Axes) -> None:
    """The 33 ms deadline, dashed; once in a panel."""
    drawing: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": "--"}
    if all(line.get_label() != DEADLINE_LABEL for line in axis.lines):
        axis.axvline(DEADLINE_MS, label=DEADLINE_LABEL, **drawing)


class Curve(NamedTuple):
    """The distribution of a method's times to an answer.

    Parameters
    ----------
    answer : str
        ``ANSWERED``, or ``FRESH`` for the fresh results alone.
    method : str
        The method's title.
    values_ms : sequence of array of float
        Of each seed the times in milliseconds, sorted.
    published : sequence of int
        How many frames were published, of each seed.
    drawing : mapping
        Colour, dashes, markers and width of the line.
    """

    answer: str
    method: str
    values_ms: Sequence[Any]
    published: Sequence[int]
    drawing: Mapping[str, Any]

    @property
    def share(self) -> str:
        """Of how many published frames the times are, mean over the seeds."""
        shares = [
            len(values_ms) / published
            for values_ms, published in zip(self.values_ms, self.published, strict=True)
        ]
        return percent_text(math.fsum(shares) / len(shares), digits=2)


def curves_of(seeds: Sequence[Columns], methods: Methods) -> Iterator[Curve]:
    """The first answers of each method, and its fresh ones where their times differ."""
    styles = style.method_styles([method.name for method in methods])
    for place, (style_number, method) in enumerate(zip(styles, methods, strict=True)):
        tables = [frames.where(method=method.name) for frames in seeds]
        tables = [rows for rows in tables if len(rows)]
        if not tables:
            continue
        first, fresh = (
            [_defined(response_ms(rows, answer)) for rows in tables]
            for answer in ("first", "fresh")
        )
        published = [len(rows) for rows in tables]
        start = MARKERS_APART * (place + 0.5) / len(methods)
        line = style.method_line(style_number) | {
            "marker": style.method_marker(style_number),
            "markevery": (start, MARKERS_APART),
            "markersize": 3.5,
        }
        yield Curve(ANSWERED, method.title, values_ms=first, published=published, drawing=line)
        if not all(map(np.array_equal, first, fresh)):
            thin = line | FRESH_LOOK | {"marker": line["marker"]}
            yield Curve(FRESH, method.title, values_ms=fresh, published=published, drawing=thin)


def _share_lines(curves: Sequence[Curve], room: int) -> list[str]:
    """The shares of answered frames and of those with a fresh result, in lines of ``room``
    characters.
    """
    lines = []
    for answer in (ANSWERED, FRESH):
        # a method and its share stay on one line
        shares = [
            f"{curve.method} {curve.share}".replace(" ", "\u00a0")
            for curve in curves
            if curve.answer == answer
        ]
        if shares:
            lines += textwrap.wrap(f"{answer}: {', '.join(shares)}", room)
    return lines


def limits_ms(tables: Iterable[Columns]) -> tuple[float, float]:
    """Of all response times and the deadline, with some room; a logarithmic axis starts at 0.1 ms
    at the latest.
    """
    times = [
        _defined(response_ms(frames, answer)) for frames in tables for answer in ("first", "fresh")
    ]
    values_ms = np.concatenate([*times, [DEADLINE_MS]])
    return max(0.8 * float(values_ms.min()), 0.1), 1.25 * float(values_ms.max())


def draw(axis: Axes, curve: Curve, *, end_ms: float, of: str, label: str | None) -> None:
    """One curve, level after its last time; nothing for no time at all.

    Parameters
    ----------
    axis : Axes
        Where it is drawn.
    curve : Curve
        What is drawn.
    end_ms : float
        Where the axis ends.
    of : str
        ``published`` or ``answered``: of which frames shares are.
    label : str or None
        Its text in the legend; without one it is not there.
    """
    if not any(map(len, curve.values_ms)):
        return
    if len(curve.values_ms) == 1:
        values_ms = curve.values_ms[0]
        places = thinned(len(values_ms))
        shares = (places + 1) / (curve.published[0] if of == "published" else len(values_ms))
        ends = [*values_ms[places], end_ms]
        axis.plot(ends, [*shares, shares[-1]], drawstyle="steps-post", label=label, **curve.drawing)
        return
    times_ms = np.unique(np.concatenate(curve.values_ms))
    times_ms = times_ms[thinned(len(times_ms))]
    seeds = []
    for values_ms, published in zip(curve.values_ms, curve.published, strict=True):
        whole = published if of == "published" else len(values_ms)
        if whole:
            seeds.append(np.searchsorted(values_ms, times_ms, side="right") / whole)
    bands = mean_bands(np.array(seeds), shares=True)
    x = np.append(times_ms, end_ms)
    mean, low, high = (np.append(line, line[-1]) for line in bands)
    axis.plot(x, mean, drawstyle="steps-post", label=label, **curve.drawing)
    draw_band(axis, x, low, high, colour=str(curve.drawing["color"]), step="post")


def _defined(values: Any) -> Any:
    return np.sort(values[~np.isnan(values)])
