"""Vehicles of recorded traffic: what they are, and where they are at any time."""

import functools
import math
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from genie_sim.base.classes import SIZES
from genie_sim.base.errors import short_repr, unknown
from genie_sim.base.geometry import Array
from genie_sim.base.grid import Area, widened
from genie_sim.base.spans import Flags, Ints
from genie_sim.worlds.scene.frames import Motions
from genie_sim.worlds.scene.view import near_pairs
from genie_sim.worlds.traffic.fcd import VehicleRows
from genie_sim.worlds.traffic.fcd_checks import JUMP_MPS
from genie_sim.worlds.traffic.vehicle_types import USUAL, VehicleType, type_named

KEPT_STEPS = 256  # of so many steps it is kept who is where
BESIDE_M = 10.0  # the map goes on beside its outermost vehicles; one street has an extent, too


def _types_by_name(
    rows: VehicleRows, own_types: Mapping[str, VehicleType]
) -> dict[str, VehicleType]:
    """The types of a file's vehicles, own ones first. Warns of those whose names say nothing, and
    of own ones that no vehicle has: they may be misspelt.
    """
    names = dict.fromkeys(
        name for name, is_person in zip(rows.types, rows.is_person, strict=True) if not is_person
    )
    for name in sorted(own_types.keys() - names.keys()):
        rows.report.warn(f"perception.types: {unknown('type', name, filter(None, names))}")
    told = {"", *own_types, *filter(type_named, names)}
    counts = Counter(name for name in rows.types if name not in told)
    if counts:
        most = ", ".join(f"{short_repr(name)} ({n:,})" for name, n in counts.most_common(5))
        more = f" and {len(counts) - 5} more" if len(counts) > 5 else ""
        rows.report.warn(f"types taken for cars: {most}{more}; perception.types says what they are")
    return {name: own_types.get(name) or type_named(name) or USUAL for name in names}


class _Links(NamedTuple):
    """Which sighting follows which, as columns (sightings,).

    From each sighting on a vehicle drives to its next. The last of a stretch has no next, but the
    vehicle is still there at that instant, and moves as just before: it drives from the sighting
    before the last. Of a vehicle with a stretch of the sightings 0, 1 and 2 and, after a gap, one
    of sighting 3 alone, which stands:

    ============ ===== ===== ===== ===== ================================
    sighting     0     1     2     3
    ============ ===== ===== ===== ===== ================================
    ``begin``    0     1     1     3     where it drives from
    ``end``      1     2     2     3     where to, and until when
    ``is_first`` true  false false true  whether it begins a stretch
    ============ ===== ===== ===== ===== ================================

    ``jumps`` are the sightings that are reached by a jump, ``longest_m`` is the longest way from
    one to the next.
    """

    begin: Ints
    end: Ints
    is_first: Flags
    jumps: Ints
    longest_m: float


def _links(vehicle: Ints, step: Ints, way_m: Array, passed_s: Array) -> _Links:
    """How sightings follow each other, by their vehicle and step (sightings,), and the way [m] and
    time [s] from each to the next (sightings - 1,).
    """
    same_vehicle = np.diff(vehicle) == 0
    is_jump = same_vehicle & (way_m > JUMP_MPS * passed_s)
    goes_on = same_vehicle & ~is_jump & (np.diff(step) == 1)
    has_next, has_previous = np.append(goes_on, False), np.append(False, goes_on)
    number = np.arange(len(vehicle))
    return _Links(
        begin=number - (~has_next & has_previous),
        end=number + has_next,
        is_first=~has_previous,
        jumps=np.flatnonzero(is_jump) + 1,
        longest_m=float(way_m.max(where=goes_on, initial=0.0)),
    )


class Vehicles:
    """All vehicles of a file, and persons on foot: what they are, and where at any time.

    Times are in seconds after the beginning of the simulation; ``times_s`` are those of the file's
    steps. A *vehicle* is a number from 0 on; ``ids``, ``is_person``, ``labels``, ``lengths_m``,
    ``widths_m``, ``heights_m`` have one value for each. A *sighting* is one vehicle at one step, a
    row of the file: they are ordered by vehicle and then by time, and ``vehicle`` (sightings,) says
    whose each is. From one a vehicle goes straight to its next, unless that comes after a gap or a
    jump; a *stretch* are the sightings from one such break to the next. ``carriers`` are the
    vehicles that are no persons and may carry cameras; ``jumps`` counts the jumps of each of these
    (teleports): where it went on elsewhere than it could have driven.
    """

    def __init__(self, rows: VehicleRows, own_types: Mapping[str, VehicleType]) -> None:
        self.ids, self.is_person = rows.ids, rows.is_person
        self.times_s = rows.times_s - rows.begin_s
        self.types_by_name = _types_by_name(rows, own_types)
        types = [
            None if is_person else self.types_by_name[name]
            for name, is_person in zip(rows.types, rows.is_person, strict=True)
        ]
        self.labels = [kind.label if kind else "person" for kind in types]
        sizes = [kind or SIZES["person"] for kind in types]
        self.lengths_m = np.array([size.length_m for size in sizes])
        self.widths_m = np.array([size.width_m for size in sizes])
        # SUMO's heights are not in the file: as high as what the detector knows of the class.
        self.heights_m = np.array([SIZES[label].height_m for label in self.labels])
        order = np.lexsort((rows.step, rows.vehicle))
        self.vehicle: Ints = rows.vehicle[order]
        self._step: Ints = rows.step[order]
        self._heading_rad = np.radians(90.0 - rows.angle_deg[order])
        # the file has the middle of persons, and the front bumper of vehicles
        half_m = np.where(rows.is_person, 0.0, self.lengths_m / 2)[self.vehicle]
        self._east_m = rows.x_m[order] - half_m * np.cos(self._heading_rad)
        self._north_m = rows.y_m[order] - half_m * np.sin(self._heading_rad)
        way_m = np.hypot(np.diff(self._east_m), np.diff(self._north_m))
        links = _links(self.vehicle, self._step, way_m, np.diff(self.times_s[self._step]))
        self._links, self._until_s = links, self.times_of(links.end)
        self.carriers: Ints = np.flatnonzero(~np.array(rows.is_person))
        jumps = np.bincount(self.vehicle[links.jumps], minlength=len(self.ids))
        self.jumps: Ints = jumps[self.carriers]
        self._in_order_of_steps: Ints = np.argsort(self._step, kind="stable")
        self._at_step = functools.lru_cache(KEPT_STEPS)(self._tree_of_step)

    @property
    def extent_m(self) -> Area:
        """The borders of the map."""
        east_m, north_m = self._east_m, self._north_m
        west, south, east, north = east_m.min(), north_m.min(), east_m.max(), north_m.max()
        return widened((float(west), float(south), float(east), float(north)), BESIDE_M)

    def at(self, sighting: Ints, t_s: Array) -> Motions:
        """Where the vehicles of some sightings (n,) are at times between these and their next (n,):
        on straight lines, and turning the shorter way.
        """
        first, last = self._links.begin[sighting], self._links.end[sighting]
        begin_s = self.times_of(first)
        whole_s = self.times_of(last) - begin_s
        whole_s[whole_s == 0.0] = 1.0
        share = np.clip((t_s - begin_s) / whole_s, 0.0, 1.0)
        from_east_m, from_north_m = self._east_m[first], self._north_m[first]
        way_east_m = self._east_m[last] - from_east_m
        way_north_m = self._north_m[last] - from_north_m
        turn_rad = self._heading_rad[last] - self._heading_rad[first]
        turn_rad -= np.rint(turn_rad / math.tau) * math.tau
        heading_rad = self._heading_rad[first] + share * turn_rad
        return Motions(
            east_m=from_east_m + share * way_east_m,
            north_m=from_north_m + share * way_north_m,
            heading_rad=heading_rad,
            cos=np.cos(heading_rad),
            sin=np.sin(heading_rad),
            speed_mps=np.sqrt(way_east_m * way_east_m + way_north_m * way_north_m) / whole_s,
        )

    def times_of(self, sighting: Ints) -> Array:
        """The times of some sightings."""
        return self.times_s[self._step[sighting]]

    def near(self, east_m: Array, north_m: Array, t_s: Array, radius_m: float) -> tuple[Ints, Ints]:
        """All pairs of a slot (slots,), a place at a time, and a vehicle that may be so near to it
        then, slot by slot: the slot and the sighting. All that are so near are among them.
        """
        places_m = np.column_stack([east_m, north_m])
        slots, sightings = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        # the last step at or before each time; -1 where there is none
        step = np.searchsorted(self.times_s, t_s, side="right") - 1
        for number in np.unique(step[step >= 0]).tolist():
            asked = np.flatnonzero(step == number)
            of_step, tree = self._at_step(number)
            place, point = near_pairs(tree, places_m[asked], radius_m + self._links.longest_m)
            slots.append(asked[place])
            sightings.append(of_step[point])
        slot, sighting = np.concatenate(slots), np.concatenate(sightings)
        is_there = t_s[slot] <= self._until_s[sighting]
        slot, sighting = slot[is_there], sighting[is_there]
        order = np.argsort(slot, kind="stable")
        return slot[order], sighting[order]

    def _tree_of_step(self, step: int) -> tuple[Ints, cKDTree]:
        """The sightings of a step, and the tree of their places."""
        order = self._in_order_of_steps
        first, end = np.searchsorted(self._step, (step, step + 1), sorter=order)
        of_step = order[first:end]
        return of_step, cKDTree(np.column_stack([self._east_m[of_step], self._north_m[of_step]]))

    def longest(self, vehicle: int, end_s: float) -> "Stretch":
        """The longest stretch of a vehicle between the beginning and ``end_s``; of equal ones the
        first.
        """
        own = np.arange(*np.searchsorted(self.vehicle, (vehicle, vehicle + 1)))
        breaks = np.flatnonzero(self._links.is_first[own[1:]]) + 1
        stretches = [Stretch(self, part, end_s) for part in np.split(own, breaks)]
        return max(stretches, key=lambda stretch: stretch.end_s - stretch.begin_s)


class Stretch:
    """A vehicle's way without a gap or a jump, as the course of the car that drives it: from
    ``begin_s``, not before the beginning of the simulation, to ``end_s``.
    """

    def __init__(self, vehicles: Vehicles, sightings: Ints, end_s: float) -> None:
        self._vehicles, self._sightings = vehicles, sightings
        self._times_s = vehicles.times_of(sightings)
        self.begin_s = max(self._times_s.item(0), 0.0)
        self.end_s = min(self._times_s.item(-1), end_s)

    def at(self, t_s: Array) -> Motions:
        number = np.searchsorted(self._times_s, t_s, side="right") - 1
        return self._vehicles.at(self._sightings[np.maximum(number, 0)], t_s)
