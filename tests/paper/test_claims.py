"""The verdicts: what counts as a match, as faster, as an order; and the rows of the table."""

from __future__ import annotations

import numpy as np
import pytest

from genie_sim.paper import printed, table1
from genie_sim.paper.checks import ALL, CHECKS, judge
from genie_sim.paper.claims import (
    HOLDS,
    KINDS,
    NO,
    NOT_RUN,
    PARTLY,
    SECTIONS,
    VERDICTS,
    Claim,
    Finding,
    all_positive,
    in_every_run,
    load_claims,
    matches,
    row,
    sentences,
    total,
    within,
)
from genie_sim.paper.evidence import Effect, interval, more
from tests.paper import notation
from tests.paper.notation import number

CLAIMS = {claim.id: claim for claim in load_claims()}
NOTHING = np.zeros(3)  # the value of an effect that any amount changes
TIGHT, WIDE = np.array([0.6, 0.61, 0.62]), np.array([0.2, 0.9, 1.9])


def claim(expect, tolerance=0.0, near=None, unit=""):
    texts = dict.fromkeys(("claim", "paper", "ours", "test", "why", "command", "where"), "")
    return Claim(
        "C0",
        "latency",
        kind="outcome",
        unit=unit,
        expect=expect,
        minutes=1,
        tolerance=tolerance,
        near=near,
        **texts,
    )


def evidence(seeds=10, noise=0.0, **numbers):
    """Six scenarios with the same numbers for every seed, each with some spread;
    ``image_reuse__car`` is a number.
    """
    named = {number(name.replace("__", ":")): value for name, value in numbers.items()}
    spread = noise * np.linspace(-1, 1, seeds)
    runs = [{of: value + away for of, value in named.items()} for away in spread]
    return notation.evidence({("base", scenario): runs for scenario in ALL})


def test_every_claim_has_a_test_a_section_a_kind_and_a_command():
    assert {*CHECKS} == {*CLAIMS} == {f"C{number}" for number in range(1, 40)}
    assert [*dict.fromkeys(one.section for one in CLAIMS.values())] == [*SECTIONS]
    assert {one.kind for one in CLAIMS.values()} == KINDS.keys()
    for one in CLAIMS.values():
        assert one.command.startswith("genie-sim ") and one.minutes > 0 and one.why, one.id


def test_a_match_is_an_interval_inside_the_tolerance():
    tight, wide = np.array([0.80, 0.81, 0.82, 0.83]), np.array([0.70, 0.78, 0.86, 0.94])
    assert matches(claim(0.82, 0.05), tight).verdict == HOLDS
    assert matches(claim(0.82, 0.05), wide).verdict == NO, "the mean fits; nobody knows it well"
    assert matches(claim(0.85, 0.04), tight).verdict == NO, "its low end is outside"
    assert matches(claim(0.78, 0.04), tight).verdict == NO, "its high end is outside"


def test_the_interval_is_student_s_and_two_seeds_have_none():
    """Four values, standard deviation 0.0129: t(0.975, 3) = 3.182 standard errors each side."""
    mean, low, high = interval(np.array([0.80, 0.81, 0.82, 0.83]))
    half = 3.182446 * np.std([0.80, 0.81, 0.82, 0.83], ddof=1) / 2
    assert (mean - low, high - mean) == pytest.approx((half, half), rel=1e-5)
    assert interval(np.array([0.2, 0.4])) == pytest.approx((0.3, 0.3, 0.3))


def effects(**parts):
    """Effects on nothing, so that any of them counts."""
    return {name: Effect(values, NOTHING) for name, values in parts.items()}


def verdict_of(*legs):
    return all_positive(NOTHING, *legs).verdict


def test_an_order_holds_only_if_every_step_excludes_zero():
    sure, unsure = np.array([1.0, 1.1, 0.9]), np.array([1.0, -0.9, 0.4])
    assert verdict_of(effects(a=sure, b=sure)) == HOLDS
    found = all_positive(NOTHING, effects(a=sure, b=unsure))
    assert (found.verdict, found.note) != (HOLDS, "")
    assert found.note == "1 of 2 effects hold, the others: b (open)"


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


def test_a_claim_holds_partly_where_one_of_its_legs_does():
    up, nothing = np.array([1.0, 1.1, 0.9]), np.array([0.3, -0.2, -0.09])
    assert verdict_of(effects(a=up), effects(b=nothing)) == PARTLY
    assert verdict_of(effects(a=up, b=-up)) == NO
    assert verdict_of(effects(a=up), effects(b=-up)) == PARTLY, "a whole leg, whatever the other"


def test_an_order_has_its_direction_only_with_evidence_and_nothing_against_it():
    up, down = np.array([1.0, 1.1, 0.9]), np.array([-0.01, -0.011, -0.009])
    nothing, noise = np.array([0.3, -0.2, -0.09]), np.array([9.0, -9.5, 2.0])
    assert verdict_of(effects(a=up, b=up, c=noise)) == PARTLY, "most hold, not the average"
    assert verdict_of(effects(a=nothing)) == NO, "it is above zero by chance"
    assert verdict_of(effects(a=up, b=noise)) == NO, "half of the parts are not most of them"
    assert verdict_of(effects(a=up, b=up, c=down)) == NO, "it points the other way for sure"


def test_effects_of_several_units_are_compared_by_what_they_change():
    """100 images of 1000 are less than 0.3 of a reuse of 0.5: both together are 24 %."""
    images = more(np.full(3, 1100.0), np.full(3, 1000.0))
    assert images.scale == 1100
    assert more(np.full(3, 0.5), np.full(3, 0.8)).scale == pytest.approx(0.8)


def test_a_bound_must_hold_for_the_whole_interval():
    assert within(claim(1.2), np.array([1.0, 1.05, 1.0]), high=1.2).verdict == HOLDS
    assert within(claim(1.2), np.array([0.5, 1.1, 1.15]), high=1.2).verdict == NO
    assert within(claim(0.9), np.array([1.0, 1.05, 1.0]), 0.9).verdict == HOLDS
    assert within(claim(0.9), np.array([1.5, 0.95, 1.0]), 0.9).verdict == NO
    assert matches(claim(1.0), np.array([1.0, 1.0])).verdict == HOLDS, "at the bound it holds"


def test_a_number_has_a_direction_only_where_the_claim_says_from_where():
    """A share is above zero by nature: that is no evidence that it is high."""
    assert matches(claim(0.31, 0.06), TIGHT).verdict == NO
    assert matches(claim(0.31, 0.06, near=0.0), TIGHT).verdict == PARTLY
    assert matches(claim(0.31, 0.06, near=0.0), WIDE).verdict == NO, "zero is not excluded"
    assert matches(claim(0.31, 0.06, near=0.0), -TIGHT).verdict == NO
    assert within(claim(0.5, near=0.7), TIGHT, high=0.5).verdict == PARTLY
    assert within(claim(0.5, near=0.61), TIGHT, high=0.5).verdict == NO
    assert within(claim(0.9, near=0.5), TIGHT, 0.9).verdict == PARTLY
    assert within(claim(0.9, near=0.5), WIDE, 0.9).verdict == NO


def test_an_invariant_holds_or_it_does_not():
    found = in_every_run(CLAIMS["C33"], np.array([0.0, 0.0, 1.0]), at_most=True)
    assert (found.verdict, found.values) == (NO, [1.0])


def test_a_row_has_the_number_in_its_unit_and_its_interval():
    of = claim(0.3, unit="%")
    found = row(of, Finding(HOLDS, np.array([0.30, 0.31, 0.32])), "partly")
    assert (found["value"], found["unit"], found["n"]) == (31.0, "%", 3)
    assert found["low"] == pytest.approx(31 - 100 * 4.30265 * 0.01 / 3**0.5, rel=1e-4)
    assert printed.number(found) == "31 % (28.5 to 33.5)"
    assert printed.verdict(found) == "holds (full run: partly)"
    few = row(of, Finding(HOLDS, np.array([0.30, 0.32])), "holds")
    assert (few["low"], few["high"], printed.number(few)) == (None, None, "31 %")


def test_a_claim_whose_runs_are_missing_is_not_run():
    rows = {one["id"]: one for one in judge(evidence(3, object_reuse__car=0.3))}
    assert rows["C31"]["verdict"] == NOT_RUN == rows["C28"]["verdict"]
    assert rows["C37"]["verdict"] == HOLDS
    assert {one["verdict"] for one in rows.values()} <= {*VERDICTS}
    assert [*rows] == [*CLAIMS]


def test_three_sentences_count_latency_levels_and_trends():
    rows = [
        row(of, Finding(HOLDS if of.id in ("C1", "C11") else NO, np.array([0.31] * 3)), HOLDS)
        for of in CLAIMS.values()
    ]
    latency, levels, trends = sentences(rows)
    assert latency.startswith("Latency: 1 of 10 claims hold; 10 of the 10 follow")
    assert "1 of 8 claims hold; objects are reused 31 % of the time (paper: 31 %)" in levels
    assert "0 of 9 claims hold" in trends
    rows[-1]["verdict"] = NOT_RUN
    assert total(rows) == "Of all 39 claims 2 hold, 0 partly, 36 do not, 1 not run."


def test_table_1_has_two_misprints_both_divided_by_the_wrong_device():
    wrong = {(cell.model, cell.device): cell for cell in table1.cells() if cell.misprinted}
    assert set(wrong) == {("YOLOv8m", "A4500"), ("YOLOv8l", "A4500")}
    for (model, _), cell in wrong.items():
        orin = next(one for one in table1.cells() if (one.model, one.device) == (model, "Orin"))
        assert cell.printed_speedup == pytest.approx(orin.printed_ms / cell.printed_ms, abs=0.006)
