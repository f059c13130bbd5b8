"""Fits the laws of a detector on a real trace, judged by KITTI's labels (``evaluation``)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from genie_sim.base.classes import GROUPS
from genie_sim.base.geometry import Array
from genie_sim.core.messages import CameraPose, Detection, Location
from genie_sim.data.kitti.drive_truth import PictureLabels
from genie_sim.data.trace import Trace, TraceFrame
from genie_sim.worlds.scene.objects import HORIZONTAL_FOV_RAD, REACHES_M
from genie_sim.worlds.town.rules import GHOST_BESIDE_M
from tools.make.evaluation import evaluate
from tools.make.town_fit.copula import fit_shares

SCORE_EDGES_M = {"vehicles": (0, 12, 18, 24, 30, 40, 60), "persons": (0, 8, 10, 12, 20)}
PLACE_EDGES_M = {"vehicles": (0, 12, 18, 24, 32, 60), "persons": (0, 10, 20)}
QUANTILES = 21
DECIMALS = 4
MIN_SIGHTINGS = 5  # of a place to which false positives come back
GHOST_M = 2.0  # two wrong detections nearer than this are of one ghost


class Look(NamedTuple):
    """One labelled object in one picture that counts: which one, from how far, and what the
    detector made of it.

    ``view_m`` is the coordinate of the gradual effect: the range less the way that the camera had
    gone. ``along_m`` and ``across_m`` are the error of the place, away from the camera and to the
    left of it.
    """

    track: int
    camera: str
    pose: CameraPose
    centre: Location
    range_m: float
    view_m: float
    detection: Detection | None
    along_m: float | None
    across_m: float | None


def looks(trace: Trace, truth: PictureLabels, min_score: float = 0.3) -> dict[str, list[Look]]:
    """Every labelled object in every picture that counts, by group."""
    evaluation = evaluate(trace, truth, min_score)
    frames = trace.by_picture
    gone_m = _gone_m(trace)
    rows: dict[str, list[Look]] = {}
    for name, group in evaluation.groups.items():
        found = {id(j.label): j.detection for j in group.detections if j.label is not None}
        rows[name] = []
        for (camera, index), labels in truth.pictures.items():
            pose = frames[camera, index].pose
            for label in labels:
                if not label.counts or label.group != name or label.centre is None:
                    continue
                east_m, north_m = label.centre[0] - pose.east_m, label.centre[1] - pose.north_m
                range_m = math.hypot(east_m, north_m)
                detection = found.get(id(label))
                along_m, across_m = errors_m(detection, label.centre, pose)
                view_m = range_m - gone_m[camera, index]
                rows[name].append(
                    Look(
                        track=label.track,
                        camera=camera,
                        pose=pose,
                        centre=label.centre,
                        range_m=range_m,
                        view_m=view_m,
                        detection=detection,
                        along_m=along_m,
                        across_m=across_m,
                    )
                )
    return rows


def errors_m(
    detection: Detection | None, centre: Location, pose: CameraPose
) -> tuple[float, float] | tuple[None, None]:
    """How far behind an object's middle, as the camera sees it, and how far to the left of it a
    detection lies.
    """
    if detection is None or detection.location is None:
        return None, None
    sight = centre[0] - pose.east_m, centre[1] - pose.north_m
    off = detection.location[0] - centre[0], detection.location[1] - centre[1]
    range_m = math.hypot(*sight)
    along_m = (off[0] * sight[0] + off[1] * sight[1]) / range_m
    return along_m, (off[1] * sight[0] - off[0] * sight[1]) / range_m


def fit(
    trace: Trace, truth: PictureLabels, ghost_truth: PictureLabels, seed: int = 1
) -> dict[str, Any]:
    """The laws of the trace's detector. ``ghost_truth`` must say which areas nobody labelled
    (``DontCare``).
    """
    by_group = looks(trace, truth)
    groups = {
        name: {
            "found": found_law(name, rows),
            "place": place_law(name, rows),
            "score_correlation": _correlation(name, rows, seed),
            "along_correlation": _place_correlation(name, rows, "along_m", seed),
            "across_correlation": _place_correlation(name, rows, "across_m", seed),
        }
        for name, rows in by_group.items()
    }
    return {
        "groups": groups,
        "ghosts": _ghosts(trace, ghost_truth, groups, seed),
        "vehicle_names": _names(by_group["vehicles"]),
    }


def _names(vehicles: Sequence[Look]) -> dict[str, Any]:
    """What the detector calls a vehicle that is no car to it: the share of vehicles to which that
    ever happens, and of the looks at these the share of each name.
    """
    names: dict[int, list[str]] = {}
    for look in vehicles:
        if look.detection is not None:
            names.setdefault(look.track, []).append(look.detection.label)
    prone = [name for one in names.values() if set(one) != {"car"} for name in one]
    return {
        "vehicles": len(names),
        "prone": round(sum(set(one) != {"car"} for one in names.values()) / len(names), DECIMALS),
        "names": [
            [name, round(prone.count(name) / max(len(prone), 1), DECIMALS)]
            for name in ("truck", "bus")
        ],
    }


def _gone_m(trace: Trace) -> dict[tuple[str, int], float]:
    """How far each camera had gone by each of its frames."""
    gone = {}
    for camera, frames in trace.frames.items():
        way_m = 0.0
        gone[camera, frames[0].index] = way_m
        for before, after in pairwise(frames):
            way_m += math.dist(before.pose[:2], after.pose[:2])
            gone[camera, after.index] = way_m
    return gone


def _binned(rows: Sequence[Look], edges_m: Sequence[float]) -> list[list[Look]]:
    return [[row for row in rows if low <= row.range_m < high] for low, high in pairwise(edges_m)]


def _quantiles(values: Sequence[float]) -> list[float]:
    return [round(float(q), DECIMALS) for q in np.quantile(values, np.linspace(0, 1, QUANTILES))]


def found_law(name: str, rows: Sequence[Look]) -> dict[str, Any]:
    """By range: the probability of a miss and the quantiles of the scores."""
    bins = [
        here for here in _binned(rows, SCORE_EDGES_M[name]) if any(look.detection for look in here)
    ]
    centres_m = [round(float(np.mean([look.range_m for look in here])), DECIMALS) for here in bins]
    # Between two bins' middles the law is a straight line: regression on these lines, so that bins
    # keep their means.
    ranges_m = [look.range_m for look in rows]
    parts = np.array([np.interp(ranges_m, centres_m, row) for row in np.eye(len(centres_m))]).T
    missed = np.array([look.detection is None for look in rows], dtype=float)
    miss = np.linalg.lstsq(parts, missed, rcond=None)[0]
    return {
        "range_m": centres_m,
        "looks": [len(here) for here in bins],
        "miss": [round(float(share), DECIMALS) for share in np.clip(miss, 0.005, 0.995)],
        "scores": [
            _quantiles([look.detection.score for look in here if look.detection]) for here in bins
        ],
    }


def place_law(name: str, rows: Sequence[Look]) -> dict[str, Any]:
    """By range: the quantiles of the errors along the line of sight and across."""
    placed = [look for look in rows if look.along_m is not None]
    bins = [here for here in _binned(placed, PLACE_EDGES_M[name]) if here]
    return {
        "range_m": [
            round(float(np.mean([look.range_m for look in here])), DECIMALS) for here in bins
        ],
        "looks": [len(here) for here in bins],
        "along_m": [_quantiles([look.along_m or 0.0 for look in here]) for here in bins],
        "across_m": [_quantiles([look.across_m or 0.0 for look in here]) for here in bins],
    }


def shares_of(
    rows: Sequence[Look], values: Sequence[float], edges_m: Sequence[float], seed: int, **how: int
) -> dict[str, float]:
    """The shares of the copula (``copula.fit_shares``) of these looks' scores or errors, ranked in
    bins of ranges.
    """
    tracks, views_m = (
        np.array([look.track for look in rows]),
        np.array([look.view_m for look in rows]),
    )
    bins = np.digitize([look.range_m for look in rows], edges_m)
    return fit_shares(tracks, views_m, bins, np.array(values), seed=seed, **how)


def _correlation(name: str, rows: Sequence[Look], seed: int) -> dict[str, float]:
    values = [look.detection.score if look.detection else 0.0 for look in rows]
    return shares_of(rows, values, SCORE_EDGES_M[name], seed)


def _place_correlation(name: str, rows: Sequence[Look], error: str, seed: int) -> dict[str, float]:
    placed = [look for look in rows if look.along_m is not None]
    return shares_of(placed, [getattr(look, error) for look in placed], PLACE_EDGES_M[name], seed)


# of a false positive: where it was placed (east, north) [m]
Sighting = tuple[TraceFrame, Detection, Array]


def _ghosts(
    trace: Trace, truth: PictureLabels, groups: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """False positives. Those that come back at a place are ghosts of that place, seen again and
    again as an object would be; the others are transient, anywhere in view, once.
    """
    evaluation = evaluate(trace, truth, 0.3)
    cameras = sorted({camera for camera, _ in truth.pictures})
    frames = [frame for camera in cameras for frame in trace.frames[camera]]
    gone_m = _gone_m(trace)
    ghosts = {}
    for name, labels in GROUPS.items():
        reach_m = REACHES_M[labels[0]]
        wrong = {
            id(j.detection): j.detection
            for j in evaluation.groups[name].detections
            if j.label is None
        }
        sightings = [
            (frame, found, np.array(found.location[:2]))
            for frame in frames
            for found in frame.detections
            if id(found) in wrong and found.location is not None
        ]
        lasting = _lasting_places(sightings)
        rows = [
            look
            for number, place in enumerate(lasting)
            for look in _looks(number, place, frames, reach_m=reach_m, gone_m=gone_m)
        ]
        came_back = [row.detection for row in rows if row.detection]
        transient = [
            found for found in wrong.values() if all(found is not kept for kept in came_back)
        ]
        ghosts[name] = {
            "fleeting_a_frame": round(len(transient) / len(frames), DECIMALS),
            "fleeting_range_m": _quantiles(
                [math.dist(frame.pose[:2], where) for frame, _, where in sightings]
            ),
            "fleeting_scores": _quantiles([found.score for found in transient]),
            "places": len(lasting),
        }
        if lasting:
            per_100m = round(100 * len(rows) / len(frames) / _street_in_view_m(reach_m), DECIMALS)
            ghosts[name] |= {"per_100m": per_100m, **_ghost_law(rows, came_back, seed)}
            ghosts[name] |= {
                key: groups[name][key]
                for key in ("place", "along_correlation", "across_correlation")
            }
    return ghosts


def _lasting_places(sightings: Sequence[Sighting]) -> list[list[Sighting]]:
    """The sightings of each place to which false positives come back, ``MIN_SIGHTINGS`` times or
    more.
    """
    places: list[list[Sighting]] = []
    for sighting in sightings:
        near = [place for place in places if math.dist(place[0][2], sighting[2]) < GHOST_M]
        if near:
            near[0].append(sighting)
        else:
            places.append([sighting])
    return [place for place in places if len(place) >= MIN_SIGHTINGS]


def _looks(
    number: int,
    place: Sequence[Sighting],
    frames: Sequence[TraceFrame],
    *,
    reach_m: float,
    gone_m: Mapping[tuple[str, int], float],
) -> Iterator[Look]:
    """Every frame that has a ghost's place in view, as a look at it.

    Parameters
    ----------
    number : of the place
    place : the ghost's sightings there
    frames : all frames
    reach_m : from how far away it can be seen
    gone_m : how far each camera had gone by each frame
    """
    detections = {(frame.camera, frame.index): detection for frame, detection, _ in place}
    middle = np.mean([location for _, _, location in place], axis=0)
    for frame in frames:
        picture = (frame.camera, frame.index)
        if picture in detections or _in_view(frame, middle, reach_m):
            range_m = math.dist(frame.pose[:2], middle)
            yield Look(
                track=number,
                camera=frame.camera,
                pose=frame.pose,
                centre=(float(middle[0]), float(middle[1]), 0.0),
                range_m=range_m,
                view_m=range_m - gone_m[picture],
                detection=detections.get(picture),
                along_m=None,
                across_m=None,
            )


def _ghost_law(rows: Sequence[Look], came_back: Sequence[Detection], seed: int) -> dict[str, Any]:
    """How often and with which scores ghosts are seen again, at any range."""
    values = [row.detection.score if row.detection else 0.0 for row in rows]
    return {
        "found": {
            "range_m": [round(float(np.mean([row.range_m for row in rows])), DECIMALS)],
            "looks": [len(rows)],
            "miss": [round(1 - len(came_back) / len(rows), DECIMALS)],
            "scores": [_quantiles([found.score for found in came_back])],
        },
        "score_correlation": shares_of(rows, values, (0.0, math.inf), seed),
    }


def _street_in_view_m(reach_m: float) -> float:
    """How much of a town's street a camera sees the ghosts of, which stand ``GHOST_BESIDE_M`` from
    its middle.
    """
    return math.sqrt(reach_m**2 - GHOST_BESIDE_M**2) - GHOST_BESIDE_M / math.tan(
        HORIZONTAL_FOV_RAD / 2
    )


def _in_view(frame: TraceFrame, place: Array, reach_m: float) -> bool:
    east_m, north_m = place[0] - frame.pose.east_m, place[1] - frame.pose.north_m
    bearing = math.remainder(math.atan2(north_m, east_m) - frame.pose.heading_rad, 2 * math.pi)
    return abs(bearing) <= frame.horizontal_fov_rad / 2 and math.hypot(east_m, north_m) <= reach_m
