"""Values of a table's column as bytes of its buffer."""

import struct
from collections.abc import Mapping, Sequence
from typing import Any


def packed(
    values: Sequence[Any],
    first: int,
    step: int,
    typecode: str,
    *,
    none: int | float | None = None,
    codes: Mapping[str, int] | None = None,
) -> bytes:
    """Packs every ``step``-th value from the ``first`` one on.

    Parameters
    ----------
    values : sequence
        The values of several rows, one row after the other.
    first, step : int
        The place of the column in a row, and the width of a row.
    typecode : {"q", "i", "b", "d"}
        What a value is in the buffer, as ``array`` calls it.
    none : number or None
        What stands for None; ``None``: the column is never empty.
    codes : mapping or None
        Of a column of text, the number of each text.

    Raises TypeError for None where a column is never empty, and TypeError, OverflowError or
    ``struct.error`` for what the buffer cannot hold.
    """
    cells = values[first::step]
    if codes is None:
        encoded = cells if none is None else [none if cell is None else cell for cell in cells]
    elif none is None:
        encoded = list(map(codes.__getitem__, cells))
    else:
        encoded = [none if cell is None else codes[cell] for cell in cells]
    # several times faster than array.extend
    return struct.pack(f"{len(encoded)}{typecode}", *encoded)
