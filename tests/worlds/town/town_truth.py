"""What really is somewhere in a town, object by object, for the tests."""

from __future__ import annotations

import functools

import numpy as np

from genie_sim.worlds.scene.objects import MIDDLES_M, SceneObject
from genie_sim.worlds.town.town import Town


@functools.cache
def _objects(town: Town):
    """Everything real in a town, and of each whether its street leads north, its length, and how
    the object moves along it.
    """
    items = [(street, item) for street in town.streets for item in street.objects if item.real]
    columns = [
        (street.northbound, street.length_m, item.along_m, item.across_m, item.speed_mps)
        for street, item in items
    ]
    return [item for _, item in items], np.array(columns).T


def truth_near(town: Town, east_m: float, north_m: float, range_m: float, t_ns: int):
    """Everything that really is within a distance of a place at a time, seen or not."""
    items, (northbound, length_m, start_m, across_m, speed_mps) = _objects(town)
    gone_m = speed_mps * (t_ns * 1e-9)
    laps = np.floor((start_m + gone_m) / length_m) * (speed_mps != 0)
    along_m = start_m + (gone_m - laps * length_m)
    there_m = np.where(northbound, [across_m, along_m], [along_m, across_m])
    away_m = there_m - [[east_m], [north_m]]
    truth = []
    for k in np.flatnonzero(np.hypot(*away_m) <= range_m).tolist():
        item, place = items[k], there_m[:, k].tolist()
        truth.append(SceneObject(item.label, item.speed_mps != 0, *place, MIDDLES_M[item.label]))
    return tuple(truth)
