"""1,620 broken inputs: each works or is refused with one clear line. ``python -m tools.fuzz`` does
more.
"""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from tools.fuzz import harness
from tools.fuzz.__main__ import ALL, TARGETS


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_broken_input_works_or_is_refused_with_one_line(target: harness.Target, tmp_path: Path):
    tally = harness.run(target, tmp_path, range(target.share))
    assert not tally.bugs, "\n\n".join(tally.bugs)
    assert tally.cases == target.share and tally.worked + tally.refused == tally.cases
    assert tally.refused, "some of it is broken"


def test_there_are_so_many_cases_and_each_is_the_same_every_time():
    assert ALL == 1_620
    seen: list[list[float]] = [[], []]
    for made in seen:
        target = harness.Target("x", 1, lambda _, made=made: lambda rng: made.append(rng.random()))
        harness.run(target, Path(), range(5))
        harness.run(target, Path(), range(4, 5))
    assert seen[0] == seen[1] and seen[0][4] == seen[0][5] and len(set(seen[0])) == 5


@pytest.mark.parametrize(
    ("error", "found"),
    [
        (UserError("one line"), (0, 0, 1)),
        (UserError("two\nlines"), (1, 0, 1)),
        (ValueError("x"), (1, 0, 0)),
        (MemoryError(), (1, 0, 0)),
        (None, (0, 1, 0)),
    ],
    ids=str,
)
def test_the_harness_finds_a_bug(
    error: Exception | None, found: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(harness, "PATIENCE_S", 0.05)

    def case(rng: random.Random) -> None:
        if error is not None:
            raise error
        time.sleep(5)

    tally = harness.run(harness.Target("x", 1, lambda _: case), Path(), range(1))
    assert (tally.tracebacks, tally.hangs, tally.refused) == found
    assert len(tally.bugs) == tally.tracebacks + tally.hangs
