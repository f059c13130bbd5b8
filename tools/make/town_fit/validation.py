"""The town's detector beside the real one: the same true objects, seen from the same places."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from genie_sim.base.classes import GROUPS
from genie_sim.worlds.scene.detector import SyntheticDetector
from genie_sim.worlds.scene.keys import mix
from genie_sim.worlds.scene.laws import MAX_VIEW_M, FittedLaws
from genie_sim.worlds.scene.objects import ObjectColumns
from genie_sim.worlds.scene.view import PlacedObjects, ViewPoses, in_view
from tools.make.town_fit.fit import SCORE_EDGES_M, Look, errors_m


def resimulate(laws: FittedLaws, group: str, looks: Sequence[Look], seed: int) -> list[Look]:
    """The same looks by the town's detector: what it finds, how sure it is, and where it puts it.

    Left out are looks at what the town's camera does not have in view: nearer than 3.5 m, its
    middle outside the picture, or a small object of its group from too far away.
    """
    label, again = GROUPS[group][0], []
    poses = [look.pose for look in looks]
    objects = ObjectColumns(
        [label] * len(looks),
        [look.track for look in looks],
        [True] * len(looks),
        laws=laws,
        seed_key=mix(seed),
    )
    each = np.arange(len(looks))
    still = np.zeros(len(looks), dtype=bool)
    east_m, north_m = np.array([look.centre[:2] for look in looks]).T
    pictures = [
        mix(
            seed
            ^ mix(round(pose.east_m * 1000) ^ mix(round(pose.north_m * 1000) ^ int(look.camera)))
        )
        for look, pose in zip(looks, poses, strict=True)
    ]
    turned = ([turn(pose.heading_rad) for pose in poses] for turn in (math.cos, math.sin))
    at = (
        np.array(column)
        for column in ([p.east_m for p in poses], [p.north_m for p in poses], *turned)
    )
    view_poses = ViewPoses(*at, t_s=np.zeros(len(looks)), key=np.array(pictures, dtype=np.uint64))
    candidates = PlacedObjects(each, each, still, east_m=east_m, north_m=north_m)
    visible = in_view(view_poses, candidates, objects, MAX_VIEW_M)
    detector = SyntheticDetector(objects, laws, on_grid=True)
    detected = detector.detect(visible, view_poses)
    for number in visible.slot.tolist():
        look = looks[number]
        detection = next(iter(detected.detections(number)), None)
        along_m, across_m = errors_m(detection, look.centre, look.pose)
        again.append(look._replace(detection=detection, along_m=along_m, across_m=across_m))
    return again


def distance(a: Iterable[float], b: Iterable[float]) -> float:
    """The Kolmogorov-Smirnov distance of two samples: the largest gap between their distribution
    functions.
    """
    a_, b_ = np.sort(list(a)), np.sort(list(b))
    at = np.concatenate([a_, b_])
    shares = [np.searchsorted(sample, at, side="right") / len(sample) for sample in (a_, b_)]
    return float(np.abs(shares[0] - shares[1]).max())


def scores(looks: Iterable[Look]) -> list[float]:
    return [look.detection.score for look in looks if look.detection is not None]


def errors(looks: Iterable[Look], name: str) -> list[float]:
    """``along_m`` or ``across_m`` of all that was placed."""
    return [getattr(look, name) for look in looks if getattr(look, name) is not None]


def found_share(looks: Sequence[Look]) -> float:
    return sum(look.detection is not None for look in looks) / len(looks)


def changes(looks: Sequence[Look]) -> float:
    """How often an object that one picture shows is found in it and missed in the next, or the
    other way round.
    """
    rows: dict[tuple[int, str], list[bool]] = {}
    for look in looks:
        rows.setdefault((look.track, look.camera), []).append(look.detection is not None)
    pairs = [pair for row in rows.values() for pair in pairwise(row)]
    return sum(a != b for a, b in pairs) / len(pairs)


def table(laws: FittedLaws, looks: Mapping[str, Sequence[Look]], replications: int = 40) -> str:
    """The comparison as a Markdown table; the town's figures are of so many replications (seeds
    from 0 on).
    """
    text = [
        "| | looks | found | score | along | across | changes | independent |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for group, real in looks.items():
        again = [resimulate(laws, group, real, seed) for seed in range(replications)]
        made = [look for one in again for look in one]
        rows = [
            ("real", len(real), found_share(real), None, None, None, changes(real), None),
            (
                "town",
                len(made) // replications,
                found_share(made),
                distance(scores(real), scores(made)),
                *(
                    distance(errors(real, name), errors(made, name))
                    for name in ("along_m", "across_m")
                ),
                sum(map(changes, again)) / replications,
                independent_changes(group, real),
            ),
        ]
        for who, count, *figures in rows:
            cells = ["-" if figure is None else f"{figure:.3f}" for figure in figures]
            text.append(f"| {group}, {who} | {count} | {' | '.join(cells)} |")
    return "\n".join(text) + "\n"


def independent_changes(group: str, looks: Sequence[Look]) -> float:
    """How often found and missed would change if every look were independent, at the shares found
    in each bin.
    """
    bins = np.digitize([look.range_m for look in looks], SCORE_EDGES_M[group])
    found = np.array([look.detection is not None for look in looks])
    shares = [found[bins == k].mean() for k in bins]
    return float(np.mean([2 * share * (1 - share) for share in shares]))
