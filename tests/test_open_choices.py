"""Choices that the paper leaves open, in whole runs: what is shared, what is learned, what a Genie's work costs."""

from __future__ import annotations

import pytest

from genie_sim.paper.replicate import Job, run_job

WINDOW = ("cars[0].route.window=[0 s, 3 s]", "cars[1].route.window=[0 s, 3 s]")


def facts(*settings, scenario="2car_hetero", methods=("genie",)):
    return run_job(
        Job(scenario, 1, (*(WINDOW if scenario.startswith("2") else ()), *settings), methods)
    ).facts


@pytest.mark.parametrize("setting", ["genie.fresh_objects=confident", "genie.fresh_objects=all"])
def test_only_confident_objects_leave_a_host(setting):
    found = facts(setting)
    assert found["objects_shared"] > 500
    assert found["unconfident_objects_shared"] == 0


def test_edges_may_exchange_all_objects_while_cars_get_confident_ones():
    found, usual = facts("genie.share_filter=all"), facts()
    assert (
        found["unconfident_objects_shared"] == 0 < found["objects_shared"] < usual["objects_shared"]
    )
    assert found["boost_per_object:edge"] != usual["boost_per_object:edge"], (
        "faint objects come from other edges"
    )


@pytest.mark.parametrize("freshness", ["never", "ttl, ttl: 2 s", "track", "recommended"])
@pytest.mark.parametrize("method", ["genie", "{method: central, name: genie}"])
def test_a_car_that_learns_from_its_own_node_only_holds_fewer_answers(method, freshness):
    freshness = f"genie.object_map.freshness={{name: {freshness}}}"
    usual, own = (
        facts(freshness, f"genie.car_learns={learns}", methods=(method,))
        for learns in ("all", "own")
    )
    key = "stored_images:car"
    assert (
        own.get(key) == usual.get(key) if "central" in method else own[key] < usual[key]
    )  # no Genie on cars there
    assert own["stored_images:edge"] >= usual["stored_images:edge"], (
        "edges learn from each other as ever"
    )


def test_a_car_without_a_detector_learns_from_its_edge_anyway():
    usual, own = (
        facts(f"genie.car_learns={learns}", scenario="case_study") for learns in ("all", "own")
    )
    key = "object_reuse:car2/genie"
    assert own[key] > 0 and own[key] != usual[key]
