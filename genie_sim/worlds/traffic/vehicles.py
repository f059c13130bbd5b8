"""Vehicles of recorded traffic: what they are, and where they are at any time."""

import functools
import itertools
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.base.classes import SIZES
from genie_sim.base.errors import short_repr
from genie_sim.base.geometry import Array
from genie_sim.worlds.scene.view import Flags, Ints
from genie_sim.worlds.traffic.fcd import JUMP_MPS, VehicleRows

BLOCK_S = 2.0  # for so long at a time it is known who may be where
KEPT_BLOCKS = 8
BESIDE_M = 10.0  # the map goes on beside its outermost vehicles; one street has an extent, too


class VehicleType(NamedTuple):
    """What a vehicle of the file is: its class, its length and its width [m]."""

    label: str
    length_m: float
    width_m: float


# Words in the names of types, as SUMO's own tools write them, and the sizes that SUMO gives to
# vehicles of that class by default [S: sumo.dlr.de/docs/Vehicle_Type_Parameter_Defaults.html].
USUAL = VehicleType("car", 5.0, 1.8)
TYPES = {
    **dict.fromkeys(("bus", "minibus", "citybus", "trolleybus"), VehicleType("bus", 12.0, 2.5)),
    "coach": VehicleType("bus", 14.0, 2.6),
    **dict.fromkeys(("truck", "lorry"), VehicleType("truck", 7.1, 2.4)),
    **dict.fromkeys(("trailer", "semitrailer"), VehicleType("truck", 16.5, 2.55)),
    "tram": VehicleType("train", 22.0, 2.4),
    "rail": VehicleType("train", 67.5, 2.84),
    "train": VehicleType("train", 67.5, 2.84),
    **dict.fromkeys(("motorcycle", "motorbike"), VehicleType("motorcycle", 2.2, 0.9)),
    "moped": VehicleType("motorcycle", 2.1, 0.8),
    "bicycle": VehicleType("bicycle", 1.6, 0.65),
    "bike": VehicleType("bicycle", 1.6, 0.65),
}


PERSON = VehicleType("person", SIZES["person"].length_m, SIZES["person"].width_m)
# words in the names of types that are known to be cars
CARS = {"", "car", "passenger", "taxi", "default", "veh", "vehicle", "private", "evehicle", "hov"}


def words_of(name: str) -> list[str]:
    """The words in the name of a type, such as bike and default for ``DEFAULT_BIKETYPE``."""
    split = re.sub("([a-z])([A-Z])", r"\1 \2", name).lower()
    words = re.findall("[a-z]+", split)
    return [word.removesuffix("type").removesuffix("veh") or word for word in words]


def type_named(name: str) -> VehicleType:
    """What a type is by the words in its name; a car where none says otherwise."""
    words = words_of(name)
    found = (TYPES[one] for word in words for one in (word, word.removesuffix("s")) if one in TYPES)
    return next(found, USUAL)


def is_known(name: str) -> bool:
    """Whether the name of a type says what it is."""
    return type_named(name) is not USUAL or not name or bool(CARS & {*words_of(name)})


class VehicleStates(NamedTuple):
    """Some stretches at some times, as arrays of one shape.

    Whether the vehicle is there, the middle of it [m], cosine and sine of its heading, and its
    speed [m/s].
    """

    there: Flags
    east_m: Array
    north_m: Array
    cos: Array
    sin: Array
    speed_mps: Array


class Vehicles:
    """All vehicles of a file and their stretches: a stretch is a vehicle's way without a gap or a
    jump. Times are in seconds after the beginning.

    ``vehicle``, ``first_s`` and ``last_s`` of each stretch say whose it is and when it begins and
    ends; the stretches of one vehicle are in order of time. ``jumps`` counts teleports of each
    vehicle: where it went on elsewhere than it could have driven.
    """

    def __init__(
        self, rows: VehicleRows, begin_s: float, own_types: Mapping[str, VehicleType]
    ) -> None:
        self.ids: Sequence[str] = rows.ids
        self.is_person: Sequence[bool] = rows.is_person
        named = zip(rows.types, rows.is_person, strict=True)
        self.types_by_name = {
            name: own_types.get(name) or type_named(name)
            for name, is_person in dict.fromkeys(named)
            if not is_person
        }
        self.types = [
            PERSON if is_person else self.types_by_name[name]
            for name, is_person in zip(rows.types, rows.is_person, strict=True)
        ]
        self._tell_types(rows, own_types)
        self.times_s = rows.times_s - begin_s
        order = np.lexsort((rows.step, rows.vehicle))
        vehicle, self._step = rows.vehicle[order], rows.step[order]
        heading = np.radians(90.0 - rows.angle_deg[order])
        half_m = np.where(rows.is_person, 0.0, self.lengths_m / 2)[vehicle]
        self._east_m = rows.x_m[order] - half_m * np.cos(heading)
        self._north_m = rows.y_m[order] - half_m * np.sin(heading)
        self._heading = heading
        way_m = np.hypot(np.diff(self._east_m), np.diff(self._north_m))
        passed_s = np.diff(self.times_s[self._step])
        same_vehicle = np.diff(vehicle) == 0
        jumps = same_vehicle & (way_m > JUMP_MPS * passed_s)
        breaks = ~same_vehicle | jumps | (np.diff(self._step) != 1)
        self._first_row = np.concatenate([[0], np.flatnonzero(breaks) + 1])
        last_row = np.concatenate([np.flatnonzero(breaks), [len(vehicle) - 1]])
        self.vehicle: Ints = vehicle[self._first_row]
        self._first_step, self._last_step = self._step[self._first_row], self._step[last_row]
        self.first_s, self.last_s = self.times_s[self._first_step], self.times_s[self._last_step]
        self.jumps = np.bincount(vehicle[1:][jumps], minlength=len(self.ids))
        self.extent_m = (
            float(self._east_m.min()) - BESIDE_M,
            float(self._north_m.min()) - BESIDE_M,
            float(self._east_m.max()) + BESIDE_M,
            float(self._north_m.max()) + BESIDE_M,
        )
        self._near = functools.lru_cache(KEPT_BLOCKS)(self._block)

    def _tell_types(self, rows: VehicleRows, own_types: Mapping[str, VehicleType]) -> None:
        """Warns of types whose names say nothing."""
        counts = Counter(
            name for name in rows.types if name not in own_types and not is_known(name)
        )
        if counts:
            names = ", ".join(f"{short_repr(name)} ({n:,})" for name, n in counts.most_common(5))
            more = f" and {len(counts) - 5} more" if len(counts) > 5 else ""
            rows.report.warn(
                f"types taken for cars: {names}{more}; perception.types says what they are"
            )

    def __len__(self) -> int:
        return len(self.ids)

    def at(self, stretch: Ints, t_s: Array) -> VehicleStates:
        """Where some stretches are at some times, on straight lines between steps and turning the
        shorter way. The shapes of the two are broadcast together.
        """
        step = np.searchsorted(self.times_s, t_s, side="right") - 1
        step = np.minimum(step, max(len(self.times_s) - 2, 0))
        first, last = self._first_step[stretch], self._last_step[stretch]
        there = (t_s >= self.first_s[stretch]) & (t_s <= self.last_s[stretch])
        # of two rows: between the last step of a stretch and the one before it at its very end
        low = np.clip(step, first, np.maximum(last - 1, first))
        row = self._first_row[stretch] + low - first
        following = np.minimum(row + 1, row + (last - low))
        begin_s = self.times_s[low]
        passed_s = self.times_s[np.minimum(low + 1, last)] - begin_s
        whole_s = np.where(passed_s > 0, passed_s, 1.0)
        share = np.clip((t_s - begin_s) / whole_s, 0.0, 1.0)
        dx = self._east_m[following] - self._east_m[row]
        dy = self._north_m[following] - self._north_m[row]
        turn = self._heading[following] - self._heading[row]
        turn -= np.rint(turn / math.tau) * math.tau
        heading = self._heading[row] + share * turn
        return VehicleStates(
            there=there,
            east_m=self._east_m[row] + share * dx,
            north_m=self._north_m[row] + share * dy,
            cos=np.cos(heading),
            sin=np.sin(heading),
            speed_mps=np.sqrt(dx * dx + dy * dy) / whole_s,
        )

    def stretch(self, vehicle: Ints, t_s: Array) -> Ints:
        """The stretch of each vehicle at its time: the last one that has begun."""
        keys = self._stretch_keys
        after = np.searchsorted(keys, vehicle * self._key_s + t_s, side="right")
        first = np.searchsorted(keys, vehicle * self._key_s + self.times_s[0])
        stretches: Ints = np.maximum(after - 1, first)
        return stretches

    @functools.cached_property
    def _key_s(self) -> float:
        return float(self.times_s[-1] - self.times_s[0]) + 1.0

    @functools.cached_property
    def _stretch_keys(self) -> Array:
        """A number for each stretch that grows with its vehicle, and with when it begins."""
        keys: Array = self.vehicle * self._key_s + self.first_s
        return keys

    def rows_of(self, stretch: int) -> tuple[Array, Array, Array, Array]:
        """The times of one stretch [s], and where its vehicle is then: east and north of its middle
        [m], and its heading [rad].
        """
        first, count = (
            self._first_row[stretch],
            int(self._last_step[stretch] - self._first_step[stretch]) + 1,
        )
        rows = slice(first, first + count)
        begin = self._first_step[stretch]
        times_s = self.times_s[begin : begin + count]
        return times_s, self._east_m[rows], self._north_m[rows], self._heading[rows]

    def near(
        self,
        west_m: float,
        south_m: float,
        east_m: float,
        north_m: float,
        *,
        times_s: Array,
    ) -> Ints:
        """The stretches that may be in an upright rectangle at some time between the first and the
        last of ``times_s``, in order.
        """
        first, last = (int(t_s // BLOCK_S) for t_s in (times_s.min(), times_s.max()))
        parts = []
        for block in range(first, last + 1):
            stretches, west, south, east, north = self._near(block)
            inside = (west <= east_m) & (east >= west_m) & (south <= north_m) & (north >= south_m)
            parts.append(stretches[inside])
        return parts[0] if len(parts) == 1 else np.unique(np.concatenate(parts))

    def _block(self, block: int) -> tuple[Ints, Array, Array, Array, Array]:
        """The stretches that are there in one block of time, and the rectangle around each then:
        its west, south, east and north borders [m].
        """
        begin_s, end_s = block * BLOCK_S, (block + 1) * BLOCK_S
        stretches = np.flatnonzero((self.first_s <= end_s) & (self.last_s >= begin_s))
        if not len(stretches):
            nowhere = np.empty(0)
            return stretches, nowhere, nowhere, nowhere, nowhere
        # all steps in the block, and those around it
        low = max(int(np.searchsorted(self.times_s, begin_s, side="right")) - 1, 0)
        high = min(int(np.searchsorted(self.times_s, end_s)), len(self.times_s) - 1)
        offset = self._first_row[stretches] - self._first_step[stretches]
        begins = offset + np.maximum(low, self._first_step[stretches])
        ends = offset + np.minimum(high, self._last_step[stretches]) + 1
        # the rows of all stretches, one behind the other, and where each begins among them
        counts = ends - begins
        firsts = np.cumsum(counts) - counts
        rows = np.arange(counts.sum()) + np.repeat(begins - firsts, counts)
        east_m, north_m = self._east_m[rows], self._north_m[rows]
        return (
            stretches,
            np.minimum.reduceat(east_m, firsts),
            np.minimum.reduceat(north_m, firsts),
            np.maximum.reduceat(east_m, firsts),
            np.maximum.reduceat(north_m, firsts),
        )

    def longest(self, vehicle: int, end_s: float) -> tuple[float, float, int]:
        """When the longest stretch of a vehicle between the beginning and ``end_s`` starts and
        ends [s], and which it is; of equal ones the first.
        """
        stretches = self._of_vehicle[vehicle]
        parts = [
            (max(self.first_s.item(k), 0.0), min(self.last_s.item(k), end_s), k) for k in stretches
        ]
        return max(parts, key=lambda part: (part[1] - part[0], -part[2]))

    @functools.cached_property
    def _of_vehicle(self) -> list[range]:
        borders = np.searchsorted(self.vehicle, np.arange(len(self.ids) + 1)).tolist()
        return [range(first, end) for first, end in itertools.pairwise(borders)]

    @functools.cached_property
    def heights_m(self) -> Array:
        """How high each vehicle is [m]."""
        return np.array([SIZES[kind.label].height_m for kind in self.types])

    @functools.cached_property
    def lengths_m(self) -> Array:
        """How long each vehicle is [m]."""
        return np.array([kind.length_m for kind in self.types])

    @functools.cached_property
    def widths_m(self) -> Array:
        """How wide each vehicle is [m]."""
        return np.array([kind.width_m for kind in self.types])
