"""What a town is made of: its streets, what stands and moves there, and how its people commute."""

import math
from dataclasses import dataclass, fields
from typing import NoReturn

from genie_sim.base.settings import SettingError
from genie_sim.worlds.scene.laws import MAX_VIEW_M

# from the middle of a junction to where a car begins to turn, and to its stop lines
JUNCTION_M = 6.0
LANE_M = 1.75  # from the middle of a street to the middle of its right-hand lane
SLOT_M = 6.5  # of kerb that a parked car takes
CLEAR_M = 14.0  # from a crossing, free of parked cars
GHOST_BESIDE_M = 9.0  # from the middle of a street to the places of ghosts
MAX_BLOCKS = 100
MAX_PER_100M = 100.0


@dataclass(frozen=True, slots=True)
class TownRules:
    """A grid of streets; lengths in metres, speeds in m/s, densities per 100 m of street, both
    sides together.

    ``blocks`` are counted to the east and to the north. Every ``main_every``-th street is a main
    street with a speed limit of its own; lights stand where two of them cross, stop signs where
    another street meets one. ``popularity`` is the exponent of Zipf's law: the k-th of the
    ``destinations`` is chosen in proportion to k ** -popularity, and 0 makes all equal. ``view_m``
    is how far a camera's detector looks.

    The densities are assumed ones: chosen so that a frame shows as many objects of each group as
    the KITTI trace does, which ``tools/make/town_laws.py`` prints. Raises UserError for values that
    make no town.
    """

    blocks: tuple[int, int] = (8, 8)
    """Blocks to the east and to the north."""

    block_m: float = 150.0
    """Length of a block."""

    main_every: int = 4
    """Every n-th street is a main street, with traffic lights where two of them cross."""

    street_half_m: float = 10.0
    """Distance from the middle of a street to the houses beside it."""

    speed_mps: float = 30 / 3.6
    """Speed limit of a street [m/s]."""

    main_speed_mps: float = 50 / 3.6
    """Speed limit of a main street [m/s]."""

    acceleration_mps2: float = 1.5
    """Acceleration of cars [m/s²]."""

    braking_mps2: float = 2.0
    """Deceleration of braking cars [m/s²]."""

    parked_cars_per_100m: float = 15.0
    """Parked cars and trucks per 100 m of street, both sides together."""

    truck_share: float = 0.05
    """Share of parked vehicles that are trucks."""

    parked_bicycles_per_100m: float = 0.6
    """Parked bicycles per 100 m of street."""

    standing_people_per_100m: float = 0.3
    """Standing people per 100 m of street."""

    furniture_per_100m: float = 0.1
    """Street furniture such as benches and hydrants, per 100 m of street."""

    moving_cars_per_100m: float = 1.0
    """Moving cars, besides those of the scenario, per 100 m of street."""

    walkers_per_100m: float = 0.3
    """Pedestrians per 100 m of street."""

    cyclists_per_100m: float = 2.5
    """Cyclists per 100 m of street."""

    destinations: int = 12
    """Number of places that cars drive to."""

    popularity: float = 1.0
    """Exponent of Zipf's law by which destinations are chosen; 0 makes all equal."""

    view_m: float = 60.0
    """Largest distance at which a camera's detector finds objects."""

    def __post_init__(self) -> None:
        two = tuple(self.blocks) if isinstance(self.blocks, list | tuple) else ()
        if len(two) != 2 or any(type(n) is not int or not 1 <= n <= MAX_BLOCKS for n in two):
            text = f"{self.blocks!r} is not two whole numbers from 1 to {MAX_BLOCKS}"
            raise SettingError("blocks", text)
        object.__setattr__(self, "blocks", two)
        positive = ("speed_mps", "main_speed_mps", "acceleration_mps2", "braking_mps2", "view_m")
        for field in fields(self)[1:]:
            value = getattr(self, field.name)
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not math.isfinite(value)
            ):
                self._refuse(field.name, "is not a finite number")
            if isinstance(field.default, float):  # 15 and 15.0 are one town
                object.__setattr__(self, field.name, float(value))
            elif not isinstance(value, int) or value < 1:
                self._refuse(field.name, "is not a whole number from 1 on")
            if field.name in positive and value <= 0:
                self._refuse(field.name, "is not positive")
            if field.name.endswith("_100m") and not 0 <= value <= MAX_PER_100M:
                self._refuse(field.name, f"is not between 0 and {MAX_PER_100M:g}")
        if self.view_m > MAX_VIEW_M:
            self._refuse("view_m", f"is more than {MAX_VIEW_M} m, where no law is known")
        if self.popularity < 0:
            self._refuse("popularity", "is negative")
        if not 0 <= self.truck_share <= 1:
            self._refuse("truck_share", "is not between 0 and 1")
        braking_m = max(self.speed_mps, self.main_speed_mps) ** 2 / (2 * self.braking_mps2)
        if self.block_m < braking_m + 4 * JUNCTION_M:
            least_m = math.ceil(braking_m + 4 * JUNCTION_M)
            self._refuse(
                "block_m", f"is too short to stop in from the speed limit; at least {least_m} m"
            )
        if not 8.0 <= self.street_half_m <= self.block_m / 4:
            self._refuse(
                "street_half_m",
                f"is not between 8 m and a quarter of a block, {self.block_m / 4:g} m",
            )
        room = 200 * self.parking_slots / self.block_m
        if self.parked_cars_per_100m > room:
            self._refuse(
                "parked_cars_per_100m",
                f"do not fit; between junctions there is room for {room:.1f}",
            )

    def _refuse(self, name: str, why: str) -> NoReturn:
        """Names the rule and its value as scenarios write them: ``view: 500 m``."""
        text = f"{getattr(self, name)!r}{' m' if name.endswith('_m') else ''} {why}"
        raise SettingError(name.removesuffix("_m"), text)

    @property
    def parking_slots(self) -> int:
        """How many cars can be parked on one side of a street between two junctions."""
        return int((self.block_m - 2 * CLEAR_M) / SLOT_M)

    def main(self, street: int) -> bool:
        """Whether the n-th street, counted from the west or the south, is a main street."""
        return street % self.main_every == 0

    def limit_mps(self, street: int) -> float:
        return self.main_speed_mps if self.main(street) else self.speed_mps
