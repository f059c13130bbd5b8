"""Looks of a camera, and maps of tracks that they are told to."""

from __future__ import annotations

import math

from genie_sim.core.messages import CameraPose, Detection, Header, Look
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.track_map import TrackMap
from tests.make import S

FOV = math.radians(90.0)


def look(
    t_s: float, *detections: Detection, at=(0.0, 0.0), heading_deg=0.0, car="car1", camera="02"
) -> Look:
    """A look east from the origin, unless it is said otherwise."""
    pose = CameraPose(at[0], at[1], 1.6, math.radians(heading_deg))
    return Look(Header(round(t_s * S), camera, car), pose, FOV, detections)


def tracks(existence=None, **settings) -> TrackMap:
    return TrackMap(existence or ExistenceFilter(), **settings)


def after(map_: TrackMap, *looks: Look) -> TrackMap:
    for taken in looks:
        map_.learn(taken, taken.header.stamp_ns)
    return map_


def there(map_: TrackMap, t_s: float) -> list[tuple[str, float, float]]:
    """What may leave at a time, by class and place."""
    map_.forget(round(t_s * S))
    places = [(seen.label, *seen.location[:2]) for seen in map_.believed(round(t_s * S))]
    return sorted((label, round(east, 2), round(north, 2)) for label, east, north in places)
