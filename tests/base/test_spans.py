"""Rows of spans."""

from __future__ import annotations

import numpy as np

from genie_sim.base.spans import rows_of_spans


def test_all_rows_come_span_after_span_and_empty_ones_have_none():
    rows, span = rows_of_spans(np.array([10, 7, 50]), np.array([2, 0, 3]))
    assert rows.tolist() == [10, 11, 50, 51, 52]
    assert span.tolist() == [0, 0, 2, 2, 2]
    nothing = np.zeros(0, dtype=np.int64)
    assert [len(column) for column in rows_of_spans(nothing, nothing)] == [0, 0]
