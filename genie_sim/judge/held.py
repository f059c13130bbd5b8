"""What consumers hold: one list of objects of all that answers show them, in many scenes at once.

An answer that holds at an instant shows all that is in view then: its objects go on with their
velocities, for a second at most, and what the answers after it show in that field of view counts no
more. Of two objects of a label within a metre in different answers the first counts; those of one
answer are different objects, however near: people walk side by side.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.core.messages import Detection
from genie_sim.judge.joins import Array, GroupedPlaces, near
from genie_sim.judge.objects import Objects
from genie_sim.tracks.consumer import Shown
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track import COAST_NS, NEAR_M


class Held(NamedTuple):
    """Objects that are held, scene by scene, in their order: the index of the scene, the object's
    number, and where it is then [m].
    """

    scene: Array
    number: Array
    east_m: Array
    north_m: Array

    def rows(self, selection: Array) -> "Held":
        """Those of a mask or of indices."""
        return Held(*(column[selection] for column in self))


def shown_objects(objects: Objects, scenes: Iterable[tuple[int, Sequence[Shown]]]) -> Held:
    """Returns what is held in each scene: its time [ns], and what answers show then."""
    lists: list[Sequence[Detection]] = []
    shown: list[tuple[int, int, int]] = []  # scene and rank of each list, for how long it holds
    views: list[tuple[int, int, Viewer]] = []  # scene and rank of answers that show all in view
    for scene, (now_ns, parts) in enumerate(scenes):
        for rank, part in enumerate(parts):
            lists.append(part.objects)
            for_ns = 0 if part.valid_ns is None else max(now_ns - part.valid_ns, 0)
            shown.append((scene, rank, for_ns))
            if part.valid_ns is not None and part.viewer is not None:
                views.append((scene, rank, part.viewer))
    scene_of, rank_of, age_ns = np.array(shown, dtype=np.int64).reshape(-1, 3).T
    number, counts = objects.numbers(lists)
    at, ranks = np.repeat(scene_of, counts), np.repeat(rank_of, counts)
    known = objects.columns()
    east_m, north_m = known.east_m[number], known.north_m[number]
    is_held = ~_decided(at, ranks, np.stack([east_m, north_m]), views)
    if age_ns.any():
        dt_s = np.minimum(np.repeat(age_ns, counts), COAST_NS) * 1e-9
        east_m = east_m + known.velocity_east_mps[number] * dt_s
        north_m = north_m + known.velocity_north_mps[number] * dt_s
    if ranks.any():
        _drop_repeated(
            is_held,
            ranks,
            GroupedPlaces(at * len(objects.labels) + known.label[number], east_m, north_m),
        )
    return Held(at, number, east_m, north_m).rows(is_held)


def _decided(
    scene: Array, rank: Array, places_m: Array, views: Sequence[tuple[int, int, Viewer]]
) -> Array:
    """Which objects stand in the field of view of an earlier answer that shows all in view.

    Parameters
    ----------
    scene, rank : array
        Of each object its scene, and the rank of the answer that shows it.
    places_m : array
        East and north, (2, n).
    views : sequence of tuple
        Scene, rank and viewer of the answers that show all in view.
    """
    decided = np.zeros(len(scene), dtype=bool)
    for of_rank in sorted({rank for _, rank, _ in views}):
        sectors = np.full((int(scene.max(initial=0)) + 1, 5), np.nan)
        for of_scene, viewer_rank, viewer in views:
            if viewer_rank == of_rank and of_scene < len(sectors):
                pose, half_rad = viewer.pose, max(viewer.horizontal_fov_rad / 2, 0.0)
                min_cosine = math.cos(half_rad) if half_rad < math.pi else -2.0
                ahead = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
                sectors[of_scene] = (pose.east_m, pose.north_m, *ahead, min_cosine)
        later = np.flatnonzero(rank > of_rank)
        from_east_m, from_north_m, ahead_east, ahead_north, min_cosines = sectors[scene[later]].T
        east_m, north_m = places_m[0, later] - from_east_m, places_m[1, later] - from_north_m
        ahead_m = east_m * ahead_east + north_m * ahead_north
        decided[later] |= ((ahead_m >= 0.0) | (min_cosines < 0.0)) & (
            ahead_m >= min_cosines * np.hypot(east_m, north_m)
        )
    return decided


def _drop_repeated(is_held: Array, rank: Array, places: GroupedPlaces) -> None:
    """Takes out of ``is_held`` what an earlier answer shows already."""
    first, later = (
        np.flatnonzero(is_held & (rank < rank.max())),
        np.flatnonzero(is_held & (rank > 0)),
    )
    pairs = near(places.rows(later), places.rows(first), NEAR_M)
    later, first = later[pairs.ours], first[pairs.theirs]
    repeats = (rank[first] < rank[later]) & (pairs.distance_m2 < NEAR_M * NEAR_M)
    later, first = later[repeats], first[repeats]
    for of_rank in range(1, rank.max() + 1):
        rows = rank[later] == of_rank
        is_held[later[rows & is_held[first]]] = False
