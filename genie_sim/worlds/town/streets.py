"""What stands and what moves on every street.

Traffic flows evenly: of each kind and direction a street carries a stream whose members keep their
speed and their distances, stop for nobody, and leave at one end of the town as others enter at its
other end. So where they are at any time is one sum.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from genie_sim.worlds.scene.keys import MIDDLE_MEMBER, object_number
from genie_sim.worlds.town.rules import (
    CLEAR_M,
    GHOST_BESIDE_M,
    JUNCTION_M,
    LANE_M,
    SLOT_M,
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
    town's zero; ``speed_mps`` is towards the street's end, and negative for those who come back. A
    stream starts from ``stream_size`` places: who enters in place of one who has left the street
    has a number that is by so much higher, or lower for those who come back.
    """

    label: str
    number: int
    along_m: float
    across_m: float
    real: bool = True
    speed_mps: float = 0.0
    stream_size: int = 0


class Street(NamedTuple):
    """A street that leads north, or else east, and all that is on it."""

    northbound: bool
    length_m: float
    objects: list[StreetObject]


def lay_out(
    rules: TownRules,
    ghosts_per_100m: Mapping[str, float],
    northbound: bool,
    index: int,
    *,
    random: np.random.Generator,
) -> Street:
    """The ``index``-th street of a direction with what stands, in the order of its place along it,
    the ghosts, by class, where the detector sees what is not there, and then what moves.
    """
    crossings = rules.blocks[1] if northbound else rules.blocks[0]
    length_m, middle_m = crossings * rules.block_m, index * rules.block_m
    right = 1 if northbound else -1  # of those who come along, across: south of the heading east
    standing: list[StreetObject] = []

    def stand(label: str, along_m: float, beside_m: float, real: bool = True) -> None:
        number = object_number(northbound, index, stream=0, member=len(standing))
        standing.append(StreetObject(label, number, along_m, middle_m + beside_m, real))

    for side in (-1, 1):
        for along_m, is_truck in _parked(rules, crossings, random):
            stand("truck" if is_truck else "car", along_m, side * PARKED_M)
    anywhere = [
        ("bicycle", rules.parked_bicycles_per_100m, PAVEMENT_M - 1.0, True),
        ("person", rules.standing_people_per_100m, PAVEMENT_M, True),
    ]
    for label, share in FURNITURE:
        anywhere.append((label, rules.furniture_per_100m * share, PAVEMENT_M + 1.0, True))
    for label, density in ghosts_per_100m.items():
        anywhere.append((label, density, GHOST_BESIDE_M, False))
    for label, density, beside_m, real in anywhere:
        for along_m, side in _scattered(density, length_m, random):
            stand(label, along_m, side * beside_m, real)
    sign = "traffic light" if rules.main(index) else "stop sign"
    for crossing in filter(rules.main, range(crossings + 1)):
        for direction in (-1, 1):
            along_m = crossing * rules.block_m - direction * JUNCTION_M
            if 0.0 <= along_m <= length_m:
                stand(sign, along_m, direction * right * PAVEMENT_M)
    objects = sorted(standing, key=lambda item: (item.along_m, item.number))

    stream = 1
    for labels, density, off_m, speed_mps in (
        (("car",), rules.moving_cars_per_100m, LANE_M, FLOW * rules.limit_mps(index)),
        (("bicycle", "person"), rules.cyclists_per_100m, BIKE_M, CYCLE_MPS),
        (("person",), rules.walkers_per_100m, PAVEMENT_M, WALK_MPS),
    ):
        for direction in (-1, 1):
            count = random.poisson(density / 2 * length_m / 100)
            starts_m = np.sort(random.random(count) * length_m).tolist()
            for member, start_m in enumerate(starts_m, MIDDLE_MEMBER):
                for own_stream, label in enumerate(labels, stream):
                    mover = StreetObject(
                        label,
                        object_number(northbound, index, own_stream, member),
                        start_m,
                        middle_m + direction * right * off_m,
                        speed_mps=direction * speed_mps,
                        stream_size=count,
                    )
                    objects.append(mover)
            stream += 2  # with room for a second one, of those on bicycles
    return Street(northbound, length_m, objects)


def _parked(
    rules: TownRules, crossings: int, random: np.random.Generator
) -> Iterator[tuple[float, bool]]:
    """Place along one side of a street, and whether it is a truck, of each parked car; some blocks
    have none.
    """
    slots = rules.parking_slots
    busy = rules.parked_cars_per_100m / 200 * rules.block_m / slots
    for block in range(crossings):
        share = random.beta(2 * busy, 2 * (1 - busy)) if 0 < busy < 1 else busy
        slot = np.flatnonzero(random.random(slots) < share)
        places_m = (
            block * rules.block_m + CLEAR_M + (slot + 0.4 + 0.2 * random.random(len(slot))) * SLOT_M
        )
        yield from zip(
            places_m.tolist(), (random.random(len(slot)) < rules.truck_share).tolist(), strict=True
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
