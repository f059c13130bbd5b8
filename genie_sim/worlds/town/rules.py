"""What a town is made of: its streets, what stands and moves there, and how its people commute."""

import math
from dataclasses import dataclass, fields
from typing import Annotated

from genie_sim.base.marks import NOT_NEGATIVE, Bounds, Count, Share
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.units import length_text
from genie_sim.worlds.scene.laws import MAX_VIEW_M

# Assumed, all of these [m].
# from the middle of a junction to where a car begins to turn, and to its stop lines
JUNCTION_M = 6.0
LANE_M = 1.75  # from the middle of a street to the middle of its right-hand lane
BAY_M = 6.5  # of kerb that a parked car takes
CLEAR_M = 14.0  # from a crossing, free of parked cars
GHOST_BESIDE_M = 9.0  # from the middle of a street to the places of ghosts
STREET_HALF_M = 8.0  # the narrowest street with room for two lanes, parked cars and a pavement

GHOSTS_PER_100M = 5.8  # of street, about: as the laws have it, which take long to read
MAX_OBJECTS = 5_000_000  # more would fill the memory of most machines

Blocks = Annotated[int, Bounds(minimum=1, maximum=100)]
Speed = Annotated[float, Bounds(above=0, maximum=100)]
Acceleration = Annotated[float, Bounds(minimum=0.01, maximum=100)]
Density = Annotated[float, Bounds(minimum=0, maximum=100)]


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
    the KITTI trace does, which ``tools/make/town_laws.py`` prints. Raises SettingError for
    values that make no town.
    """

    blocks: tuple[Blocks, Blocks] = (8, 8)
    """Blocks to the east and to the north."""

    block_m: Annotated[float, Bounds(maximum=10_000)] = 150.0
    """Length of a block."""

    main_every: Count = 4
    """Every n-th street is a main street, with traffic lights where two of them cross."""

    street_half_m: float = 10.0
    """Distance from the middle of a street to the houses beside it."""

    speed_mps: Speed = 30 / 3.6
    """Speed limit of a street [m/s]."""

    main_speed_mps: Speed = 50 / 3.6
    """Speed limit of a main street [m/s]."""

    acceleration_mps2: Acceleration = 1.5
    """Acceleration of cars [m/s²]."""

    braking_mps2: Acceleration = 2.0
    """Deceleration of braking cars [m/s²]."""

    parked_cars_per_100m: Density = 15.0
    """Parked cars and trucks per 100 m of street, both sides together."""

    truck_share: Share = 0.05
    """Share of parked vehicles that are trucks."""

    parked_bicycles_per_100m: Density = 0.6
    """Parked bicycles per 100 m of street."""

    standing_people_per_100m: Density = 0.3
    """Standing people per 100 m of street."""

    furniture_per_100m: Density = 0.1
    """Street furniture such as benches and hydrants, per 100 m of street."""

    moving_cars_per_100m: Density = 1.0
    """Moving cars, besides those of the scenario, per 100 m of street."""

    walkers_per_100m: Density = 0.3
    """Pedestrians per 100 m of street."""

    cyclists_per_100m: Density = 2.5
    """Cyclists per 100 m of street."""

    destinations: Count = 12
    """Number of places that cars drive to."""

    popularity: Annotated[float, NOT_NEGATIVE] = 1.0
    """Exponent of Zipf's law by which destinations are chosen; 0 makes all equal."""

    view_m: Annotated[float, Bounds(above=0, maximum=MAX_VIEW_M)] = 60.0
    """Largest distance at which a camera's detector finds objects."""

    def __post_init__(self) -> None:
        braking_m = max(self.speed_mps, self.main_speed_mps) ** 2 / (2 * self.braking_mps2)
        least_m = math.ceil(braking_m + 4 * JUNCTION_M)
        if self.block_m < braking_m + 4 * JUNCTION_M:
            why = f"is too short to stop in from the speed limit; at least {least_m} m"
            raise SettingError("block", f"{length_text(self.block_m)} {why}")
        if not STREET_HALF_M <= self.street_half_m <= self.block_m / 4:
            least, most, own = map(
                length_text, (STREET_HALF_M, self.block_m / 4, self.street_half_m)
            )
            why = f"must be from {least} to a quarter of a block, {most}, but is {own}"
            raise SettingError("street_half", why)
        room = 200 * self.parking_bays / self.block_m
        if self.parked_cars_per_100m > room:
            why = f"do not fit; between junctions there is room for {math.floor(10 * room) / 10}"
            raise SettingError("parked_cars_per_100m", f"{self.parked_cars_per_100m} {why}")
        east, north = self.blocks
        streets_m = (east * (north + 1) + north * (east + 1)) * self.block_m
        per_100m = (field.name for field in fields(self) if field.name.endswith("_per_100m"))
        # A cyclist is a bicycle and a person.
        densities = [self.cyclists_per_100m, *(getattr(self, name) for name in per_100m)]
        # Two lights or signs of each street where a main street crosses it.
        mains_east, mains_north = (count // self.main_every + 1 for count in self.blocks)
        signs = 2 * ((east + 1) * mains_north + (north + 1) * mains_east)
        count = streets_m / 100 * (math.fsum(densities) + GHOSTS_PER_100M) + signs
        if count > MAX_OBJECTS:
            why = f"make about {count:,.0f} objects, and at most {MAX_OBJECTS:,} are possible"
            raise SettingError("blocks", why)

    @property
    def parking_bays(self) -> int:
        """How many cars can be parked on one side of a street between two junctions."""
        return int((self.block_m - 2 * CLEAR_M) / BAY_M)

    def main(self, street: int) -> bool:
        """Whether the n-th street, counted from the west or the south, is a main street."""
        return street % self.main_every == 0

    def limit_mps(self, street: int) -> float:
        return self.main_speed_mps if self.main(street) else self.speed_mps
