"""The figures of the evaluation: those of the paper's Section V over all seeds, in the paper's
arrangement, homogeneous above heterogeneous.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from genie_sim.analysis import figures, frame_metrics, genie_metrics, style
from genie_sim.analysis.drawing import in_style, is_narrow, letter_panels
from genie_sim.analysis.latency_cdf import latency_cdf
from genie_sim.analysis.style import PAGE_IN
from genie_sim.paper import figure_tables
from genie_sim.paper.checks import ALL, CASE, HE, HO
from genie_sim.paper.facts import METHODS
from genie_sim.record import provenance
from genie_sim.record.columns import Columns, Text, concat

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
    frames = {TITLES[name]: _pooled(tables[name], "frames") for name in (*HO, *HE)}
    lookups = {WRAPPED[name]: _pooled(tables[name], "lookups") for name in (*HO, *HE)}
    one_seed = {TITLES[name]: tables[name][0]["lookups"] for name in (*HO, *HE)}
    drawing: dict[str, Any] = {"methods": METHODS, "footer": footer, "width_in": width_in}
    of_first = drawing | {"footer": f"{footer}; the first seed"}
    page_in = width_in or PAGE_IN
    worth = provenance.read_json(evaluation / "quality.json")
    return {
        "latency_cdf": partial(latency_cdf, frames, of="answered", **drawing),
        "latency_cdf_of_published": partial(latency_cdf, frames, **drawing),
        "image_reuse": partial(figures.image_reuse, lookups, **drawing),
        "object_reuse": partial(figures.object_reuse, lookups, **drawing),
        "confidence_boost": partial(figures.confidence_boost, one_seed, **of_first),
        "case_study": partial(_case_study, tables[CASE], footer, page_in),
        "worth": partial(_worth, worth, footer, page_in),
    }


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
    for car, label, drawing in (
        ("car2", "car2, no cameras", objects),
        ("car1", "car1, cameras", images),
    ):
        values = frame_metrics.response_ms(genie.where(car=car), "first")
        ordered = np.sort(values[~np.isnan(values)])
        left.plot(ordered, np.arange(1, len(ordered) + 1) / len(ordered), label=label, **drawing)
    left.axvline(41.0, color="black", linewidth=0.9, linestyle="--", label="41 ms (24 frames/s)")
    left.set_xlabel("response time, first answer [ms]")
    left.set_ylabel("share of frames")
    lookups = seeds[0]["lookups"]
    of_image = lookups["kind"] == "image"
    for events, label, drawing in (
        (lookups.rows(~of_image).where(genie="car2/genie"), "objects, car2 (no cameras)", objects),
        (lookups.rows(of_image).where(genie="car1/genie"), "images, car1 (cameras)", images),
    ):
        ratios = genie_metrics.running_reuse(events)["ratio"]
        right.plot(np.arange(1, len(ratios) + 1), ratios, label=label, **drawing)
    right.set_xlabel("events (messages looked up)")
    right.set_ylabel("running hits / requests")
    right.set_ylim(0, 1.02)
    right.yaxis.set_major_formatter(FuncFormatter(style.percent_tick))
    for axis in (left, right):
        axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.24), ncols=1)
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
    styles = style.method_styles([method.name for method in METHODS])
    for place, method in enumerate(METHODS):
        for x, name in enumerate(names):
            row = by_method.get((method.name, name))
            if row is not None:
                mean, low, high = (row[key] for key in ("value", "low", "high"))
                label = method.title if x == 0 else None
                at = x + 0.27 * (place - 1)
                drawing = style.method_bar(styles[place]) | {"label": label}
                axis.bar(at, mean, 0.25, edgecolor="black", linewidth=0.7, **drawing)
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
