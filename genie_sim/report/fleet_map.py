"""The map of a fleet over time: where its cars are, what becomes of their frames, and what the edge
of each cell has to do.

Cells are named by their edges, ``edge_COLUMN_ROW``. Many cars are thinned evenly; the cells count
all of them.
"""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.analysis.resource_metrics import running_use
from genie_sim.analysis.statistics import thinned
from genie_sim.base.units import NS_PER_S
from genie_sim.report.streets import ground

if TYPE_CHECKING:
    from genie_sim.record.columns import Columns
    from genie_sim.record.results import Run

    Floats = np.ndarray[Any, np.dtype[np.float64]]
    Instants = np.ndarray[Any, np.dtype[np.int64]]

MAX_CARS, MAX_INSTANTS = 250, 240
MAX_VALUES = 40_000  # of a layer of the map's cells: about 250 kB
EDGE = re.compile(r"(edge_(\d+)_(\d+))\b")
SHARE_DIGITS = 3


class Layer(NamedTuple):
    """Something that the cells of the map show: its name in the page's data, its title and its
    unit, as in ``analysis.registry``.
    """

    name: str
    title: str
    unit: str


LAYERS = (
    Layer("load", "load of the edge's accelerator", "%"),
    Layer("reuse", "image reuse of the edge so far", "%"),
    Layer("air", "load of the radio cell, up", "%"),
)


def fleet_data(run: "Run", notes: list[str]) -> dict[str, Any] | None:
    """What the page draws of a fleet's map; ``None`` for cars and edges given one by one."""
    scenario = run.facts["scenario"]
    if scenario.get("fleet") is None or not len(run.tables["frames"]):
        return None
    area = ground(run)
    if area is None:
        notes.append("No map is drawn: the results do not say where its borders are.")
        return None
    end_ns = int(run.tables["frames"]["stamp_ns"].max())
    cells = area.columns * area.rows * len(run.methods)
    step_ns = max(NS_PER_S, -(-end_ns // max(min(MAX_INSTANTS, MAX_VALUES // cells), 2)))
    # two at least
    instants_ns = np.arange(run.warm_up_ns, end_ns + step_ns + 1, step_ns, dtype=np.int64)
    if not len(run.tables["poses"]):
        notes.append("The map has no cars: the run holds no poses; 'record' must name them.")
    return {
        **area._asdict(),
        "instants_s": [round(float(t_ns) / NS_PER_S, 3) for t_ns in instants_ns],
        "cars": list(_cars(run, instants_ns, notes)),
        "all_cars": len(run.tables["poses"]["car"].unique()),
        "layers": [layer._asdict() for layer in LAYERS],
        "load": list(_loads(run, instants_ns, ".accelerator")),
        "reuse": list(_reuse(run, instants_ns)),
        "air": list(_loads(run, instants_ns, ".cell_up")),
    }


def _by_cell(run: "Run", rows: "Columns", name: str) -> "Iterator[tuple[dict[str, Any], Columns]]":
    """The rows of each method and of each edge that the column ``name`` speaks of, in order of
    time.
    """
    for method in run.methods:
        for resource, of_resource in rows.where(method=method.name).groups(name):
            if edge := EDGE.match(resource):
                yield (
                    {"method": method.name, "cell": [int(edge[2]), int(edge[3])]},
                    of_resource.by("t_ns"),
                )


def _cars(run: "Run", instants_ns: "Instants", notes: list[str]) -> Iterator[dict[str, Any]]:
    """East and north [m] of each car that is drawn, at every instant: where its last frame before
    was taken, and what became of that frame under each method.
    """
    by_car = dict(run.tables["poses"].groups("car"))
    names = sorted(by_car, key=lambda name: (len(name), name))
    drawn = thinned(len(names), MAX_CARS)
    if len(drawn) < len(names):
        notes.append(
            f"The map draws {len(drawn)} of {len(names):,} cars, evenly chosen; "
            "the cells count all."
        )
    table = run.tables["frames"]
    frames = {
        method.name: dict(table.where(method=method.name).groups("car")) for method in run.methods
    }
    for name in [names[place] for place in drawn]:
        poses = by_car[name].by("stamp_ns")
        last = np.maximum(np.searchsorted(poses["stamp_ns"], instants_ns, side="right") - 1, 0)
        position = {
            axis: np.round(poses.floats(f"{axis}_m")[last]).astype(int).tolist()
            for axis in ("east", "north")
        }
        letters = {
            method: _outcomes(of_car[name], instants_ns)
            for method, of_car in frames.items()
            if name in of_car
        }
        yield {"name": name, **position, "outcomes": letters}


def _loads(run: "Run", instants_ns: "Instants", suffix: str) -> Iterator[dict[str, Any]]:
    """Share of each step in which an edge's accelerator or radio cell was busy; ``suffix`` ends the
    names of these.
    """
    lengths_ns = np.diff(instants_ns, prepend=instants_ns[0] - instants_ns[1])
    resources = run.tables["resources"]
    names = resources["resource"].names
    codes = [code for code, name in enumerate(names) if name.endswith(suffix)]
    of_kind = resources.rows(np.isin(resources["resource"].codes, codes))
    for where, samples in _by_cell(run, of_kind, "resource"):
        worked_ns = np.interp(instants_ns, *running_use(samples))
        yield {**where, "values": _shares(np.diff(worked_ns, prepend=worked_ns[0]) / lengths_ns)}


def _reuse(run: "Run", instants_ns: "Instants") -> Iterator[dict[str, Any]]:
    """Hits / requests for images at each edge so far, ``None`` before the first request."""
    for where, lookups in _by_cell(
        run, run.tables["lookups"].where(kind="image", placement="edge"), "genie"
    ):
        until = np.searchsorted(lookups["t_ns"], instants_ns, side="right")
        requests, hits = (
            np.concatenate([[0], lookups[of].cumsum()])[until] for of in ("requests", "hits")
        )
        shares = np.divide(hits, requests, out=np.full(len(until), np.nan), where=requests > 0)
        yield {**where, "values": _shares(shares)}


def _shares(values: "Floats") -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), SHARE_DIGITS) for value in values]


def _outcomes(frames: "Columns", instants_ns: "Instants") -> str:
    """What became of the last frame of a car before each instant, one letter each: h, m or c for
    hit, miss or coalesced at its own Genie, a for answered without one, n for no answer, and -
    where there was no frame in this step. ``frames`` are the car's under one method.
    """
    frames = frames.by("stamp_ns")
    last = np.searchsorted(frames["stamp_ns"], instants_ns, side="right") - 1
    begins_ns = np.concatenate([[-1], instants_ns[:-1]])
    hit, coalesced = frames["image_hit"].tolist(), frames["coalesced"].tolist()
    answered = (~np.isnan(frames.floats("first_answer_ns"))).tolist()
    stamps_ns = frames["stamp_ns"].tolist()
    letters = []
    for place, begin_ns in zip(last.tolist(), begins_ns.tolist(), strict=True):
        if place < 0 or stamps_ns[place] <= begin_ns:
            letters.append("-")
        else:
            letters.append(_letter(hit[place], coalesced[place], answered[place]))
    return "".join(letters)


def _letter(hit: bool | None, coalesced: bool | None, answered: bool) -> str:
    if hit is None:
        return "a" if answered else "n"
    return "c" if coalesced else "h" if hit else "m"
