"""Columns of numpy arrays: they hold what the pandas table holds, and group and choose rows as it
does.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from genie_sim.analysis.statistics import t_quantile
from genie_sim.record.columns import Columns, Text, concat
from tests import make


def test_columns_hold_what_pandas_holds():
    for table in (
        make.frames(2, 2),
        make.lookups(2, 60),
        make.resources(2, 10),
    ):
        columns, frame = table.columns(), table.to_frame()
        pd.testing.assert_frame_equal(Columns.of(frame).to_frame(), frame)
        (of_two, of_frame) = (
            columns.where(method="genie").rows(slice(1, None, 2)),
            frame[frame["method"] == "genie"],
        )
        pd.testing.assert_frame_equal(of_two.to_frame(), of_frame.iloc[1::2].reset_index(drop=True))


def test_groups_are_sorted_and_keep_the_order_of_rows():
    table = Columns({"who": Text.of(np.array([1, 0, -1, 1]), ["b", "a"]), "n": np.arange(4)})
    assert [(name, part["n"].tolist()) for name, part in table.groups("who")] == [
        ("a", [0, 3]),
        ("b", [1]),
    ]
    assert table["who"].tolist() == ["a", "b", None, "a"] and table["who"].unique() == ["a", "b"]
    assert (table["who"] != "a").tolist() == [False, True, True, False]
    assert table["who"].isin(["a", "none"]).tolist() == [True, False, False, True]
    assert list(table.rows([]).groups("who")) == []
    both = concat([table, table.assign(who="c")])
    assert both["who"].tolist() == ["a", "b", None, "a", "c", "c", "c", "c"]


def test_quantiles_of_t_are_scipys():
    from scipy.special import stdtr

    for freedom in (*range(1, 320), 1000, 10**6):
        assert float(stdtr(freedom, t_quantile(freedom))) == pytest.approx(0.975, rel=1e-13)
