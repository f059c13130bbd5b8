"""Measures a detector's laws on what it found, without labels."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from genie_sim.core.freshness.laws import ASSUMED, RANGE_STEP_M, SCORE_STEP, DetectorLaws
from genie_sim.core.freshness.track import Tracks
from genie_sim.core.rules import ObjectMapRules
from genie_sim.core.track_map import TrackMap
from genie_sim.core.tracking import VEHICLE
from genie_sim.messages import Header, Look

FEWEST = 4  # looks at an object after the first, to tell whether it is real
REAL, FALSE = 0.5, 0.25  # share of those that found it: at least, at most
WORTH = 20.0  # looks that the assumed laws count for: where little was seen they stay
SCORES = len(ASSUMED.ratios)


@dataclass
class _Record:
    """One track: the scores with which it was found, and the ranges of its looks with whether they found it."""

    vehicle: bool
    scores: list[float] = field(default_factory=list)
    looks: list[tuple[float, bool]] = field(default_factory=list)


class _Census(Tracks):
    """Believes in everything and keeps a record of every track."""

    def __init__(self) -> None:
        super().__init__()
        self.records: dict[int, _Record] = {}

    def seen(self, one: Any, score: float, header: Header) -> None:
        record = self.records.setdefault(one.number, _Record(one.kind is VEHICLE))
        if record.scores:
            record.looks.append((one.range_m, True))
        record.scores.append(score)

    def unseen(self, one: Any, range_m: float, header: Header) -> None:
        self.records[one.number].looks.append((range_m, False))


def measured(looks: Iterable[Look]) -> DetectorLaws:
    """The laws of the detector that made these looks, those of one camera in order of time.

    Everything found is tracked. What at least half of the looks at it found again is taken for real, what at most a
    quarter did for false; others, and what was looked at fewer than four times, do not count. Found are the real ones
    by range; scores are compared between real and false. The assumed laws count as twenty looks each, so that where the
    recording shows little they stay. Objects that were never found leave no trace, so the laws hold for those that have
    been found once, which are those that a map asks about.
    """
    census = _Census()
    tracks = TrackMap(ObjectMapRules(), census)
    for look in looks:
        tracks.look(look, look.header.stamp_ns)
    real, false = [], []
    for record in census.records.values():
        if len(record.looks) >= FEWEST:
            share = sum(found for _, found in record.looks) / len(record.looks)
            if share >= REAL:
                real.append(record)
            elif share <= FALSE:
                false.append(record)
    return DetectorLaws(
        _found([one for one in real if one.vehicle], ASSUMED.vehicles),
        _found([one for one in real if not one.vehicle], ASSUMED.others),
        _ratios(real, false),
        _firsts(real, false),
    )


def _found(records: list[_Record], assumed: Iterable[float]) -> tuple[float, ...]:
    looked = [
        (min(round(range_m / RANGE_STEP_M), 9), found)
        for one in records
        for range_m, found in one.looks
    ]
    looks, hits = (
        Counter(place for place, _ in looked),
        Counter(place for place, found in looked if found),
    )
    return tuple((hits[i] + WORTH * prior) / (looks[i] + WORTH) for i, prior in enumerate(assumed))


def _ratios(real: list[_Record], false: list[_Record]) -> tuple[float, ...]:
    """How likely a look finds a real object with such a score, over how likely it finds a false one."""
    of_real, of_false = (
        _by_score(score for one in each for score in one.scores[1:]) for each in (real, false)
    )
    real_looks, false_looks = (sum(len(one.looks) for one in each) for each in (real, false))
    false_prior, ratios = WORTH * 0.2 / SCORES, []
    for i, prior in enumerate(ASSUMED.ratios):
        true = (of_real[i] + false_prior * prior) / (real_looks + WORTH)
        ratios.append(true / ((of_false[i] + false_prior) / (false_looks + WORTH)))
    return tuple(ratios)


def _firsts(real: list[_Record], false: list[_Record]) -> tuple[float, ...]:
    """Which share of what was found with such a score for the first time was real."""
    right, wrong = (_by_score(one.scores[0] for one in each) for each in (real, false))
    return tuple(
        (right[i] + WORTH * prior) / (right[i] + wrong[i] + WORTH)
        for i, prior in enumerate(ASSUMED.firsts)
    )


def _by_score(scores: Iterable[float]) -> Counter[int]:
    """How many there are of each tenth."""
    return Counter(round(score / SCORE_STEP) for score in scores)
