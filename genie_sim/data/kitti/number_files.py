"""Reads input files as rows of numbers and as matrices. Every error names the file, and the line or
the matrix.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.geometry import Array
from genie_sim.base.paths import read_text

MAX = 1e9  # no number in KITTI's files is larger
MAX_SIDE_PX = 10_000  # of a picture


def are_plausible(values: npt.ArrayLike) -> bool:
    """Whether all values are numbers below ``MAX``: neither infinite nor nan, and their products
    are finite.
    """
    return bool((np.abs(np.asarray(values, dtype=np.float64)) < MAX).all())


def numbered_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number (from 1 on) and blank- or comma-separated fields of each line that has any."""
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if fields := line.replace(",", " ").split():
            yield number, fields


def unbroken_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """``numbered_lines`` of a file with a line for each frame. Raises UserError for an empty line
    before another.
    """
    for expected, (number, fields) in enumerate(numbered_lines(path), start=1):
        if number != expected:
            raise UserError(f"{path}: line {expected}: is empty")
        yield number, fields


def numbers(path: Path, columns: int) -> Array:
    """A table (n, columns) of numbers ``are_plausible``. Raises UserError for a line that holds
    anything else.
    """
    rows: list[list[float]] = []
    for number, fields in unbroken_lines(path):
        with as_user_error(f"{path}: line {number}", ValueError):
            row = [float(field) for field in fields]
        if len(row) != columns:
            raise UserError(f"{path}: line {number}: {len(row)} fields, expected {columns}")
        if not are_plausible(row):
            raise UserError(f"{path}: line {number}: a number is not finite, or too large")
        rows.append(row)
    return np.array(rows).reshape(-1, columns)


def named_rows(path: Path) -> dict[str, list[str]]:
    """The rows of a calibration file whose lines are ``NAME: numbers`` or ``NAME numbers``."""
    return {fields[0].rstrip(":"): fields[1:] for _, fields in numbered_lines(path)}


def size_of(rows: Mapping[str, Iterable[str | float]], name: str) -> tuple[int, int] | None:
    """Width and height [px] in a row of a calibration file; ``None`` where it tells no size."""
    try:
        width, height = (round(float(text)) for text in rows.get(name, ()))
    except (ValueError, OverflowError):
        return None
    is_size = 0 < width <= MAX_SIDE_PX and 0 < height <= MAX_SIDE_PX
    return (width, height) if is_size else None


def matrices(
    path: Path,
    rows: Mapping[str, Iterable[str | float]],
    names_and_columns: Sequence[tuple[Sequence[str], int]],
) -> list[Array]:
    """Matrices (3, columns) out of the ``rows`` of a calibration file.

    ``names_and_columns``: the names that each may have, and its columns. Raises UserError for one
    that is missing, or whose first three columns cannot be inverted.
    """
    table: list[Array] = []
    for names, columns in names_and_columns:
        values = next((rows[name] for name in names if name in rows), [])
        try:
            matrix = np.array([float(value) for value in values]).reshape(3, columns)
        except ValueError as error:
            raise UserError(
                f"{path}: {names[0]} is missing or has not {3 * columns} numbers"
            ) from error
        with np.errstate(all="ignore"):
            singular = abs(np.linalg.det(matrix[:, :3])) < 1e-9
        if singular or not are_plausible(matrix):
            raise UserError(f"{path}: {names[0]} is not a matrix that can be inverted")
        table.append(matrix)
    return table
