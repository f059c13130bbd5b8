"""380 broken inputs: each works or is refused with one clear line."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ros.fuzz import TARGETS
from tools.fuzz import harness


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_broken_input_works_or_is_refused_with_one_line(target: harness.Target, tmp_path: Path):
    tally = harness.run(target, tmp_path, range(target.share))
    assert not tally.bugs, "\n\n".join(tally.bugs)
    assert tally.cases == target.share and tally.worked + tally.refused == tally.cases
    assert tally.refused, "some of it is broken"
