"""Spans of rows: some rows of a table that follow each other, by the first one and their number."""

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]
Ints = npt.NDArray[np.int64]


def rows_of_spans(firsts: Ints, counts: Ints) -> tuple[Ints, Ints]:
    """All rows of some spans (n,), span after span, and for each row which span it is of.

    >>> rows_of_spans(np.array([10, 50]), np.array([2, 3]))
    (array([10, 11, 50, 51, 52]), array([0, 0, 1, 1, 1]))
    """
    span = np.repeat(np.arange(len(counts)), counts)
    rows = np.arange(len(span)) + (firsts - np.cumsum(counts) + counts)[span]
    return rows, span
