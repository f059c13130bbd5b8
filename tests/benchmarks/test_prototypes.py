"""The benchmark of prototypes: when a target counts as reached."""

from __future__ import annotations

from benchmarks.prototypes import (
    Case,
    Outcome,
    batch_cases,
    street_cases,
    swaps,
    town_cases,
    verdict,
)
from genie_sim.api import load_scenario

EXPECTED = {"local": (8, 42), "remote": (59, 88), "recommended": (83, 86)}


def outcomes(**percentages: tuple[float, float]) -> dict[str, Outcome]:
    return {name: Outcome(*both, worst_car=0.0, jain=1.0) for name, both in percentages.items()}


def test_numbers_are_reached_within_two_points_and_the_recommended_genie_does_not_count():
    case = Case("x", {}, EXPECTED, "numbers")
    near = outcomes(local=(9.9, 42.0), remote=(59.5, 86.1), recommended=(50.0, 50.0))
    assert verdict(case, near) == "within 1.9 points"
    far = outcomes(local=(8.0, 42.0), remote=(59.0, 91.5), recommended=(83.0, 86.0))
    assert verdict(case, far) == "missed: 3.5 points"


def test_an_order_is_kept_unless_a_clear_difference_has_the_other_sign():
    case = Case("x", {}, EXPECTED, "order")
    assert (
        verdict(case, outcomes(local=(5, 9), remote=(90, 50), recommended=(1, 1))) == "same order"
    )
    turned = outcomes(local=(8, 50), remote=(59, 45), recommended=(1, 1))
    assert verdict(case, turned) == "1 pair in another order"
    assert swaps([10, 11], [30, 20]) == 0, "a difference of one point is no order"
    assert swaps([10, 13], [30, 20]) == 1


def test_every_case_is_a_scenario():
    for scenario, cases in (
        ("3car_hetero", street_cases(None, None)),
        ("fleet_30", [*town_cases(), *batch_cases()]),
    ):
        for case in cases:
            methods = [name for name in case.expected if name != "recommended"]
            assert load_scenario(scenario, {**case.settings, "methods": methods}).methods
    assert len(street_cases("rate", "rtt")) == 6
