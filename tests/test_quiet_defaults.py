"""What holds when nothing is said: changed results are refused, pages are written."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from genie_sim import api, article
from genie_sim.analysis import seed_runs
from genie_sim.recording import results
from genie_sim.report.output import USUAL, Output
from genie_sim.scenario.scenario import Scenario
from genie_sim.scenario.setting_paths import choices_of
from genie_sim.study import printed


def default(call: Callable[..., Any], name: str) -> Any:
    return inspect.signature(call).parameters[name].default


@pytest.mark.parametrize("module", [api, article, results, seed_runs, printed])
def test_changed_results_are_refused_unless_they_are_allowed(module: ModuleType):
    readers = [
        call
        for call in vars(module).values()
        if inspect.isfunction(call) and "allow_changed" in inspect.signature(call).parameters
    ]
    assert readers
    for call in readers:
        assert default(call, "allow_changed") in (False, inspect.Parameter.empty), call


def test_several_seeds_have_a_page_and_no_figures():
    assert Output(page=True, figures=()) == USUAL


@pytest.mark.parametrize(
    ("path", "choices"),
    [
        ("cars[0].cameras", ["true", "false"]),
        ("genie.object_map.rule", ["noisy_or", "literal"]),
        ("seed", []),
    ],
)
def test_the_choices_of_a_setting_are_offered(path: str, choices: list[str]):
    found = choices_of(Scenario, path)
    assert found[:2] == choices if choices else found == []
