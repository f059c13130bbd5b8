"""Static and moving objects of every street.

Traffic flows evenly: of each kind and direction a street carries a stream whose members keep their
speed and their distances, stop for nobody, and leave at one end of the town as others enter at its
other end. So where they are at any time is one sum.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from genie_sim.worlds.scene.keys import MIDDLE_MEMBER, object_number
from genie_sim.worlds.scene.laws import FittedLaws
from genie_sim.worlds.scene.objects import SceneObject, scene_object
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


class VehicleStream(NamedTuple):
    """One kind of traffic in one direction of one street: places along it at time 0, in order.

    ``movers`` are those who begin at each place: one, or for a cyclist a bicycle and a person.
    ``speed_mps`` is negative for those who come back along the street.
    """

    movers: list[tuple[SceneObject, ...]]
    beside_m: float
    speed_mps: float
    starts_m: array[float]


class Street:
    """One street: what stands on it in the order of its place along it, and what moves along it."""

    def __init__(
        self,
        northbound: bool,
        length_m: float,
        standing: list[SceneObject],
        streams: list[VehicleStream],
    ) -> None:
        self.northbound, self.length_m = northbound, length_m
        self.streams = [stream for stream in streams if stream.starts_m]
        self.standing = sorted(
            standing, key=lambda s: (s.north_m if northbound else s.east_m, s.number)
        )

    @property
    def objects(self) -> list[SceneObject]:
        """All that stands and then all that moves."""
        moving = (mover for stream in self.streams for movers in stream.movers for mover in movers)
        return [*self.standing, *moving]


class Layout(NamedTuple):
    """What all streets of a town are made from; ``seed_key`` are 64 bits of the town's seed."""

    rules: TownRules
    laws: FittedLaws
    seed_key: int


def lay_out(layout: Layout, northbound: bool, index: int, random: np.random.Generator) -> Street:
    """The ``index``-th street of a direction with all that is on it, and the places where the
    detector sees what is not there.
    """
    rules, laws, seed_key = layout
    crossings = rules.blocks[1] if northbound else rules.blocks[0]
    length_m, middle_m = crossings * rules.block_m, index * rules.block_m
    standing: list[SceneObject] = []

    def stand(label: str, along_m: float, beside_m: float, real: bool = True) -> None:
        place = (middle_m + beside_m, along_m) if northbound else (along_m, middle_m + beside_m)
        number = object_number(northbound, index, stream=0, member=len(standing))
        standing.append(
            scene_object(laws.of(label, real), seed_key, number, label, place=place, real=real)
        )

    for side in (-1, 1):
        for along_m, is_truck in _parked(rules, crossings, random):
            stand("truck" if is_truck else "car", along_m, side * PARKED_M)
    for label, density, beside_m, real in (
        ("bicycle", rules.parked_bicycles_per_100m, PAVEMENT_M - 1.0, True),
        ("person", rules.standing_people_per_100m, PAVEMENT_M, True),
        *(
            (label, rules.furniture_per_100m * share, PAVEMENT_M + 1.0, True)
            for label, share in FURNITURE
        ),
        *(
            (label, density, GHOST_BESIDE_M, False)
            for label, density in laws.ghosts_per_100m.items()
        ),
    ):
        for along_m, side in _scattered(density, length_m, random):
            stand(label, along_m, side * beside_m, real)
    for crossing in range(crossings + 1):
        other = rules.main(crossing)
        if not other:
            continue
        sign = "traffic light" if rules.main(index) else "stop sign"
        for direction in (-1, 1):
            along_m = crossing * rules.block_m - direction * JUNCTION_M
            if 0.0 <= along_m <= length_m:
                # On the right of those who come along: right of the heading east is south.
                stand(sign, along_m, direction * PAVEMENT_M * (1 if northbound else -1))
    return Street(
        northbound=northbound,
        length_m=length_m,
        standing=standing,
        streams=_streams(layout, northbound, index, random),
    )


def _streams(
    layout: Layout, northbound: bool, index: int, random: np.random.Generator
) -> list[VehicleStream]:
    """Traffic in both directions of a street."""
    rules, laws, seed_key = layout
    length_m = (rules.blocks[1] if northbound else rules.blocks[0]) * rules.block_m
    streams: list[VehicleStream] = []
    for labels, density, off_m, speed_mps in (
        (("car",), rules.moving_cars_per_100m, LANE_M, FLOW * rules.limit_mps(index)),
        (("bicycle", "person"), rules.cyclists_per_100m, BIKE_M, CYCLE_MPS),
        (("person",), rules.walkers_per_100m, PAVEMENT_M, WALK_MPS),
    ):
        for direction in (-1, 1):
            count = random.poisson(density / 2 * length_m / 100)
            starts_m = array("d", np.sort(random.random(count) * length_m))
            # on their right
            beside_m = index * rules.block_m + direction * off_m * (1 if northbound else -1)

            def mover(label: str, stream: int, k: int) -> SceneObject:
                number = object_number(northbound, index, stream, MIDDLE_MEMBER + k)
                return scene_object(laws.of(label), seed_key, number, label, moving=True)

            first = 2 * len(streams) + 1
            movers = [
                tuple(mover(label, stream, k) for stream, label in enumerate(labels, first))
                for k in range(count)
            ]
            streams.append(VehicleStream(movers, beside_m, direction * speed_mps, starts_m))
    return streams


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


class Streets(NamedTuple):
    """All streets of a town, by number from the south, and from the west: those that lead east, and
    those that lead north. ``half_m`` is from the middle of a street to its houses.
    """

    block_m: float
    half_m: float
    east: list[Street]
    north: list[Street]
