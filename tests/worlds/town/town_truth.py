"""What really is somewhere in a town, object by object, for the tests."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator

from genie_sim.worlds.scene.objects import SceneObject
from genie_sim.worlds.town.streets import Street, VehicleStream
from genie_sim.worlds.town.town import Town


def truth_near(town: Town, east_m: float, north_m: float, range_m: float, t_ns: int):
    """Everything that really is within a distance of a place at a time, by number."""
    everything = near(town, east_m, north_m, range_m, t_ns * 1e-9)
    return tuple(sorted((item for item in everything if item.real), key=lambda item: item.number))


def near(
    town: Town, east_m: float, north_m: float, range_m: float, t_s: float
) -> Iterator[SceneObject]:
    """All that is within a distance of a place at a time, seen or not, ghosts too."""
    streets, block_m = town.streets, town.rules.block_m
    reach_m = range_m + streets.half_m
    for of_direction, across_m, along_m in (
        (streets.east, north_m, east_m),
        (streets.north, east_m, north_m),
    ):
        for number, street in enumerate(of_direction):
            if across_m - reach_m <= number * block_m <= across_m + reach_m:
                for item in _on_street(street, along_m - range_m, along_m + range_m, t_s):
                    if math.hypot(item.east_m - east_m, item.north_m - north_m) <= range_m:
                        yield item


def _on_street(street: Street, low_m: float, high_m: float, t_s: float) -> Iterator[SceneObject]:
    """All that is between two places along a street at a time."""
    places_m = [item.north_m if street.northbound else item.east_m for item in street.standing]
    yield from street.standing[bisect_left(places_m, low_m) : bisect_left(places_m, high_m)]
    low_m, high_m = max(low_m, 0.0), min(high_m, street.length_m)
    if low_m < high_m:
        for stream in street.streams:
            yield from _of_stream(stream, street, low_m, high_m, t_s)


def _of_stream(
    stream: VehicleStream, street: Street, low_m: float, high_m: float, t_s: float
) -> Iterator[SceneObject]:
    """Who has come to the end begins again as somebody else, with a number of its own."""
    starts_m, length_m = stream.starts_m, street.length_m
    gone_m = stream.speed_mps * t_s
    lap, begin_m = divmod(low_m - gone_m, length_m)
    end_m = begin_m + high_m - low_m
    k = bisect_left(starts_m, begin_m)
    while True:
        if k == len(starts_m):
            if end_m < length_m:
                return
            k, end_m, lap = 0, end_m - length_m, lap + 1
        if starts_m[k] > end_m:
            return
        along_m = starts_m[k] + (gone_m + lap * length_m)
        place = (stream.beside_m, along_m) if street.northbound else (along_m, stream.beside_m)
        for mover in stream.movers[k]:
            yield mover.at(mover.number - int(lap) * len(starts_m), *place)
        k += 1
