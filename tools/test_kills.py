"""Two kills of a run at random instants; ``python -m tools.kills --kills 100`` does more."""

from __future__ import annotations

import sys

import pytest

from tools import kills


@pytest.mark.skipif(sys.platform == "win32", reason="needs the signals of Unix")
def test_a_run_killed_at_random_instants_loses_nothing(capsys: pytest.CaptureFixture[str]):
    assert kills.main(["--kills", "2", "--only", "run"]) == 0, capsys.readouterr().out
    assert capsys.readouterr().out.count("\n") == 3
