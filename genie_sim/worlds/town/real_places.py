"""Where real objects of some class are in a town, asked about many places and times at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import VEHICLES
from genie_sim.base.geometry import Array
from genie_sim.worlds.town.streets import Ints, Street, Streets

CLASSES = dict.fromkeys(VEHICLES, VEHICLES[0])  # whose objects count as each other
MARGIN_M = 1e-3  # more than rounding; what is found is compared exactly


class _Line(NamedTuple):
    """Objects of a class that move along a street together, or stand there: their speed, and where
    they begin along the street, in order, and across [m].
    """

    speed_mps: float
    starts_m: Sequence[float]
    beside_m: Sequence[float]


def _lines(street: Street) -> dict[str, list[_Line]]:
    """The lines of each class that a street has."""
    lines: dict[str, list[_Line]] = {}
    standing: dict[str, list[tuple[float, float]]] = {}
    for item in street.standing:
        if item.real:
            place = item.east_m, item.north_m
            if street.northbound:
                place = item.north_m, item.east_m
            standing.setdefault(CLASSES.get(item.label, item.label), []).append(place)
    for name, places in standing.items():
        lines[name] = [_Line(0.0, *zip(*places, strict=True))]
    for stream in street.streams:
        beside_m = [stream.beside_m] * len(stream.starts_m)
        for name in {CLASSES.get(label, label) for label in stream.labels}:
            line = _Line(stream.speed_mps, stream.starts_m, beside_m)
            lines.setdefault(name, []).append(line)
    return lines


class _Direction:
    """The lines of all streets of one direction, one after the other.

    Each line is there twice, the second time a street's length farther on, where those who have
    come to its end begin anew.
    """

    def __init__(
        self, length_m: float, of_streets: Sequence[dict[str, list[_Line]]], codes: dict[str, int]
    ) -> None:
        self.count, self.length_m = len(of_streets), length_m
        self._span_m = 3.0 * length_m
        flat = [line for lines in of_streets for of_class in lines.values() for line in of_class]
        most = max((len(of) for lines in of_streets for of in lines.values()), default=0)
        # by street and class; the line after the last one is empty, the last class unknown
        self.lines = np.full((most, self.count, len(codes) + 1), len(flat))
        number = 0
        for street, lines in enumerate(of_streets):
            for name, of_class in lines.items():
                rows = range(number, number + len(of_class))
                self.lines[: len(rows), street, codes[name]] = rows
                number += len(rows)
        self._speed_mps = np.array([*(line.speed_mps for line in flat), 0.0])
        twice = [(number, lap) for number in range(len(flat)) for lap in (0, 1)]
        counts = [len(flat[number].starts_m) for number, _ in twice]
        self._start_m = np.concatenate([np.zeros(0), *(flat[n].starts_m for n, _ in twice)])
        self._beside_m = np.concatenate([np.zeros(0), *(flat[n].beside_m for n, _ in twice)])
        self._lap = np.repeat(np.array([lap for _, lap in twice], dtype=np.int64), counts)
        line = np.repeat(np.array([number for number, _ in twice], dtype=np.int64), counts)
        self._key_m = line * self._span_m + self._lap * self.length_m + self._start_m

    def are_near(
        self, line: Ints, *, along_m: Array, across_m: Array, t_s: Array, range_m: float
    ) -> Array:
        """Whether anything of a line is within a distance of a place at a time, for each line."""
        low_m = np.maximum(along_m - range_m, 0.0)
        high_m = np.minimum(along_m + range_m, self.length_m)
        gone_m = self._speed_mps[line] * t_s
        lap, begin_m = np.divmod(low_m - gone_m, self.length_m)
        key_m = line * self._span_m + begin_m
        first = np.searchsorted(self._key_m, key_m - MARGIN_M)
        last = np.searchsorted(self._key_m, key_m + (high_m - low_m) + MARGIN_M)
        counts = np.maximum(last - first, 0)
        asked = np.repeat(np.arange(len(line)), counts)
        place = np.arange(len(asked)) + (first - np.cumsum(counts) + counts)[asked]
        laps = lap[asked] + self._lap[place]
        there_m = self._start_m[place] + (gone_m[asked] + laps * self.length_m)
        away_m = np.hypot(there_m - along_m[asked], self._beside_m[place] - across_m[asked])
        is_near = (away_m <= range_m) & (low_m[asked] <= there_m) & (there_m <= high_m[asked])
        result = np.zeros(len(line), dtype=bool)
        result[asked[is_near]] = True
        return result


class RealPlaces:
    """Where everything real is in a town at any time."""

    def __init__(self, streets: Streets) -> None:
        self._block_m, self._half_m = streets.block_m, streets.half_m
        directions = streets.east, streets.north
        lines = [[_lines(street) for street in of_direction] for of_direction in directions]
        names = {name for of_direction in lines for of_street in of_direction for name in of_street}
        self._codes = {name: code for code, name in enumerate(sorted(names))}
        self._east, self._north = (
            _Direction(of_direction[0].length_m, of_streets, self._codes)
            for of_direction, of_streets in zip(directions, lines, strict=True)
        )

    def are_there(
        self, labels: Sequence[str], east_m: Array, north_m: Array, *, t_s: Array, range_m: float
    ) -> Array:
        """Whether anything of the class of each label is within a distance of each place then,
        whether it can be seen or not.
        """
        codes = self._codes
        class_ = np.array([codes.get(CLASSES.get(label, label), -1) for label in labels], dtype=int)
        result = np.zeros(len(labels), dtype=bool)
        reach_m = range_m + self._half_m
        for direction, along_m, across_m in (
            (self._east, east_m, north_m),
            (self._north, north_m, east_m),
        ):
            street = np.maximum(np.ceil((across_m - reach_m) / self._block_m), 0.0).astype(int)
            last = np.floor((across_m + reach_m) / self._block_m)
            last = np.minimum(last, direction.count - 1)
            while len(rows := np.flatnonzero(street <= last)):
                for line in direction.lines[:, street[rows], class_[rows]]:
                    result[rows] |= direction.are_near(
                        line,
                        along_m=along_m[rows],
                        across_m=across_m[rows],
                        t_s=t_s[rows],
                        range_m=range_m,
                    )
                street += 1
        return result
