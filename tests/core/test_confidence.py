"""Algorithm 2, line 5, under four readings: what one more sighting does to the confidence of a
stored object.
"""

from __future__ import annotations

import pytest

from genie_sim.core.confidence import CONFIDENCE_RULES, ema, literal, noisy_or, positive_part
from tests.core.conformance import ConfidenceRuleConformance


class TestNoisyOr(ConfidenceRuleConformance):
    rule = staticmethod(noisy_or)


class TestLiteral(ConfidenceRuleConformance):
    rule = staticmethod(literal)
    stronger_sightings_help = False  # as printed


class TestEma(ConfidenceRuleConformance):
    rule = staticmethod(ema)


class TestPositivePart(ConfidenceRuleConformance):
    rule = staticmethod(positive_part)


def test_every_rule_is_held_to_the_conformance_tests():
    tested = {one.rule for one in ConfidenceRuleConformance.__subclasses__()}
    assert set(CONFIDENCE_RULES.values()) <= tested


@pytest.mark.parametrize(
    ("rule", "weaker", "stronger"),
    [
        (noisy_or, 0.5 + 0.1 * 0.3 * 0.5, 0.5 + 0.1 * 0.9 * 0.5),
        (literal, 0.5 + 0.1 * 0.2, 0.5 - 0.1 * 0.4),
        (ema, 0.5 - 0.1 * 0.2, 0.5 + 0.1 * 0.4),
        (positive_part, 0.5, 0.5 + 0.1 * 0.4),
    ],
)
def test_a_sighting_of_an_object_stored_with_one_half(rule, weaker, stronger):
    """Seen with 0.3, or with 0.9, at lambda = 0.1."""
    assert rule(0.5, 0.3, 0.1) == pytest.approx(weaker)
    assert rule(0.5, 0.9, 0.1) == pytest.approx(stronger)


def test_the_printed_rule_lets_the_confidence_of_a_shared_object_diverge():
    """Section III-D: "even with an initial low score, many cars will see and recognize it". Here
    0.3, then 0.5 each.
    """
    confidences = dict.fromkeys(CONFIDENCE_RULES, 0.3)
    for _ in range(100):
        confidences = {name: CONFIDENCE_RULES[name](c, 0.5, 0.1) for name, c in confidences.items()}
    assert confidences["literal"] == 0.0
    assert confidences["ema"] == confidences["positive_part"] == pytest.approx(0.5, abs=1e-4)
    assert confidences["noisy_or"] > 0.99
