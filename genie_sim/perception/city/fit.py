"""Fits the laws of a detector on a real trace that was judged by KITTI's labels (``evaluation``)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from genie_sim.core.geometry import Array
from genie_sim.messages import CameraPose, Detection, Location
from genie_sim.perception.evaluation import LABELS, evaluate
from genie_sim.perception.trace import Trace, TraceFrame
from genie_sim.perception.truth import Truth

SCORE_EDGES_M = {"vehicles": (0, 12, 18, 24, 30, 40, 60), "persons": (0, 8, 10, 12, 20)}
PLACE_EDGES_M = {"vehicles": (0, 12, 18, 24, 32, 60), "persons": (0, 10, 20)}
QUANTILES = 21
DECIMALS = 4
GHOST_M = 2.0  # two wrong detections nearer than this are of one ghost
GHOST_SIGHTINGS = 3  # from so many on at one place they are of a lasting ghost
GHOST_VIEW_M = 45.0  # as far as a car is seen
LAGS_M = (0.0, 0.25, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
OBJECT_SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
LOOK_SHARES = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3)
SMOOTH_M = (3.0, 6.0, 12.0, 24.0)
REPLICATIONS = 20


class Look(NamedTuple):
    """One labelled object in one picture that counts: which one, from how far, and what the detector made of it.

    ``view_m`` is the coordinate of the gradual effect: the range less the way that the camera had gone. ``along_m``
    and ``across_m`` are the error of the place, away from the camera and to the left of it.
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


def looks(trace: Trace, truth: Truth, min_score: float = 0.3) -> dict[str, list[Look]]:
    """Every labelled object in every picture that counts, by group."""
    evaluation = evaluate(trace, truth, min_score)
    frames = {(camera, frame.index): frame for camera in trace.frames for frame in trace.frames[camera]}
    gone_m = _gone_m(trace)
    rows: dict[str, list[Look]] = {}
    for name, group in evaluation.groups.items():
        found = {id(j.label): j.detection for j in group.judged if j.label is not None}
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
                    Look(label.track, camera, pose, label.centre, range_m, view_m, detection, along_m, across_m)
                )
    return rows


def errors_m(
    detection: Detection | None, centre: Location, pose: CameraPose
) -> tuple[float, float] | tuple[None, None]:
    """How far behind an object's middle, as the camera sees it, and how far to the left of it a detection lies."""
    if detection is None or detection.location is None:
        return None, None
    sight = centre[0] - pose.east_m, centre[1] - pose.north_m
    off = detection.location[0] - centre[0], detection.location[1] - centre[1]
    range_m = math.hypot(*sight)
    along_m = (off[0] * sight[0] + off[1] * sight[1]) / range_m
    return along_m, (off[1] * sight[0] - off[0] * sight[1]) / range_m


def fit(trace: Trace, truth: Truth, ghost_truth: Truth, seed: int = 1) -> dict[str, Any]:
    """The laws of the trace's detector. ``ghost_truth`` must say which areas nobody labelled (``DontCare``)."""
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
    names = [look.detection.label for look in by_group["vehicles"] if look.detection is not None]
    return {
        "groups": groups,
        "ghosts": _ghosts(trace, ghost_truth, groups, seed),
        "vehicle_names": [[name, round(names.count(name) / len(names), DECIMALS)] for name in ("truck", "bus")],
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
    bins = [here for here in _binned(rows, SCORE_EDGES_M[name]) if any(look.detection for look in here)]
    centres_m = [round(float(np.mean([look.range_m for look in here])), DECIMALS) for here in bins]
    # Between two bins' middles the law is a straight line: regression on these lines, so that bins keep their means.
    ranges_m = [look.range_m for look in rows]
    parts = np.array([np.interp(ranges_m, centres_m, row) for row in np.eye(len(centres_m))]).T
    missed = np.array([look.detection is None for look in rows], dtype=float)
    miss = np.linalg.lstsq(parts, missed, rcond=None)[0]
    return {
        "range_m": centres_m,
        "looks": [len(here) for here in bins],
        "miss": [round(float(share), DECIMALS) for share in np.clip(miss, 0.005, 0.995)],
        "scores": [_quantiles([look.detection.score for look in here if look.detection]) for here in bins],
    }


def place_law(name: str, rows: Sequence[Look]) -> dict[str, Any]:
    """By range: the quantiles of the errors along the line of sight and across."""
    placed = [look for look in rows if look.along_m is not None]
    bins = [here for here in _binned(placed, PLACE_EDGES_M[name]) if here]
    return {
        "range_m": [round(float(np.mean([look.range_m for look in here])), DECIMALS) for here in bins],
        "looks": [len(here) for here in bins],
        "along_m": [_quantiles([look.along_m or 0.0 for look in here]) for here in bins],
        "across_m": [_quantiles([look.across_m or 0.0 for look in here]) for here in bins],
    }


def normal_scores(values: npt.ArrayLike, bins: npt.ArrayLike) -> Array:
    """Each value's rank within its bin as a standard normal number; equal values (misses) share the middle rank."""
    from scipy.stats import norm, rankdata

    values_, bins_ = np.asarray(values, dtype=float), np.asarray(bins)
    z = np.empty(len(values_))
    for k in np.unique(bins_):
        here = bins_ == k
        z[here] = norm.ppf((rankdata(values_[here]) - 0.5) / here.sum())
    z -= z.mean()
    scaled: Array = z / max(float(z.std()), 1e-9)
    return scaled


class Pairs:
    """All pairs of looks at one object, by the distance of their views; each object counts alike, however often it
    was seen."""

    def __init__(self, tracks: Array, views_m: Array) -> None:
        firsts, seconds, weights = [], [], []
        for track in np.unique(tracks):
            here = np.flatnonzero(tracks == track)
            a, b = np.triu_indices(len(here), 1)
            firsts.append(here[a])
            seconds.append(here[b])
            weights.append(np.full(len(a), 1.0 / len(here)))
        self._a, self._b, self._weights = map(np.concatenate, (firsts, seconds, weights))
        self._lag = np.digitize(np.abs(views_m[self._a] - views_m[self._b]), LAGS_M) - 1
        self._count = np.bincount(self._lag, self._weights, len(LAGS_M))

    def likeness(self, z: Array) -> Array:
        """Mean product of the normal scores of two looks at one object, for each of ``LAGS_M``; nan without pairs."""
        total = np.bincount(self._lag, self._weights * z[self._a] * z[self._b], len(LAGS_M))
        means: Array = np.divide(total, self._count, out=np.full(len(LAGS_M), np.nan), where=self._count > 0)
        return means


def _correlation(name: str, rows: Sequence[Look], seed: int) -> dict[str, float]:
    values = [look.detection.score if look.detection else 0.0 for look in rows]
    return fit_correlation(rows, values, SCORE_EDGES_M[name], seed)


def _place_correlation(name: str, rows: Sequence[Look], error: str, seed: int) -> dict[str, float]:
    placed = [look for look in rows if look.along_m is not None]
    return fit_correlation(placed, [getattr(look, error) for look in placed], PLACE_EDGES_M[name], seed)


def fit_correlation(
    rows: Sequence[Look],
    values: Sequence[float],
    edges_m: Sequence[float],
    seed: int,
    replications: int = REPLICATIONS,
) -> dict[str, float]:
    """The shares of the copula whose looks, made at the same places, are alike to the same degree as the real ones.

    ``values`` are scores (0: missed) or errors. Every combination of ``OBJECT_SHARES``, ``LOOK_SHARES`` and
    ``SMOOTH_M`` is simulated; the one nearest to the real likeness, in squares over ``LAGS_M``, is taken.
    """
    tracks = np.array([look.track for look in rows])
    views_m = np.array([look.view_m for look in rows])
    bins = np.digitize([look.range_m for look in rows], edges_m)
    pairs = Pairs(tracks, views_m)
    real = pairs.likeness(normal_scores(values, bins))
    missing = {k: float(np.mean(np.array(values)[bins == k] == 0.0)) for k in set(bins.tolist())}
    objects = np.searchsorted(np.unique(tracks), tracks)
    random = np.random.default_rng(seed)
    draws = random.standard_normal((replications, 3, len(rows)))
    best: tuple[float, dict[str, float]] = (math.inf, {})
    cut = np.array([NormalDist().inv_cdf(min(max(missing[k], 1e-9), 1 - 1e-9)) for k in bins.tolist()])
    for smooth_m in SMOOTH_M:
        gradual = _gradual(tracks, views_m, smooth_m, draws[:, 1])
        for of_object in OBJECT_SHARES:
            for of_look in LOOK_SHARES:
                of_view = 1 - of_object - of_look
                made = []
                for k in range(replications):
                    lasting = draws[k, 0][objects]
                    z = of_object**0.5 * lasting + of_view**0.5 * gradual[k] + of_look**0.5 * draws[k, 2]
                    z = np.where(z < cut, -9.0, z)
                    made.append(pairs.likeness(normal_scores(z, bins)))
                gap = float(np.nansum((np.mean(made, axis=0) - real) ** 2))
                if gap < best[0]:
                    shares = {"object": of_object, "view": round(of_view, DECIMALS), "smooth_m": smooth_m}
                    best = gap, shares
    return best[1]


def _gradual(tracks: Array, views_m: Array, smooth_m: float, draws: Array) -> Array:
    """Standard normal numbers (replications, looks), correlated by exp(-distance of views / smooth_m) per object."""
    made = np.empty_like(draws)
    for track in np.unique(tracks):
        here = np.flatnonzero(tracks == track)
        gaps = np.abs(views_m[here, None] - views_m[None, here])
        factor = np.linalg.cholesky(np.exp(-gaps / smooth_m) + 1e-9 * np.eye(len(here)))
        made[:, here] = draws[:, here] @ factor.T
    return made


def _ghosts(trace: Trace, truth: Truth, groups: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Wrong detections. Those that come back at a place are ghosts of that place, seen again and again as an object
    would be; the others are fleeting, anywhere in view, once."""
    evaluation = evaluate(trace, truth, 0.3)
    cameras = sorted({camera for camera, _ in truth.pictures})
    frames = [frame for camera in cameras for frame in trace.frames[camera]]
    way_m = sum(math.dist(a.pose[:2], b.pose[:2]) for a, b in pairwise(trace.frames[cameras[0]]))
    gone_m = _gone_m(trace)
    ghosts = {}
    for name in LABELS:
        wrong = {id(j.detection): j.detection for j in evaluation.groups[name].judged if j.label is None}
        sightings = [
            (frame, found, np.array(found.location[:2]))
            for frame in frames
            for found in frame.detections
            if id(found) in wrong and found.location is not None
        ]
        places: list[list[tuple[TraceFrame, Detection, Array]]] = []
        for sighting in sightings:
            near = [p for p in places if math.dist(p[0][2], sighting[2]) < GHOST_M]
            if near:
                near[0].append(sighting)
            else:
                places.append([sighting])
        lasting = [place for place in places if len(place) >= GHOST_SIGHTINGS]
        rows = []
        for number, place in enumerate(lasting):
            seen = {(frame.camera, frame.index): found for frame, found, _ in place}
            middle = np.mean([where for _, _, where in place], axis=0)
            for frame in frames:
                picture = (frame.camera, frame.index)
                range_m = math.dist(frame.pose[:2], middle)
                if picture in seen or _in_view(frame, middle):
                    view_m = range_m - gone_m[picture]
                    where = (float(middle[0]), float(middle[1]), 0.0)
                    found = seen.get(picture)
                    rows.append(Look(number, frame.camera, frame.pose, where, range_m, view_m, found, None, None))
        found_rows = [row.detection for row in rows if row.detection]
        fleeting = [found for found in wrong.values() if all(found is not kept for kept in found_rows)]
        edges_m = (0.0, GHOST_VIEW_M + 1)
        values = [row.detection.score if row.detection else 0.0 for row in rows]
        ghosts[name] = {
            "places": len(lasting),
            "per_100m": round(100 * len(lasting) / (way_m + GHOST_VIEW_M), DECIMALS),
            "fleeting_a_frame": round(len(fleeting) / len(frames), DECIMALS),
            "fleeting_range_m": _quantiles([math.dist(frame.pose[:2], where) for frame, _, where in sightings]),
            "fleeting_scores": _quantiles([d.score for d in fleeting]),
            "found": {
                "range_m": [round(float(np.mean([row.range_m for row in rows])), DECIMALS)],
                "looks": [len(rows)],
                "miss": [round(1 - len(found_rows) / len(rows), DECIMALS)],
                "scores": [_quantiles([found.score for found in found_rows])],
            },
            "score_correlation": fit_correlation(rows, values, edges_m, seed),
            **{key: groups[name][key] for key in ("place", "along_correlation", "across_correlation")},
        }
    return ghosts


def _in_view(frame: TraceFrame, place: Array) -> bool:
    east_m, north_m = place[0] - frame.pose.east_m, place[1] - frame.pose.north_m
    bearing = math.remainder(math.atan2(north_m, east_m) - frame.pose.heading_rad, 2 * math.pi)
    return abs(bearing) <= frame.horizontal_fov_rad / 2 and math.hypot(east_m, north_m) <= GHOST_VIEW_M
