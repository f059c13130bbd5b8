"""What a town is made of: its streets, what stands and moves there, and how its people commute."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

from genie_sim.errors import UserError

JUNCTION_M = 6.0  # from the middle of a junction to where a car begins to turn, and to its stop lines
LANE_M = 1.75  # from the middle of a street to the middle of its right-hand lane
SLOT_M = 6.5  # of kerb that a parked car takes
CLEAR_M = 14.0  # from a crossing, free of parked cars
GHOST_BESIDE_M = 9.0  # from the middle of a street to what a detector takes for something
MOST_VIEW_M = 100
MOST_BLOCKS = 100
MOST_PER_100M = 100.0


@dataclass(frozen=True, slots=True)
class TownRules:
    """A grid of streets; lengths in metres, speeds in m/s, densities per 100 m of street, both sides together.

    ``blocks`` are counted to the east and to the north. Every ``main_every``-th street is a main street with a speed
    limit of its own; lights stand where two of them cross, stop signs where another street meets one. ``popularity``
    is the exponent of Zipf's law: the k-th of the ``destinations`` is chosen in proportion to k ** -popularity, and 0
    makes all equal. ``view_m`` is how far a camera's detector looks.

    The densities are assumed ones: chosen so that a frame shows as many objects of each group as the KITTI trace
    does, which ``benchmarks/city_laws.py`` prints. Raises UserError for values that make no town.
    """

    blocks: tuple[int, int] = (8, 8)
    block_m: float = 150.0
    main_every: int = 4
    street_half_m: float = 10.0
    speed_mps: float = 30 / 3.6
    main_speed_mps: float = 50 / 3.6
    acceleration_mps2: float = 1.5
    braking_mps2: float = 2.0
    parked_cars_per_100m: float = 15.0
    truck_share: float = 0.05
    parked_bicycles_per_100m: float = 0.6
    standing_people_per_100m: float = 0.3
    furniture_per_100m: float = 0.1
    moving_cars_per_100m: float = 1.0
    walkers_per_100m: float = 0.3
    cyclists_per_100m: float = 2.5
    destinations: int = 12
    popularity: float = 1.0
    view_m: float = 60.0

    def __post_init__(self) -> None:
        two = tuple(self.blocks) if isinstance(self.blocks, list | tuple) else ()
        if len(two) != 2 or any(type(n) is not int or not 1 <= n <= MOST_BLOCKS for n in two):
            raise UserError(f"town: blocks: {self.blocks!r} is not two whole numbers from 1 to {MOST_BLOCKS}")
        object.__setattr__(self, "blocks", two)
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "blocks":
                continue
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise UserError(f"town: {field.name}: {value!r} is not a finite number")
            if isinstance(field.default, float):  # 15 and 15.0 are one town
                object.__setattr__(self, field.name, float(value))
        for name in ("main_every", "destinations"):
            if not isinstance(getattr(self, name), int) or getattr(self, name) < 1:
                raise UserError(f"town: {name}: {getattr(self, name)!r} is not a whole number from 1 on")
        for name in ("speed_mps", "main_speed_mps", "acceleration_mps2", "braking_mps2", "view_m"):
            if getattr(self, name) <= 0:
                raise UserError(f"town: {name}: {getattr(self, name)!r} is not positive")
        if self.view_m > MOST_VIEW_M:
            raise UserError(f"town: view_m: {self.view_m!r} is more than {MOST_VIEW_M}, where no law is known")
        if self.popularity < 0:
            raise UserError(f"town: popularity: {self.popularity!r} is negative")
        for field in fields(self):
            if field.name.endswith("_100m") and not 0 <= getattr(self, field.name) <= MOST_PER_100M:
                raise UserError(
                    f"town: {field.name}: {getattr(self, field.name)!r} is not between 0 and {MOST_PER_100M:g}"
                )
        if not 0 <= self.truck_share <= 1:
            raise UserError(f"town: truck_share: {self.truck_share!r} is not between 0 and 1")
        if not 8.0 <= self.street_half_m <= self.block_m / 4:
            raise UserError(f"town: street_half_m: {self.street_half_m!r} is not between 8 and a quarter of block_m")
        braking_m = max(self.speed_mps, self.main_speed_mps) ** 2 / (2 * self.braking_mps2)
        if self.block_m < braking_m + 4 * JUNCTION_M:
            raise UserError(
                f"town: block_m: {self.block_m!r} is too short to stop in from the speed limit; "
                f"at least {braking_m + 4 * JUNCTION_M:.0f}"
            )

        room = 200 * self.parking_slots / self.block_m
        if self.parked_cars_per_100m > room:
            raise UserError(
                f"town: parked_cars_per_100m: {self.parked_cars_per_100m!r} do not fit; "
                f"between junctions there is room for {room:.1f}"
            )

    @property
    def parking_slots(self) -> int:
        """How many cars can be parked on one side of a street between two junctions."""
        return int((self.block_m - 2 * CLEAR_M) / SLOT_M)

    def main(self, street: int) -> bool:
        """Whether the n-th street, counted from the west or the south, is a main street."""
        return street % self.main_every == 0

    def limit_mps(self, street: int) -> float:
        return self.main_speed_mps if self.main(street) else self.speed_mps


class TrueObject(NamedTuple):
    """An object of the town: its number, its class, where its middle is [m] at the time it was asked for."""

    number: int
    label: str
    location: tuple[float, float, float]
    moving: bool
