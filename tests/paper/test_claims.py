"""The verdicts: what counts as a match, as faster, as an order; and when a verdict hangs on the
seeds.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from genie_sim.paper import table1, verdict_table
from genie_sim.paper.checks import ALL, CHECKS, load_claims
from genie_sim.paper.claims import VERDICTS, judge, judge_one, verdict_of
from genie_sim.paper.evidence import (
    Claim,
    Effect,
    Evidence,
    Finding,
    above,
    all_positive,
    below,
    interval,
    matches,
    more,
)
from genie_sim.paper.readings import load_reading
from tests.paper.notation import fact
from tests.paper.notation import facts as facts_by_notation

CLAIMS = {claim.id: claim for claim in load_claims()}
NOTHING = np.zeros(3)  # the value of an effect that any amount changes
STREET = load_reading("street")
KINDS = {"input", "near_input", "calibrated", "prediction", "invariant", "table"}


def claim(expect, tolerance=0.0, near=None):
    return Claim("C0", "", "prediction", "", "", "", expect, tolerance, near)


def evidence(seeds=10, noise=0.0, **facts):
    """Six scenarios with the same facts for every seed, each with some spread; ``image_reuse__car``
    is a fact.
    """
    spread = noise * np.linspace(-1, 1, seeds)
    named = facts_by_notation(facts)
    return Evidence(
        {("base", s): [{k: v + e for k, v in named.items()} for e in spread] for s in ALL}
    )


def test_every_claim_has_a_test_and_every_test_a_claim():
    assert list(CHECKS) == list(CLAIMS) == [f"C{number}" for number in range(1, 40)]
    assert {claim.kind for claim in CLAIMS.values()} == KINDS


def test_exactly_the_two_fitted_numbers_are_calibrated():
    assert [claim.id for claim in CLAIMS.values() if claim.kind == "calibrated"] == ["C11", "C13"]


def test_a_match_is_an_interval_inside_the_tolerance():
    tight, wide = np.array([0.80, 0.81, 0.82, 0.83]), np.array([0.70, 0.78, 0.86, 0.94])
    assert interval(wide)[0] == pytest.approx(0.82)
    assert matches(claim(0.82, 0.05), tight).holds
    assert not matches(claim(0.82, 0.05), wide).holds, (
        "the mean fits exactly, but nobody knows it well enough"
    )
    assert not matches(claim(0.85, 0.04), tight).holds, "its low end is outside"
    assert not matches(claim(0.78, 0.04), tight).holds, "its high end is outside"


def test_the_interval_is_student_s():
    """Four values, standard deviation 0.0129: t(0.975, 3) = 3.182 standard errors each side."""
    mean, low, high = interval(np.array([0.80, 0.81, 0.82, 0.83]))
    half = 3.182446 * np.std([0.80, 0.81, 0.82, 0.83], ddof=1) / 2
    assert (mean - low, high - mean) == pytest.approx((half, half), rel=1e-5)


def effects(**parts):
    """Effects on nothing, so that any of them counts."""
    return {"": {name: Effect(values, NOTHING) for name, values in parts.items()}}


def test_an_order_holds_only_if_every_step_excludes_zero():
    sure, unsure = np.array([1.0, 1.1, 0.9]), np.array([1.0, -0.9, 0.4])
    assert all_positive(effects(a=sure, b=sure)).holds
    found = all_positive(effects(a=sure, b=unsure))
    assert not found.holds
    assert found.note == "1 of 2 shown; not: b +0.167 (open); decided by b"
    assert found.value == pytest.approx(0.5 / 3)
    assert found.low < 0, "the number that is shown is the one that decides"


@pytest.mark.parametrize(
    ("change", "spread", "state"),
    [
        (1.5, 0.1, "holds"),
        (1.05, 0.1, "open"),  # more than 1 % on average, but the interval begins below
        (0.5, 0.1, "negligible"),
        (0.0, 0.0, "negligible"),
        (-0.5, 0.1, "negligible"),
        (-1.05, 0.1, "open"),
        (-1.5, 0.1, "contrary"),
    ],
)
@pytest.mark.parametrize("value", [0.0002, 40.0, -3.0])
def test_an_effect_below_1_percent_of_its_value_does_not_count(change, spread, state, value):
    percent = np.array([change - spread, change, change + spread])
    of = np.full(3, value)
    assert Effect(percent / 100 * abs(value), of).state == state


def test_where_there_was_nothing_any_effect_counts():
    assert Effect(np.array([1e-9, 1.1e-9, 0.9e-9]), NOTHING).state == "holds"
    assert Effect(NOTHING, NOTHING).state == "negligible"


def test_effects_of_several_units_are_compared_by_what_they_change():
    """100 images of 1000 are less than 0.3 of a reuse of 0.5."""
    images = more(np.full(3, 1100.0), np.full(3, 1000.0))
    reuse = more(np.full(3, 0.8), np.full(3, 0.5))
    found = all_positive({"stored": {"images": images}, "reused": {"reuse": reuse}})
    assert found.note.endswith("decided by images") and found.value == pytest.approx(100)


def test_a_claim_holds_in_part_where_one_of_its_legs_does():
    up, nothing = np.array([1.0, 1.1, 0.9]), np.array([0.3, -0.2, -0.09])
    legs = {"one": effects(a=up)[""], "other": effects(b=nothing)[""]}
    found = all_positive(legs)
    assert [(leg.name, leg.holds) for leg in found.legs] == [("one", True), ("other", False)]
    assert verdict_of(CLAIMS["C16"], found) == "in part"
    assert verdict_of(CLAIMS["C16"], all_positive(effects(a=up, b=nothing))) != "in part"


def test_an_order_has_its_direction_only_with_evidence_and_nothing_against_it():
    up, down = np.array([1.0, 1.1, 0.9]), np.array([-0.01, -0.011, -0.009])
    nothing, noise = np.array([0.3, -0.2, -0.09]), np.array([9.0, -9.5, 2.0])
    assert all_positive(effects(a=up, b=up, c=noise)).direction, (
        "most are shown, though the average is not"
    )
    assert not all_positive(effects(a=nothing)).direction, "it is above zero by chance"
    assert not all_positive(effects(a=up, b=noise)).direction, (
        "half of the parts are not most of them"
    )
    found = all_positive(effects(a=up, b=up, c=down))
    assert found.high < 0 and not found.direction, "however small, it points the other way for sure"
    assert found.note == "2 of 3 shown; not: c -0.01 (contrary); decided by c"


def test_one_number_under_two_claims_is_told():
    """As on the bench, where boost per object and stored confidence grow by the same amount."""
    boosts = [0.01, 0.02, 0.03] * 2
    runs = {
        ("base", s): [
            {fact("confidence_boost:edge"): boost, fact("stored_confidence:edge"): 0.6 + boost}
        ]
        * 3
        for s, boost in zip(ALL, boosts, strict=True)
    }
    verdicts = {verdict.claim.id: verdict for verdict in judge(Evidence(runs))}
    assert verdicts["C25"].same_as == "C23" and verdicts["C23"].same_as is None
    assert not any(one.same_as for one in verdicts.values() if one.claim.id != "C25")


def test_nothing_is_predicted_where_outcomes_were_in_sight():
    kinds = {one.claim.id: one.claim.kind for one in judge(evidence(1), False, retrodicted=True)}
    assert kinds["C15"] == kinds["C11"] == "retrodicted"
    assert "prediction" not in kinds.values()


def test_a_bound_must_hold_for_the_whole_interval():
    assert below(claim(1.2), np.array([1.0, 1.05, 1.0])).holds
    assert not below(claim(1.2), np.array([0.5, 1.1, 1.15])).holds
    assert above(claim(0.9), np.array([1.0, 1.05, 1.0])).holds
    assert not above(claim(0.9), np.array([1.5, 0.95, 1.0])).holds
    for judge_by in (above, below, matches):
        assert judge_by(claim(1.0), np.array([1.0, 1.0])).holds, "at the bound it holds"


def test_a_number_has_a_direction_only_where_the_claim_says_from_where():
    """A share is above zero by nature: that is no evidence that it is high."""
    tight, wide = np.array([0.6, 0.61, 0.62]), np.array([0.2, 0.9, 1.9])
    assert not matches(claim(0.31, 0.06), tight).direction
    assert matches(claim(0.31, 0.06, near=0.0), tight).direction
    assert not matches(claim(0.31, 0.06, near=0.0), wide).direction, (
        "its interval does not exclude zero"
    )
    assert not matches(claim(0.31, 0.06, near=0.0), -tight).direction
    assert below(claim(0.5, near=0.7), tight).direction
    assert not below(claim(0.5, near=0.61), tight).direction
    assert above(claim(0.9, near=0.5), tight).direction
    assert not above(claim(0.9, near=0.5), wide).direction


def test_the_verdicts():
    claim = CLAIMS["C15"]
    found = {"low": 0.0, "high": 0.0, "n": 10, "unit": "1"}
    assert verdict_of(claim, Finding(1.0, holds=True, direction=True, **found)) == "reproduced"
    assert (
        verdict_of(claim, Finding(1.0, holds=False, direction=True, **found))
        == "same direction, other size"
    )
    assert (
        verdict_of(claim, Finding(-1.0, holds=False, direction=False, **found)) == "not reproduced"
    )
    assert verdict_of(claim, None) == verdict_of(
        claim, Finding(math.nan, holds=False, direction=False, **found)
    )
    assert verdict_of(claim, None) == "not testable here"


def test_what_was_fitted_is_never_called_reproduced():
    objects, images = {"object_reuse__car": 0.31, "object_reuse__edge": 0.31}, 0.0775
    fits = evidence(**objects, image_reuse__car=images, image_reuse__edge=images)
    assert judge_one(CLAIMS["C11"], fits).verdict == "calibrated"
    assert judge_one(CLAIMS["C13"], fits).verdict == "calibrated"
    other = evidence(object_reuse__car=0.6, object_reuse__edge=0.6)
    assert judge_one(CLAIMS["C11"], other).verdict == "not reproduced", (
        "a share above zero is no direction"
    )
    twice = evidence(
        object_reuse__car=0.6, object_reuse__edge=0.6, image_reuse__car=0.3, image_reuse__edge=0.3
    )
    assert judge_one(CLAIMS["C13"], twice).verdict == "same direction, other size"


def test_an_invariant_holds_or_it_does_not():
    one_leaked = Finding(1.0, 1.0, 1.0, 10, "objects", holds=False, direction=True)
    assert verdict_of(CLAIMS["C33"], one_leaked) == "not reproduced"


def test_a_verdict_that_hangs_on_the_seeds_is_marginal():
    sure = evidence(noise=0.001, object_reuse__car=0.33, object_reuse__edge=0.33)
    unsure = evidence(noise=0.08, object_reuse__car=0.33, object_reuse__edge=0.33)
    assert not judge_one(CLAIMS["C11"], sure).marginal
    assert judge_one(CLAIMS["C11"], unsure).marginal


def test_a_resample_has_the_seeds_that_were_drawn():
    reuse, nothing = fact("image_reuse:car"), fact("object_reuse:car")
    runs = [{reuse: value} for value in (0.1, 0.2, 0.3)]
    whole = Evidence({("base", "1car_homo"): runs, ("other", "1car_homo"): []})
    drawn = whole.resampled([2, 0, 2])
    assert whole.of("1car_homo", reuse).tolist() == [0.1, 0.2, 0.3]
    assert drawn.of("1car_homo", reuse).tolist() == [0.3, 0.1, 0.3]
    assert drawn.mean_of(["1car_homo"], [reuse, nothing]).tolist() == [0.3, 0.1, 0.3]
    assert drawn.of("1car_homo", reuse, "other").tolist() == []


def test_a_resample_has_as_many_seeds_as_there_are(monkeypatch):
    sizes = set()
    resampled = Evidence.resampled

    def counted(whole, places):
        sizes.add(len(places))
        return resampled(whole, places)

    monkeypatch.setattr(Evidence, "resampled", counted)
    judge_one(CLAIMS["C11"], evidence(noise=0.05, object_reuse__car=0.3, object_reuse__edge=0.3))
    assert sizes == {10}


def test_one_seed_shows_nothing_of_other_seeds():
    alone = judge_one(
        CLAIMS["C11"], evidence(seeds=1, object_reuse__car=0.31, object_reuse__edge=0.31)
    )
    assert alone.finding.n == 1 and alone.marginal
    assert not judge_one(CLAIMS["C37"], evidence(seeds=1)).marginal, "arithmetic needs no seeds"
    rows = [
        verdict_table.row(alone, STREET),
        verdict_table.row(judge_one(CLAIMS["C37"], evidence(seeds=1)), STREET),
    ]
    shown = verdict_table.in_markdown(rows)
    assert "0.31 (one seed)" in shown and "| 5.02 reproduced |" in shown
    assert "One seed has no interval: every verdict on a simulated number is marginal." in shown


def test_few_seeds_say_what_they_cannot_decide():
    def shown(seeds):
        found = judge_one(
            CLAIMS["C11"], evidence(seeds, object_reuse__car=0.31, object_reuse__edge=0.31)
        )
        return verdict_table.text([verdict_table.row(found, STREET)], 200)

    assert "4 seeds do not decide what lies near a threshold" in shown(4)
    assert "do not decide" not in shown(10)


def test_what_was_not_run_is_not_testable():
    verdicts = {verdict.claim.id: verdict for verdict in judge(evidence(3, object_reuse__car=0.3))}
    assert verdicts["C31"].verdict == "not testable here"
    assert {verdict.verdict for verdict in verdicts.values()} <= set(VERDICTS)


def test_table_1_has_two_misprints_both_divided_by_the_wrong_device():
    wrong = {(cell.model, cell.device): cell for cell in table1.cells() if cell.misprinted}
    assert set(wrong) == {("YOLOv8m", "A4500"), ("YOLOv8l", "A4500")}
    for (model, _), cell in wrong.items():
        orin = next(one for one in table1.cells() if (one.model, one.device) == (model, "Orin"))
        assert cell.printed_speedup == pytest.approx(orin.printed_ms / cell.printed_ms, abs=0.006)


@pytest.mark.parametrize("claim", ["C37", "C38", "C39"])
def test_our_profiles_agree_with_table_1(claim):
    assert judge_one(CLAIMS[claim], evidence()).verdict == "reproduced"
