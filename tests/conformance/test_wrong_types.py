"""A class of the user's own that gives a wrong type ends a run with one line that names it."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.folder import run_in_memory
from tests.conformance import own, small
from tests.conformance.wrong_types import CASES, OWN


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_type_is_one_line(case: str, monkeypatch: pytest.MonkeyPatch):
    settings, cls, name, value, message = CASES[case]
    usual = {"methods": ["local"], "perception": {"source": f"{OWN}:Street", "speed_mps": 1.0}}
    scenario = small.scenario(**{**usual, **settings})
    monkeypatch.setattr(cls, name, value, raising=False)
    with pytest.raises(UserError) as error:
        run_in_memory(scenario)
    text = str(error.value)
    assert message in text and f"{OWN}:" in text and "\n" not in text


def test_what_comes_out_wrong_in_the_middle_of_a_run_names_the_class(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(own.Again, "on_car", lambda *_: "x")
    with pytest.raises(UserError) as error:
        run_in_memory(small.scenario(methods=["local", f"{OWN}:Again"]))
    text = str(error.value)
    assert text.startswith("the run failed with ") and f"method {OWN}:Again" in text
    assert "on_car() is 'x', but must be a HostConfig" in text and "tests/conformance" in text
    assert "\n" not in text


@pytest.mark.parametrize("returned", [None, "x", 7])
def test_a_node_that_returns_no_effects_says_so(returned: object, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(own.Latest, "on_message", lambda *_: returned)
    with pytest.raises(UserError) as error:
        run_in_memory(small.scenario(methods=[f"{OWN}:Again"]))
    assert f"on_message() is {returned!r}, but must be a list of effects" in str(error.value)


def test_a_fault_at_what_is_not_there_is_one_line():
    fault = {"fault": f"{OWN}:Nowhere", "target": "edge1", "begin": "0.1 s", "end": "0.2 s"}
    with pytest.raises(UserError) as error:
        run_in_memory(small.scenario(methods=["remote"], faults=[fault]))
    assert f"fault '{OWN}:Nowhere': unknown host 'edge99'" in str(error.value)
