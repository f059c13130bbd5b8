"""A class of the user's own that returns a wrong type ends a run with one line that names the class
and the method.
"""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
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


def test_what_a_frame_source_returns_is_checked_every_time(monkeypatch: pytest.MonkeyPatch):
    returned: dict[str, object] = {"now": {"street": {}}}
    monkeypatch.setattr(own.Street, "provenance", lambda _: returned["now"])
    setting = small.scenario(methods=["local"], perception={"source": f"{OWN}:Street"})
    prepared = prepare(setting)
    returned["now"] = "x"
    with pytest.raises(UserError, match=r"provenance\(\) is 'x', but must be a mapping"):
        prepared.frames.provenance()
