"""Measures a detector's laws on what it found, without labels."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from genie_sim.core.freshness.laws import ASSUMED, RANGE_STEP_M, SCORE_STEP, DetectorLaws
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.messages import Header, Look
from genie_sim.core.recommended.track_map import TrackMap
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.tracking import VEHICLE

MIN_LOOKS = 4  # at an object after the first, to tell whether it is real
# share of those looks that found it: what is real has at least, what is not at most
REAL_SHARE, FALSE_SHARE = 0.5, 0.25
PRIOR_LOOKS = 20.0  # that the assumed laws count for: where little was seen they stay
PRIOR_FALSE_SHARE = 0.2
SCORES = len(ASSUMED.ratios)


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


class _Census(Tracks):
    """Never expires a track for what looks miss, and logs every look at it."""

    def __init__(self) -> None:
        super().__init__()
        self.records: dict[int, _Record] = {}

    def seen(self, track: Any, score: float, header: Header) -> None:
        record = self.records.setdefault(track.number, _Record(track.kind is VEHICLE))
        if record.scores:
            record.looks.append((track.range_m, True))
        record.scores.append(score)

    def unseen(self, track: Any, range_m: float, header: Header) -> None:
        self.records[track.number].looks.append((range_m, False))


def measured(recordings: Iterable[Iterable[Look]]) -> DetectorLaws:
    """The laws of the detector that made these looks: of each recording those of one camera, in
    order of time.

    Everything found is tracked. What at least half of the looks at it found again is taken for
    real, what at most a quarter did for false; others, and what was looked at fewer than four
    times, do not count. Found are the real ones by range; scores are compared between real and
    false. The assumed laws count as twenty looks each, so that where the recording shows little
    they stay. Objects that were never found leave no trace, so the laws hold for those that have
    been found once, which are those that a map asks about.
    """
    records: list[_Record] = []
    for looks in recordings:
        census = _Census()
        tracks = TrackMap(ObjectMapRules(), census)
        for look in looks:
            tracks.count(look, look.header.stamp_ns)
        records += census.records.values()
    often = [record for record in records if len(record.looks) >= MIN_LOOKS]
    real = [record for record in often if record.found_share() >= REAL_SHARE]
    false = [record for record in often if record.found_share() <= FALSE_SHARE]
    vehicles = [record for record in real if record.vehicle]
    others = [record for record in real if not record.vehicle]
    return DetectorLaws(
        vehicles=_found_by_range(vehicles, ASSUMED.vehicles),
        others=_found_by_range(others, ASSUMED.others),
        ratios=_ratios(real, false),
        firsts=_firsts(real, false),
    )


def _found_by_range(records: list[_Record], assumed: Iterable[float]) -> tuple[float, ...]:
    """The share of looks that found the object, at 0, 10, 20 ... m."""
    looks: Counter[int] = Counter()
    hits: Counter[int] = Counter()
    for record in records:
        for range_m, found in record.looks:
            place = round(range_m / RANGE_STEP_M)
            looks[place] += 1
            hits[place] += found
    return tuple(
        (hits[place] + PRIOR_LOOKS * prior) / (looks[place] + PRIOR_LOOKS)
        for place, prior in enumerate(assumed)
    )


def _ratios(real: list[_Record], false: list[_Record]) -> tuple[float, ...]:
    """How likely a look finds a real object with such a score, over how likely it finds a false
    one.
    """
    real_scores = _by_score(score for record in real for score in record.scores[1:])
    false_scores = _by_score(score for record in false for score in record.scores[1:])
    real_looks = sum(len(record.looks) for record in real) + PRIOR_LOOKS
    false_looks = sum(len(record.looks) for record in false) + PRIOR_LOOKS
    false_prior = PRIOR_LOOKS * PRIOR_FALSE_SHARE / SCORES
    ratios = []
    for score, prior in enumerate(ASSUMED.ratios):
        of_real = (real_scores[score] + false_prior * prior) / real_looks
        of_false = (false_scores[score] + false_prior) / false_looks
        ratios.append(of_real / of_false)
    return tuple(ratios)


def _firsts(real: list[_Record], false: list[_Record]) -> tuple[float, ...]:
    """Which share of what was found with such a score for the first time was real."""
    right = _by_score(record.scores[0] for record in real)
    wrong = _by_score(record.scores[0] for record in false)
    return tuple(
        (right[score] + PRIOR_LOOKS * prior) / (right[score] + wrong[score] + PRIOR_LOOKS)
        for score, prior in enumerate(ASSUMED.firsts)
    )


def _by_score(scores: Iterable[float]) -> Counter[int]:
    """How many there are of each tenth."""
    return Counter(round(score / SCORE_STEP) for score in scores)
