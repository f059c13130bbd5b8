"""The laws of a detector that existence needs: how often it finds what is there, and what its
scores are worth.
"""

from collections.abc import Sequence
from typing import NamedTuple

RANGE_STEP_M, SCORE_STEP = 10.0, 0.1
# As Autoware's tracker assumes: how often a detector finds something again where nothing is.
FALSE_SHARE = 0.2


class DetectorLaws(NamedTuple):
    """Tables with straight lines between their entries.

    ``vehicles`` and ``others``: the share of looks at an object that find it, at 0, 10, 20 ... m.
    ``ratios``: how much likelier it is to find an object with a score if it is there than if it is
    not, and ``firsts``: how likely something found for the first time exists; both for scores of 0,
    0.1 ... 1.
    """

    vehicles: Sequence[float]
    others: Sequence[float]
    ratios: Sequence[float]
    firsts: Sequence[float]

    def detection(self, vehicle: bool, range_m: float) -> float:
        """How likely a look at an object finds it."""
        return _between(self.vehicles if vehicle else self.others, range_m / RANGE_STEP_M)

    def ratio(self, score: float) -> float:
        """Likelihood ratio of a detection with this score: the object exists, or does not."""
        return _between(self.ratios, score / SCORE_STEP)

    def first(self, score: float) -> float:
        """How likely an object exists that was found for the first time."""
        return _between(self.firsts, score / SCORE_STEP)


def _between(table: Sequence[float], place: float) -> float:
    i = min(int(place), len(table) - 2)
    return table[i] + (table[i + 1] - table[i]) * min(place - i, 1.0)


def _assumed_found(near: float) -> tuple[float, ...]:
    """Assumed: falls from 20 m on, in a straight line, to a fifth."""
    return tuple(
        max(0.2, near * min(1.0, 1.0 - (range_m - 20.0) / 30.0)) for range_m in range(0, 61, 10)
    )


_TENTHS = tuple(i / 10 for i in range(11))
ASSUMED = DetectorLaws(
    _assumed_found(0.9),
    _assumed_found(0.8),
    tuple(0.9 * score / FALSE_SHARE for score in _TENTHS),
    _TENTHS,
)
