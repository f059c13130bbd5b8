"""Columns of rows as bytes."""

from __future__ import annotations

import math
import struct
from array import array
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.recording.packed_rows import packed

ROWS = [7, "a", None, 1.5, True, -8, "b", 3, None, None, 9, "a", 2**31 - 1, math.inf, False]
CODES = {"a": 4, "b": 0}


def unpacked(first: int, typecode: str, **options: Any) -> list[Any]:
    return array(typecode, packed(ROWS, first, 5, typecode, **options)).tolist()


def test_each_column_of_three_rows():
    assert unpacked(0, "q") == [7, -8, 9]
    assert unpacked(1, "i", codes=CODES) == [4, 0, 4]
    assert unpacked(2, "i", none=-5) == [-5, 3, 2**31 - 1]
    assert unpacked(4, "b", none=-1) == [1, -1, 0]
    first, unknown, last = unpacked(3, "d", none=math.nan)
    assert (first, last) == (1.5, math.inf) and math.isnan(unknown)


def test_text_that_may_be_missing():
    made = packed(["a", None, "b"], 0, 1, "i", none=-1, codes=CODES)
    assert array("i", made).tolist() == [4, -1, 0]


@given(st.lists(st.integers(-(2**63), 2**63 - 1)), st.integers(0, 3), st.integers(1, 4))
def test_every_whole_number_is_kept(values: list[int], first: int, step: int):
    assert array("q", packed(values, first, step, "q")).tolist() == values[first::step]


@given(st.lists(st.floats(width=64) | st.integers(-(2**53), 2**53)))
def test_every_number_is_kept(values: list[float]):
    assert packed(values, 0, 1, "d") == struct.pack(f"{len(values)}d", *values)


@pytest.mark.parametrize(
    ("value", "typecode", "options"),
    [
        (None, "q", {}),
        (None, "i", {}),
        (None, "d", {}),
        (None, "b", {}),
        ("text", "q", {}),
        ("text", "d", {"none": math.nan}),
        (1.5, "q", {}),
        (1.5, "i", {"none": -1}),
        (2**63, "q", {}),
        (2**31, "i", {}),
        (-(2**31) - 1, "i", {}),
        (200, "b", {}),
        (10**400, "d", {}),
        ([1], "i", {"codes": CODES}),
    ],
)
def test_what_a_buffer_cannot_hold_is_refused(value: Any, typecode: str, options: dict[str, Any]):
    with pytest.raises((TypeError, OverflowError, struct.error)):
        packed([value], 0, 1, typecode, **options)
