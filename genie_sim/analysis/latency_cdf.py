"""One figure: the distribution of response times; of several seeds their mean, with its band."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.drawing import (
    draw_band,
    finish_panel,
    in_style,
    logarithmic_x,
    one_panel,
)
from genie_sim.analysis.frame_metrics import response_ms
from genie_sim.analysis.metric import DEADLINE_MS
from genie_sim.analysis.statistics import has_interval, mean_bands, thinned
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo

FRESH_LOOK: dict[str, Any] = {
    "linewidth": 0.9,
    "linestyle": (0, (4, 2)),
    "markerfacecolor": "white",
    "marker": "o",
    "markersize": 3.5,
}
MARKERS_APART = 0.3  # along a curve, in diagonals of the panel


@in_style()
def latency_cdf(
    seeds: Sequence[Columns],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Response time under each method, with the 33 ms deadline (paper: Fig. "cdf-time").

    A curve ends at the share of published frames that were answered at all. The fresh result is a
    thin curve with hollow markers where it differs from the first answer. Markers stand at other
    places on each curve, so equal curves are told apart. Of several seeds a curve is the mean of
    theirs, with a band from three on: the 95 % t interval at each time, within 0 and 1.

    Parameters
    ----------
    seeds : sequence of Columns
        The table ``frames`` of each seed.
    methods : sequence of MethodInfo
        Those that ran, in the order of their colours.
    footer : str
        Names the run.
    width_in : float, optional
        The figure's width in inches; by default a column's.
    ax : Axes, optional
        Where to draw; by default in a figure of its own.
    """
    _, axis = one_panel(width_in or style.COLUMN_IN, 2.05, ax)
    low, high = limits_ms(seeds)
    curves = list(curves_of(seeds, methods))
    for curve in curves:
        _draw(axis, curve, end_ms=high)
    if any(curve.is_fresh and any(map(len, curve.values_ms)) for curve in curves):
        axis.plot([], [], label="fresh results", **(FRESH_LOOK | {"color": "0.4"}))
    deadline: dict[str, Any] = {"color": "black", "linewidth": 0.9, "linestyle": "--"}
    axis.axvline(DEADLINE_MS, label=f"{DEADLINE_MS:g} ms deadline", **deadline)
    axis.set_ylim(0, 1.02)
    logarithmic_x(axis, low, high)
    axis.set_xlabel("response time [ms], logarithmic")
    axis.set_ylabel("share of published frames")
    title = "Response time from the camera's stamp to the first answer, share of published frames"
    if len(seeds) > 1:
        title += f"; means of {len(seeds)} seeds"
    if has_interval(len(seeds)):
        title += " with 95 % intervals"
    return finish_panel(axis, ax, title, footer)


class Curve(NamedTuple):
    """The distribution of a method's times to an answer.

    Parameters
    ----------
    is_fresh : bool
        Whether it is of the fresh results alone.
    method : str
        The method's title.
    values_ms : sequence of array of float
        Of each seed the times in milliseconds, sorted.
    published : sequence of int
        How many frames were published, of each seed.
    drawing : mapping
        Colour, dashes, markers and width of the line.
    """

    is_fresh: bool
    method: str
    values_ms: Sequence[Any]
    published: Sequence[int]
    drawing: Mapping[str, Any]


def curves_of(seeds: Sequence[Columns], methods: Sequence[MethodInfo]) -> Iterator[Curve]:
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
        yield Curve(False, method.title, values_ms=first, published=published, drawing=line)
        if not all(map(np.array_equal, first, fresh)):
            thin = line | FRESH_LOOK | {"marker": line["marker"]}
            yield Curve(True, method.title, values_ms=fresh, published=published, drawing=thin)


def limits_ms(tables: Iterable[Columns]) -> tuple[float, float]:
    """Of all response times and the deadline, with some room; a logarithmic axis starts at 0.1 ms
    at the latest.
    """
    times = [
        _defined(response_ms(frames, answer)) for frames in tables for answer in ("first", "fresh")
    ]
    values_ms = np.concatenate([*times, [DEADLINE_MS]])
    return max(0.8 * float(values_ms.min()), 0.1), 1.25 * float(values_ms.max())


def _draw(axis: Axes, curve: Curve, end_ms: float) -> None:
    """One curve, level after its last time until the axis ends; nothing for no time at all. In the
    legend stand first answers alone.
    """
    if not any(map(len, curve.values_ms)):
        return
    label = None if curve.is_fresh else curve.method
    if len(curve.values_ms) == 1:
        values_ms = curve.values_ms[0]
        places = thinned(len(values_ms))
        shares = (places + 1) / curve.published[0]
        ends = [*values_ms[places], end_ms]
        axis.plot(ends, [*shares, shares[-1]], drawstyle="steps-post", label=label, **curve.drawing)
        return
    times_ms = np.unique(np.concatenate(curve.values_ms))
    times_ms = times_ms[thinned(len(times_ms))]
    of_seeds = zip(curve.values_ms, curve.published, strict=True)
    rises = [np.searchsorted(values, times_ms, side="right") / n for values, n in of_seeds]
    bands = mean_bands(np.array(rises), shares=True)
    x = np.append(times_ms, end_ms)
    mean, low, high = (np.append(line, line[-1]) for line in bands)
    axis.plot(x, mean, drawstyle="steps-post", label=label, **curve.drawing)
    draw_band(axis, x, low, high, colour=str(curve.drawing["color"]), step="post")


def _defined(values: Any) -> Any:
    return np.sort(values[~np.isnan(values)])
