"""What Python programs hand over is taken as what it is, or refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.python_values import plain


class Mine:
    """A class of the user's own."""


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (np.int64(2), 2),
        (np.float64(0.5), 0.5),
        (np.float32(0.5), 0.5),
        (np.bool_(True), True),
        (np.str_("wifi"), "wifi"),
        (np.arange(1, 3), [1, 2]),
        (np.array(7), 7),
        (range(2), [0, 1]),
        ((1, "a"), [1, "a"]),
        (pd.Series([1.5, 2.5]), [1.5, 2.5]),
        (Path("a/b"), "a/b"),
        ({"like": np.str_("ideal"), 1: None}, {"like": "ideal", "1": None}),
        (Mine, f"{__name__}:Mine"),
    ],
    ids=str,
)
def test_a_value_is_what_it_stands_for(value: Any, expected: Any):
    found = plain(value, "x")
    assert found == expected and type(found) is type(expected)
    if isinstance(found, list):
        assert [type(item) for item in found] == [type(item) for item in expected]


@pytest.mark.parametrize(
    "value",
    [
        object(),
        b"bytes",
        pd.Timedelta("10ms"),
        {"a": [lambda: 0]},
        {"genie", "local"},
        {"a": [frozenset("b")]},
    ],
    ids=["object", "bytes", "time", "function", "set", "frozenset"],
)
def test_anything_else_is_refused_with_its_place_and_type(value: Any):
    with pytest.raises(UserError, match=r"^x(\.a\[0\])?: .* of type \w+: expected a number"):
        plain(value, "x")
