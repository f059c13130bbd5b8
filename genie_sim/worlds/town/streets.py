"""What stands and what moves on every street.

Traffic flows evenly: of each kind and direction a street carries a stream whose members keep their
speed and their distances, stop for nobody, and come back at one end of the town when they leave it
at the other. So where they are at any time is one sum.
"""

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from genie_sim.worlds.scene.keys import object_number
from genie_sim.worlds.town.rules import (
    BAY_M,
    CLEAR_M,
    GHOST_BESIDE_M,
    JUNCTION_M,
    LANE_M,
    TownRules,
)

# Assumed, all of these: the first three are from the middle of the street, FLOW is the share of the
# speed limit that traffic drives.
PARKED_M, PAVEMENT_M, BIKE_M = 5.0, 7.5, 3.2
WALK_MPS, CYCLE_MPS, FLOW = 1.4, 4.5, 0.9
FURNITURE = (("fire hydrant", 0.4), ("bench", 0.5))


class StreetObject(NamedTuple):
    """Something on a street, or a ghost there, which stands or keeps a speed.

    ``along_m`` and ``across_m`` are where it is at time 0, along the street and across it, from the
    town's zero; ``speed_mps`` is towards the street's end, and negative for those who come back.
    Who leaves the street enters it again at its other end.
    """

    label: str
    number: int
    along_m: float
    across_m: float
    real: bool = True
    speed_mps: float = 0.0


class Street(NamedTuple):
    """The ``number``-th street that leads north, or else east, along so many blocks [m], and all
    that is on it.
    """

    northbound: bool
    number: int
    blocks: int
    block_m: float
    objects: list[StreetObject]

    @property
    def length_m(self) -> float:
        return self.blocks * self.block_m

    @property
    def middle_m(self) -> float:
        """Of the street, across it."""
        return self.number * self.block_m

    @property
    def right(self) -> int:
        """The sign, across, of the right of who comes along: south of the heading east."""
        return 1 if self.northbound else -1


def lay_out(
    rules: TownRules,
    ghosts_per_100m: Mapping[str, float],
    northbound: bool,
    number: int,
    *,
    random: np.random.Generator,
) -> Street:
    """The ``number``-th street of a direction with what stands, ghosts too (where the detector sees
    what is not there), in the order of the place along it, and then what moves.

    The order of the draws is part of the town: another one, or a draw in between, makes another
    town of every seed. What is new draws at the end.
    """
    blocks = rules.blocks[1 if northbound else 0]
    street = Street(northbound, number, blocks, rules.block_m, objects=[])
    standing = [
        StreetObject(
            label,
            object_number(northbound, number, stream=0, member=member),
            along_m,
            street.middle_m + beside_m,
            real,
        )
        for member, (label, along_m, beside_m, real) in enumerate(
            _standing(rules, ghosts_per_100m, street, random)
        )
    ]
    standing.sort(key=lambda item: (item.along_m, item.number))
    street.objects.extend([*standing, *_moving(rules, street, random)])
    return street


def _standing(
    rules: TownRules,
    ghosts_per_100m: Mapping[str, float],
    street: Street,
    random: np.random.Generator,
) -> Iterator[tuple[str, float, float, bool]]:
    """What stands on a street: label, place along it and beside its middle, and whether it is
    there or a ghost.
    """
    for side in (-1, 1):
        for along_m, is_truck in _parked(rules, street.blocks, random):
            yield "truck" if is_truck else "car", along_m, side * PARKED_M, True
    anywhere = [
        ("bicycle", rules.parked_bicycles_per_100m, PAVEMENT_M - 1.0, True),
        ("person", rules.standing_people_per_100m, PAVEMENT_M, True),
    ]
    for label, share in FURNITURE:
        anywhere.append((label, rules.furniture_per_100m * share, PAVEMENT_M + 1.0, True))
    for label, density in ghosts_per_100m.items():
        anywhere.append((label, density, GHOST_BESIDE_M, False))
    for label, density, beside_m, real in anywhere:
        for along_m, side in _scattered(density, street.length_m, random):
            yield label, along_m, side * beside_m, real
    sign = "traffic light" if rules.main(street.number) else "stop sign"
    for crossing in filter(rules.main, range(street.blocks + 1)):
        for direction in (-1, 1):
            along_m = crossing * rules.block_m - direction * JUNCTION_M
            if 0.0 <= along_m <= street.length_m:
                yield sign, along_m, direction * street.right * PAVEMENT_M, True


def _moving(
    rules: TownRules, street: Street, random: np.random.Generator
) -> Iterator[StreetObject]:
    """What moves on a street, stream by stream. A stream of cyclists has a second one beside it, of
    those on the bicycles; so every other number is a stream's own.
    """
    kinds = (
        (("car",), rules.moving_cars_per_100m, LANE_M, FLOW * rules.limit_mps(street.number)),
        (("bicycle", "person"), rules.cyclists_per_100m, BIKE_M, CYCLE_MPS),
        (("person",), rules.walkers_per_100m, PAVEMENT_M, WALK_MPS),
    )
    ways = itertools.product(kinds, (-1, 1))
    for stream, ((labels, density, off_m, speed_mps), direction) in zip(
        itertools.count(1, 2), ways
    ):
        count = random.poisson(density / 2 * street.length_m / 100)
        starts_m = np.sort(random.random(count) * street.length_m).tolist()
        for member, start_m in enumerate(starts_m):
            for own_stream, label in enumerate(labels, stream):
                yield StreetObject(
                    label,
                    object_number(street.northbound, street.number, own_stream, member),
                    start_m,
                    street.middle_m + direction * street.right * off_m,
                    speed_mps=direction * speed_mps,
                )


def _parked(
    rules: TownRules, blocks: int, random: np.random.Generator
) -> Iterator[tuple[float, bool]]:
    """Place along one side of a street, and whether it is a truck, of each parked car; some blocks
    have none, and short ones no room for any.
    """
    bays = rules.parking_bays
    if not bays:
        return
    busy = rules.parked_cars_per_100m / 200 * rules.block_m / bays
    for block in range(blocks):
        share = random.beta(2 * busy, 2 * (1 - busy)) if 0 < busy < 1 else busy
        bay = np.flatnonzero(random.random(bays) < share)
        places_m = (
            block * rules.block_m + CLEAR_M + (bay + 0.4 + 0.2 * random.random(len(bay))) * BAY_M
        )
        yield from zip(
            places_m.tolist(), (random.random(len(bay)) < rules.truck_share).tolist(), strict=True
        )


def _scattered(
    per_100m: float, length_m: float, random: np.random.Generator
) -> Iterator[tuple[float, int]]:
    """Place along a street and side (-1 or 1) of objects that stand anywhere."""
    count = random.poisson(per_100m * length_m / 100)
    places_m = random.random(count) * length_m
    yield from zip(
        places_m.tolist(), np.where(random.random(count) < 0.5, -1, 1).tolist(), strict=True
    )
