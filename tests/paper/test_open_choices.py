"""Choices that the paper leaves open, in whole runs: what is shared, what is learned, what a
Genie's work costs.
"""

from __future__ import annotations

import pytest

from genie_sim.paper.facts import Fact, placed
from genie_sim.paper.runs import EvaluationRun

WINDOW = ("cars[0].route.window=[0 s, 3 s]", "cars[1].route.window=[0 s, 3 s]")


def facts(*settings, scenario="street_2car_hetero", methods=("genie",)):
    window = WINDOW if "2car" in scenario else ()
    return EvaluationRun(scenario, 1, (*window, *settings), methods).simulate().facts


@pytest.mark.parametrize("setting", ["genie.fresh_objects=confident", "genie.fresh_objects=all"])
def test_only_confident_objects_leave_a_host(setting):
    found = facts(setting)
    assert found[Fact("objects_shared")] > 500
    assert found[Fact("unconfident_objects_shared")] == 0


def test_edges_may_exchange_all_objects_while_cars_get_confident_ones():
    found, usual = facts("genie.share_filter=all"), facts()
    assert (
        found[Fact("unconfident_objects_shared")]
        == 0
        < found[Fact("objects_shared")]
        < usual[Fact("objects_shared")]
    )
    assert found[placed("boost_per_object", "edge")] != usual[placed("boost_per_object", "edge")], (
        "faint objects come from other edges"
    )


@pytest.mark.parametrize("forget_after", ["null", "2 s"])
@pytest.mark.parametrize("method", ["genie", "{method: central, name: genie}"])
def test_a_car_that_learns_from_its_own_node_only_holds_fewer_answers(method, forget_after):
    forgets = f"genie.object_map.forget_after={forget_after}"
    usual, own = (
        facts(forgets, f"genie.car_learns={learns}", methods=(method,)) for learns in ("all", "own")
    )
    key = placed("stored_images", "car")
    # no Genie on cars there
    assert own.get(key) == usual.get(key) if "central" in method else own[key] < usual[key]
    assert own[placed("stored_images", "edge")] >= usual[placed("stored_images", "edge")], (
        "edges learn from each other as ever"
    )


def test_a_car_without_a_detector_learns_from_its_edge_anyway():
    usual, own = (
        facts(f"genie.car_learns={learns}", scenario="street_case_study")
        for learns in ("all", "own")
    )
    with_detector, without = (
        Fact("object_reuse", component=f"{car}/genie") for car in ("car1", "car2")
    )
    assert own[with_detector] < usual[with_detector]
    assert own[without] > 0.9 * usual[without] > 0
