"""The figures of the paper's Section V, drawn from the tables of runs.

Each function takes ``panels``: a label for every run (``{"3 cars, heterogeneous": frames}``; one run is a mapping with
one entry) and the ``footer`` that names the run. Sizes are those of a printed column (88 mm) or page (182 mm) with
text of 8 points; methods and roles differ in line style or hatch and in lightness, so that they survive greyscale. The
same tables give the same bytes with the same matplotlib.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator, ScalarFormatter

from genie_sim.analysis.metrics import (
    DEADLINE_MS,
    METHODS,
    ROLES,
    WINDOW_REQUESTS,
    response_ms,
    reuse,
    running_boost,
    running_use,
    windowed_reuse,
)

if TYPE_CHECKING:
    import pandas as pd

Panels = Mapping[str, "pd.DataFrame"]

COLUMN_IN, PAGE_IN = 3.46, 7.16
LINE_IN = 0.17  # height of a line of 8 points
STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "figure.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "savefig.dpi": 200,
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "genie-sim",
}
METHOD_LINES: dict[str, dict[str, Any]] = {
    "local": {"label": "local (L)", "color": "#E69F00", "linestyle": (0, (1, 1)), "linewidth": 1.8},
    "remote": {"label": "remote (R)", "color": "#C44E00", "linestyle": (0, (5, 1.2, 1, 1.2)), "linewidth": 1.6},
    "genie": {"label": "Genie (DG)", "color": "#0B3C6F", "linestyle": "-", "linewidth": 1.8},
}
METHOD_LETTERS = {"local": "L", "remote": "R", "genie": "DG"}
ROLE_BARS: dict[str, dict[str, Any]] = {
    "local": {"label": "local Genies (cars)", "facecolor": "#F0C060", "hatch": "////"},
    "remote": {"label": "remote Genies (edges)", "facecolor": "#3D6FA5", "hatch": ""},
}
ROLE_LINES: dict[str, dict[str, Any]] = {
    "local": {"label": "local Genies (cars)", "color": "#E69F00", "linestyle": (0, (4, 1.2)), "linewidth": 1.6},
    "remote": {"label": "remote Genies (edges)", "color": "#0B3C6F", "linestyle": "-", "linewidth": 1.6},
}
RESOURCE_KINDS = {
    "accelerator": "accelerators busy",
    "cpu": "CPUs busy",
    "link": "links busy",
    "queue": "messages waiting",
}
LINE_STYLES = ("-", (0, (4, 1.2)), (0, (1, 1)), (0, (5, 1.2, 1, 1.2)))
LINE_COLOURS = ("#0B3C6F", "#E69F00", "#009E73", "#C44E00", "#56B4E9", "#777777", "#CC79A7", "#000000")
POINTS_PER_CURVE = 1000
NS_PER_S = 1e9
LEAST_USE = 0.01


def of_run(
    label: str, frames: pd.DataFrame, lookups: pd.DataFrame, resources: pd.DataFrame, footer: str
) -> dict[str, Figure]:
    """Every figure of one run, by file name, but of Genies and of use only what was simulated and recorded."""
    figures = {
        "latency_cdf": latency_cdf({label: frames}, footer),
        "latency_cdf_of_answered": latency_cdf({label: frames}, footer, of="answered"),
    }
    if len(resources):
        of_cars = {f"{car}.accelerator" for car in frames["car"].unique()} & set(resources["resource"].unique())
        figures["resources"] = resource_use(resources, footer, "" if of_cars else "edges: ")
    if len(lookups):
        figures["image_reuse"] = image_reuse({label: lookups}, footer)
        figures["object_reuse"] = object_reuse({label: lookups}, footer)
        figures["confidence_boost"] = confidence_boost({label: lookups}, footer)
    return figures


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Writes ``name.svg`` and ``name.png``, without date and version. Raises OSError if it cannot."""
    paths = [folder / f"{name}.svg", folder / f"{name}.png"]
    with style.context(["default", STYLE]):
        _settle(figure)
        figure.savefig(paths[0], metadata={"Date": None, "Creator": None})
        figure.savefig(paths[1], metadata={"Software": None})
    return paths


def _settle(figure: Figure) -> None:
    """Lays the figure out once and rounds the result: the layout's solver varies in the last digit from call to call,
    and matplotlib names parts of an SVG file after such digits."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis in figure.axes:
        left, bottom, width, height = (round(length, 6) for length in axis.get_position().bounds)
        axis.set_position((left, bottom, width, height))


@style.context(["default", STYLE])
def latency_cdf(panels: Panels, footer: str = "", of: str = "published") -> Figure:
    """Response time of L, R and DG, with the 33 ms deadline (paper: Fig. "cdf-time").

    ``of="published"``: a curve ends at the share of frames that were answered at all. ``of="answered"``, the paper's
    way: every curve reaches 1, however many frames were dropped. Either way each panel's title tells the shares. The
    fresh answer is drawn where it differs from the first.
    """
    title = f"Response time from received to first answer, share of {of} frames"
    figure, axes = _grid(panels)
    low, high = _limits_ms(panels)
    for axis, (label, frames) in zip(axes, panels.items(), strict=True):
        answered, fresh = [], []
        for method in METHODS:
            mine = frames[frames["method"] == method]
            if mine.empty:
                continue
            curves = {answer: _known(response_ms(mine, answer)) for answer in ("first", "fresh")}
            for answer, values in curves.items():
                whole = len(mine) if of == "published" else len(values)
                if answer == "first":
                    _step(axis, values, whole, high, **METHOD_LINES[method])
                elif not np.array_equal(values, curves["first"]):
                    thin = METHOD_LINES[method] | {"linewidth": 0.9, "linestyle": (0, (4, 2))}
                    _step(axis, values, whole, high, **thin | {"label": f"{METHOD_LETTERS[method]}, fresh answer"})
                    fresh.append(f"{METHOD_LETTERS[method]} {_percent(len(values) / len(mine))}")
            answered.append(f"{METHOD_LETTERS[method]} {_percent(len(curves['first']) / len(mine))}")
        axis.axvline(DEADLINE_MS, color="black", linewidth=0.9, linestyle="--", label=f"{DEADLINE_MS:g} ms deadline")
        shares = [f"{what}: {', '.join(found)}" for what, found in (("answered", answered), ("fresh", fresh)) if found]
        axis.set_title("\n".join([label, *shares]))
        axis.set_ylim(0, 1.02)
        _logarithmic_ms(axis, low, high)
    _label_outer(axes, "response time [ms], logarithmic", f"share of {of} frames")
    _finish(figure, title, footer, axes)
    return figure


@style.context(["default", STYLE])
def image_reuse(panels: Panels, footer: str = "") -> Figure:
    """Hits / requests of the message caches, asked by their own clients (paper: Fig. "reuse-img")."""
    of_clients = {label: _rows(lookups, kind="image", asker="client") for label, lookups in panels.items()}
    return _reuse_bars(of_clients, "Image reuse", footer)


@style.context(["default", STYLE])
def object_reuse(panels: Panels, footer: str = "") -> Figure:
    """Object look-ups answered by an object with C >= C_T / all of them (paper: Fig. "reuse-obj")."""
    of_maps = {label: lookups[lookups["kind"] != "image"] for label, lookups in panels.items()}
    return _reuse_bars(of_maps, "Object reuse", footer)


@style.context(["default", STYLE])
def confidence_boost(panels: Panels, footer: str = "") -> Figure:
    """Running mean of C_new - C_old over the updates of a role's object maps (paper: Fig. "boost")."""
    figure, axes = _grid(panels)
    for axis, (label, lookups) in zip(axes, panels.items(), strict=True):
        for role in ROLES:
            curve = running_boost(_rows(lookups, role=role))
            kept = _thinned(len(curve))
            axis.plot(curve["updates"].to_numpy()[kept], curve["boost"].to_numpy()[kept], **ROLE_LINES[role])
        axis.set_title(label)
        axis.margins(x=0.02)
    _label_outer(axes, "updates so far", "mean of C(new) - C(old)")
    _finish(figure, "Confidence boost: running mean over the updates of the object maps", footer, axes)
    return figure


@style.context(["default", STYLE])
def resource_use(resources: pd.DataFrame, footer: str = "", whose: str = "") -> Figure:
    """Utilisation of accelerators, CPUs and links, and queue lengths over simulated time; a column a method.

    Each point is the mean of the last second. What is never used by 1 % (queues: never holds a message) is left out;
    more than eight of a kind are drawn as their range and median. A panel in which nothing is left says "none".
    ``whose`` begins the title where the resources are not everybody's.
    """
    kinds = [kind for kind in RESOURCE_KINDS if (resources["kind"] == kind).any()]
    methods = [method for method in METHODS if (resources["method"] == method).any()]
    figure = Figure(figsize=(PAGE_IN, 0.9 + 1.25 * max(len(kinds), 1)))
    grid = figure.subplots(max(len(kinds), 1), max(len(methods), 1), sharex=True, sharey="row", squeeze=False)
    for row, kind in zip(grid, kinds, strict=False):
        used = {method: _used(_rows(resources, kind=kind, method=method)) for method in methods}
        names = sorted({name for curves in used.values() for name in curves})
        for axis, method in zip(row, methods, strict=False):
            _draw_use(axis, used[method], names)
            if kind != "queue":
                axis.set_ylim(0, 1.05)
                axis.yaxis.set_major_formatter(FuncFormatter(_percent_tick))
        row[0].set_ylabel(RESOURCE_KINDS[kind])
        _legend_beside(list(row))
    for axis, method in zip(grid[0], methods, strict=False):
        axis.set_title(str(METHOD_LINES[method]["label"]))
    for axis in grid[-1]:
        axis.set_xlabel("simulated time [s]")
    title = "use of devices and links, and queues, over simulated time"
    _finish(figure, f"{whose}{title}".capitalize(), footer)
    return figure


def _reuse_bars(panels: Panels, what: str, footer: str) -> Figure:
    """Bars are means over the Genies of a role, error bars the extreme windows of any of them."""
    title = f"{what}: mean over Genies; bars: extreme windows of {WINDOW_REQUESTS} requests of any Genie"
    width_in = COLUMN_IN if len(panels) <= 3 else PAGE_IN
    figure = Figure(figsize=(width_in, 2.7))
    axis = figure.subplots()
    for place, role in enumerate(ROLES):
        for x, lookups in enumerate(panels.values()):
            mine = _rows(lookups, role=role)
            ratios, windows = reuse(mine), windowed_reuse(mine)["ratio"]
            left = x + 0.38 * (place - 0.5)
            if not len(ratios):
                axis.text(left, 0.01, "none", ha="center", va="bottom")
                continue
            mean = float(ratios.mean())
            axis.bar(left, mean, 0.34, edgecolor="black", linewidth=0.7, **ROLE_BARS[role])
            if len(windows):
                ends = [[max(mean - windows.min(), 0)], [max(windows.max() - mean, 0)]]
                axis.errorbar(left, mean, yerr=ends, color="black", linewidth=1, capsize=3)
            box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
            axis.annotate(
                _percent(mean), (left, 0), (0, 3), textcoords="offset points", ha="center", va="bottom", bbox=box
            )
    axis.set_xticks(range(len(panels)), list(panels))
    axis.set_xlim(-0.6, len(panels) - 0.4)
    axis.set_ylim(0, None)
    axis.grid(axis="x", visible=False)
    axis.yaxis.set_major_formatter(FuncFormatter(_percent_tick))
    axis.set_ylabel("hits / requests")
    _finish(figure, title, footer, [axis])
    return figure


def _grid(panels: Panels) -> tuple[Figure, list[Axes]]:
    """One panel a run: at most three beside each other, as in the paper."""
    columns = min(len(panels), 3)
    rows = -(-len(panels) // columns)
    width_in = COLUMN_IN if columns == 1 else PAGE_IN
    figure = Figure(figsize=(width_in, 1.4 + 2.0 * rows))
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    for axis in axes[len(panels) :]:
        axis.remove()
    return figure, axes[: len(panels)]


def _finish(figure: Figure, title: str, footer: str, axes: Iterable[Axes] = ()) -> None:
    """What is shown, above; below the panels their common legend, and which run it is."""
    width_in, height_in = figure.get_size_inches()
    figure.suptitle(textwrap.fill(title, int(width_in * 14)), x=0.01, ha="left")
    lines = textwrap.wrap(footer, int(width_in * 15))
    figure.text(0.01, 0.01, "\n".join(lines), ha="left", va="bottom", color="0.35")
    below = len(lines) * LINE_IN / height_in
    handles = _handles(axes)
    if handles:
        columns = 2 if width_in <= COLUMN_IN else len(handles)
        labels, drawn = list(handles), list(handles.values())
        figure.legend(drawn, labels, loc="lower center", bbox_to_anchor=(0.5, below), ncols=columns)
        below += (-(-len(handles) // columns) + 0.6) * LINE_IN / height_in
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))


def _handles(axes: Iterable[Axes]) -> dict[str, Any]:
    """What stands in the legends of these panels, each label once."""
    return {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}


def _legend_beside(axes: list[Axes]) -> None:
    handles = _handles(axes)
    if handles:
        legend = axes[-1].legend(list(handles.values()), list(handles), loc="center left", labelspacing=0.2)
        legend.set_bbox_to_anchor((1.0, 0.5))


def _label_outer(axes: list[Axes], x_label: str, y_label: str) -> None:
    for axis in axes:
        axis.set_xlabel(x_label)
        axis.set_ylabel(y_label)
        axis.label_outer()


def _logarithmic_ms(axis: Axes, low: float, high: float) -> None:
    """Ticks at 1, 2 and 5 times each power of ten, written out."""
    ticks = [digit * 10.0**power for power in range(-1, 7) for digit in (1, 2, 5)]
    axis.set_xscale("log")
    axis.set_xlim(low, high)
    axis.xaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.xaxis.set_major_formatter(ScalarFormatter())


def _limits_ms(panels: Panels) -> tuple[float, float]:
    """Of all response times and the deadline, with some room; a logarithmic axis starts at 0.1 ms at the latest."""
    times = [_known(response_ms(frames, answer)) for frames in panels.values() for answer in ("first", "fresh")]
    known = np.concatenate([*times, [DEADLINE_MS]])
    return max(0.8 * float(known.min()), 0.1), 1.25 * float(known.max())


def _step(axis: Axes, values_ms: Any, whole: int, end_ms: float, **line: Any) -> None:
    """The distribution of sorted values as shares of ``whole``, level after the last; nothing for no value."""
    if len(values_ms):
        kept = _thinned(len(values_ms))
        shares = (kept + 1) / whole
        axis.plot([*values_ms[kept], end_ms], [*shares, shares[-1]], drawstyle="steps-post", **line)


def _use(samples: pd.DataFrame) -> tuple[Any, Any]:
    """Time [s], and over the last second the mean length of a queue or the share of time spent serving."""
    t_ns, total_ns = running_use(samples)
    begin_ns = np.maximum(t_ns - NS_PER_S, 0.0)
    span_ns = np.maximum(t_ns - begin_ns, 1.0)
    return t_ns[1:] / NS_PER_S, ((total_ns - np.interp(begin_ns, t_ns, total_ns)) / span_ns)[1:]


def _used(of_kind: pd.DataFrame) -> dict[str, tuple[Any, Any]]:
    """The curve of each resource that is used at all."""
    ordered = of_kind.sort_values("t_ns", kind="stable")
    curves = {str(name): _use(samples) for name, samples in ordered.groupby("resource", observed=True)}
    return {name: curve for name, curve in curves.items() if curve[1].max() >= LEAST_USE}


def _draw_use(axis: Axes, curves: dict[str, tuple[Any, Any]], names: list[str]) -> None:
    if len(names) <= len(LINE_COLOURS):
        for name, (t_s, values) in curves.items():
            place = names.index(name)
            style_, colour = LINE_STYLES[place % len(LINE_STYLES)], LINE_COLOURS[place]
            axis.plot(t_s, values, label=_short(name), color=colour, linestyle=style_, linewidth=1.0)
    elif curves:
        t_s = np.unique(np.concatenate([t for t, _ in curves.values()]))
        values = np.stack([np.interp(t_s, *curve) for curve in curves.values()])
        axis.fill_between(t_s, values.min(0), values.max(0), color="0.8", label="range")
        axis.plot(t_s, np.median(values, axis=0), color=LINE_COLOURS[0], linewidth=1.2, label="median")
    if not curves:
        axis.text(0.5, 0.5, "none", transform=axis.transAxes, ha="center", va="center", color="0.35")


def _short(resource: str) -> str:
    """``edge1.accelerator`` to ``edge1``: the row already says the kind."""
    return resource.removesuffix(".accelerator").removesuffix(".cpu")


def _rows(table: pd.DataFrame, **where: str) -> pd.DataFrame:
    for column, value in where.items():
        table = table[table[column] == value]
    return table


def _known(values: Any) -> Any:
    return np.sort(values[~np.isnan(values)])


def _thinned(n: int) -> Any:
    """At most 1000 places of n, both ends among them."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS_PER_CURVE)).astype(int)) if n else np.arange(0)


def _percent_tick(share: float, _place: object) -> str:
    return f"{100 * share:.4g} %"


def _percent(share: float) -> str:
    """Two digits: 0.071 to ``7.1 %``, 0.71 to ``71 %``."""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"
