"""What holds when nothing is said: changed results are refused, pages are written."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from genie_sim import api, kinds
from genie_sim.analysis import seed_runs
from genie_sim.record import results
from genie_sim.report.output import DEFAULT_OUTPUT, Output


def default(call: Callable[..., Any], name: str) -> Any:
    return inspect.signature(call).parameters[name].default


@pytest.mark.parametrize("module", [api, kinds, results, seed_runs])
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
    assert Output(page=True, figures=()) == DEFAULT_OUTPUT
