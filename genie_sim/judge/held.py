"""What consumers hold: one list of objects of all that answers show them, in many scenes at once.

An answer that holds at an instant shows all that is in view then: its objects go on with their
velocities, for a second at most, and what the answers after it show in that field of view counts no
more. Of two objects of a label within a metre in different answers the first counts; those of one
answer are different objects, however near: people walk side by side.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from genie_sim.core.messages import Detection
from genie_sim.judge.joins import Array, GroupedPlaces, near, pair_codes
from genie_sim.judge.objects import LabelCodes, ShownObjects
from genie_sim.judge.scenes import in_field_of_view
from genie_sim.tracks.consumer import Shown
from genie_sim.tracks.coverage import Viewer
from genie_sim.tracks.track import COAST_NS, NEAR_M


class Held(NamedTuple):
    """Columns (n,), a row per object that is held, scene by scene, in their order: the index of the
    scene, codes of its label and class, and where it is then [m].
    """

    scene: Array
    label: Array
    class_: Array
    east_m: Array
    north_m: Array

    def rows(self, selection: Array) -> "Held":
        """Those of a mask or of indices."""
        return Held(*(column[selection] for column in self))


def shown_objects(scenes: Iterable[tuple[int, Sequence[Shown]]], labels: LabelCodes) -> Held:
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
    objects, counts = ShownObjects.of(lists, labels)
    at, ranks = np.repeat(scene_of, counts), np.repeat(rank_of, counts)
    east_m, north_m = objects.east_m, objects.north_m
    is_held = ~_decided(at, ranks, np.stack([east_m, north_m]), views)
    if age_ns.any():
        dt_s = np.minimum(np.repeat(age_ns, counts), COAST_NS) * 1e-9
        east_m = east_m + objects.velocity_east_mps * dt_s
        north_m = north_m + objects.velocity_north_mps * dt_s
    if ranks.any():
        group = pair_codes(at, objects.label, len(labels.codes))
        _drop_repeated(is_held, ranks, GroupedPlaces(group, east_m, north_m))
    return Held(at, objects.label, objects.class_, east_m, north_m).rows(is_held)


def _decided(
    scene: Array, rank: Array, places_m: Array, views: Sequence[tuple[int, int, Viewer]]
) -> Array:
    """Which objects stand in the field of view of an earlier answer that shows all in view.

    Parameters
    ----------
    scene, rank : array
        Of each of (n,) objects its scene, and the rank of the answer that shows it.
    places_m : array
        East and north [m], (2, n).
    views : sequence of tuple
        Scene, rank and viewer of the answers that show all in view.
    """
    decided = np.zeros(len(scene), dtype=bool)
    for of_rank in sorted({rank for _, rank, _ in views}):
        # of each scene the camera's place, heading and half of its field of view; NaN sees nothing
        cameras = np.full((int(scene.max(initial=0)) + 1, 4), np.nan)
        for of_scene, viewer_rank, viewer in views:
            if viewer_rank == of_rank and of_scene < len(cameras):
                east_m, north_m, _, heading_rad = viewer.pose
                cameras[of_scene] = east_m, north_m, heading_rad, viewer.horizontal_fov_rad / 2
        later = np.flatnonzero(rank > of_rank)
        camera = cameras[scene[later]].T
        away_east_m, away_north_m = places_m[:, later] - camera[:2]
        decided[later] |= in_field_of_view(away_east_m, away_north_m, camera[2], camera[3])
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
