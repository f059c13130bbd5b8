"""Counts what a detector found, without labels: what its laws are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from genie_sim.core.messages import Header, Look
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.laws import ASSUMED, RANGE_STEP_M, SCORE_STEP
from genie_sim.tracks.measure import SCORES, LawCounts
from genie_sim.tracks.track import COAST_NS, VEHICLE, Track
from genie_sim.tracks.track_map import TrackMap

MIN_LOOKS = 4  # at an object after the first, to tell whether it is real
# share of those looks that found it: what is real has at least, what is not at most
REAL_SHARE, FALSE_SHARE = 0.5, 0.25
RANGES = len(ASSUMED.vehicles)
NEVER_NS = 2**62


@dataclass
class _Record:
    """One track: the scores with which it was found, and the ranges of its looks with whether they
    found it.
    """

    vehicle: bool
    scores: list[float] = field(default_factory=list)
    looks: list[tuple[float, bool]] = field(default_factory=list)

    def found_share(self) -> float:
        """The share of the looks that found it."""
        return sum(found for _, found in self.looks) / len(self.looks)


class _Census(ExistenceFilter):
    """Expires no track for what looks miss, and logs every look at it."""

    def __init__(self) -> None:
        super().__init__()
        self.records: dict[int, _Record] = {}

    def expires_ns(self, track: Track) -> int:
        return track.seen_ns + COAST_NS if track.moving else NEVER_NS

    def confirm(self, track: Any, score: float, header: Header) -> None:
        record = self.records.setdefault(track.number, _Record(track.kind is VEHICLE))
        if record.scores:
            record.looks.append((track.range_m, True))
        record.scores.append(score)

    def doubt(self, track: Any, range_m: float, header: Header) -> None:
        self.records[track.number].looks.append((range_m, False))


def counted(recordings: Iterable[Iterable[Look]]) -> LawCounts:
    """What these looks of a detector come to: of each recording those of one camera, in order of
    time.

    Everything found is tracked. What at least half of the looks at it found again is taken for
    real, what at most a quarter did for false; others, and what was looked at fewer than four
    times, do not count. Objects that were never found leave no trace, so the laws hold for those
    that have been found once, which are those that a map asks about.
    """
    records: list[_Record] = []
    for looks in recordings:
        census = _Census()
        tracks = TrackMap(census)
        for look in looks:
            tracks.learn(look, look.header.stamp_ns)
        records += census.records.values()
    often = [record for record in records if len(record.looks) >= MIN_LOOKS]
    real = [record for record in often if record.found_share() >= REAL_SHARE]
    false = [record for record in often if record.found_share() <= FALSE_SHARE]
    of_vehicles = [look for record in real if record.vehicle for look in record.looks]
    of_others = [look for record in real if not record.vehicle for look in record.looks]
    return LawCounts(
        vehicle_looks=_by_range(range_m for range_m, _ in of_vehicles),
        vehicles_found=_by_range(range_m for range_m, found in of_vehicles if found),
        other_looks=_by_range(range_m for range_m, _ in of_others),
        others_found=_by_range(range_m for range_m, found in of_others if found),
        real_looks=sum(len(record.looks) for record in real),
        real_scores=_by_score(score for record in real for score in record.scores[1:]),
        real_firsts=_by_score(record.scores[0] for record in real),
        false_looks=sum(len(record.looks) for record in false),
        false_scores=_by_score(score for record in false for score in record.scores[1:]),
        false_firsts=_by_score(record.scores[0] for record in false),
    )


def _by_range(ranges_m: Iterable[float]) -> list[int]:
    """How many there are of each 10 m, up to 60 m."""
    places = [round(range_m / RANGE_STEP_M) for range_m in ranges_m]
    return [places.count(place) for place in range(RANGES)]


def _by_score(scores: Iterable[float]) -> list[int]:
    """How many there are of each tenth."""
    places = [round(score / SCORE_STEP) for score in scores]
    return [places.count(place) for place in range(SCORES)]
