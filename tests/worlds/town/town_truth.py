"""What really is somewhere in a town, object by object, for the tests."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from genie_sim.worlds.scene.objects import MIDDLES_M, SceneObject
from genie_sim.worlds.town.town import Town


def truth_near(town: Town, east_m: float, north_m: float, range_m: float, t_ns: int):
    """Everything that really is within a distance of a place at a time, by number."""
    everything = near(town, east_m, north_m, range_m, t_ns * 1e-9)
    return tuple(sorted((item for item, real in everything if real), key=lambda item: item.number))


@functools.cache
def _objects(town: Town):
    """Everything in a town, and of each whether its street leads north, its length, and how the
    object moves along it.
    """
    items = [(street, item) for street in town.streets for item in street.objects]
    columns = [
        (street.northbound, street.length_m, item.along_m, item.across_m, item.speed_mps)
        for street, item in items
    ]
    return [item for _, item in items], np.array(columns).T


def near(
    town: Town, east_m: float, north_m: float, range_m: float, t_s: float
) -> Iterator[tuple[SceneObject, bool]]:
    """All that is within a distance of a place at a time, seen or not, and whether it is real. Who
    has come to the end of a street begins again as somebody else, with a number of its own.
    """
    items, (northbound, length_m, start_m, across_m, speed_mps) = _objects(town)
    laps = np.floor((start_m + speed_mps * t_s) / length_m) * (speed_mps != 0)
    along_m = start_m + (speed_mps * t_s - laps * length_m)
    there_m = np.where(northbound, [across_m, along_m], [along_m, across_m])
    away_m = there_m - [[east_m], [north_m]]
    for k in np.flatnonzero(np.hypot(*away_m) <= range_m).tolist():
        item, place = items[k], there_m[:, k].tolist()
        number = item.number + int(laps[k]) * item.stream_size
        moving, up_m = item.speed_mps != 0, MIDDLES_M[item.label]
        yield SceneObject(item.label, number, moving, *place, up_m), item.real
