"""What the Genies of a fleet do, by the cell of the map in which a car is: hits, what cars hold of
one another, ghosts, and the age of what is held. All cars count.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.base.units import NS_PER_S, NS_PER_US

if TYPE_CHECKING:
    from genie_sim.record.columns import Columns
    from genie_sim.record.results import Run
    from genie_sim.report.streets import Ground

    Floats = np.ndarray[Any, np.dtype[np.float64]]
    Integers = np.ndarray[Any, np.dtype[np.int64]]

WINDOW_NS = 5 * NS_PER_S  # before an instant, over which its values are taken
DIGITS = 3


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
    Layer("hits", "image reuse of the cars' own Genies, last 5 s", "%"),
    Layer("shared", "held objects that another car saw last, last 5 s", "%"),
    Layer("ghosts", "false objects, last 5 s", "%"),
    Layer("age", "age of held objects, last 5 s", "s"),
)


class Whereabouts:
    """In which cell of the map each car was at any time: where its last frame was taken."""

    def __init__(self, poses: "Columns", ground: "Ground") -> None:
        self.ground = ground
        self._cars = poses["car"].names
        self._car, self._stamp_ns = poses["car"].codes, poses["stamp_ns"]
        order = np.lexsort((self._stamp_ns, self._car))
        self._keys = self._key(self._car, self._stamp_ns)[order]
        west_m, south_m, east_m, north_m = ground.extent_m
        column = _part(poses.floats("east_m"), west_m, east_m, ground.columns)
        row = _part(poses.floats("north_m"), south_m, north_m, ground.rows)
        self._cell = (row * ground.columns + column)[order]

    def cells(self, rows: "Columns", instant: str) -> "Integers":
        """The number of the cell of each row's car at its ``instant``, -1 where that is not
        known.
        """
        car = rows["car"].codes_in(self._cars)
        places = np.searchsorted(self._keys, self._key(car, rows[instant]), side="right") - 1
        known = (car >= 0) & (places >= 0)
        of_car = np.where(known, self._keys[places] >> _TIME_BITS == car, False)
        return np.where(of_car, self._cell[places], -1)

    def _key(self, car: "Integers", stamp_ns: "Integers") -> "Integers":
        return (car.astype(np.int64) << _TIME_BITS) + stamp_ns // NS_PER_US


_TIME_BITS = 44  # of an instant [us]: half a year


def _part(places_m: "Floats", low_m: float, high_m: float, parts: int) -> "Integers":
    """In which of equal parts each place lies; those outside count to the outermost."""
    shares = (places_m - low_m) / (high_m - low_m)
    return np.clip((shares * parts).astype(np.int64), 0, parts - 1)


def cell_layers(
    run: "Run", ground: "Ground", instants_ns: "Integers"
) -> dict[str, list[dict[str, Any]]]:
    """By layer, the values of each cell under each method, ``None`` where there are none: over the
    5 s before each instant.
    """
    poses = run.tables["poses"]
    layers: dict[str, list[dict[str, Any]]] = {
        name: [] for name in ("hits", "shared", "ghosts", "age")
    }
    if not len(poses):
        return layers
    whereabouts = Whereabouts(poses, ground)
    images = run.tables["lookups"].where(kind="image", placement="car", requester="client")
    consumers = run.tables["held"].where(what="consumer")
    for method in run.methods:
        sums = _Sums(whereabouts, images.where(method=method.name), "t_ns", instants_ns)
        hits, requests = sums.over("hits"), sums.over("requests")
        layers["hits"] += _by_cell(method.name, hits, requests, ground.columns)
        held_rows = consumers.where(method=method.name)
        held_rows = held_rows.rows(held_rows["held"] > 0)
        sums = _Sums(whereabouts, held_rows, "stamp_ns", instants_ns)
        held = sums.over("held")
        layers["shared"] += _by_cell(method.name, sums.over("shared"), held, ground.columns)
        ghosts = held - sums.over("right")
        layers["ghosts"] += _by_cell(method.name, ghosts, held, ground.columns)
        age_s = held_rows.floats("age_s")
        known = np.where(np.isnan(age_s), 0, held_rows["held"])
        ages = sums.of(np.nan_to_num(age_s) * held_rows["held"]), sums.of(known)
        layers["age"] += _by_cell(method.name, *ages, ground.columns)
    return layers


class _Sums:
    """Sums of columns over the rows of each cell in the time before each instant."""

    def __init__(
        self, whereabouts: Whereabouts, rows: "Columns", instant: str, instants_ns: "Integers"
    ) -> None:
        ground = whereabouts.ground
        self._rows, self._shape = rows, (ground.columns * ground.rows, len(instants_ns))
        cells = whereabouts.cells(rows, instant)
        steps = np.searchsorted(instants_ns, rows[instant])  # the first instant not before it
        self._counted = (cells >= 0) & (steps < len(instants_ns))
        self._places = (cells * len(instants_ns) + steps)[self._counted]
        self._window = max(1, round(WINDOW_NS / int(instants_ns[1] - instants_ns[0])))

    def over(self, column: str) -> "Floats":
        return self.of(self._rows[column])

    def of(self, values: "Floats") -> "Floats":
        """Of one value for each row: (cells, instants)."""
        count = self._shape[0] * self._shape[1]
        sums = np.bincount(self._places, values[self._counted], count)
        until: Floats = np.cumsum(sums.reshape(self._shape).astype(np.float64), axis=1)
        before = np.zeros_like(until)
        before[:, self._window :] = until[:, : -self._window]
        return until - before


def _by_cell(
    method: str, parts: "Floats", wholes: "Floats", columns: int
) -> Iterator[dict[str, Any]]:
    """parts / wholes of the cells in which there is anything."""
    for cell in np.flatnonzero(wholes.sum(axis=1) > 0).tolist():
        values = [
            None if whole < 0.5 else round(float(part / whole), DIGITS)
            for part, whole in zip(parts[cell], wholes[cell], strict=True)
        ]
        yield {"method": method, "cell": [cell % columns, cell // columns], "values": values}


def outcomes(frames: "Columns", instants_ns: "Integers") -> str:
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
