"""The figures of the paper's Section V, drawn from the tables of runs.

Each function takes ``panels``: a label for every run (``{"3 cars, heterogeneous": frames}``; one run is a mapping with
one entry), the ``methods`` that ran, the ``footer`` that names the run, and ``width_in``: a printed column's or page's,
with text of 8 points; by default whichever fits. The same tables give the same bytes with the same matplotlib.
"""

import io
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import style
from genie_sim.analysis.breakdown import time_parts
from genie_sim.analysis.drawing import finish, in_style, logarithmic_ms
from genie_sim.analysis.latency_accuracy import drawable, latency_accuracy
from genie_sim.analysis.metrics import (
    DEADLINE_MS,
    PART,
    WINDOW_REQUESTS,
    response_ms,
    reuse,
    running_boost,
    running_use,
    windowed_reuse,
)
from genie_sim.analysis.style import (
    CHARACTER_IN,
    COLUMN_IN,
    PAGE_IN,
    PLACEMENTS,
    by_number,
    percent_tick,
    thinned,
)
from genie_sim.recording.columns import Columns
from genie_sim.recording.results import MethodInfo, Run
from genie_sim.units import NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

Panels = Mapping[str, "Columns | pd.DataFrame"]
Tables = Mapping[str, Columns]
Methods = Sequence[MethodInfo]

RESOURCE_KINDS = {
    "accelerator": "accelerators busy",
    "cpu": "CPUs busy",
    "link": "links busy",
    "queue": "messages waiting",
}
# Of each format: what the title and the description of a figure are called in it, and what it is not to tell.
FORMATS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "svg": ("Title", "Description", ("Date", "Creator")),
    "png": ("Title", "Description", ("Software",)),
    "pdf": ("Title", "Subject", ("CreationDate", "Creator", "Producer")),
}
LEAST_USE = 0.01
FEW_UPDATES = 50
TITLE_CHARACTERS_PER_IN = 15
MOST_COLUMNS = 4  # of methods beside each other


def of_run(run: Run, width_in: float | None = None) -> dict[str, Figure]:
    """Every figure of one run, by file name, but of Genies and of use only what was simulated and recorded. They are
    ``width_in`` wide if that is given; use needs a page."""
    frames, lookups, resources = (run.tables[name] for name in ("frames", "lookups", "resources"))
    methods, panel, said = run.methods, run.name, (run.footer, width_in)
    figures = {}
    if drawable({panel: run.measured}):
        figures["latency_accuracy"] = latency_accuracy({panel: run.measured}, methods, *said)
    figures |= {
        "latency_cdf": latency_cdf({panel: frames}, methods, *said),
        "latency_cdf_of_answered": latency_cdf({panel: frames}, methods, *said, of="answered"),
    }
    if any(one.metric in PART.values() for one in run.measured):
        figures["time_parts"] = time_parts(run.measured, methods, *said)
    if len(resources):
        figures["resources"] = resource_use(resources, methods, run.footer)
    if len(lookups):
        figures["image_reuse"] = image_reuse({panel: lookups}, methods, *said)
        figures["object_reuse"] = object_reuse({panel: lookups}, methods, *said)
        figures["confidence_boost"] = confidence_boost({panel: lookups}, methods, *said)
    return figures


def save(
    figure: Figure, folder: Path, name: str, formats: Sequence[str] = ("svg", "png")
) -> list[Path]:
    """Writes ``name.svg`` and so on, with the figure's title and run but without date and version. Raises OSError."""
    paths = [folder / f"{name}.{format}" for format in formats]
    with in_style():
        _settle(figure)
        for path, format in zip(paths, formats, strict=True):
            figure.savefig(path, format=format, metadata=_metadata(figure, format))
    return paths


def _metadata(figure: Figure, format: str) -> dict[str, str | None]:
    title, description, untold = FORMATS[format]
    said = zip((title, description), str(figure.get_label()).split("\n"), strict=False)
    return dict.fromkeys(untold) | {name: text for name, text in said if text}


def write(run: Run, folder: Path, formats: Sequence[str], width: str | None = None) -> list[Path]:
    """Writes every figure of a run into a folder, as wide as a ``column`` or ``page`` if that is said. Raises OSError
    if it cannot."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = of_run(run, None if width is None else style.WIDTHS[width])
    return [path for name, figure in drawn.items() for path in save(figure, folder, name, formats)]


def svg(figure: Figure) -> bytes:
    """The figure as ``save`` writes it."""
    to = io.BytesIO()
    with in_style():
        _settle(figure)
        figure.savefig(to, format="svg", metadata=_metadata(figure, "svg"))
    return to.getvalue()


def _settle(figure: Figure) -> None:
    """Lays the figure out once and rounds the result: the layout's solver varies in the last digit from call to call,
    and matplotlib names parts of an SVG file after such digits."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis in figure.axes:
        left, bottom, width, height = (round(length, 6) for length in axis.get_position().bounds)
        axis.set_position((left, bottom, width, height))


@in_style()
def latency_cdf(
    panels: Panels,
    methods: Methods,
    footer: str = "",
    width_in: float | None = None,
    of: str = "published",
) -> Figure:
    """Response time under each method, with the 33 ms deadline (paper: Fig. "cdf-time").

    ``of="published"``: a curve ends at the share of frames that were answered at all. ``of="answered"``, the paper's
    way: every curve reaches 1, however many frames were dropped. Either way the shares are told: of one run in the
    legend, of several above each panel. The fresh answer is drawn where it differs from the first.
    """
    figure, axes = _grid(panels, width_in)
    tables = {label: Columns.of(frames) for label, frames in panels.items()}
    low, high = _limits_ms(tables)
    for axis, (label, frames) in zip(axes, tables.items(), strict=True):
        shares: dict[str, list[str]] = {"answered": [], "fresh": []}
        for position, method in enumerate(methods):
            mine = frames.where(method=method.name)
            if not len(mine):
                continue
            line = style.method_line(position)
            first, fresh = (_known(response_ms(mine, answer)) for answer in ("first", "fresh"))
            looks = {
                "answered": (first, line),
                "fresh": (fresh, line | {"linewidth": 0.9, "linestyle": (0, (4, 2))}),
            }
            if np.array_equal(first, fresh):
                del looks["fresh"]
            for answer, (values, look) in looks.items():
                share = _percent(len(values) / len(mine))
                name = method.title if answer == "answered" else f"{method.title}, fresh"
                shares[answer].append(
                    f"{method.name} {share}".replace(" ", "\u00a0")
                )  # in one line
                told = name if len(panels) > 1 else f"{name}, {share}"
                _step(
                    axis,
                    values,
                    len(mine) if of == "published" else None,
                    high,
                    **look | {"label": told},
                )
        axis.axvline(
            DEADLINE_MS,
            color="black",
            linewidth=0.9,
            linestyle="--",
            label=f"{DEADLINE_MS:g} ms deadline",
        )
        if len(panels) > 1:
            said = [f"{what}: {', '.join(found)}" for what, found in shares.items() if found]
            room = int(axis.get_position().width * figure.get_figwidth() * TITLE_CHARACTERS_PER_IN)
            axis.set_title(
                "\n".join([label, *(line for one in said for line in textwrap.wrap(one, room))])
            )
        axis.set_ylim(0, 1.02)
        logarithmic_ms(axis, low, high)
    _label_outer(axes, "response time [ms], logarithmic", f"share of {of} frames")
    finish(
        figure, f"Response time from received to first answer, share of {of} frames", footer, axes
    )
    return figure


@in_style()
def image_reuse(
    panels: Panels, methods: Methods, footer: str = "", width_in: float | None = None
) -> Figure:
    """Hits / requests of the message caches, asked by their own clients (paper: Fig. "reuse-img")."""
    of_clients = {
        label: Columns.of(lookups).where(kind="image", requester="client")
        for label, lookups in panels.items()
    }
    return _reuse_bars(of_clients, methods, "Image reuse", footer, width_in)


@in_style()
def object_reuse(
    panels: Panels, methods: Methods, footer: str = "", width_in: float | None = None
) -> Figure:
    """Object look-ups answered by an object with C >= C_T / all of them (paper: Fig. "reuse-obj")."""
    tables = {label: Columns.of(lookups) for label, lookups in panels.items()}
    of_maps = {label: lookups.rows(lookups["kind"] != "image") for label, lookups in tables.items()}
    return _reuse_bars(of_maps, methods, "Object reuse", footer, width_in)


@in_style()
def confidence_boost(
    panels: Panels, methods: Methods, footer: str = "", width_in: float | None = None
) -> Figure:
    """Running mean of C_new - C_old over the updates of the object maps on cars and on edges (paper: Fig. "boost").

    In greys; with several methods that run Genies, in the colour of each. The axis is that of the curves after their
    first updates, which are means of few and may lie outside.
    """
    figure, axes = _grid(panels, width_in)
    tables = {label: Columns.of(lookups) for label, lookups in panels.items()}
    several = len(_with_genies(tables, methods)) > 1
    settled: list[float] = []
    for axis, (label, lookups) in zip(axes, tables.items(), strict=True):
        for position, method in _with_genies(tables, methods):
            for placement, where in PLACEMENTS.items():
                curve = running_boost(lookups.where(method=method.name, placement=placement))
                if not len(curve):
                    continue
                kept = thinned(len(curve))
                settled += curve["boost"][curve["updates"] > FEW_UPDATES].tolist()
                look = style.PLACEMENT_LINES[placement] | {"label": f"Genies {where}"}
                if several:
                    look |= {
                        "color": style.COLOURS[position % len(style.COLOURS)],
                        "label": f"{method.title}, {where}",
                    }
                axis.plot(curve["updates"][kept], curve["boost"][kept], **look)
        axis.set_title(label if len(panels) > 1 else "")
        axis.margins(x=0.02)
    if settled:
        room = 0.08 * (max(settled) - min(settled)) or 0.01
        axes[0].set_ylim(min(settled) - room, max(settled) + room)
    _label_outer(axes, "updates so far", "mean of C(new) - C(old)")
    finish(
        figure, "Confidence boost: running mean over the updates of the object maps", footer, axes
    )
    return figure


@in_style()
def resource_use(resources: "Columns | pd.DataFrame", methods: Methods, footer: str = "") -> Figure:
    """Utilization of accelerators, CPUs and links, and queue lengths over simulated time; a column a method.

    Each point is the mean of the last second. What is never used by 1 % (queues: never holds a message) is left out,
    and so is a kind of which nothing is used. Each host has its colour and marker in every panel; of a host, the
    second link or queue is dashed, the third dotted. More than eight hosts are drawn as their range and median.
    """
    resources = Columns.of(resources)
    methods = [method for method in methods if (resources["method"] == method.name).any()]
    used = {
        kind: [_used(resources.where(kind=kind, method=method.name)) for method in methods]
        for kind in RESOURCE_KINDS
        if (resources["kind"] == kind).any()
    }
    used = {kind: curves for kind, curves in used.items() if any(curves)} or dict(
        list(used.items())[:1]
    )
    hosts = sorted(
        {_host(name) for of_kind in used.values() for curves in of_kind for name in curves},
        key=by_number,
    )
    kinds, columns = max(len(used), 1), min(max(len(methods), 1), MOST_COLUMNS)
    blocks = max(-(-len(methods) // columns), 1)  # of methods, one below the other
    figure = Figure(figsize=(PAGE_IN, 0.4 + 1.15 * kinds * blocks))
    grid = figure.subplots(kinds * blocks, columns, sharex=True, sharey="row", squeeze=False)
    for row, (kind, of_kind) in enumerate(used.items()):
        names = sorted({name for curves in of_kind for name in curves}, key=by_number)
        for place, curves in enumerate(of_kind):
            axis = grid[place // columns * kinds + row, place % columns]
            _draw_use(axis, curves, names, hosts)
            if kind != "queue":
                axis.set_ylim(0, 1.05)
                axis.yaxis.set_major_formatter(FuncFormatter(percent_tick))
        for block in range(blocks):
            grid[block * kinds + row, 0].set_ylabel(RESOURCE_KINDS[kind])
    for place, method in enumerate(methods):
        grid[place // columns * kinds, place % columns].set_title(method.title)
    for axis in grid[-kinds:, (len(methods) - 1) % columns + 1 :].flat:
        axis.remove()
    for axis in grid[-1]:
        axis.set_xlabel("simulated time [s]")
    finish(
        figure, "Use of devices and links, and queues, over simulated time", footer, list(grid.flat)
    )
    return figure


def _reuse_bars(
    panels: Tables, methods: Methods, what: str, footer: str, width_in: float | None
) -> Figure:
    """Bars are means over the Genies on cars and on edges, error bars the extreme windows of any of them."""
    ran = [method for _, method in _with_genies(panels, methods)] or methods[:1]
    groups = [(label, method, lookups) for label, lookups in panels.items() for method in ran]
    title = f"{what}: mean over Genies; bars: extreme windows of {WINDOW_REQUESTS} requests of any Genie"
    labels = [
        f"{label}\n{method.title}" if len(panels) > 1 else method.title
        for label, method, _ in groups
    ]
    if len(ran) == 1:
        labels = list(panels)
    width_in = width_in or (COLUMN_IN if len(groups) <= 3 else PAGE_IN)
    room_in = (width_in - 0.7) / len(groups)  # of a group of two bars
    longest_in = max(len(line) for label in labels for line in label.split("\n")) * CHARACTER_IN
    tilted = longest_in > 1.05 * room_in
    figure = Figure(figsize=(width_in, 1.9 + tilted * longest_in))
    axis = figure.subplots()
    for side, (placement, where) in enumerate(PLACEMENTS.items()):
        look = style.PLACEMENT_BARS[placement] | {"label": f"Genies {where}"}
        for x, (_, method, lookups) in enumerate(groups):
            mine = lookups.where(method=method.name, placement=placement)
            _reuse_bar(
                axis, x + 0.38 * (side - 0.5), mine, look, upright=0.38 * room_in < 6 * CHARACTER_IN
            )
    axis.set_xticks(range(len(groups)), labels, rotation=90 if tilted else 0)
    axis.set_xlim(-0.6, len(groups) - 0.4)
    axis.set_ylim(0, None)
    axis.grid(axis="x", visible=False)
    axis.yaxis.set_major_formatter(FuncFormatter(percent_tick))
    axis.set_ylabel(what.lower())
    finish(figure, title, footer, [axis])
    return figure


def _reuse_bar(
    axis: Axes, left: float, lookups: Columns, look: dict[str, Any], upright: bool
) -> None:
    turn = 90 if upright else 0
    ratios, windows = list(reuse(lookups).values()), windowed_reuse(lookups)["ratio"]
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
    mean = float(np.mean(ratios))
    axis.bar(left, mean, 0.34, edgecolor="black", linewidth=0.7, **look)
    if len(windows):
        ends = [[max(mean - windows.min(), 0)], [max(windows.max() - mean, 0)]]
        axis.errorbar(left, mean, yerr=ends, color="black", linewidth=1, capsize=3)
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    look = {"ha": "center", "va": "bottom", "bbox": box, "rotation": turn}
    axis.annotate(_percent(mean), (left, 0), (0, 3), textcoords="offset points", **look)


def _with_genies(panels: Tables, methods: Methods) -> list[tuple[int, MethodInfo]]:
    """The methods under which Genies looked something up, with their positions."""
    names = {name for lookups in panels.values() for name in lookups["method"].unique()}
    return [(position, method) for position, method in enumerate(methods) if method.name in names]


def _grid(panels: Panels, width_in: float | None) -> tuple[Figure, list[Axes]]:
    """One panel a run: at most three beside each other, as in the paper; one in a column's width."""
    columns = 1 if width_in == COLUMN_IN else min(len(panels), 3)
    rows = -(-len(panels) // columns)
    figure = Figure(
        figsize=(width_in or (COLUMN_IN if columns == 1 else PAGE_IN), 0.3 + 1.75 * rows)
    )
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    for axis in axes[len(panels) :]:
        axis.remove()
    return figure, axes[: len(panels)]


def _label_outer(axes: list[Axes], x_label: str, y_label: str) -> None:
    for axis in axes:
        axis.set_xlabel(x_label)
        axis.set_ylabel(y_label)
        axis.label_outer()


def _limits_ms(panels: Tables) -> tuple[float, float]:
    """Of all response times and the deadline, with some room; a logarithmic axis starts at 0.1 ms at the latest."""
    times = [
        _known(response_ms(frames, answer))
        for frames in panels.values()
        for answer in ("first", "fresh")
    ]
    known = np.concatenate([*times, [DEADLINE_MS]])
    return max(0.8 * float(known.min()), 0.1), 1.25 * float(known.max())


def _step(axis: Axes, values_ms: Any, whole: int | None, end_ms: float, **line: Any) -> None:
    """The distribution of sorted values as shares of ``whole`` (``None``: of themselves), level after the last; nothing
    for no value."""
    if len(values_ms):
        kept = thinned(len(values_ms))
        shares = (kept + 1) / (whole or len(values_ms))
        axis.plot([*values_ms[kept], end_ms], [*shares, shares[-1]], drawstyle="steps-post", **line)


def _use(samples: Columns) -> tuple[Any, Any]:
    """Time [s], and over the last second the mean length of a queue or the share of time spent serving."""
    t_ns, total_ns = running_use(samples)
    begin_ns = np.maximum(t_ns - NS_PER_S, 0.0)
    span_ns = np.maximum(t_ns - begin_ns, 1.0)
    return t_ns[1:] / NS_PER_S, ((total_ns - np.interp(begin_ns, t_ns, total_ns)) / span_ns)[1:]


def _used(of_kind: Columns) -> dict[str, tuple[Any, Any]]:
    """The curve of each resource that is used at all."""
    curves = {name: _use(samples) for name, samples in of_kind.by("t_ns").groups("resource")}
    return {name: curve for name, curve in curves.items() if curve[1].max() >= LEAST_USE}


def _draw_use(
    axis: Axes, curves: dict[str, tuple[Any, Any]], names: list[str], hosts: list[str]
) -> None:
    if not curves:
        axis.text(
            0.5, 0.5, "not used", transform=axis.transAxes, ha="center", va="center", color="0.35"
        )
    elif len(hosts) <= len(style.HOSTS):
        for name, (t_s, values) in curves.items():
            host = _host(name)
            place, nth = hosts.index(host), [one for one in names if _host(one) == host].index(name)
            look: dict[str, Any] = {
                "color": style.HOSTS[place],
                "linestyle": ("-", "--", ":")[min(nth, 2)],
            }
            look |= {
                "marker": style.MARKERS[place],
                "markevery": ((place + 0.5) / 8 / len(style.HOSTS), 1 / 8),
            }
            axis.plot(
                t_s, values, linewidth=1.0, markersize=3.5, label=host if nth == 0 else None, **look
            )
    else:
        t_s = np.unique(np.concatenate([t for t, _ in curves.values()]))
        values = np.stack([np.interp(t_s, *curve) for curve in curves.values()])
        axis.fill_between(t_s, values.min(0), values.max(0), color="0.8", label="range")
        axis.plot(t_s, np.median(values, axis=0), color="black", linewidth=1.2, label="median")


def _host(resource: str) -> str:
    """``edge1.accelerator``, ``edge1->car1`` and ``edge1/genie:/image_raw`` to ``edge1``."""
    return re.split(r"[./]|->", resource)[0]


def _known(values: Any) -> Any:
    return np.sort(values[~np.isnan(values)])


def _percent(share: float) -> str:
    """Two digits: 0.071 to ``7.1 %``, 0.71 to ``71 %``."""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"
