"""The figures of the paper's Section V, drawn from the tables of runs.

Functions take a table of each seed (of one run a sequence of one), the ``methods`` that ran, the
``footer`` that names the run, and ``width_in``: a printed column's or page's, with text of 8
points; by default whichever fits. With ``ax`` they draw into that panel of the user's own. The same
tables give the same bytes with the same matplotlib.
"""

import functools
import io
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.compare import compared
from genie_sim.analysis.drawing import draw_band, finish_panel, in_style, one_panel
from genie_sim.analysis.genie_metrics import (
    images,
    objects,
    reuse,
    running_boost,
    running_reuse,
)
from genie_sim.analysis.latency_cdf import latency_cdf
from genie_sim.analysis.points import differences, drawable, latency_accuracy, resource_use
from genie_sim.analysis.resource_metrics import busiest
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.analysis.statistics import (
    around_mean,
    has_interval,
    mean_and_spread,
    mean_bands,
    thinned,
)
from genie_sim.analysis.style import (
    CHARACTER_IN,
    COLUMN_IN,
    PAGE_IN,
    PLACEMENTS,
    TITLE_CHARACTERS,
    percent_tick,
)
from genie_sim.base.paths import OutputKind, atomic_write, usable
from genie_sim.base.text import percent_text
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, Run

Seeds = Sequence[Columns]
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
FEW_EVENTS = 50


def of_run(run: Run | SeedRuns, width_in: float | None = None) -> dict[str, Figure]:
    """Every figure of ``makers``, drawn."""
    return {name: draw() for name, draw in makers(run, width_in).items()}


def makers(run: Run | SeedRuns, width_in: float | None = None) -> dict[str, Callable[..., Figure]]:
    """What draws each figure of one run, or of several seeds with their paired differences, by file
    name; figures of what was not simulated or recorded are left out. What was drawn is not drawn
    again. All but ``differences`` also draw into a panel, ``ax``.

    Parameters
    ----------
    run : Run or SeedRuns
        What is drawn.
    width_in : float, optional
        How wide figures are, in inches; by default as fits each.
    """
    about = (run.methods, run.footer, width_in)
    frames, lookups = (
        [of_seed.tables[name] for of_seed in run.runs] for name in ("frames", "lookups")
    )
    drawn: dict[str, Callable[..., Figure]] = {}
    if drawable(run.measured):
        drawn["latency_accuracy"] = functools.partial(latency_accuracy, run.measured, *about)
    drawn["latency_cdf"] = functools.partial(latency_cdf, frames, *about)
    if busiest(run.measured):
        drawn["resources"] = functools.partial(resource_use, run.measured, *about)
    if any(map(len, lookups)):
        for draw in (image_reuse, object_reuse, confidence_boost):
            drawn[draw.__name__] = functools.partial(draw, lookups, *about)
    if isinstance(run, SeedRuns) and len(run.methods) > 1:
        drawn["differences"] = lambda: differences(compared([run]), run.footer, width_in)
    return {name: functools.cache(draw) for name, draw in drawn.items()}


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
    seeds: Seeds,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Hits / requests of the message caches (paper: Fig. "reuse-img")."""
    bars = _ReuseBars("Image reuse", [images(lookups) for lookups in seeds], methods)
    return bars.drawn(footer, width_in, ax)


@in_style()
def object_reuse(
    seeds: Seeds,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    *,
    ax: Axes | None = None,
) -> Figure:
    """Share of object look-ups that an object with C >= C_T answers (paper's Fig. "reuse-obj")."""
    bars = _ReuseBars("Object reuse", [objects(lookups) for lookups in seeds], methods)
    return bars.drawn(footer, width_in, ax)


@in_style()
def confidence_boost(
    seeds: Seeds,
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
    Of several seeds a curve is the mean of theirs, as far as all of them go, from three on
    with its 95 % t interval.
    """
    settled: list[float] = []
    _, axis = one_panel(width_in or COLUMN_IN, 2.05, ax)
    with_genies = _with_genies(seeds, methods)
    for method_style, method in with_genies:
        for placement, where in PLACEMENTS.items():
            curve = _boost_curve(
                [objects(rows.where(method=method.name, placement=placement)) for rows in seeds]
            )
            if curve is None:
                continue
            events, boost, low, high = curve
            settled += boost[events > FEW_EVENTS].tolist()
            drawing = style.PLACEMENT_LINES[placement] | {"label": f"Genies {where}"}
            if len(with_genies) > 1:
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
    axis.margins(x=0.02)
    bottom, top = axis.get_ylim()
    if settled:
        top = min(top, 2 * max(settled))
    axis.set_ylim(min(bottom, 0.0), max(top, 0.0))
    axis.set_xlabel("events recorded so far")
    axis.set_ylabel("confidence boost")
    title = "Confidence boost: confidence added so far over the objects then stored"
    return finish_panel(axis, ax, title, footer)


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


class _ReuseBars(NamedTuple):
    """Bars that are means over the Genies on cars and on edges. Error bars are the lowest and
    highest running ratio of any of them; of several seeds, the 95 % interval of their mean.

    ``what`` is the title of the ratio, ``seeds`` are the look-ups of each.
    """

    what: str
    seeds: Seeds
    methods: Methods

    def drawn(self, footer: str, width_in: float | None, ax: Axes | None) -> Figure:
        """The figure, or the panel ``ax`` with them."""
        ran = [method for _, method in _with_genies(self.seeds, self.methods)] or self.methods[:1]
        whiskers = "lowest and highest running ratio of a Genie"
        if len(self.seeds) > 1:
            whiskers = "95 % interval over seeds" if has_interval(len(self.seeds)) else ""
        width_in = width_in or (COLUMN_IN if len(ran) <= 3 else PAGE_IN)
        room_in = (width_in - 0.7) / len(ran)  # of a group of two bars
        labels = [textwrap.fill(method.title, TITLE_CHARACTERS) for method in ran]
        longest_in = CHARACTER_IN * max(len(line) for label in labels for line in label.split("\n"))
        tilted = longest_in > 1.05 * room_in
        _, axis = one_panel(width_in, 1.9 + tilted * longest_in, ax)
        if whiskers:
            axis.errorbar([], [], yerr=[], color="black", linewidth=1, capsize=3, label=whiskers)
        upright = 0.38 * room_in < 6 * CHARACTER_IN
        for side, (placement, where) in enumerate(PLACEMENTS.items()):
            drawing = style.PLACEMENT_BARS[placement] | {"label": f"Genies {where}"}
            for x, method in enumerate(ran):
                rows = [rows.where(method=method.name, placement=placement) for rows in self.seeds]
                _reuse_bar(axis, x + 0.38 * (side - 0.5), rows, drawing, upright=upright)
        axis.set_xticks(range(len(ran)), labels, rotation=90 if tilted else 0)
        axis.set_xlim(-0.6, len(ran) - 0.4)
        axis.margins(y=0.3 if upright else 0.12)  # room for the numbers above the bars
        axis.set_ylim(0, None)
        axis.grid(axis="x", visible=False)
        axis.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        axis.set_ylabel(self.what.lower())
        title = f"{self.what}: mean over Genies"
        if whiskers:
            title += f"; error bars: {whiskers}"
        return finish_panel(axis, ax, title, footer)


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
    ends_of_mean = around_mean(*mean_and_spread(means), len(means))
    whiskers = np.clip([end for end in ends_of_mean if end is not None], 0, 1)
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


def _with_genies(seeds: Seeds, methods: Methods) -> list[tuple[int, MethodInfo]]:
    """The methods under which Genies looked something up, with their styles."""
    names = {name for rows in seeds for name in rows["method"].unique()}
    styles = style.method_styles([method.name for method in methods])
    return [pair for pair in zip(styles, methods, strict=True) if pair[1].name in names]
