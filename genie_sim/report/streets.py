"""The ground of a fleet's map: its borders, its cells, and its streets.

The streets of a town follow from its settings. Of any other map only the ways of the cars are
known: where one has driven, there is a street.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.base.grid import Area, cell_counts
from genie_sim.base.units import length_m

if TYPE_CHECKING:
    from genie_sim.record.columns import Columns
    from genie_sim.record.results import Run

STEP_M = 10.0  # places nearer to each other are one place of a street
MAX_STEPS = 300  # along the longer side of the map: more could not be told apart on a page
Street = list[float]  # east and north of its corners in turn [m]


class Ground(NamedTuple):
    """The borders of a map, its columns and rows of cells, and its streets, the main ones apart."""

    extent_m: Area
    columns: int
    rows: int
    streets: list[Street]
    main_streets: list[Street]


def ground(run: "Run") -> Ground | None:
    """The ground of a fleet's map; ``None`` where the run does not say where its borders are."""
    scenario = run.facts["scenario"]
    if "town" in scenario["perception"]:
        town = scenario["perception"]["town"]
        block_m = length_m(town["block"])
        east_m, north_m = (blocks * block_m for blocks in town["blocks"])
        extent_m = 0.0, 0.0, east_m, north_m
        streets, main_streets = _of_town(town["blocks"], block_m, town["main_every"])
    elif "map" in run.facts:
        west_m, south_m, east_m, north_m = run.facts["map"]["extent_m"]
        extent_m = west_m, south_m, east_m, north_m
        streets, main_streets = list(_driven(run.tables["poses"], extent_m)), []
    else:
        return None
    columns, rows = cell_counts(extent_m, length_m(scenario["fleet"]["cell"]))
    return Ground(extent_m, columns, rows, streets=streets, main_streets=main_streets)


def _of_town(
    blocks: list[int], block_m: float, main_every: int
) -> tuple[list[Street], list[Street]]:
    """The streets of a town: those along its blocks, and of these the main ones."""
    columns, rows = blocks
    east_m, north_m = columns * block_m, rows * block_m
    streets: tuple[list[Street], list[Street]] = [], []
    for number in range(columns + 1):
        place_m = number * block_m
        streets[number % main_every == 0].append([place_m, 0.0, place_m, north_m])
    for number in range(rows + 1):
        place_m = number * block_m
        streets[number % main_every == 0].append([0.0, place_m, east_m, place_m])
    return streets


def _driven(poses: "Columns", extent_m: Area) -> Iterator[Street]:
    """The ways of all cars, each part of a way once."""
    west_m, south_m, east_m, north_m = extent_m
    step_m = max(STEP_M, max(east_m - west_m, north_m - south_m) / MAX_STEPS)
    column = np.floor((poses.floats("east_m") - west_m) / step_m).astype(np.int64)
    row = np.floor((poses.floats("north_m") - south_m) / step_m).astype(np.int64)
    squares, square = np.unique(row * (1 << 32) + column, return_inverse=True)
    poses_in = np.maximum(np.bincount(square, minlength=len(squares)), 1)
    middles = [
        np.round(np.bincount(square, poses.floats(name), len(squares)) / poses_in).astype(int)
        for name in ("east_m", "north_m")
    ]
    corners = np.stack(middles, axis=1).tolist()
    driven: set[tuple[int, int]] = set()
    for _, way in poses.assign(square=square).groups("car"):
        places = way.by("stamp_ns")["square"]
        places = places[np.diff(places, prepend=-1) != 0].tolist()
        yield from _new_parts(places, corners, driven)


def _new_parts(
    places: list[int], corners: list[list[int]], driven: set[tuple[int, int]]
) -> Iterator[Street]:
    """The parts of a way, as numbers of its corners, that nobody has driven before, in either
    direction; they are added to ``driven``.
    """
    street: list[Any] = []
    for begin, end in pairwise(places):
        part = min(begin, end), max(begin, end)
        if part in driven:
            if street:
                yield street
            street = []
            continue
        driven.add(part)
        street = [*(street or corners[begin]), *corners[end]]
    if street:
        yield street
