"""Figures of a sweep: what reuse, response times and correctness do along each axis, and over two axes at once."""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import style
from genie_sim.analysis.drawing import finish, in_style
from genie_sim.analysis.statistics import across_seeds
from genie_sim.analysis.style import PAGE_IN, PLACEMENTS, percent_tick, thinned
from genie_sim.sweeps.design import PANELS, Axis, Design, Level, spans_much

if TYPE_CHECKING:
    import pandas as pd

MOST_TICKS = 8
MOST_COLUMNS = 4  # of panels, side by side
MOST_PLACES = 6  # of the axes beyond the second, each with figures of its own
LEVEL_CHARACTERS = 16  # of a value that is a text, as in the page
SIDE_BY_SIDE = (  # of these, where each value of another axis has a column of panels
    "image_reuse", "object_reuse", "first_answer_mean", "fresh_answered_share", "streaming_f1", "ghost_share"
)  # fmt: skip
HEATED = ("first_answer_mean", "object_reuse", "streaming_f1", "ghost_share")  # drawn as heat maps
SHARES = PANELS.keys() - {"confidence_boost", "first_answer_mean", "fresh_answer_mean"}
MARKER_ROOM = 0.03  # above the highest value, of the panel's height


def of_sweep(design: Design, runs: "pd.DataFrame", footer: str) -> Iterator[tuple[str, Figure]]:
    """Every figure with the name of its file; ``runs`` is ``tables.of_runs``.

    Along each axis, with a column of panels for each value of one other axis; a heat map of the first two crossed
    axes. Where there are more axes, every combination of their first values has figures of its own. Only over values
    that were drawn is anything averaged, and the figure says so.
    """
    columns, crossed = design.columns, design.crossed
    for name, axis in design.axes.items():
        others = [other for other in crossed if other != name]
        averaged = (
            []
            if axis.sampled
            else [columns[other] for other in design.axes if other not in crossed]
        )
        beside = columns[others[0]] if others else None
        for suffix, said, here in _places(runs, [columns[other] for other in others[1:]]):
            yield (
                f"{name}{suffix}",
                along(axis, columns[name], here, footer, beside, averaged, said),
            )
    if len(crossed) > 1:
        first, second = crossed[:2]
        for suffix, said, here in _places(runs, [columns[other] for other in crossed[2:]]):
            yield (
                f"{first}-{second}{suffix}",
                heat(columns[first], columns[second], here, footer, said),
            )


def _places(
    runs: "pd.DataFrame", columns: Sequence[str]
) -> "Iterator[tuple[str, str, pd.DataFrame]]":
    """The runs at every combination of values of these columns, with a suffix for file names and words for titles."""
    values = [list(dict.fromkeys(runs[column])) for column in columns]
    for number, place in enumerate(
        itertools.islice(itertools.product(*values), MOST_PLACES), start=1
    ):
        here = runs
        for column, value in zip(columns, place, strict=True):
            here = here[here[column] == value]
        said = ", ".join(
            f"{column} = {_shortened(value)}" for column, value in zip(columns, place, strict=True)
        )
        yield (f"-{number}" if columns else ""), said, here


@in_style()
def along(
    axis: Axis,
    column: str,
    runs: "pd.DataFrame",
    footer: str,
    beside: str | None = None,
    averaged: Sequence[str] = (),
    at: str = "",
) -> Figure:
    """Means along one axis with their 95 % intervals across seeds: a row of panels a metric, and with ``beside``
    another axis a column for each of its values. ``averaged`` axes and where the runs are ``at`` are told above them.

    Drawn values of a sampled axis are no line but points, for the other sampled axes differ from one to the next.
    """
    levels: Sequence[Any] = list(dict.fromkeys(runs[beside])) if beside else [None]
    kept = [levels[place] for place in thinned(len(levels), MOST_COLUMNS)]
    means = across_seeds(runs[runs["component"] == ""], [column, *([beside] if beside else [])])
    methods = list(dict.fromkeys(means["method"]))
    shown = [panel for panel in PANELS.items() if (means["metric"] == panel[0]).any()]
    shown = shown if beside is None else [panel for panel in shown if panel[0] in SIDE_BY_SIDE]
    wide = 3 if beside is None else len(kept)
    rows = max(1, -(-len(shown) // 3)) if beside is None else max(1, len(shown))
    figure = Figure(figsize=(PAGE_IN, 0.6 + (1.8 if beside is None else 1.3) * rows))
    grid = figure.subplots(rows, wide, squeeze=False, sharey=False if beside is None else "row")
    panels = [(metric, label, level) for metric, label in shown for level in kept]
    for panel, (metric, label, level) in zip(grid.flat, panels, strict=False):
        mine = means[means["metric"] == metric]
        _draw(panel, axis, column, mine if level is None else mine[mine[beside] == level], methods)
        place = panel.get_subplotspec()
        panel.set_ylabel(label if beside is None or place.is_first_col() else "")
        if beside is None or place.is_last_row():
            panel.set_xlabel(f"{column}, logarithmic" if panel.get_xscale() == "log" else column)
        if level is not None and place.is_first_row():
            panel.set_title(f"{beside} = {_shortened(level)}")
        if metric in SHARES:
            panel.yaxis.set_major_formatter(FuncFormatter(percent_tick))
    for panel in list(grid.flat)[len(panels) :]:
        panel.remove()
    for panel in (
        figure.axes if beside is None else grid[:, 0]
    ):  # after all are drawn, for a row shares its limits
        low, high = panel.get_ylim()
        low = min(0.0, low)
        panel.set_ylim(low, high + MARKER_ROOM * (high - low))
    note = [f"{len(kept)} of {len(levels)} values of {beside}"] if len(kept) < len(levels) else []
    note += [f"averaged over {', '.join(averaged)}"] if averaged else []
    note += [f"at {at}"] if at else []
    several = "means and 95 % intervals across seeds"
    shows = several if runs["seed"].nunique() > 1 else "one seed, so without intervals"
    finish(figure, f"Along {column}: {shows}", footer, figure.axes, "; ".join(note))
    return figure


@in_style()
def heat(first: str, second: str, runs: "pd.DataFrame", footer: str, at: str = "") -> Figure:
    """Means across seeds over two axes, ``second`` to the right and ``first`` upwards: a row of panels a metric, a
    column a method. Darker is more, on one scale a metric; of Genies' metrics those on cars are shown."""
    means = across_seeds(runs[runs["component"] == ""], [first, second])
    means = means[
        means["placement"].isin(("all", "car"))
        & means["metric"].isin(HEATED)
        & means["value"].notna()
    ]
    methods = list(dict.fromkeys(means["method"]))
    metrics = [metric for metric in HEATED if (means["metric"] == metric).any()]
    up, right = ([*dict.fromkeys(runs[column])] for column in (first, second))
    height_in = 0.5 + len(metrics) * (0.8 + 0.22 * len(up))
    figure = Figure(figsize=(PAGE_IN, max(2.0, height_in)))
    grid = figure.subplots(max(1, len(metrics)), max(1, len(methods)), squeeze=False)
    for row, metric in zip(grid, metrics, strict=False):
        mine = means[means["metric"] == metric]
        ends = (float(mine["value"].min()), float(mine["value"].max()))
        for panel, method in zip(row, methods, strict=True):
            cells = mine[mine["method"] == method].pivot_table(
                index=first, columns=second, values="value", sort=False
            )
            if cells.empty:
                panel.set_axis_off()
                continue
            _heat_map(panel, cells.reindex(index=up, columns=right), ends, percent=metric in SHARES)
            panel.set_title(f"{method}: {PANELS[metric]}")
            panel.set_xlabel(second)
            panel.set_ylabel(first if panel.get_subplotspec().is_first_col() else "")
    title = f"Over {first} and {second}: means across seeds, darker is more"
    finish(figure, title, footer, note=f"at {at}" if at else "")
    return figure


def _heat_map(panel: Axes, cells: "pd.DataFrame", ends: tuple[float, float], percent: bool) -> None:
    values = cells.to_numpy(float)
    panel.imshow(values, cmap="Blues", aspect="auto", origin="lower", vmin=ends[0], vmax=ends[1])
    panel.grid(False)
    panel.set_xticks(range(values.shape[1]), [_shortened(level) for level in cells.columns])
    panel.set_yticks(range(values.shape[0]), [_shortened(level) for level in cells.index])
    middle = sum(ends) / 2
    for (y, x), value in [
        (place, values[place]) for place in itertools.product(*map(range, values.shape))
    ]:
        if not math.isnan(value):
            text = f"{100 * value:.0f} %" if percent else f"{value:.3g}"
            panel.text(
                x,
                y,
                text,
                ha="center",
                va="center",
                color="white" if value > middle else "black",
                fontsize=7,
            )


def _draw(
    panel: Axes, axis: Axis, column: str, means: "pd.DataFrame", methods: Sequence[str]
) -> None:
    levels = list(dict.fromkeys(means[column]))
    numbers = [level for level in levels if isinstance(level, float)]
    numeric = len(numbers) == len(levels)
    for (method, placement), mine in means.groupby(["method", "placement"], sort=False):
        if numeric:
            mine = mine.sort_values(column)
        if mine["value"].notna().sum() == 0:
            continue
        x = (
            mine[column].to_numpy(float)
            if numeric
            else [levels.index(level) for level in mine[column]]
        )
        ends = [mine["value"] - mine["low"], mine["high"] - mine["value"]]
        line = _look(str(method), str(placement), methods, alone=means["method"].nunique() == 1)
        if not numeric or axis.sampled:
            line["linestyle"] = "none"
        panel.errorbar(x, mine["value"], yerr=ends, markersize=3.5, capsize=2, **line)
    if not numeric:
        names = [_shortened(level) for level in levels]
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
    marker = {"marker": style.method_marker(position)}
    if placement not in PLACEMENTS:
        return style.method_line(position) | marker | {"label": method}
    line, where = style.PLACEMENT_LINES[placement], PLACEMENTS[placement]
    if alone:
        return line | {
            "label": f"Genies {where}",
            "marker": style.MARKERS[list(PLACEMENTS).index(placement)],
        }
    return (
        line
        | marker
        | {"label": f"{method}, {where}", "color": style.method_line(position)["color"]}
    )


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
