"""What a terminal shows of a run: its header, and a table of any number of methods."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from genie_sim.analysis import screen
from genie_sim.analysis.seed_runs import SeedRuns
from genie_sim.record.columns import Columns
from genie_sim.record.results import MethodInfo, MetricValue, Run
from tests import make

TEN = [MethodInfo(f"m{i}", f"Method number {i}", baseline=False) for i in range(10)]


def run_of(methods: list[MethodInfo], seed: int = 7, label: str = "", shift: float = 0.0) -> Run:
    measured = [
        MetricValue("first_answer_mean", method.name, "all", "", 10.0 + i + shift, "ms")
        for i, method in enumerate(methods)
    ]
    tables = {"frames": make.frames(3, 2).columns().assign(method="m0")}
    return make.run_of(measured, methods, tables, label, name="town", seed=seed, cars=[{}] * 3)


def test_the_header_says_what_was_run():
    """Two seconds of frames at 10 Hz on four streams of three cars, under each of three methods;
    the last stamp is 1.9 s and 75 ms.
    """
    run = run_of(TEN[:2], label="two edges")
    header = screen.header(run)
    assert header == (
        "two edges (town): 3 cars, 1 edge, 1.98 s simulated, "
        "720 frames under each of 2 methods, seed 7"
    )
    frames = run.tables["frames"]
    fewer = frames.where(car="car1").assign(method="m1")
    both = Columns.of(pd.concat([frames.to_frame(), fewer.to_frame()]))
    more = screen.header(replace(run, tables={"frames": both}))
    assert f", {len(fewer)} to 720 frames under each of 2 methods" in more


@pytest.mark.parametrize("width", [60, 80, 100])
def test_ten_methods_stand_in_blocks_with_legible_labels(width):
    lines = screen.text(run_of(TEN), width).splitlines()
    assert max(map(len, lines)) <= width
    rows = [line for line in lines if line.startswith("first answer, mean [ms]")]
    assert len(rows) > 1, "ten columns do not fit side by side"
    numbers = " ".join(row.removeprefix("first answer, mean [ms]") for row in rows).split()
    assert numbers == [str(10 + i) for i in range(10)]
    assert all(f" {i}" in " ".join(lines) for i in range(10))


def test_methods_that_fit_stand_in_one_block():
    lines = screen.text(run_of(TEN[:3]), 80).splitlines()
    assert sum(line.startswith("first answer") for line in lines) == 1


def test_several_seeds_show_their_mean_and_interval():
    """10, 12 and 14 have the mean 12 and, by Student's t of two degrees of freedom, 12 +- 4.97."""
    three = [run_of(TEN[:1], seed=3 + n, shift=2.0 * n) for n in range(3)]
    text = screen.text(SeedRuns(three), 80)
    assert "12 (7.03 to 17)" in text
    assert "seeds 3 to 5" in " ".join(text.split())
    assert "720 frames" in text.splitlines()[0]
    assert "11 (" not in screen.text(SeedRuns(three[:2]), 80), "two seeds give no interval"
