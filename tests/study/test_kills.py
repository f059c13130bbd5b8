"""Two kills of a run at random instants; ``python -m tests.study.kills --kills 100`` does more."""

from __future__ import annotations

import pytest

from tests.study import kills


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.nightly
@pytest.mark.unix
def test_a_run_killed_at_random_instants_loses_nothing(capsys: pytest.CaptureFixture[str]):
    assert kills.main(["--kills", "2", "--only", "run"]) == 0, capsys.readouterr().out
    assert capsys.readouterr().out.count("\n") == 3
