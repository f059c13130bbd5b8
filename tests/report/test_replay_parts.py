"""Columns of the replay, packed."""

from __future__ import annotations

import numpy as np

from genie_sim.record.columns import Text
from genie_sim.report.replay import _Names, deltas, integers, scaled


def test_a_text_that_the_page_does_not_know_is_shown_by_itself():
    names = _Names(("miss", "hit"))
    column = Text.of(np.array([0, 1, 0]), ["expired", "hit"])
    assert names.codes(column) == [2, 1, 2] and list(names.all) == ["miss", "hit", "expired"]


def test_columns_are_packed_as_short_whole_numbers():
    assert deltas(np.array([5, 7, 7, 4])) == [5, 2, 0, -3]
    assert scaled(np.array([0.1, 0.25, 1.0006]), 1000).tolist() == [100, 250, 1001]
    assert integers(np.array([1.0, np.nan, 3.0])).tolist() == [1, -1, 3]
