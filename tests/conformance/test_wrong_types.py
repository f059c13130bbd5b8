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
    from genie_sim.recommended.paced_remote import PacedSender

    monkeypatch.setattr(PacedSender, "on_message", lambda *_: returned)
    setting = small.scenario(methods=["paced_remote"])
    of_scenario = "genie_sim.scenario.scenario.Scenario"
    monkeypatch.setattr(f"{of_scenario}.own_code", lambda _: {"method 'x:Y'": ("method", "x:Y")})
    monkeypatch.setattr(f"{of_scenario}.own_code_digests", lambda _: {})
    with pytest.raises(UserError) as error:
        run_in_memory(setting)
    assert f"on_message() is {returned!r}, but must be a list of effects" in str(error.value)


def test_what_an_own_class_raises_itself_is_not_renamed(monkeypatch: pytest.MonkeyPatch):
    def broken(*_: object) -> None:
        raise KeyError("mine")

    monkeypatch.setattr(own.Again, "on_car", broken)
    monkeypatch.setattr("genie_sim.base.plugins.own_fault", lambda error: "method 'x:Y'")
    with pytest.raises(KeyError, match="mine"):
        run_in_memory(small.scenario(methods=[f"{OWN}:Again"]))
