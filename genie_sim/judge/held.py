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
from genie_sim.judge.joins import Array, GroupedPlaces, near, pair_codes, rows_of
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


def shown_objects(scenes: Iterable[tuple[int, Sequence[Shown]]], labels: LabelCodes) -> Held:
    """Returns what is held in each scene: its time [ns], and what answers show then."""
    lists: list[Sequence[Detection]] = []
    # of each list its scene, the rank of its answer, and how old that is [ns]
    about_lists: list[tuple[int, int, int]] = []
    views: list[tuple[int, int, Viewer]] = []  # scene and rank of answers that show all in view
    for scene, (now_ns, answers) in enumerate(scenes):
        for rank, answer in enumerate(answers):
            lists.append(answer.objects)
            age_ns = 0 if answer.valid_ns is None else max(now_ns - answer.valid_ns, 0)
            about_lists.append((scene, rank, age_ns))
            if answer.valid_ns is not None and answer.viewer is not None:
                views.append((scene, rank, answer.viewer))
    shown, objects_per_list = ShownObjects.of(lists, labels)
    per_list = np.array(about_lists, dtype=np.int64).reshape(-1, 3)
    # from here on, arrays have a value for each object
    object_scene, object_rank, age_ns = np.repeat(per_list, objects_per_list, axis=0).T
    dt_s = np.minimum(age_ns, COAST_NS) * 1e-9
    # covered is what was found in a view, wherever it has moved to since
    places_m = np.stack([shown.east_m, shown.north_m])
    is_covered = _covered(object_scene, object_rank, places_m, views)
    held = Held(
        object_scene,
        shown.label,
        shown.class_,
        east_m=shown.east_m + shown.velocity_east_mps * dt_s,
        north_m=shown.north_m + shown.velocity_north_mps * dt_s,
    )
    held, object_rank = rows_of(held, ~is_covered), object_rank[~is_covered]
    if object_rank.any():
        group = pair_codes(held.scene, held.label, len(labels.codes))
        places = GroupedPlaces(group, held.east_m, held.north_m)
        held = rows_of(held, ~_repeated(object_rank, places))
    return held


def _covered(
    scene: Array, rank: Array, places_m: Array, views: Sequence[tuple[int, int, Viewer]]
) -> Array:
    """Which objects stand in the field of view of an earlier answer that shows all in view: they
    count no more.

    Parameters
    ----------
    scene, rank : array
        Of each of (n,) objects its scene, and the rank among its answers of the one that shows it.
    places_m : array
        East and north [m], (2, n), where they were found.
    views : sequence of tuple
        Scene, rank and viewer of the answers that show all in view.
    """
    covered = np.zeros(len(scene), dtype=bool)
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
        covered[later] |= in_field_of_view(away_east_m, away_north_m, camera[2], camera[3])
    return covered


def _repeated(rank: Array, places: GroupedPlaces) -> Array:
    """Which objects repeat what an earlier answer, one of a lower rank, shows within a metre. What
    repeats an object itself is repeated by none.

    Three answers show a car at 0, 0.8 and 1.6 m: the second repeats the first, and the third none.

    >>> east_m, scene = np.array([0.0, 0.8, 1.6]), np.zeros(3, dtype=int)
    >>> _repeated(np.arange(3), GroupedPlaces(scene, east_m, np.zeros(3)))
    array([False,  True, False])
    """
    pairs = near(places, places, NEAR_M)
    is_later = rank[pairs.ours] < rank[pairs.theirs]
    earlier, later, _ = rows_of(pairs, is_later & (pairs.distance_m2 < NEAR_M * NEAR_M))
    repeated = np.zeros(len(rank), dtype=bool)
    for of_rank in range(1, int(rank.max()) + 1):
        is_shown = (rank[later] == of_rank) & ~repeated[earlier]
        repeated[later[is_shown]] = True
    return repeated
