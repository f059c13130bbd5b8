"""The laws of a detector that follow from counts (``tools/make/count_looks.py`` makes them)."""

from collections.abc import Sequence
from typing import NamedTuple

from genie_sim.tracks.laws import ASSUMED, FALSE_SHARE, DetectorLaws

SCORES = len(ASSUMED.ratios)


class LawCounts(NamedTuple):
    """What looks of a detector come to: at real vehicles and others by range, at 0, 10, 20 ... m,
    how many looks there were and how many found the object; at what is real and what is false, how
    many looks, how many found it with a score of 0, 0.1 ... 1, and of how many that was the first.
    """

    vehicle_looks: Sequence[int]
    vehicles_found: Sequence[int]
    other_looks: Sequence[int]
    others_found: Sequence[int]
    real_looks: int
    real_scores: Sequence[int]
    real_firsts: Sequence[int]
    false_looks: int
    false_scores: Sequence[int]
    false_firsts: Sequence[int]


def total(counts: Sequence[LawCounts]) -> LawCounts:
    """The counts of several drives together."""
    return LawCounts._make(
        sum(of_drives)
        if isinstance(of_drives[0], int)
        else [sum(entries) for entries in zip(*of_drives, strict=True)]
        for of_drives in zip(*counts, strict=True)
    )


def shrunk(counts: LawCounts, prior_looks: float) -> DetectorLaws:
    """The laws that counts come to, shrunk towards the assumed ones: these weigh as much as so many
    looks in every entry, so that where little was seen they stay.
    """
    return DetectorLaws(
        vehicles=_shares(
            counts.vehicles_found, counts.vehicle_looks, ASSUMED.vehicles, prior_looks
        ),
        others=_shares(counts.others_found, counts.other_looks, ASSUMED.others, prior_looks),
        ratios=_ratios(counts, prior_looks),
        firsts=_shares(
            counts.real_firsts,
            [sum(pair) for pair in zip(counts.real_firsts, counts.false_firsts, strict=True)],
            ASSUMED.firsts,
            prior_looks,
        ),
    )


def _shares(
    hits: Sequence[int], looks: Sequence[int], priors: Sequence[float], prior_looks: float
) -> tuple[float, ...]:
    """Found by looks, entry by entry."""
    return tuple(
        (of_found + prior_looks * prior) / (of_looks + prior_looks)
        for of_found, of_looks, prior in zip(hits, looks, priors, strict=True)
    )


def _ratios(counts: LawCounts, prior_looks: float) -> tuple[float, ...]:
    """How likely a look finds a real object with such a score, over how likely it finds a false
    one.
    """
    real_looks, false_looks = counts.real_looks + prior_looks, counts.false_looks + prior_looks
    false_prior = prior_looks * FALSE_SHARE / SCORES
    return tuple(
        (of_real + false_prior * prior) / real_looks * false_looks / (of_false + false_prior)
        for of_real, of_false, prior in zip(
            counts.real_scores, counts.false_scores, ASSUMED.ratios, strict=True
        )
    )
