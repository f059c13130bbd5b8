"""The page of baselines says what its committed numbers say, and what a run of the study counts."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks import baselines
from benchmarks.speed_page import filled
from genie_sim.recording.columns import Columns
from tests.conftest import REPOSITORY

PAGE = (REPOSITORY / "docs" / "baselines.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    return pd.read_csv(REPOSITORY / "results" / "baselines" / "numbers.csv")


@pytest.mark.parametrize("name", ["in-short", "methods", "starts", "cases"])
def test_the_page_shows_the_committed_numbers(table: pd.DataFrame, name: str):
    text = filled(PAGE, name, baselines.blocks(table)[name], "baselines.md")
    assert text == PAGE


def test_the_study_has_every_case_start_consumer_and_method(table: pd.DataFrame):
    every = set(map(tuple, table[baselines.BY].drop_duplicates().to_numpy()))
    lines = baselines.setups(94_800)
    assert every == {tuple(line.levels[name] for name in baselines.BY) for line in lines}
    for line in lines:
        levels = [line.levels[name] for name in baselines.BY]
        rows = table[(table[baselines.BY] == levels).all(axis=1)]
        names = {entry.name for entry in line.run.scenario.methods}
        assert names == set(rows["method"]), line.levels
    paying = {entry.name: entry for entry in lines[0].run.scenario.methods}
    charged = lines[0].run.scenario.under(paying["genie"]).genie.capacity
    assert charged.bytes == 1_000_000 - 94_800
    assert lines[0].run.scenario.under(paying["genie_free"]).genie.capacity.bytes == 1_000_000


def test_only_the_last_lap_of_each_car_counts():
    cars = np.array(["car1", "car2", "car1", "car2"])
    rows = Columns.of(pd.DataFrame({"car": cars, "stamp_ns": [10, 10, 30, 30]}))
    counted = baselines.since(rows, {"car1": 20, "car2": 5})
    assert list(zip(counted["car"].tolist(), counted["stamp_ns"], strict=True)) == [
        ("car2", 10),
        ("car1", 30),
        ("car2", 30),
    ]


def test_utilization_is_that_of_the_edges_within_the_span():
    samples = {
        "resource": ["edge1.accelerator"] * 3
        + ["edge2.accelerator"] * 3
        + ["car1.accelerator"] * 3,
        "t_ns": [0, 10, 20] * 3,
        "busy_ns": [0, 8, 8, 0, 4, 14, 0, 10, 20],
    }
    resources = Columns.of(pd.DataFrame(samples))
    assert baselines.utilization(resources, (0, 10)) == pytest.approx((0.8 + 0.4) / 2)
    assert baselines.utilization(resources, (10, 20)) == pytest.approx((0.0 + 1.0) / 2)
