"""The laws of a detector as they are measured on its looks, by hand."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from genie_sim.core.messages import Look
from genie_sim.tracks.laws import ASSUMED, FALSE_SHARE, DetectorLaws
from genie_sim.tracks.measure import SCORES, shrunk
from tests.make import seen
from tests.tracks.looks import look
from tools.make.count_looks import counted

PRIOR_LOOKS = 20


def measured(recordings: Iterable[Iterable[Look]]) -> DetectorLaws:
    """The laws of these looks, where the assumed ones weigh as much as a few."""
    return shrunk(counted(recordings), PRIOR_LOOKS)


def test_a_measured_law_knows_a_good_detector_from_a_bad_one():
    """Twenty objects that every look finds, or every other look; a false one now and then."""

    def looks(every: int) -> list[Look]:
        places = [(8.0 + 2.0 * (i // 4), -6.0 + 4.0 * (i % 4)) for i in range(8)]
        return [
            look(
                0.1 * t,
                *(seen(*at) for k, at in enumerate(places) if (t + k) % every == 0),
            )
            for t in range(60)
        ]

    good, bad = measured([looks(1)]), measured([looks(2)])
    assert good.detection(True, 12.0) > 0.95 > 0.75 > bad.detection(True, 12.0) > 0.4
    assert good.others == pytest.approx(ASSUMED.others), "no persons were seen"
    assert all(
        found == pytest.approx(known) for found, known in zip(measured([]), ASSUMED, strict=True)
    )


def looks_at(*objects: tuple[str, float, float]) -> list[Look]:
    """Ten looks a second at one object after the other, each far from the others: which looks found
    it (``"1"``), how far away it is, and its score.
    """
    looks: list[Look] = []
    for number, (pattern, range_m, score) in enumerate(objects):
        camera = (1_000.0 * number, 0.0)
        for found in pattern:
            car = seen(camera[0] + range_m, score=score)
            looks.append(look(0.1 * len(looks), *([car] if found == "1" else []), at=camera))
    return looks


FALSE_PRIOR = PRIOR_LOOKS * FALSE_SHARE / SCORES


def test_what_half_of_four_looks_find_again_is_real():
    laws = measured([looks_at(("11010", 10.0, 0.9))])
    assert laws.vehicles[1] == pytest.approx((2 + PRIOR_LOOKS * 0.9) / (4 + PRIOR_LOOKS))
    assert laws.firsts[9] == pytest.approx((1 + PRIOR_LOOKS * 0.9) / (1 + PRIOR_LOOKS))
    of_real = (2 + FALSE_PRIOR * ASSUMED.ratios[9]) / (4 + PRIOR_LOOKS)
    assert laws.ratios[9] == pytest.approx(of_real / (FALSE_PRIOR / PRIOR_LOOKS))


def test_what_a_quarter_of_four_looks_find_again_is_false():
    laws = measured([looks_at(("11000", 10.0, 0.3))])
    assert laws.vehicles == pytest.approx(ASSUMED.vehicles)
    assert laws.firsts[3] == pytest.approx(PRIOR_LOOKS * 0.3 / (1 + PRIOR_LOOKS))
    of_false = (1 + FALSE_PRIOR) / (4 + PRIOR_LOOKS)
    of_real = FALSE_PRIOR * ASSUMED.ratios[3] / PRIOR_LOOKS
    assert laws.ratios[3] == pytest.approx(of_real / of_false)


@pytest.mark.parametrize(
    "pattern",
    ["110100", "1101", "1000"],
    ids=["two of five looks find it again", "three looks", "three looks, none finds it"],
)
def test_what_is_neither_real_nor_false_does_not_count(pattern):
    for measured_law, assumed_law in zip(
        measured([looks_at((pattern, 10.0, 0.9))]), ASSUMED, strict=True
    ):
        assert measured_law == pytest.approx(assumed_law)
