"""What the figures of an evaluation draw: of the runs of the first reading, as it means the
metrics, the points of curves and the heights of bars.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis import genie_metrics
from genie_sim.analysis.statistics import thinned
from genie_sim.paper import facts
from genie_sim.paper.checks import CASE
from genie_sim.paper.definitions import Definitions
from genie_sim.paper.facts import METHODS
from genie_sim.record import tables
from genie_sim.record.columns import Columns, concat
from genie_sim.record.tables import Column, Schema, Table

FILE = "figures.parquet"
SCHEMA = Schema(
    "evaluation_figures",
    "A point of a curve of the evaluation's figures, or one of the three heights of a bar.",
    (
        Column("scenario", "text", "", "the scenario that was simulated"),
        Column(
            "what",
            "text",
            "",
            "first, fresh, mean, image_reuse, object_reuse, boost, events_reuse",
        ),
        Column("of", "text", "", "the method, the car or the placement"),
        Column("x", "float64", "", "share of frames, events, seeds, or mean, lowest, highest"),
        Column("y", "float64", "", "time in ms, never for no answer; ratio; boost", nullable=True),
    ),
)
FIGURES = (  # by their file names; those that take longest come first
    "latency_cdf",
    "latency_cdf_of_published",
    "confidence_boost",
    "case_study",
    "object_reuse",
    "image_reuse",
    "worth",
)
CURVE_POINTS = 400
TIME_POINTS = 1000  # of answered frames
ANSWERS = ("first", "fresh")
REUSED = {True: "image_reuse", False: "object_reuse"}  # of images, or of objects
PLACEMENTS = ("edge", "car")

Runs = Sequence[Mapping[str, Columns]]  # of each seed the tables by name


class Key(NamedTuple):
    """What points are of; see ``SCHEMA``."""

    scenario: str
    what: str
    of: str


class Points(NamedTuple):
    """Of a curve, from left to right, or of a bar."""

    x: Any
    y: Any


def write(folder: Path, runs: Mapping[str, Runs], definitions: Definitions) -> None:
    """Writes what is drawn of runs, by scenario. Raises OSError."""
    table = Table(SCHEMA)
    for key, points in drawn(runs, definitions).items():
        for x, y in zip(*map(np.ndarray.tolist, points), strict=True):
            table.append((*key, x, None if np.isnan(y) else y))
    table.write(folder / FILE)


def read(folder: Path) -> dict[Key, Points]:
    """What is drawn of an evaluation. Raises ``UserError``."""
    return {
        Key(scenario, what, of): Points(rows["x"], rows["y"])
        for scenario, of_scenario in tables.read(folder / FILE, SCHEMA).groups("scenario")
        for what, of_kind in of_scenario.groups("what")
        for of, rows in of_kind.groups("of")
    }


def drawn(runs: Mapping[str, Runs], definitions: Definitions) -> dict[Key, Points]:
    """What is drawn of runs, by scenario, as ``definitions`` mean the metrics."""
    return {
        Key(scenario, *key): Points(*(np.asarray(end, dtype=float) for end in points))
        for scenario, seeds in runs.items()
        for key, points in [
            *_times(seeds, definitions, scenario == CASE),
            *_reuse(seeds, definitions),
            *_boosts(seeds, definitions),
            *(_case_reuse(seeds, definitions) if scenario == CASE else ()),
        ]
    }


Found = Iterator[tuple[tuple[str, str], tuple[Any, Any]]]


def _times(seeds: Runs, definitions: Definitions, of_cars: bool) -> Found:
    """Times to the answers of all seeds, a curve a method, or one a car with Genie; and the mean to
    the first one.
    """
    frames = concat([tables["frames"] for tables in seeds])
    if definitions.time == "stamp":
        frames = frames.assign(received_ns=frames["stamp_ns"])
    if of_cars:
        parts = frames.where(method="genie").groups("car")
    else:
        parts = iter((method.name, frames.where(method=method.name)) for method in METHODS)
    for of, rows in parts:
        times_ms = [np.sort(facts.response_ms(rows, answer)) for answer in ANSWERS]
        answered = [int(np.count_nonzero(~np.isnan(values))) for values in times_ms]  # NaN is last
        n = len(rows)
        places = thinned(n, TIME_POINTS * n // max([*answered, 1]))
        places = np.union1d(places, [count - 1 for count in answered if count])
        for answer, values in zip(ANSWERS, times_ms, strict=True):
            yield (answer, of), ((places + 1) / n, values[places].round(4))
        yield ("mean", of), ([len(seeds)], [np.nanmean(times_ms[0])])


def lookups(seeds: Runs, definitions: Definitions, of_images: bool, **where: str) -> list[Columns]:
    """Of each seed the look-ups of images, or of objects, that count as requests."""
    if of_images and definitions.image_reuse == "own_requests":
        where["requester"] = "client"
    of_seeds = [tables["lookups"] for tables in seeds]
    return [rows.rows((rows["kind"] == "image") == of_images).where(**where) for rows in of_seeds]


def _reuse(seeds: Runs, definitions: Definitions) -> Found:
    """By placement the mean reuse, and the lowest and highest ratio, all means over seeds."""
    ratios_of = {"windows": facts.windowed_reuse, "running": genie_metrics.running_reuse}
    ratios = ratios_of[definitions.error_bars]
    for of_images, what in REUSED.items():
        for placement in PLACEMENTS:
            of_seeds = [
                rows
                for rows in lookups(seeds, definitions, of_images, placement=placement)
                if rows["requests"].sum()
            ]
            if of_seeds:
                means = [np.mean([*genie_metrics.reuse(rows).values()]) for rows in of_seeds]
                extremes = [ratios(rows)["ratio"] for rows in of_seeds]
                ends = [
                    float(np.mean([end(values) for values in extremes if len(values)] or means))
                    for end in (np.min, np.max)
                ]
                yield (what, placement), (range(3), (float(np.mean(means)), *ends))


def _boosts(seeds: Runs, definitions: Definitions) -> Found:
    """By placement the boost over events of the object maps, mean over seeds."""
    per_object = definitions.boost == "per_object"
    for placement in PLACEMENTS:
        curves = [
            (curve["events"], curve["boost"])
            for rows in lookups(seeds, definitions, False, placement=placement)
            if len(curve := boost_over_events(rows, per_object))
        ]
        if curves:
            yield ("boost", placement), _mean_curve(curves)


def _case_reuse(seeds: Runs, definitions: Definitions) -> Found:
    """Hits / requests so far over events: of images on the car with cameras, of objects on the one
    without.
    """
    for of_images, car in ((False, "car2"), (True, "car1")):
        rows_of = lookups(seeds, definitions, of_images, genie=f"{car}/genie")
        ratios = [genie_metrics.running_reuse(rows)["ratio"] for rows in rows_of]
        curves = [(np.arange(1, len(ratio) + 1), ratio) for ratio in ratios if len(ratio)]
        if curves:
            yield ("events_reuse", car), _mean_curve(curves)


def _mean_curve(curves: Sequence[tuple[Any, Any]]) -> tuple[Any, Any]:
    """The mean of curves, where all of them are."""
    first = max(x[0] for x, _ in curves)
    last = max(min(x[-1] for x, _ in curves), first)
    places = np.unique(np.linspace(first, last, CURVE_POINTS).astype(np.int64))
    return places, np.mean([np.interp(places, x, y) for x, y in curves], axis=0)


def boost_over_events(lookups: Columns, per_object: bool) -> Columns:
    """All confidence added so far, over the updates or over the objects then stored, Genies
    together, from the first of these on: columns ``events`` (how many look-ups) and ``boost``.
    """
    over = np.cumsum(genie_metrics._added_entries(lookups) if per_object else lookups["updates"])
    known = over > 0
    boost = np.cumsum(lookups["boost_sum"])[known] / over[known]
    return Columns({"events": np.flatnonzero(known) + 1, "boost": boost})
