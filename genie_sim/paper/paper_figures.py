"""The figures of the evaluation: those of the paper's Section V over all seeds, in the paper's
arrangement, homogeneous above heterogeneous; and what the open parameters and the calibration do,
in the same style.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from genie_sim.analysis import figures, frame_metrics, genie_metrics, style
from genie_sim.analysis.drawing import in_style, is_narrow, letter_panels
from genie_sim.analysis.latency_cdf import latency_cdf
from genie_sim.analysis.style import PAGE_IN
from genie_sim.paper import figure_tables
from genie_sim.paper.assumptions import load_assumptions
from genie_sim.paper.checks import ALL, CASE, HE, HO
from genie_sim.paper.facts import METHODS
from genie_sim.paper.figure_tables import FITTED, TRIED
from genie_sim.recording import provenance
from genie_sim.recording.columns import Columns, Text, concat

TITLES = {
    name: f"{name[0]} car{'s' if name[0] > '1' else ''}, {'hetero.' if name in HE else 'homo.'}"
    for name in ALL
}
WRAPPED = {name: title.replace(", ", "\n") for name, title in TITLES.items()}
OBJECTS_LINE: dict[str, Any] = {"color": "0.1", "marker": "o", "markersize": 3.5, "linewidth": 1.6}
IMAGES_LINE: dict[str, Any] = {
    "color": "0.55",
    "marker": "s",
    "markersize": 3.5,
    "linewidth": 1.6,
    "linestyle": (0, (4, 1.2)),
}
PAPER_LINE: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (1, 1.5))}
# a sweep whose largest value is this many times its smallest gets a logarithmic axis
LOGARITHMIC_FROM = 10.0
FORMATS = ("svg", "png", "pdf")

Row = Mapping[str, Any]


def save(evaluation: Path, name: str) -> None:
    """Draws a figure of an evaluation into its folder ``figures``, as SVG, PNG and PDF. Raises
    OSError if a file cannot be written.
    """
    figures.save(_kept_makers(evaluation)[name](), evaluation / "figures", name, FORMATS)


@lru_cache(maxsize=1)
def _kept_makers(evaluation: Path) -> dict[str, Callable[[], Figure]]:
    """What draws each figure: a process that draws several reads the tables once."""
    return _makers(evaluation)


def of_evaluation(
    evaluation: Path, width_in: float | None = None, allow_changed: bool = False
) -> dict[str, Figure]:
    """Every figure that there is something for in an evaluation's folder, by file name, as wide as
    a column or a page; by default a page. Raises ``UserError``, also for files that were changed
    since they were written, unless they are allowed.
    """
    names = [*figure_tables.FILES.values(), "readings.json", "quality.json"]
    names += [name for name in (FITTED, TRIED) if (evaluation / name).is_file()]
    known = provenance.read_json(evaluation / "run.json").get("digests")
    changed = provenance.changed_files(evaluation, known, names)
    provenance.refuse_changed(evaluation, changed, allow_changed)
    return {name: make() for name, make in _makers(evaluation, width_in).items()}


def _makers(evaluation: Path, width_in: float | None = None) -> dict[str, Callable[[], Figure]]:
    """What draws each figure."""
    tables = figure_tables.read(evaluation)
    first = provenance.read_json(evaluation / "readings.json")[0]
    seeds = len(tables[CASE])
    footer = f"genie-sim reproduce, {first['name']}: {', '.join(first['settings'])}, {seeds} seeds"
    targets = load_assumptions().targets
    frames = {TITLES[name]: _pooled(tables[name], "frames") for name in (*HO, *HE)}
    lookups = {WRAPPED[name]: _pooled(tables[name], "lookups") for name in (*HO, *HE)}
    one_seed = {TITLES[name]: tables[name][0]["lookups"] for name in (*HO, *HE)}
    look: dict[str, Any] = {"methods": METHODS, "footer": footer, "width_in": width_in}
    of_first = look | {"footer": f"{footer}; the first seed"}
    page_in = width_in or PAGE_IN
    worth = provenance.read_json(evaluation / "quality.json")
    makers: dict[str, Callable[[], Figure]] = {
        "latency_cdf": partial(latency_cdf, frames, of="answered", **look),
        "latency_cdf_of_published": partial(latency_cdf, frames, **look),
        "image_reuse": partial(figures.image_reuse, lookups, **look),
        "object_reuse": partial(figures.object_reuse, lookups, **look),
        "confidence_boost": partial(figures.confidence_boost, one_seed, **of_first),
        "case_study": partial(_case_study, tables[CASE], footer, page_in),
        "worth": partial(_worth, worth, footer, page_in),
    }
    if (search := evaluation / FITTED).is_file():
        fitted = provenance.read_json(search)
        makers["calibration"] = partial(_calibration, fitted, targets, footer, page_in)
    if (tried := evaluation / TRIED).is_file():
        sweeps = provenance.read_json(tried)["sweeps"]
        makers["sensitivity"] = partial(_sweeps, sweeps, targets, footer, page_in)
    return makers


def _side_by_side(width_in: float, height_in: float, **options: Any) -> tuple[Figure, Any, Any]:
    """A figure with two panels of a height; one below the other in a column."""
    rows = 2 if is_narrow(width_in) else 1
    figure = Figure(figsize=(width_in, rows * height_in), layout="constrained")
    first, second = figure.subplots(rows, 3 - rows, **options)
    return figure, first, second


@in_style()
def _case_study(seeds: Sequence[Mapping[str, Columns]], footer: str, width_in: float) -> Figure:
    """Vision-assisted driving (paper: Fig. "bs"): response times of both cars, and reuse over
    events: the running ratio hits / requests.
    """
    figure, left, right = _side_by_side(width_in, 2.8)
    figure.set_label(
        f"Vision-assisted driving: car2 has no cameras\n{footer}; reuse: the first seed"
    )
    objects, images = OBJECTS_LINE | {"marker": ""}, IMAGES_LINE | {"marker": ""}
    genie = _pooled(seeds, "frames").where(method="genie")
    for car, label, look in (
        ("car2", "car2, no cameras", objects),
        ("car1", "car1, cameras", images),
    ):
        values = frame_metrics.response_ms(genie.where(car=car), "first")
        ordered = np.sort(values[~np.isnan(values)])
        left.plot(ordered, np.arange(1, len(ordered) + 1) / len(ordered), label=label, **look)
    left.axvline(41.0, color="black", linewidth=0.9, linestyle="--", label="41 ms (24 frames/s)")
    left.set_xlabel("response time, first answer [ms]")
    left.set_ylabel("share of frames")
    lookups = seeds[0]["lookups"]
    of_image = lookups["kind"] == "image"
    for events, label, look in (
        (lookups.rows(~of_image).where(genie="car2/genie"), "objects, car2 (no cameras)", objects),
        (lookups.rows(of_image).where(genie="car1/genie"), "images, car1 (cameras)", images),
    ):
        ratios = genie_metrics.running_reuse(events)["ratio"]
        right.plot(np.arange(1, len(ratios) + 1), ratios, label=label, **look)
    right.set_xlabel("events (messages looked up)")
    right.set_ylabel("running hits / requests")
    right.set_ylim(0, 1.02)
    right.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    for axis in (left, right):
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.24), ncols=1)
    letter_panels(figure)
    return figure


@in_style()
def _sweeps(
    rows: Sequence[Row], targets: Mapping[str, float], footer: str, width_in: float
) -> Figure:
    """Object and image reuse, means of the twelve bars with 95 % intervals over seeds, against each
    open parameter.

    ``rows``: ``parameter``, ``unit``, ``used`` (the evaluation's own value, or ``None``), and
    ``points``: a list of ``value``, ``object_reuse`` and ``image_reuse`` as (mean, low, high).
    """
    columns = 2 if is_narrow(width_in) else 3
    lines = -(-len(rows) // columns)
    figure = Figure(figsize=(width_in, 0.9 + 1.75 * lines), layout="constrained")
    figure.set_label(
        f"Reuse against each parameter that the paper leaves open, all else unchanged\n{footer}"
    )
    grid = figure.subplots(lines, columns, sharey=True, squeeze=False)
    axes = list(grid.flat)
    for axis, row in zip(axes, rows, strict=False):
        _sweep(axis, row, targets, every_tick=2 if is_narrow(width_in) else 1)
    for axis in axes[len(rows) :]:
        axis.remove()
    for line in grid:
        line[0].set_ylabel("mean of 12 bars")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=2 if is_narrow(width_in) else 4
    )
    letter_panels(figure)
    return figure


@in_style()
def _calibration(
    search: Mapping[str, Any], targets: Mapping[str, float], footer: str, width_in: float
) -> Figure:
    """Both calibrated numbers over the two fitted parameters, with the paper's level as a line
    where it is reached.
    """
    points, best = search["tried"], search["best"]
    figure, left, right = _side_by_side(width_in, 3.0, sharey=True)
    figure.set_label(
        f"Calibration: the two published numbers over the two fitted parameters\n{footer}"
    )
    for axis, name, target, title in (
        (left, "object_reuse", targets["object_reuse_mean"], "object reuse, mean of 12 bars"),
        (right, "ratio", targets["object_to_image_reuse"], "object reuse / image reuse"),
    ):
        overlap, gate_m, values = (
            np.array([row[key] for row in points]) for key in ("overlap", "gate_m", name)
        )
        shades = axis.scatter(
            overlap, gate_m, c=values, cmap="cividis", s=42, edgecolors="black", linewidths=0.4
        )
        for x, y, value in zip(overlap, gate_m, values, strict=True):
            is_best = (x, y) == (best["overlap"], best["gate_m"])
            in_the_way = (abs(overlap - x) < 0.09) & (gate_m >= y) & (gate_m < y + 0.3)
            if is_best or in_the_way.sum() == 1:  # its own point alone
                offset = (0, -12 if is_best else 6)
                axis.annotate(
                    f"{value:.2f}",
                    (x, y),
                    offset,
                    textcoords="offset points",
                    ha="center",
                    fontsize=6,
                )
        if values.min() < target < values.max():
            axis.tricontour(
                overlap, gate_m, values, levels=[target], colors="#C44E00", linewidths=1.4
            )
            title += f"; line: {target:g}"
        else:
            title += f"; {target:g} not reached"
        axis.plot(
            best["overlap"],
            best["gate_m"],
            marker="x",
            color="#C44E00",
            markersize=9,
            markeredgewidth=2,
        )
        axis.set_title(title)
        axis.set_xlabel("overlap of the routes")
        axis.set_xlim(overlap.min() - 0.08, overlap.max() + 0.08)
        axis.set_ylim(gate_m.min() - 0.25, gate_m.max() + 0.3)
        figure.colorbar(shades, ax=axis)
    left.set_ylabel("gate of the object map [m]")
    letter_panels(figure)
    return figure


@in_style()
def _worth(rows: Sequence[Row], footer: str, width_in: float) -> Figure:
    """Precision, recall and ghosts of what the consumer holds, for L, R and DG; ``rows`` as
    ``quality`` makes them.
    """
    figure = Figure(figsize=(width_in, 2.6), layout="constrained")
    figure.set_label(
        f"What the consumer holds at each instant, against KITTI's labels (drive 0005)\n{footer}"
    )
    names = {
        "object_precision": "precision",
        "object_recall_static": "recall, static",
        "object_recall_moving": "recall, moving",
        "ghost_share": "ghosts",
    }
    by_method = {(row["method"], row["name"]): row for row in rows}
    axis = figure.subplots()
    looks = style.method_looks([method.name for method in METHODS])
    for place, method in enumerate(METHODS):
        for x, name in enumerate(names):
            row = by_method.get((method.name, name))
            if row is not None:
                mean, low, high = (row[key] for key in ("value", "low", "high"))
                label = method.title if x == 0 else None
                at = x + 0.27 * (place - 1)
                look = style.method_bar(looks[place]) | {"label": label}
                axis.bar(at, mean, 0.25, edgecolor="black", linewidth=0.7, **look)
                axis.errorbar(
                    at,
                    mean,
                    yerr=[[mean - low], [high - mean]],
                    color="black",
                    linewidth=1,
                    capsize=3,
                )
    space = "\n" if is_narrow(width_in) else " "
    axis.set_xticks(range(len(names)), [name.replace(" ", space) for name in names.values()])
    axis.grid(axis="x", visible=False)
    axis.set_ylabel("share of objects")
    axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _sweep(axis: Axes, row: Row, targets: Mapping[str, float], every_tick: int) -> None:
    points = row["points"]
    values = np.array([point["value"] for point in points])
    for name, look, label in (
        ("object_reuse", OBJECTS_LINE, "object reuse"),
        ("image_reuse", IMAGES_LINE, "image reuse"),
    ):
        mean, low, high = np.array([point[name] for point in points], dtype=float).T
        axis.plot(values, mean, label=label, **look)
        axis.fill_between(values, low, high, color=look["color"], alpha=0.2, linewidth=0)
    level = targets["object_reuse_mean"]
    axis.axhline(level, color="0.1", label=f"paper: {100 * level:.0f} % of objects", **PAPER_LINE)
    images = level / targets["object_to_image_reuse"]
    axis.axhline(images, color="0.55", label="paper: a quarter of it", **PAPER_LINE)
    if row["used"] is not None:
        axis.axvline(row["used"], color="0.5", linewidth=0.8)
    if values.min() > 0 and values.max() / values.min() >= LOGARITHMIC_FROM:
        axis.set_xscale("log")
        labelled = values[::every_tick]
        axis.set_xticks(labelled, [f"{value:g}" for value in labelled])
        axis.xaxis.set_minor_locator(NullLocator())
    unit = "" if row["unit"] == "1" else f" [{row['unit']}]"
    axis.set_xlabel(row["title"] + unit)
    axis.set_ylim(0, 1.02)
    axis.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))


def _pooled(seeds: Sequence[Mapping[str, Columns]], table: str) -> Columns:
    """All seeds in one table; each seed's Genies are Genies of their own, so bars are means over
    Genies and seeds.
    """
    parts = []
    for number, tables in enumerate(seeds):
        part = tables[table]
        if "genie" in part.names:
            genies = part["genie"]
            part = part.assign(
                genie=Text.of(genies.codes, [f"{genie}#{number}" for genie in genies.names])
            )
        parts.append(part)
    return concat(parts)
