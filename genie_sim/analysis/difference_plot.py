"""One figure: the differences of a comparison, with their intervals and a line at zero."""

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from genie_sim.analysis import style
from genie_sim.analysis.compare import ComparedRuns, Difference
from genie_sim.analysis.drawing import finish, in_style, is_narrow
from genie_sim.analysis.metric import LOWER, SHORT
from genie_sim.analysis.registry import definition, shown
from genie_sim.analysis.style import LINE_IN, PAGE_IN, TITLE_CHARACTERS

MAX_COLUMNS = 3
FEW_ARMS = 3  # leave room for two panels instead of three in a column
ROW_IN, MIN_PANEL_IN = 0.2, 0.76
SMALL_ROW_IN, SMALL_PANEL_IN, SMALL_TITLE = 0.14, 0.52, 14  # in a column


@in_style()
def differences(
    comparison: ComparedRuns, footer: str = "", width_in: float | None = None
) -> Figure:
    """A panel for each main metric: of each arm its difference from the one it is compared with, as
    a point with its 95 % interval. An interval off the line at zero is a difference that the data
    show; the label of an axis says which side is better.
    """
    rows = [row for row in comparison.rows if row.difference is not None]
    metrics = shown(SHORT, [row.metric for row in rows])
    arms = [arm for arm in comparison.arms if any(row.arm == arm.label for row in rows)]
    labels = [arm.label for arm in comparison.arms]
    styles = dict(zip(labels, style.method_styles(labels), strict=True))
    titles = {arm.label: arm.title for arm in comparison.arms}
    width_in = width_in or PAGE_IN
    narrow = is_narrow(width_in)
    most = MAX_COLUMNS - 1 if narrow and len(arms) <= FEW_ARMS else MAX_COLUMNS
    columns = min(max(len(metrics), 1), most)
    lines = -(-max(len(metrics), 1) // columns)
    row_in, panel_in = (SMALL_ROW_IN, SMALL_PANEL_IN) if narrow else (ROW_IN, MIN_PANEL_IN)
    room = SMALL_TITLE if narrow else TITLE_CHARACTERS
    titles_of = [textwrap.fill(definition(metric).title, room) for metric in metrics]
    title_in = LINE_IN * max((title.count("\n") for title in titles_of), default=0)
    height_in = lines * (panel_in + title_in + row_in * len(arms))
    figure = Figure(figsize=(width_in, height_in + 0.2))
    grid = figure.subplots(lines, columns, squeeze=False)
    for number, axis in enumerate(grid.flat):
        if number >= len(metrics):
            axis.remove()
            continue
        of_metric = {row.arm: row for row in rows if row.metric == metrics[number]}
        drawn = [of_metric.get(arm.label) for arm in arms]
        _draw(axis, metrics[number], drawn, [styles[arm.label] for arm in arms])
        axis.set_xlabel(_label(metrics[number], narrow))
        axis.set_title(titles_of[number])
        names = [arm.title if number % columns == 0 else "" for arm in arms]
        axis.set_yticks(range(len(arms)), names)
    references = list(dict.fromkeys(titles[row.against] for row in rows))
    against = references[0] if len(references) == 1 else "the first setting"
    by = " and ".join(sorted({row.by for row in rows if row.by}))
    by = by.replace(" ", "\u00a0")  # on one line
    note = f"difference from {against}, 95 % intervals paired by {by}" if by else ""
    finish(figure, "Paired differences with 95 % intervals", footer, note=note)
    return figure


def _draw(
    axis: Axes, metric: str, rows: Sequence[Difference | None], styles: Sequence[int]
) -> None:
    """One metric: a point and an interval for each arm, the first at the top."""
    info = definition(metric)
    axis.axvline(0, color="black", linewidth=0.9)
    for place, (row, style_number) in enumerate(zip(rows, styles, strict=True)):
        if row is None or row.difference is None:
            continue
        x = info.factor * row.difference
        ends = None
        if row.low is not None and row.high is not None:
            ends = [[x - info.factor * row.low], [info.factor * row.high - x]]
        axis.errorbar(
            x,
            place,
            xerr=ends,
            color=style.method_colour(style_number),
            marker=style.method_marker(style_number),
            markersize=4,
            capsize=2.5,
            linestyle="",
        )
    axis.set_ylim(len(rows) - 0.5, -0.5)
    axis.margins(x=0.12)
    axis.grid(axis="y", visible=False)
    axis.locator_params(axis="x", nbins=3)


def _label(metric: str, narrow: bool) -> str:
    """The unit, and which side is better; in a column in one short line."""
    info = definition(metric)
    points = "points" if narrow else "percentage points"
    unit = points if info.unit == "%" else info.unit
    lines = [f"[{unit}]" if unit else "difference"]
    if info.better and narrow:
        lines.append("\u2190 better" if info.better == LOWER else "better \u2192")
    elif info.better:
        lines.append(f"{info.better} is better")
    return (" " if narrow else "\n").join(lines)
