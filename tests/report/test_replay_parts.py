"""Columns of the replay, packed."""

from __future__ import annotations

import numpy as np

from genie_sim.record.columns import Codes, Text
from genie_sim.report.replay import coded, deltas, integers, scaled


def test_columns_are_packed_as_short_whole_numbers():
    names = Codes(hit=0)
    column = Text.of(np.array([0, 1, -1]), ["miss", "hit"])
    assert coded(column, names) == [1, 0, -1] and list(names) == ["hit", "miss"]
    assert deltas(np.array([5, 7, 7, 4])) == [5, 2, 0, -3]
    assert scaled(np.array([0.1, 0.25, 1.0006]), 1000).tolist() == [100, 250, 1001]
    assert integers(np.array([1.0, np.nan, 3.0])).tolist() == [1, -1, 3]
