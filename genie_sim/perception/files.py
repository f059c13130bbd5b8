"""Reads input files as bytes, as text or as rows of numbers. Every error names the file and, in text, the line."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from genie_sim.core.geometry import Array
from genie_sim.errors import UserError

MOST = 1e9  # no number in KITTI's files is larger

def read_bytes(path: Path) -> bytes:
    """All bytes of a regular file. Raises UserError for anything else: a device or a pipe may have no end."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise UserError(f"{path}: cannot be read: not a regular file")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from error


def read_text(path: Path) -> str:
    """The text of a regular file in UTF-8, lines ending in a newline. Raises UserError."""
    try:
        text = read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not a text file: {error}") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def within(values: npt.ArrayLike) -> bool:
    """Whether all values are numbers below ``MOST``: neither infinite nor nan, and their products are finite."""
    return bool((np.abs(np.asarray(values, dtype=np.float64)) < MOST).all())


def lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number (from 1 on) and blank- or comma-separated fields of each line that is not empty."""
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if line.strip():
            yield number, line.replace(",", " ").split()


def numbers(path: Path, columns: int) -> Array:
    """A table (n, columns) of numbers ``within`` bounds. Raises UserError for a line that holds anything else."""
    rows: list[list[float]] = []
    for number, fields in lines(path):
        try:
            row = [float(field) for field in fields]
        except ValueError as error:
            raise UserError(f"{path}: line {number}: {error}") from error
        if len(row) != columns:
            raise UserError(f"{path}: line {number}: {len(row)} fields, expected {columns}")
        if not within(row):
            raise UserError(f"{path}: line {number}: a number is not finite, or too large")
        rows.append(row)
    return np.array(rows).reshape(-1, columns)
