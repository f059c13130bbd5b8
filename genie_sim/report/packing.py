"""Columns of whole numbers that pack well as JSON."""

from itertools import pairwise
from typing import Any

import numpy as np

Column = np.ndarray[Any, Any]

US = 1_000
UNKNOWN = -1


def scaled(values: Column, scale: int) -> Column:
    """Whole numbers of a finer unit."""
    return np.round(values * scale).astype(np.int64)


def deltas(values: Column) -> list[int]:
    """The first value, then the differences: short numbers."""
    # Most columns have a few values, with which numpy's own difference takes ten times as long.
    return [after - before for before, after in pairwise([0, *values.tolist()])]


def integers(values: Column) -> Column:
    """Whole numbers, -1 for unknown."""
    return np.nan_to_num(values, nan=UNKNOWN).astype(np.int64)
