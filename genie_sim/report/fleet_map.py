"""The map of a fleet over time: where its cars are, and what the edge of each cell has to do.

Cells are named by their edges, ``edge_COLUMN_ROW``. Many cars are thinned evenly; load and reuse count all of them.
"""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from genie_sim.analysis.metrics import response_ms, running_use
from genie_sim.analysis.style import thinned
from genie_sim.units import NS_PER_S, length_m

if TYPE_CHECKING:
    from genie_sim.recording.columns import Columns
    from genie_sim.recording.results import Run

    Floats = np.ndarray[Any, np.dtype[np.float64]]
    Instants = np.ndarray[Any, np.dtype[np.int64]]

MOST_CARS, MOST_INSTANTS = 250, 240
POINTS = 300  # of a distribution over cars
AGES_S = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, float("inf"))
EDGE = re.compile(r"(edge_(\d+)_(\d+))\b")
SHARE_DIGITS = 3


def fleet_data(run: "Run", notes: list[str]) -> dict[str, Any] | None:
    """What the page draws of a fleet's town; ``None`` for cars and edges given one by one."""
    scenario = run.facts["scenario"]
    if scenario.get("fleet") is None or not len(run.tables["frames"]):
        return None
    town = scenario["perception"]["town"]
    end_ns = int(run.tables["frames"]["stamp_ns"].max())
    step_ns = max(NS_PER_S, -(-end_ns // MOST_INSTANTS))
    instants_ns = np.arange(0, end_ns + step_ns + 1, step_ns, dtype=np.int64)  # two at least
    if not len(run.tables["poses"]):
        notes.append("The map has no cars: the run holds no poses; 'record' must name them.")
    return {
        "blocks": town["blocks"],
        "block_m": length_m(town["block"]),
        "main_every": town["main_every"],
        "instants_s": [round(float(t_ns) / NS_PER_S, 3) for t_ns in instants_ns],
        "cells": sorted(_cells(run)),
        "cars": list(_cars(run, instants_ns, notes)),
        "load": list(_loads(run, instants_ns)),
        "reuse": list(_reuse(run, instants_ns)),
        "hand_overs": list(_hand_overs(run, instants_ns)),
        "over_cars": list(_over_cars(run)),
        "ghosts_by_age": list(_ghosts_by_age(run)),
    }


def _cells(run: "Run") -> Iterator[tuple[int, int]]:
    """Column and row of every cell that has an edge in the tables."""
    names = {
        *run.tables["resources"]["resource"].unique(),
        *run.tables["lookups"]["genie"].unique(),
    }
    yield from {(int(found[2]), int(found[3])) for name in names if (found := EDGE.match(name))}


def _by_cell(run: "Run", rows: "Columns", name: str) -> "Iterator[tuple[dict[str, Any], Columns]]":
    """The rows of each method and of each edge that the column ``name`` speaks of, in order of time."""
    for method in run.methods:
        for thing, mine in rows.where(method=method.name).groups(name):
            if found := EDGE.match(thing):
                yield (
                    {"method": method.name, "cell": [int(found[2]), int(found[3])]},
                    mine.by("t_ns"),
                )


def _cars(run: "Run", instants_ns: "Instants", notes: list[str]) -> Iterator[dict[str, Any]]:
    """East and north [m] of each car that is drawn, at every instant: where its last frame before was taken."""
    by_car = dict(run.tables["poses"].groups("car"))
    names = sorted(by_car, key=lambda name: (len(name), name))
    kept = thinned(len(names), MOST_CARS)
    if len(kept) < len(names):
        notes.append(
            f"The map draws {len(kept)} of {len(names):,} cars, evenly chosen; load and reuse count all."
        )
    for name in [names[place] for place in kept]:
        poses = by_car[name].by("stamp_ns")
        last = np.maximum(np.searchsorted(poses["stamp_ns"], instants_ns, side="right") - 1, 0)
        at = {
            axis: np.round(poses.floats(f"{axis}_m")[last]).astype(int).tolist()
            for axis in ("east", "north")
        }
        yield {"name": name, **at}


def _loads(run: "Run", instants_ns: "Instants") -> Iterator[dict[str, Any]]:
    """Share of each step in which an edge's accelerator worked."""
    lengths_ns = np.diff(instants_ns, prepend=instants_ns[0] - instants_ns[1])
    for where, samples in _by_cell(
        run, run.tables["resources"].where(kind="accelerator"), "resource"
    ):
        worked_ns = np.interp(instants_ns, *running_use(samples))
        yield {**where, "values": _shares(np.diff(worked_ns, prepend=0.0) / lengths_ns)}


def _reuse(run: "Run", instants_ns: "Instants") -> Iterator[dict[str, Any]]:
    """Hits / requests for images at each edge so far, ``None`` before the first request."""
    for where, mine in _by_cell(
        run, run.tables["lookups"].where(kind="image", placement="edge"), "genie"
    ):
        until = np.searchsorted(mine["t_ns"], instants_ns, side="right")
        requests, hits = (
            np.concatenate([[0], mine[of].cumsum()])[until] for of in ("requests", "hits")
        )
        shares = np.divide(hits, requests, out=np.full(len(until), np.nan), where=requests > 0)
        yield {**where, "values": _shares(shares)}


def _hand_overs(run: "Run", instants_ns: "Instants") -> Iterator[dict[str, Any]]:
    """How many times cars have changed their edge until each instant, by the edges that looked up their frames."""
    asked = run.tables["lookups"].where(placement="edge", requester="client")
    for method, mine in asked.groups("method"):
        in_order = mine.rows(np.lexsort((mine["t_ns"], mine["car"].codes)))
        car, genie, t_ns = in_order["car"].codes, in_order["genie"].codes, in_order["t_ns"]
        changes_ns = np.sort(t_ns[1:][(car[1:] == car[:-1]) & (genie[1:] != genie[:-1])])
        yield {
            "method": method,
            "until": np.searchsorted(changes_ns, instants_ns, side="right").tolist(),
        }


def _over_cars(run: "Run") -> Iterator[dict[str, Any]]:
    """Distributions over cars: 95th percentile of the time to the first and to the fresh answer [ms], image reuse."""
    images = run.tables["lookups"].where(kind="image", placement="car")
    for method in run.methods:
        of_cars = [mine for _, mine in run.tables["frames"].where(method=method.name).groups("car")]
        for answer in ("first", "fresh"):
            times = [response_ms(mine, answer) for mine in of_cars]
            known = [one[~np.isnan(one)] for one in times]
            slow = [float(np.quantile(one, 0.95)) for one in known if len(one)]
            yield from _distribution(method.name, f"{answer}_p95", slow)
        of_genies = images.where(method=method.name).groups("genie")
        asked = [(int(one["hits"].sum()), int(one["requests"].sum())) for _, one in of_genies]
        yield from _distribution(
            method.name, "image_reuse", [hits / requests for hits, requests in asked if requests]
        )


def _distribution(method: str, of: str, values: Sequence[float]) -> Iterator[dict[str, Any]]:
    ordered = np.sort(np.asarray(values, dtype=float))
    kept = thinned(len(ordered), POINTS)
    if len(ordered):
        ranks = (kept + 1) / len(ordered)
        yield {
            "method": method,
            "of": of,
            "x": ordered[kept].round(4).tolist(),
            "y": ranks.round(4).tolist(),
        }


def _ghosts_by_age(run: "Run") -> Iterator[dict[str, Any]]:
    """Share of what consumers hold that is not there, by the age of what they hold [s]."""
    consumers = run.tables["held"].where(what="consumer")
    for method in run.methods:
        mine = consumers.where(method=method.name)
        mine = mine.rows(mine["held"] > 0)
        bins = np.digitize(mine.floats("age_s"), AGES_S[1:-1])
        rows = []
        for number, (low, high) in enumerate(pairwise(AGES_S)):
            objects, right = (int(mine[of][bins == number].sum()) for of in ("held", "right"))
            if objects:
                end = None if high == AGES_S[-1] else high
                rows.append([low, end, objects, round(1 - right / objects, SHARE_DIGITS)])
        if rows:
            yield {"method": method.name, "rows": rows}


def _shares(values: "Floats") -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), SHARE_DIGITS) for value in values]
