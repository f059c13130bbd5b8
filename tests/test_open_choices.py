"""Choices that the paper leaves open, in whole runs: what is shared, what is learned, what a Genie's work costs."""

from __future__ import annotations

import pytest

from genie_sim.paper.replicate import Job, run_job

WINDOW = ("cars[0].route.window=[0 s, 3 s]", "cars[1].route.window=[0 s, 3 s]")


def facts(*settings, scenario="2car_hetero", methods=("genie",)):
    return run_job(Job(scenario, 1, (*(WINDOW if scenario.startswith("2") else ()), *settings), methods)).facts


@pytest.mark.parametrize("setting", ["genie.fresh_objects=confident", "genie.fresh_objects=all"])
def test_only_confident_objects_leave_a_host(setting):
    found = facts(setting)
    assert found["objects_shared"] > 500
    assert found["unconfident_objects_shared"] == 0
