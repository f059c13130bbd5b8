"""The verdicts: what counts as a match, as faster, as an order; and when a verdict hangs on the seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.paper import table1
from genie_sim.paper.checks import ALL, CHECKS, load_claims
from genie_sim.paper.claims import VERDICTS, holds_under, judge, judge_one, verdict_of
from genie_sim.paper.evidence import Evidence, Finding, all_positive, below, interval, matches

CLAIMS = {claim.id: claim for claim in load_claims()}
KINDS = {"input", "near_input", "calibrated", "prediction", "invariant", "table"}


def evidence(seeds=10, noise=0.0, **facts):
    """Six scenarios with the same facts for every seed, each with some spread; ``image_reuse__car`` is a fact."""
    spread = noise * np.linspace(-1, 1, seeds)
    named = {name.replace("__", ":"): value for name, value in facts.items()}
    return Evidence({("base", s): [{k: v + e for k, v in named.items()} for e in spread] for s in ALL})


def test_every_claim_has_a_test_and_every_test_a_claim():
    assert list(CHECKS) == list(CLAIMS) == [f"C{number}" for number in range(1, 40)]
    assert {claim.kind for claim in CLAIMS.values()} == KINDS


def test_exactly_the_two_fitted_numbers_are_calibrated():
    assert [claim.id for claim in CLAIMS.values() if claim.kind == "calibrated"] == ["C11", "C13"]


def test_a_match_is_an_interval_inside_the_tolerance():
    tight, wide = np.array([0.80, 0.81, 0.82, 0.83]), np.array([0.70, 0.78, 0.86, 0.94])
    assert interval(wide)[0] == pytest.approx(0.82)
    assert matches(tight, 0.82, 0.05).holds
    assert not matches(wide, 0.82, 0.05).holds, "the mean fits exactly, but nobody knows it well enough"


def test_the_interval_is_student_s():
    """Four values, standard deviation 0.0129: t(0.975, 3) = 3.182 standard errors each side."""
    mean, low, high = interval(np.array([0.80, 0.81, 0.82, 0.83]))
    half = 3.182446 * np.std([0.80, 0.81, 0.82, 0.83], ddof=1) / 2
    assert (mean - low, high - mean) == pytest.approx((half, half), rel=1e-5)


def test_an_order_holds_only_if_every_step_excludes_zero():
    sure, unsure, wrong = np.array([1.0, 1.1, 0.9]), np.array([1.0, -0.9, 0.4]), np.array([-1.0, -1.1, -0.9])
    assert all_positive({"a": sure, "b": sure}).holds
    found = all_positive({"a": sure, "b": unsure})
    assert not found.holds and found.direction
    assert "not: b" in found.note
    assert not all_positive({"a": wrong, "b": unsure}).direction


def test_a_bound_must_hold_for_the_whole_interval():
    assert below(np.array([1.0, 1.05, 1.0]), 1.2).holds
    assert not below(np.array([0.5, 1.1, 1.15]), 1.2).holds


def test_the_four_verdicts():
    claim = CLAIMS["C15"]
    found = {"low": 0.0, "high": 0.0, "n": 10, "unit": "1"}
    assert verdict_of(claim, Finding(1.0, holds=True, direction=True, **found)) == "reproduced"
    assert verdict_of(claim, Finding(1.0, holds=False, direction=True, **found)) == "same direction, other size"
    assert verdict_of(claim, Finding(-1.0, holds=False, direction=False, **found)) == "not reproduced"
    assert verdict_of(claim, None) == verdict_of(claim, Finding(math.nan, holds=False, direction=False, **found))
    assert verdict_of(claim, None) == "not testable here"


def test_what_was_fitted_is_never_called_reproduced():
    objects, images = {"object_reuse__car": 0.31, "object_reuse__edge": 0.31}, 0.0775
    fits = evidence(**objects, image_reuse__car=images, image_reuse__edge=images)
    assert judge_one(CLAIMS["C11"], fits).verdict == "calibrated"
    assert judge_one(CLAIMS["C13"], fits).verdict == "calibrated"
    other = evidence(object_reuse__car=0.6, object_reuse__edge=0.6)
    assert judge_one(CLAIMS["C11"], other).verdict == "same direction, other size"


def test_an_invariant_holds_or_it_does_not():
    one_leaked = Finding(1.0, 1.0, 1.0, 10, "objects", holds=False, direction=True)
    assert verdict_of(CLAIMS["C33"], one_leaked) == "not reproduced"


def test_a_verdict_that_hangs_on_the_seeds_is_marginal():
    sure = evidence(noise=0.001, object_reuse__car=0.33, object_reuse__edge=0.33)
    unsure = evidence(noise=0.08, object_reuse__car=0.33, object_reuse__edge=0.33)
    assert not judge_one(CLAIMS["C11"], sure).marginal
    assert judge_one(CLAIMS["C11"], unsure).marginal


def test_what_was_not_run_is_not_testable():
    verdicts = {verdict.claim.id: verdict for verdict in judge(evidence(object_reuse__car=0.3))}
    assert verdicts["C31"].verdict == "not testable here"
    assert {verdict.verdict for verdict in verdicts.values()} <= set(VERDICTS)


def test_other_readings_under_which_a_claim_would_hold_are_found():
    readings = {
        "too_much": evidence(object_reuse__car=0.6, object_reuse__edge=0.6),
        "just_right": evidence(object_reuse__car=0.3, object_reuse__edge=0.32),
    }
    assert holds_under(CLAIMS["C11"], readings) == {"too_much": False, "just_right": True}
    assert holds_under(CLAIMS["C30"], readings) == {}, "nobody tried"


def test_table_1_has_two_misprints_both_divided_by_the_wrong_device():
    wrong = {(cell.model, cell.device): cell for cell in table1.cells() if cell.misprinted}
    assert set(wrong) == {("YOLOv8m", "A4500"), ("YOLOv8l", "A4500")}
    for (model, _), cell in wrong.items():
        orin = next(one for one in table1.cells() if (one.model, one.device) == (model, "Orin"))
        assert cell.printed_speedup == pytest.approx(orin.printed_ms / cell.printed_ms, abs=0.006)


@pytest.mark.parametrize("claim", ["C37", "C38", "C39"])
def test_our_profiles_agree_with_table_1(claim):
    assert judge_one(CLAIMS[claim], evidence()).verdict == "reproduced"
