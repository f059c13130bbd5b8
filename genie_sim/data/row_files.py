"""Tables that somebody else wrote, as CSV or Parquet: rows of typed values, and errors that name
file, line and column.
"""

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from genie_sim.base import parquet
from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.paths import usable

FLAGS = {"true": True, "false": False, "1": True, "0": False}
MAX_TEXT = 100
BATCH_ROWS = 65_536  # of a Parquet file, in memory at once


@dataclass(frozen=True)
class FileColumn:
    """A column that a table must or may have.

    Numbers must be finite and from ``lowest`` to ``highest``. An optional column may be missing,
    and its values may be empty: they read as ``None``.
    """

    name: str
    kind: Literal["number", "text", "flag"] = "number"
    lowest: float = -math.inf
    highest: float = math.inf
    optional: bool = False

    def value(self, raw: object) -> Any:
        """What a cell holds. Raises ``ValueError``."""
        if raw is None or raw == "":
            if self.optional:
                return None
            raise ValueError("is empty")
        if self.kind == "number":
            return self._number(raw)
        text = str(raw).strip()
        if self.kind == "flag":
            if text.lower() not in FLAGS:
                raise ValueError(f"must be true or false, not {short_repr(raw)}")
            return FLAGS[text.lower()]
        if not text or len(text) > MAX_TEXT or not text.isprintable():
            raise ValueError(f"must be 1 to {MAX_TEXT} printable characters, not {short_repr(raw)}")
        return text

    def _number(self, raw: object) -> float:
        # float() reads the digits of every script, and 4_9
        plain = isinstance(raw, str) and raw.isascii() and "_" not in raw
        if not plain and (isinstance(raw, bool) or not isinstance(raw, int | float)):
            raise ValueError(f"must be a number, not {short_repr(raw)}")
        try:
            number = float(raw)  # type: ignore[arg-type]
        except (ValueError, OverflowError) as error:
            raise ValueError(f"must be a number, not {short_repr(raw)}") from error
        if not (math.isfinite(number) and self.lowest <= number <= self.highest):
            limits = ""
            if math.isfinite(self.lowest):
                limits = f" from {self.lowest:g} to {self.highest:g}"
            raise ValueError(f"must be a number{limits}, not {short_repr(raw)}")
        return number


class FileRow(NamedTuple):
    """One row: where it stands, to begin errors with, and its values in the order of the columns
    that were asked for.
    """

    where: str
    values: tuple[Any, ...]


def read_rows(path: Path, columns: Sequence[FileColumn]) -> Iterator[FileRow]:
    """The rows of a CSV or Parquet file, one after the other; other columns are passed over.

    Raises UserError, naming file, line (Parquet: row) and column, for a file that cannot be read, a
    column that is missing or there twice, and a value that is none.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise UserError(f"{path}: must end in .csv or .parquet")
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    cells = _csv_cells(path, columns) if path.suffix == ".csv" else _parquet_cells(path, columns)
    for where, raw in cells:
        try:
            values = tuple(column.value(cell) for column, cell in zip(columns, raw, strict=True))
        except ValueError:
            raise _error(where, columns, raw) from None
        yield FileRow(where, values)


def _error(where: str, columns: Sequence[FileColumn], raw: Sequence[object]) -> UserError:
    """What is wrong in a row with a wrong value."""
    for column, cell in zip(columns, raw, strict=True):
        try:
            column.value(cell)
        except ValueError as error:
            return UserError(f"{where}: {column.name}: {error}")
    raise AssertionError("no value of the row is wrong")


def _places(path: Path, columns: Sequence[FileColumn], header: Sequence[str]) -> list[int | None]:
    """Where each column stands in a header; ``None``: nowhere."""
    places: list[int | None] = []
    for column in columns:
        count = header.count(column.name)
        if count > 1:
            raise UserError(f"{path}: column {column.name!r} is there {count} times")
        if count == 0 and not column.optional:
            raise UserError(f"{path}: {_missing(column.name, header)}")
        places.append(header.index(column.name) if count else None)
    return places


def _missing(name: str, header: Sequence[str]) -> str:
    names = ", ".join(short_repr(title) for title in header[:12])
    return f"column {name!r} is missing; the file has {names or 'none'}"


def _csv_cells(path: Path, columns: Sequence[FileColumn]) -> Iterator[tuple[str, list[str | None]]]:
    broken = as_user_error(f"{path}: not a readable CSV file", csv.Error, UnicodeDecodeError)
    with (
        usable(path, "cannot be read"),
        broken,
        path.open(encoding="utf-8-sig", newline="") as file,
    ):
        lines = csv.reader(file, strict=True)
        header = [title.strip() for title in next(lines, [])]
        places = _places(path, columns, header)
        for cells in lines:
            if not cells:  # an empty line
                continue
            where = f"{path}: line {lines.line_num}"
            if len(cells) != len(header):
                raise UserError(f"{where}: has {len(cells)} values, the header {len(header)}")
            yield where, [None if place is None else cells[place] for place in places]


def _parquet_cells(path: Path, columns: Sequence[FileColumn]) -> Iterator[tuple[str, list[object]]]:
    with parquet.opened(path) as file:
        places = _places(path, columns, list(file.schema_arrow.names))
        names = [
            column.name for column, place in zip(columns, places, strict=True) if place is not None
        ]
        number = 0
        for batch in file.iter_batches(BATCH_ROWS, columns=names, use_threads=False):
            by_name = {name: batch.column(name).to_pylist() for name in names}
            empty = [None] * batch.num_rows
            for cells in zip(*(by_name.get(column.name, empty) for column in columns), strict=True):
                number += 1
                yield f"{path}: row {number}", list(cells)
