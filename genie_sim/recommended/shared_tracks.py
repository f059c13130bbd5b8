"""Tracks that an edge shares with a car: what other cars saw, and what of it the car may believe.

An edge shares tracks that other cars saw, and a car believes in them only where its own cameras do
not say otherwise. It gets no track of itself, which others see: to it that is a false object.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from genie_sim.base.marks import Bounds, Share
from genie_sim.core.messages import CameraPose, Detection
from genie_sim.tracks.track import COAST_NS, MotionClass, kind_of
from genie_sim.tracks.track_map import FAST_DRIFT_M, TrackMap

SHARED = "shared"  # the source of what an edge tells a car of others' looks
SAME_SHARED_M = 2.0  # assumed: shared objects of a kind this near to each other are one
OLD_NS = 1_500_000_000  # assumed: what was seen longer ago is not believed in


@dataclass(frozen=True)
class SharingRules:
    """What edges share with cars of other cars' looks, and what cars believe of it. Assumed, but
    for ``gate``: what it keeps out was compared for errors of position on development drives.
    """

    p_min: Share = 0.5
    """An edge shares tracks that exist with at least this probability."""

    gate_m: Annotated[float, Bounds(minimum=0)] = 2.0
    """A shared object this near to one of the car's own of its kind is that one. At least twice the
    error of the cars' positions."""

    reach_m: Annotated[float, Bounds(above=0)] = 60.0
    """An edge shares with a car what is within this distance."""

    self_m: Annotated[float, Bounds(minimum=0)] = 4.0
    """What others saw this near to the car is the car itself."""

    seen_within_ns: Annotated[int, Bounds(above=0)] = 1_000_000_000
    """An edge shares tracks that another car has seen within this time."""


def tracks_to_share(
    tracks: TrackMap, *, car: str, pose: CameraPose, now_ns: int, rules: SharingRules
) -> Iterator[Detection]:
    """The tracks that an edge shares with a car whose camera stood at ``pose``.

    Parameters
    ----------
    tracks : TrackMap
        The edge's map.
    car : str
        The car that gets them; of what it saw itself it gets nothing.
    pose : CameraPose
        Where it is.
    now_ns : int
        The time for which places are predicted.
    rules : SharingRules
        What is shared.
    """
    # Far tracks are most of a map: the exact place of one that cannot be in reach is not needed.
    around_m = rules.reach_m + FAST_DRIFT_M
    for track in tracks:
        if (
            abs(track.east_m - pose.east_m) > around_m
            or abs(track.north_m - pose.north_m) > around_m
            or track.existence < rules.p_min  # which only sinks between looks
        ):
            continue
        others_ns = [stamp_ns for origin, stamp_ns in track.seen_by_ns.items() if origin != car]
        if not others_ns or now_ns - max(others_ns) > rules.seen_within_ns:
            continue
        probability = tracks.probability(track, now_ns)
        if probability < rules.p_min:
            continue
        east_m, north_m = track.place(now_ns)
        away_m = math.hypot(east_m - pose.east_m, north_m - pose.north_m)
        if not rules.self_m < away_m <= rules.reach_m:
            continue
        yield track.as_detection(now_ns, probability)


class SharedTracks:
    """What a car has got last of others' tracks: one list, which the next one replaces, apart from
    its own tracks (``own_tracks``).
    """

    def __init__(self, rules: SharingRules, own_tracks: TrackMap) -> None:
        self._rules = rules
        self._own_tracks = own_tracks
        self._objects: Sequence[Detection] = ()
        self._valid_ns = 0

    def replace(self, objects: Sequence[Detection], valid_ns: int) -> None:
        """A list came that holds for this time; an older one than the last is ignored."""
        if valid_ns >= self._valid_ns:
            self._objects, self._valid_ns = objects, valid_ns

    def believed(
        self, own_objects: Sequence[Detection], pose: CameraPose, now_ns: int
    ) -> list[Detection]:
        """The shared objects that the car believes beside its own, each at its predicted place.

        ``own_objects`` are those of the car's own map; ``pose`` is where its camera is.
        """
        objects: list[Detection] = []
        ahead_s = min(max(now_ns - self._valid_ns, 0), COAST_NS) * 1e-9
        for item in self._objects:
            if item.motion is None or item.location is None:
                continue
            seen_ns = item.motion.seen_in.stamp_ns
            if now_ns - seen_ns > OLD_NS:
                continue
            (east_mps, north_mps), (east_m, north_m, up_m) = item.motion.velocity_mps, item.location
            east_m, north_m = east_m + ahead_s * east_mps, north_m + ahead_s * north_mps
            kind = kind_of(item.label)
            if (
                math.hypot(east_m - pose.east_m, north_m - pose.north_m) <= self._rules.self_m
                or _is_near(own_objects, kind, east_m, north_m, within_m=self._rules.gate_m)
                or _is_near(objects, kind, east_m, north_m, within_m=SAME_SHARED_M)
                or self._own_tracks.contradicts(item.label, east_m, north_m, seen_ns)
            ):
                continue
            place = (east_m, north_m, up_m)
            # how old an answer is follows from the car's own looks: others' do not make it newer
            objects.append(replace(item, location=place, seen_in=None))
        return objects


def _is_near(
    objects: Iterable[Detection],
    kind: MotionClass,
    east_m: float,
    north_m: float,
    *,
    within_m: float,
) -> bool:
    """Whether one of the objects is of this kind and within a distance of a place."""
    return any(
        item.location is not None
        and kind_of(item.label) is kind
        and math.hypot(item.location[0] - east_m, item.location[1] - north_m) <= within_m
        for item in objects
    )
