"""Figures of points with their 95 % intervals: accuracy versus latency, the values of one metric,
the use of devices, and the differences of a comparison.
"""

import textwrap
from collections.abc import Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.compare import ComparedRuns, Difference
from genie_sim.analysis.drawing import (
    MAX_COLUMN_IN,
    NotebookFigure,
    draw_point,
    finish,
    finish_panel,
    in_style,
    is_narrow,
    line_in,
    logarithmic_x,
    name_rows,
    one_panel,
)
from genie_sim.analysis.metric import LOWER, SHORT, Metric
from genie_sim.analysis.registry import (
    METRICS,
    NO_WORDS,
    Words,
    component_title,
    definition,
    is_drawn_logarithmically,
    shown,
)
from genie_sim.analysis.resource_metrics import MAX_RESOURCES, busiest
from genie_sim.analysis.style import COLUMN_IN, LINE_IN, PAGE_IN, TITLE_CHARACTERS
from genie_sim.base.errors import UserError
from genie_sim.base.text import natural_key
from genie_sim.record.records import ZERO_DELAY
from genie_sim.record.results import MethodInfo, MetricValue

LATENCY = "first_answer_mean"
ACCURACIES = ("streaming_f1", "first_proxy_f1")  # the first of them that a run has is drawn
ROW_SHARE = 0.6  # of the height of a row, over which the points of methods stand
BELOW_IN = 0.55  # of the panel: ticks and label
MANY_TICKS = 100  # a logarithmic axis over more than that has a tick for each power of ten alone
MAX_COLUMNS = 3  # of panels of differences
FEW_ARMS = 3  # leave room for two panels instead of three in a column
ROW_IN, MIN_PANEL_IN = 0.2, 0.76
SMALL_ROW_IN, SMALL_PANEL_IN, SMALL_TITLE = 0.14, 0.52, 14  # in a column

Methods = Sequence[MethodInfo]
Ends = tuple[float, float | None, float | None]


def drawable(metrics: Iterable[MetricValue]) -> str | None:
    """Which accuracy is drawn of these numbers; ``None`` where there is none."""
    defined = {metric.metric for metric in metrics if metric.value is not None}
    return next((name for name in ACCURACIES if {name, LATENCY} <= defined), None)


@in_style()
def latency_accuracy(
    metrics: Sequence[MetricValue],
    methods: Sequence[MethodInfo],
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """A point for each method, with the intervals of both; up and to the left is better.

    Streaming F1 where the run has it, else the proxy; the dotted line is the zero-delay detector.
    ``ax`` is a panel of the user's own to draw into. There must be something ``drawable``.
    """
    accuracy = drawable(metrics)
    assert accuracy is not None
    _, axis = one_panel(width_in or COLUMN_IN, 2.1, ax)
    numbers: dict[tuple[str, str, str], Ends] = {
        (metric.metric, metric.method, metric.component): (metric.value, metric.low, metric.high)
        for metric in metrics
        if metric.placement == "all" and metric.value is not None
    }
    styles = style.method_styles([method.name for method in methods])
    for style_number, method in zip(styles, methods, strict=True):
        x, y = (numbers.get((name, method.name, "")) for name in (LATENCY, accuracy))
        if x is not None and y is not None:
            draw_point(axis, x, y, style_number, method.title)
    for (name, _, component), (bound, *_) in numbers.items():
        if (name, component) == (accuracy, ZERO_DELAY):
            axis.axhline(
                bound, label=component_title(component), color="0.4", linewidth=0.9, linestyle=":"
            )
            break
    axis.set_xscale("log")
    logarithmic_x(axis, *axis.get_xlim())
    axis.set_ylim(0, 1.02)
    axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    axis.set_xlabel(f"{METRICS[LATENCY].label}, logarithmic")
    axis.set_ylabel(METRICS[accuracy].title)
    title = f"Accuracy versus latency: {METRICS[accuracy].title}, with 95 % intervals"
    return finish_panel(axis, ax, title, footer)


@in_style()
def resource_use(
    metrics: Sequence[MetricValue],
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Utilization of the busiest accelerators, CPUs and links, a row each, with a point for each
    method; of several seeds with its 95 % interval.
    """
    names = sorted(busiest(metrics)[:MAX_RESOURCES], key=natural_key)
    _, axis = one_panel(width_in or COLUMN_IN, 0.6 + 0.18 * max(len(names), 1), ax)
    styles = style.method_styles([method.name for method in methods])
    for place, (style_number, method) in enumerate(zip(styles, methods, strict=True)):
        aside = ROW_SHARE * ((place + 0.5) / len(methods) - 0.5)
        for use in metrics:
            is_shown = (use.metric, use.method) == ("utilization", method.name)
            if is_shown and use.component in names and use.value is not None:
                row = (names.index(use.component) + aside, None, None)
                draw_point(axis, (use.value, use.low, use.high), row, style_number, method.title)
    name_rows(axis, [textwrap.fill(name, TITLE_CHARACTERS) for name in names])
    axis.set_xlim(-0.02, 1.03)
    axis.xaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    axis.set_xlabel("utilization")
    return finish_panel(axis, ax, "Use of the busiest devices and links", footer)


@in_style()
def metric_values(
    name: str,
    metrics: Sequence[MetricValue],
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    own: Words = NO_WORDS,
    ax: Axes | None = None,
) -> Figure:
    """A point with its interval for each method, and for each placement or component of which the
    metric is. Raises ``UserError`` where there is no value, or more than there is room for.

    Parameters
    ----------
    name : str
        The metric.
    metrics : sequence of MetricValue
        The numbers of a run.
    methods : sequence of MethodInfo
        Those that are drawn, the first at the top.
    footer : str
        Names the run.
    width_in : float, optional
        The figure's width in inches; by default a column's.
    own : mapping
        What the results say of metrics of the user's own.
    ax : Axes, optional
        Where to draw; by default in a figure of its own.
    """
    about = definition(name, own)
    rows = _rows(name, metrics, methods)
    if not rows:
        raise UserError(f"{name}: these results have no value of it")
    titles = {method.name: method.title for method in methods}
    names = []
    for row in rows:
        whole = about.titled(row.placement, component_title(row.component, methods))
        text = f"{titles[row.method]} {whole.removeprefix(about.title).strip(' ,')}"
        names.append(textwrap.fill(text, TITLE_CHARACTERS))
    lines = sum(label.count("\n") + 1 for label in names)
    height_in = BELOW_IN + 1.15 * lines * line_in("ytick.labelsize")
    if ax is None and height_in > MAX_COLUMN_IN and is_narrow(width_in or COLUMN_IN):
        raise UserError(
            f"{name}: {len(rows)} values are too many for a column: name fewer with --methods, or "
            "draw them on a page with --width page"
        )
    _, axis = one_panel(width_in or COLUMN_IN, height_in, ax)
    styles = dict(zip(titles, style.method_styles(list(titles)), strict=True))
    ends: list[float] = []
    for number, row in enumerate(rows):
        x = _scaled(about, row.value, row.low, row.high)
        draw_point(axis, x, (number, None, None), styles[row.method])
        ends += [end for end in x if end is not None]
    if is_drawn_logarithmically(about, ends):
        low, high = 0.8 * min(ends), 1.25 * max(ends)
        logarithmic_x(axis, low, high, (1, 2, 5) if high < MANY_TICKS * low else (1,))
    elif min(ends) >= 0:
        axis.set_xlim(0, 1.08 * max(ends) or 1.0)
    name_rows(axis, names)
    better = "" if not about.better else f", {about.better} is better"
    axis.set_xlabel(f"{about.label}{better}")
    return finish_panel(axis, ax, f"{about.title}, with intervals", footer)


def _scaled(about: Metric, value: float | None, low: float | None, high: float | None) -> Ends:
    """A value and the ends of its interval in the unit that is shown."""
    assert value is not None
    ends = (None if end is None else about.factor * end for end in (low, high))
    return (about.factor * value, *ends)  # type: ignore[return-value]


def _rows(name: str, metrics: Sequence[MetricValue], methods: Methods) -> list[MetricValue]:
    """The values of the metric, method by method: those of the whole method where it has them, else
    by placement or component.
    """
    defined = [metric for metric in metrics if metric.metric == name and metric.value is not None]
    whole = [metric for metric in defined if (metric.placement, metric.component) == ("all", "")]
    by_place = [metric for metric in defined if not metric.component]
    chosen = whole or by_place or defined
    return [metric for method in methods for metric in chosen if metric.method == method.name]


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
    arms = [arm for arm in comparison.arms if any(row.arm is arm for row in rows)]
    labels = [arm.label for arm in comparison.arms]
    styles = dict(zip(labels, style.method_styles(labels), strict=True))
    width_in = width_in or PAGE_IN
    narrow = is_narrow(width_in)
    most = MAX_COLUMNS - 1 if narrow and len(arms) <= FEW_ARMS else MAX_COLUMNS
    columns = min(max(len(metrics), 1), most)
    lines = -(-max(len(metrics), 1) // columns)
    row_in, panel_in = (SMALL_ROW_IN, SMALL_PANEL_IN) if narrow else (ROW_IN, MIN_PANEL_IN)
    room = SMALL_TITLE if narrow else TITLE_CHARACTERS
    abouts = {row.metric: row.about for row in rows}
    titles_of = [textwrap.fill(abouts[metric].title, room) for metric in metrics]
    title_in = LINE_IN * max((title.count("\n") for title in titles_of), default=0)
    height_in = lines * (panel_in + title_in + row_in * len(arms))
    figure = NotebookFigure(figsize=(width_in, height_in + 0.2))
    grid = figure.subplots(lines, columns, squeeze=False)
    for number, axis in enumerate(grid.flat):
        if number >= len(metrics):
            axis.remove()
            continue
        of_metric = {row.arm: row for row in rows if row.metric == metrics[number]}
        drawn = [of_metric.get(arm) for arm in arms]
        _draw_differences(axis, drawn, [styles[arm.label] for arm in arms])
        axis.set_xlabel(_label(abouts[metrics[number]], narrow))
        axis.set_title(titles_of[number])
        name_rows(axis, [arm.title if number % columns == 0 else "" for arm in arms])
    references = list(dict.fromkeys(row.reference for row in rows))
    several = "the first setting" if len(comparison.names) > 1 else "the best baseline"
    against = references[0] if len(references) == 1 else several
    note, title = f"difference from {against}" if rows else "", "Paired differences"
    if by := comparison.units.replace(" ", "\u00a0"):  # on one line
        note, title = f"{note}, 95 % intervals paired by {by}", f"{title} with 95 % intervals"
    finish(figure, title, footer, note=note)
    return figure


def _draw_differences(axis: Axes, rows: Sequence[Difference | None], styles: Sequence[int]) -> None:
    """One metric: a point and an interval for each arm, the first at the top."""
    axis.axvline(0, color="black", linewidth=0.9)
    for place, (row, style_number) in enumerate(zip(rows, styles, strict=True)):
        if row is not None:
            x = _scaled(row.about, row.difference, row.low, row.high)
            draw_point(axis, x, (place, None, None), style_number)
    axis.margins(x=0.12)
    axis.locator_params(axis="x", nbins=3)


def _label(info: Metric, narrow: bool) -> str:
    """The unit, and which side is better; in a column in one short line."""
    points = "points" if narrow else "percentage points"
    unit = points if info.unit == "%" else info.unit
    lines = [f"[{unit}]" if unit else "difference"]
    if info.better and narrow:
        lines.append("\u2190 better" if info.better == LOWER else "better \u2192")
    elif info.better:
        lines.append(f"{info.better} is better")
    return (" " if narrow else "\n").join(lines)
