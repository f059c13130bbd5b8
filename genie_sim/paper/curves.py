"""What the evaluation's figures draw besides numbers: points of curves."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from genie_sim.analysis import frame_metrics, genie_metrics
from genie_sim.paper.checks import CASE
from genie_sim.record import tables
from genie_sim.record.columns import Columns
from genie_sim.record.tables import Column, Schema, Table

FILE = "curves.parquet"
SCHEMA = Schema(
    "evaluation_curves",
    "A point of a curve of the evaluation's figures.",
    (
        Column("scenario", "text", "", "the scenario that was simulated"),
        Column("what", "text", "", "time, boost or reuse"),
        Column("of", "text", "", "the method, the car or the placement"),
        Column("x", "float64", "", "share of answered frames, or recorded events"),
        Column("y", "float64", "", "time since the camera's stamp [ms]; boost; hits / requests"),
    ),
)
POINTS = 200  # of a curve
SHARES = (np.arange(POINTS) + 1) / POINTS


class Key(NamedTuple):
    """What points are of; see ``SCHEMA``."""

    scenario: str
    what: str
    of: str


class Points(NamedTuple):
    """Of a curve, from left to right."""

    x: np.ndarray[Any, Any]
    y: np.ndarray[Any, Any]


Curves = Mapping[Key, Points]


def of_run(scenario: str, columns: Mapping[str, Columns]) -> dict[Key, Points]:
    """The curves of a run of a scenario of the paper, from its ``frames`` and ``lookups``."""
    curves = dict(_times(columns["frames"], scenario == CASE))
    maps = genie_metrics.objects(columns["lookups"])
    for placement in genie_metrics.GENIE_PLACEMENTS:
        boost = genie_metrics.running_boost(maps.where(placement=placement))
        if len(boost):
            curves["boost", placement] = _thinned(boost["events"], boost["boost"])
    if scenario == CASE:
        images = columns["lookups"].where(kind="image", genie="car1/genie")
        for car, lookups in (("car2", maps.where(genie="car2/genie")), ("car1", images)):
            ratios = genie_metrics.running_reuse(lookups)["ratio"]
            if len(ratios):
                curves["reuse", car] = _thinned(np.arange(1, len(ratios) + 1), ratios)
    return {Key(scenario, what, of): points for (what, of), points in curves.items()}


def _times(frames: Columns, of_cars: bool) -> Iterator[tuple[tuple[str, str], Points]]:
    """Times to the first answer of answered frames, a curve a method, or one a car with Genie."""
    groups = frames.where(method="genie").groups("car") if of_cars else frames.groups("method")
    for of, rows in groups:
        times_ms = frame_metrics.response_ms(rows, "first")
        answered = times_ms[~np.isnan(times_ms)]
        if len(answered):
            at = np.quantile(answered, SHARES, method="inverted_cdf")
            yield ("time", of), Points(SHARES, at.round(4))


def _thinned(x: Any, y: Any) -> Points:
    places = np.unique(np.linspace(0, len(x) - 1, POINTS).astype(np.int64))
    return Points(x[places].astype(float), y[places])


def pooled(of_seeds: Sequence[Curves]) -> dict[Key, Points]:
    """The curves over all seeds: distributions of all frames together, else means, as far as all
    seeds go.
    """
    pooled_curves = {}
    for key in dict.fromkeys(key for curves in of_seeds for key in curves):
        curves = [curves[key] for curves in of_seeds if key in curves]
        if key.what == "time":
            times_ms = np.concatenate([points.y for points in curves])
            pooled_curves[key] = Points(
                SHARES, np.quantile(times_ms, SHARES, method="inverted_cdf")
            )
        else:
            first = max(points.x[0] for points in curves)
            last = max(min(points.x[-1] for points in curves), first)
            x = np.unique(np.linspace(first, last, POINTS).astype(np.int64)).astype(float)
            pooled_curves[key] = Points(
                x, np.mean([np.interp(x, *points) for points in curves], axis=0)
            )
    return pooled_curves


def write(path: Path, curves: Curves) -> None:
    """Raises OSError."""
    table = Table(SCHEMA)
    for key, points in curves.items():
        for x, y in zip(points.x.tolist(), points.y.tolist(), strict=True):
            table.append((*key, x, y))
    table.write(path)


def read(path: Path) -> dict[Key, Points]:
    """Raises ``UserError``."""
    return {
        Key(scenario, what, of): Points(rows["x"], rows["y"])
        for scenario, of_scenario in tables.read(path, SCHEMA).groups("scenario")
        for what, of_kind in of_scenario.groups("what")
        for of, rows in of_kind.groups("of")
    }
