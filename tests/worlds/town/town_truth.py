"""What really is somewhere in a town, object by object, for the tests."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from genie_sim.worlds.scene.objects import SceneObject
from genie_sim.worlds.town.town import Town


def truth_near(town: Town, east_m: float, north_m: float, range_m: float, t_ns: int):
    """Everything that really is within a distance of a place at a time, by number."""
    everything = near(town, east_m, north_m, range_m, t_ns * 1e-9)
    return tuple(sorted((item for item in everything if item.real), key=lambda item: item.number))


@functools.cache
def _objects(town: Town):
    """Everything in a town, and of each its speed and its street's length, and where it is along
    and across that street at time 0, how many are in its stream, and whether the street leads
    north.
    """
    items, columns = [], []
    for street in (*town.streets.east, *town.streets.north):
        for item in street.standing:
            ways = item.east_m, item.north_m
            items.append(item)
            columns.append(
                (0.0, math.inf, *(ways[::-1] if street.northbound else ways), 0, street.northbound)
            )
        for stream in street.streams:
            for start_m, movers in zip(stream.starts_m, stream.movers, strict=True):
                for item in movers:
                    items.append(item)
                    place = start_m, stream.beside_m, len(stream.starts_m), street.northbound
                    columns.append((stream.speed_mps, street.length_m, *place))
    return items, np.array(columns).T


def near(
    town: Town, east_m: float, north_m: float, range_m: float, t_s: float
) -> Iterator[SceneObject]:
    """All that is within a distance of a place at a time, seen or not, ghosts too. Who has come to
    the end of a street begins again as somebody else, with a number of its own.
    """
    items, (speed_mps, length_m, start_m, across_m, stream_size, northbound) = _objects(town)
    laps = np.where(speed_mps, -np.floor((start_m + speed_mps * t_s) / length_m), 0)
    driven_m = np.where(speed_mps, speed_mps * t_s + laps * np.minimum(length_m, 1e9), 0)
    along_m = start_m + driven_m
    away_m = [
        np.where(northbound, along_m, across_m) - north_m,
        np.where(northbound, across_m, along_m) - east_m,
    ]
    for k in np.flatnonzero(np.hypot(*away_m) <= range_m).tolist():
        place = (across_m[k], along_m[k]) if northbound[k] else (along_m[k], across_m[k])
        yield items[k].at(items[k].number - int(laps[k] * stream_size[k]), *place)
