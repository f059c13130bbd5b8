"""The figures of the paper's Section V, drawn from the tables of runs.

Each function takes ``panels``: a label for every run (``{"3 cars, heterogeneous": frames}``; one
run is a mapping with one entry), with a table or, of several seeds, one for each; the ``methods``
that ran, the ``footer`` that names the run, and ``width_in``: a printed column's or page's, with
text of 8 points; by default whichever fits. The same tables give the same bytes with the same
matplotlib.
"""

import io
import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.breakdown import time_parts
from genie_sim.analysis.compare import compared
from genie_sim.analysis.difference_plot import differences
from genie_sim.analysis.drawing import (
    Panels,
    draw_band,
    figure_grid,
    finish,
    finish_axes,
    in_style,
    label_outer,
    one_panel,
    seeds_of,
)
from genie_sim.analysis.frame_metrics import PART
from genie_sim.analysis.genie_metrics import (
    images,
    objects,
    reuse,
    running_boost,
    running_reuse,
)
from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy
from genie_sim.analysis.latency_cdf import latency_cdf
from genie_sim.analysis.resource_metrics import MAX_RESOURCES, busiest
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.statistics import interval, mean_bands, thinned
from genie_sim.analysis.style import (
    CHARACTER_IN,
    COLUMN_IN,
    PAGE_IN,
    PLACEMENTS,
    TITLE_CHARACTERS,
    percent_tick,
)
from genie_sim.base.paths import OutputKind, atomic_write, usable
from genie_sim.base.text import natural_key, percent_text
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, MetricValue, Run

Tables = Mapping[str, Sequence[Columns]]
Methods = Sequence[MethodInfo]

# Of each format: the metadata keys of a figure's title and description, and those to suppress.
FORMATS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "svg": ("Title", "Description", ("Date", "Creator")),
    "png": ("Title", "Description", ("Software",)),
    "pdf": ("Title", "Subject", ("CreationDate", "Creator", "Producer")),
}
OUTPUTS = {
    "svg": OutputKind("picture in SVG", rb".*<svg"),
    "png": OutputKind("picture in PNG", rb"\x89PNG"),
    "pdf": OutputKind("PDF", rb"%PDF"),
}
ALWAYS = "latency_cdf"  # the figure of every run
FEW_EVENTS = 50
ROW_SHARE = 0.6  # of the height of a row, over which the points of methods stand


def of_run(run: Run | SeedRuns, width_in: float | None = None) -> dict[str, Figure]:
    """Every figure of ``makers``, drawn."""
    return {name: draw() for name, draw in makers(run, width_in).items()}


def makers(
    run: Run | SeedRuns, width_in: float | None = None, footer: str | None = None
) -> dict[str, Callable[[], Figure]]:
    """What draws each figure of one run, or of several seeds with their paired differences, by file
    name, but of Genies and of use only what was simulated and recorded.

    Parameters
    ----------
    run : Run or SeedRuns
        What is drawn.
    width_in : float, optional
        How wide figures are, in inches; by default as fits each.
    footer : str, optional
        Names the run; by default as it does itself.
    """
    methods, footer = run.methods, run.footer if footer is None else footer
    metrics = {run.title: run.measured}
    frames = {run.title: tables_of(run, "frames")}
    lookups = {run.title: tables_of(run, "lookups")}
    drawn: dict[str, Callable[[], Figure]] = {}
    if drawable(metrics):
        drawn["latency_accuracy"] = partial(latency_accuracy, metrics, methods, footer, width_in)
    cdf = partial(latency_cdf, frames, methods, footer, width_in)
    drawn[ALWAYS] = cdf
    drawn["latency_cdf_of_answered"] = partial(cdf, of="answered")
    if any(metric.metric in PART.values() for metric in run.measured):
        drawn["time_parts"] = partial(time_parts, run.measured, methods, footer, width_in)
    if busiest(run.measured):
        drawn["resources"] = partial(resource_use, run.measured, methods, footer, width_in)
    if any(map(len, lookups[run.title])):
        for draw in (image_reuse, object_reuse, confidence_boost):
            drawn[draw.__name__] = partial(draw, lookups, methods, footer, width_in)
    if isinstance(run, SeedRuns) and len(methods) > 1:
        drawn["differences"] = lambda: differences(compared([run]), footer, width_in)
    return drawn


def tables_of(run: Run | SeedRuns, name: str) -> list[Columns]:
    """A table of each seed."""
    return [of_seed.tables[name] for of_seed in run.runs]


def save(
    figure: Figure, folder: Path, name: str, formats: Sequence[str] = ("svg", "png")
) -> list[Path]:
    """Writes ``name.svg`` and so on, with the figure's title and run but without date and version.
    Raises UserError.
    """
    paths = [folder / f"{name}.{format}" for format in formats]
    with in_style():
        _settle(figure)
        for path, format in zip(paths, formats, strict=True):
            # takes the place of a link, and never follows it
            with atomic_write(path, OUTPUTS[format]) as beside:
                figure.savefig(beside, format=format, metadata=_metadata(figure, format))
    return paths


def _metadata(figure: Figure, format: str) -> dict[str, str | None]:
    title, description, suppressed = FORMATS[format]
    texts = zip((title, description), str(figure.get_label()).split("\n"), strict=False)
    return dict.fromkeys(suppressed) | {name: text for name, text in texts if text}


def save_all(figures: Mapping[str, Figure], folder: Path, formats: Sequence[str]) -> list[Path]:
    """Writes figures by their names into a folder. Raises UserError if it cannot."""
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return [
        path for name, figure in figures.items() for path in save(figure, folder, name, formats)
    ]


def svg(figure: Figure) -> bytes:
    """The figure as ``save`` writes it."""
    to = io.BytesIO()
    with in_style():
        _settle(figure)
        figure.savefig(to, format="svg", metadata=_metadata(figure, "svg"))
    return to.getvalue()


def _settle(figure: Figure) -> None:
    """Lays the figure out once and rounds the result: the layout's solver varies in the last digit
    from call to call, and matplotlib names parts of an SVG file after such digits.
    """
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
    figure.set_layout_engine(None)  # with one, even "none", matplotlib draws a figure twice
    for axis in figure.axes:
        left, bottom, width, height = (round(length, 6) for length in axis.get_position().bounds)
        axis.set_position((left, bottom, width, height))


@in_style()
def image_reuse(
    panels: Panels,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Hits / requests of the message caches (paper: Fig. "reuse-img")."""
    of_caches = {
        label: [images(lookups) for lookups in seeds_of(panel)] for label, panel in panels.items()
    }
    return _reuse_bars(
        of_caches, methods, what="Image reuse", footer=footer, width_in=width_in, ax=ax
    )


@in_style()
def object_reuse(
    panels: Panels,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Share of object look-ups that an object with C >= C_T answers (paper's Fig. "reuse-obj")."""
    of_maps = {
        label: [objects(lookups) for lookups in seeds_of(panel)] for label, panel in panels.items()
    }
    return _reuse_bars(
        of_maps, methods, what="Object reuse", footer=footer, width_in=width_in, ax=ax
    )


@in_style()
def confidence_boost(
    panels: Panels,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Confidence added so far by the object maps on cars and on edges, over the objects that they
    then store (paper: Fig. "boost").

    In greys; with several methods that run Genies, in the colour of each. The axis begins at
    zero and ends at most at twice what is reached after the first events, which are means of few.
    Of several seeds a curve is the mean of theirs, as far as all of them go,
    with its 95 % t interval.
    """
    settled: list[float] = []
    figure, axes = figure_grid(panels, width_in, ax)
    tables = {label: seeds_of(lookups) for label, lookups in panels.items()}
    several = len(_with_genies(tables, methods)) > 1 or bool(axes[0].lines)
    for axis, (label, seeds) in zip(axes, tables.items(), strict=True):
        for method_style, method in _with_genies(tables, methods):
            for placement, where in PLACEMENTS.items():
                curve = _boost_curve(
                    [objects(rows.where(method=method.name, placement=placement)) for rows in seeds]
                )
                if curve is None:
                    continue
                events, boost, low, high = curve
                settled += boost[events > FEW_EVENTS].tolist()
                drawing = style.PLACEMENT_LINES[placement] | {"label": f"Genies {where}"}
                if several:
                    drawing |= {
                        "color": style.method_colour(method_style),
                        "label": f"{method.title}, {where}",
                        "marker": style.method_marker(method_style),
                        "markevery": (0.05 + 0.03 * (method_style % 8), 0.3),
                        "markersize": 3.5,
                    }
                axis.plot(events, boost, **drawing)
                if len(seeds) > 1:
                    draw_band(axis, events, low, high, colour=str(drawing["color"]))
        axis.set_title(label if len(panels) > 1 else "")
        axis.margins(x=0.02)
    low, high = axes[0].get_ylim()
    if settled:
        high = min(high, 2 * max(settled))
    axes[0].set_ylim(min(low, 0.0), max(high, 0.0))
    label_outer(axes, "events recorded so far", "confidence boost")
    title = "Confidence boost: confidence added so far over the objects then stored"
    if ax is None:
        finish(figure, title, footer, axes)
    else:
        finish_axes(ax)
    return figure


def _boost_curve(seeds: Sequence[Columns]) -> tuple[Any, Any, Any, Any] | None:
    """How many events were recorded, and then the mean over seeds and the ends of its interval;
    ``None`` where no seed stores an object.
    """
    curves = [curve for rows in seeds if len(curve := running_boost(rows))]
    if not curves:
        return None
    if len(curves) == 1:
        places = thinned(len(curves[0]))
        events, boost = curves[0]["events"], curves[0]["boost"]
        return events[places], boost[places], boost[places], boost[places]
    first = max(curve["events"][0] for curve in curves)
    last = max(min(curve["events"][-1] for curve in curves), first)
    events = np.unique(np.linspace(first, last, 1000).astype(np.int64))
    boosts = [np.interp(events, curve["events"], curve["boost"]) for curve in curves]
    return (events, *mean_bands(np.array(boosts)))


@in_style()
def resource_use(
    metrics: Sequence[MetricValue],
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
) -> Figure:
    """Utilization of the busiest accelerators, CPUs and links, a row each, with a point for each
    method; of several seeds with its 95 % interval.
    """
    names = sorted(busiest(metrics)[:MAX_RESOURCES], key=natural_key)
    height_in = 0.6 + 0.18 * max(len(names), 1)
    figure, axis = one_panel(width_in or COLUMN_IN, height_in, ax=None)
    styles = style.method_styles([method.name for method in methods])
    for place, (number, method) in enumerate(zip(styles, methods, strict=True)):
        aside = ROW_SHARE * ((place + 0.5) / len(methods) - 0.5)
        points = [
            (metric.value, names.index(metric.component) + aside, metric.low, metric.high)
            for metric in metrics
            if (metric.metric, metric.method) == ("utilization", method.name)
            and metric.component in names
            and metric.value is not None
        ]
        drawing: dict[str, Any] = {
            "color": style.method_colour(number),
            "marker": style.method_marker(number),
            "markersize": 3.5,
            "linestyle": "",
            "capsize": 2,
            "label": method.title,
        }
        reach = [
            [0.0 if low is None else max(value - low, 0.0) for value, _, low, _ in points],
            [0.0 if high is None else max(high - value, 0.0) for value, _, _, high in points],
        ]
        x, y = [value for value, *_ in points], [row for _, row, *_ in points]
        axis.errorbar(x, y, xerr=reach if any(map(any, reach)) else None, **drawing)
    labels = [textwrap.fill(name, TITLE_CHARACTERS) for name in names]
    axis.set_yticks(range(len(names)), labels)
    axis.set_ylim(max(len(names), 1) - 0.5, -0.5)
    axis.set_xlim(-0.02, 1.03)
    axis.xaxis.set_major_formatter(FuncFormatter(percent_tick))
    axis.set_xlabel("utilization")
    finish(figure, "Use of the busiest devices and links", footer, [axis])
    return figure


def _reuse_bars(
    panels: Tables,
    methods: Methods,
    *,
    what: str,
    footer: str,
    width_in: float | None,
    ax: Axes | None,
) -> Figure:
    """Bars are means over the Genies on cars and on edges. Error bars are the lowest and highest
    running ratio of any of them; of several seeds, the 95 % interval of their mean.

    Parameters
    ----------
    panels : mapping of str to sequence of Columns
        The look-ups of each run, a table a seed, by its label.
    methods : sequence of MethodInfo
        Those that ran.
    what : str
        The title of the ratio.
    footer : str
        Names the run.
    width_in : float or None
        The figure's width in inches; ``None`` for whichever fits.
    ax : Axes or None
        Where to draw; ``None`` for a figure of its own.
    """
    ran = [method for _, method in _with_genies(panels, methods)] or methods[:1]
    groups = [(label, method, seeds) for label, seeds in panels.items() for method in ran]
    several_seeds = max(map(len, panels.values())) > 1
    whiskers = "lowest and highest running ratio of a Genie"
    if several_seeds:
        whiskers = "95 % interval over seeds"
    title = f"{what}: mean over Genies; error bars: {whiskers}"
    labels = [f"{label}\n{method.title}" for label, method, _ in groups]
    if len(panels) == 1:
        labels = [method.title.replace(": ", ":\n") for method in ran]  # of one of several results
    elif len(ran) == 1:
        labels = list(panels)
    width_in = width_in or (COLUMN_IN if len(groups) <= 3 else PAGE_IN)
    room_in = (width_in - 0.7) / len(groups)  # of a group of two bars
    labels = [
        "\n".join(textwrap.fill(line, TITLE_CHARACTERS) for line in label.split("\n"))
        for label in labels
    ]
    longest_in = max(len(line) for label in labels for line in label.split("\n")) * CHARACTER_IN
    tilted = longest_in > 1.05 * room_in
    figure, axis = one_panel(width_in, 1.9 + tilted * longest_in, ax)
    axis.errorbar([], [], yerr=[], color="black", linewidth=1, capsize=3, label=whiskers)
    upright = 0.38 * room_in < 6 * CHARACTER_IN
    for side, (placement, where) in enumerate(PLACEMENTS.items()):
        drawing = style.PLACEMENT_BARS[placement] | {"label": f"Genies {where}"}
        for x, (_, method, seeds) in enumerate(groups):
            of_placement = [rows.where(method=method.name, placement=placement) for rows in seeds]
            _reuse_bar(
                axis,
                x + 0.38 * (side - 0.5),
                of_placement,
                drawing,
                upright=upright,
            )
    axis.set_xticks(range(len(groups)), labels, rotation=90 if tilted else 0)
    axis.set_xlim(-0.6, len(groups) - 0.4)
    axis.margins(y=0.3 if upright else 0.12)  # room for the numbers above the bars
    axis.set_ylim(0, None)
    axis.grid(axis="x", visible=False)
    axis.yaxis.set_major_formatter(FuncFormatter(percent_tick))
    axis.set_ylabel(what.lower())
    if ax is None:
        finish(figure, title, footer, [axis])
    else:
        finish_axes(ax)
    return figure


def _reuse_bar(
    axis: Axes, left: float, seeds: Sequence[Columns], drawing: dict[str, Any], upright: bool
) -> None:
    """One bar, with its error bar and its number.

    Parameters
    ----------
    axis : Axes
        Where it is drawn.
    left : float
        Its middle, in units of the groups of bars.
    seeds : sequence of Columns
        Of each seed the look-ups of the Genies that it stands for.
    drawing : dict
        Colour, hatch and label.
    upright : bool
        Whether its number is turned, for want of room.
    """
    turn = 90 if upright else 0
    ratios = [list(of_seed.values()) for rows in seeds if (of_seed := reuse(rows))]
    if not ratios:
        axis.annotate(
            "none",
            (left, 0),
            (0, 3),
            textcoords="offset points",
            ha="center",
            va="bottom",
            rotation=turn,
        )
        return
    means = [float(np.mean(of_genies)) for of_genies in ratios]
    mean = float(np.mean(means))
    axis.bar(left, mean, 0.34, edgecolor="black", linewidth=0.7, **drawing)
    whiskers = np.clip([end for end in interval(means) if end is not None], 0, 1)
    if len(seeds) == 1:
        whiskers = running_reuse(seeds[0])["ratio"]
    top = mean
    if len(whiskers):
        top = max(mean, float(whiskers.max()))
        ends = [[max(mean - whiskers.min(), 0)], [top - mean]]
        axis.errorbar(left, mean, yerr=ends, color="black", linewidth=1, capsize=3)
    drawing = {"ha": "center", "va": "bottom", "rotation": turn}
    axis.annotate(
        percent_text(mean, digits=2), (left, top), (0, 2), textcoords="offset points", **drawing
    )


def _with_genies(panels: Tables, methods: Methods) -> list[tuple[int, MethodInfo]]:
    """The methods under which Genies looked something up, with their styles."""
    names = {
        name for seeds in panels.values() for rows in seeds for name in rows["method"].unique()
    }
    styles = style.method_styles([method.name for method in methods])
    return [pair for pair in zip(styles, methods, strict=True) if pair[1].name in names]
