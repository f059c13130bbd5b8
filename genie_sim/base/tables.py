"""Tables that somebody else wrote, as text or Parquet: rows of typed values, and errors that name
file, line and column.

Text is CSV in UTF-8 or UTF-16, perhaps packed by gzip, its columns separated by tabs, semicolons,
commas or blanks, as its first line is. Where commas do not separate, they may be decimal marks.
Lines that begin with ``#`` are comments; of a table without titles the last comment before it has
them. Units are found in titles: ``time_ms``, ``Time [ms]`` and ``time (s)`` all are ``time_s``.
"""

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from genie_sim.base import parquet, units
from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.paths import check_is_file, usable
from genie_sim.base.units import MAX_M, MAX_TIME_S

if TYPE_CHECKING:
    import pandas

MAX_CELL = 1e15  # of a column that names no limits: products with units stay finite
FLAGS = {"true": True, "false": False, "1": True, "0": False}
MAX_TEXT = 100
MAX_LINE = 1_000_000  # characters of a text
MAX_CHARACTERS = 2 * 10**9  # of a text
# A packed one has at most so many, or so many times its size: each row takes far more memory.
SMALL_CHARACTERS, MAX_EXPANSION = 2**24, 100
BATCH_ROWS = 65_536  # of a Parquet file, in memory at once
MARKS = "\t;,"  # separate columns wherever they stand
BLANKS = " "  # separates columns: any number of spaces and tabs
EMPTY = MARKS + BLANKS  # a line of nothing else is empty
Row = tuple[str, list[Any]]  # where it stands, and its cells

# What a unit in a title measures, and how many of the smallest unit it is.
UNITS: dict[str, tuple[str, float]] = {
    name.lower(): (quantity.name, float(value))
    for quantity in units.IN_TITLES
    for name, value in (*quantity.units.items(), *quantity.in_titles.items())
}
SMALLER = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9}  # than a second, so often
SOME_DATES_S = (9e8, MAX_TIME_S)  # since 1970: from 1998 on
_BYTES = re.compile(r"[kKMG]?B(ps|/s)")  # bytes a second, which lower case would take for bits
_IN_BRACKETS = re.compile(r"(.+?)\s*[\[(]\s*([^\[\]()]+?)\s*[\])]")
_AT_THE_END = re.compile(r"(.+?)\s*[_ .,/-]\s*([^\W\d_]+(?:/s)?)")


class Title(NamedTuple):
    """A column's name without its unit, and the unit as in ``UNITS``; ``""``: it has none."""

    stem: str
    unit: str


def title_of(text: str) -> Title:
    """The parts of a title such as ``latency_ms``, ``Latency [ms]`` or ``latency (ms)``."""
    for pattern in (_IN_BRACKETS, _AT_THE_END):
        found = pattern.fullmatch(text.strip())
        if found and not _BYTES.fullmatch(found[2]) and found[2].lower() in UNITS:
            return Title(found[1].lower(), found[2].lower())
    return Title(text.strip().lower(), "")


@dataclass(frozen=True)
class FileColumn:
    """A column that a table must or may have.

    Its name ends with the unit of its values; a table may have another unit of the kind. Numbers
    must be from ``lowest`` to ``highest``. An optional column may be missing, and its
    values may be empty: they read as ``None``.
    """

    name: str
    kind: Literal["number", "text", "flag"] = "number"
    lowest: float = -MAX_CELL
    highest: float = MAX_CELL
    optional: bool = False

    def value(self, raw: object, factor: float = 1.0) -> Any:
        """What a cell holds, a number times ``factor``. Raises ``ValueError``."""
        if raw is None or raw == "":
            if self.optional:
                return None
            raise ValueError("is empty")
        if self.kind == "number":
            return self._number(raw, factor)
        text = str(raw).strip()
        if self.kind == "flag":
            if text.lower() not in FLAGS:
                raise ValueError(f"must be true or false, not {short_repr(raw)}")
            return FLAGS[text.lower()]
        if not text or len(text) > MAX_TEXT or not text.isprintable():
            raise ValueError(f"must be 1 to {MAX_TEXT} printable characters, not {short_repr(raw)}")
        return text

    @property
    def is_time(self) -> bool:
        """Whether its values are times or durations, by the unit in its name."""
        return UNITS.get(title_of(self.name).unit, ("",))[0] == units.DURATION.name

    def _number(self, raw: object, factor: float) -> float:
        try:  # what most cells hold
            number = float(raw if type(raw) is str and raw.isascii() and "_" not in raw else "")
        except ValueError:
            number = plain_number(raw)
        if factor != 1.0:
            number *= factor
        if not self.lowest <= number <= self.highest:
            limits = f"from {self.lowest:g} to {self.highest:g}"
            hint = since_1970(number / factor) if self.is_time else ""
            raise ValueError(f"must be a number {limits}, not {short_repr(raw)}{hint}")
        return number


TIME = FileColumn("time_s", lowest=-MAX_TIME_S, highest=MAX_TIME_S)
EAST = FileColumn("east_m", lowest=-MAX_M, highest=MAX_M)
NORTH = FileColumn("north_m", lowest=-MAX_M, highest=MAX_M)


def since_1970(number: float) -> str:
    """Which unit makes a date of a time that is out of range; nothing where none does."""
    for unit, times in SMALLER.items():
        if SOME_DATES_S[0] <= number / times <= SOME_DATES_S[1]:
            return f": are these {unit} since 1970? Say so in the title"
    return ""


def plain_number(raw: object) -> float:
    """The number in a cell, infinite or none of them included. Raises ``ValueError``."""
    # float() reads the digits of every script, and 4_9
    plain = isinstance(raw, str) and raw.isascii() and "_" not in raw
    if not plain and (isinstance(raw, bool) or not isinstance(raw, int | float)):
        raise ValueError(f"must be a number, not {short_repr(raw)}")
    try:
        return float(raw)  # type: ignore[arg-type]
    except (ValueError, OverflowError) as error:
        raise ValueError(f"must be a number, not {short_repr(raw)}") from error


class FileRow(NamedTuple):
    """One row: where it stands, to begin errors with, and its values in the order of the columns
    that were asked for.
    """

    where: str
    values: tuple[Any, ...]


class _ColumnPlace(NamedTuple):
    """Where a column stands in a table, and what its numbers are multiplied by."""

    number: int
    factor: float


class ForeignTable:
    """A table of others: the ``titles`` of its columns and its ``cells``; errors begin with its
    ``path``.
    """

    path: Path
    titles: tuple[str, ...] = ()
    separator = ","

    def place(self, column: FileColumn) -> _ColumnPlace | None:
        """Where a column stands; ``None`` where there is none. Raises UserError for one that is
        there twice, or whose unit nobody tells.
        """
        wanted, name = title_of(column.name), column.name
        kind, factor = UNITS.get(wanted.unit, ("", 1.0))
        found = [_ColumnPlace(at, 1.0) for at, title in enumerate(self.titles) if title == name]
        found = found or [
            _ColumnPlace(at, UNITS[title.unit][1] / factor if title.unit else 1.0)
            for at, title in enumerate(map(title_of, self.titles))
            if title.stem == wanted.stem and UNITS.get(title.unit, ("", 1.0))[0] == kind
        ]
        if len(found) > 1:
            among = ", ".join(short_repr(self.titles[place.number]) for place in found)
            raise UserError(f"{self.path}: column {name!r} could be each of {among}: keep one")
        if not found and wanted.unit and wanted.stem in map(str.lower, self.titles):
            raise UserError(
                f"{self.path}: column {name!r} is missing; {wanted.stem!r} has no unit: call it "
                f"{name}, or {wanted.stem}_ and its unit"
            )
        return found[0] if found else None

    def unused(self, columns: Sequence[FileColumn]) -> list[str]:
        """The titles of all other columns."""
        used = {place.number for column in columns if (place := self.place(column)) is not None}
        return [title for index, title in enumerate(self.titles) if index not in used]

    def rows(self, columns: Sequence[FileColumn]) -> Iterator[FileRow]:
        """The rows, one after the other; other columns are passed over.

        Raises UserError, naming file, line (Parquet: row) and column, for a column that is missing
        or there twice, and a value that is none.
        """
        places = [self.place(column) for column in columns]
        for column, place in zip(columns, places, strict=True):
            if place is None and not column.optional:
                names = ", ".join(short_repr(title) for title in self.titles[:12]) or "none"
                text = f"column {column.name!r} is missing; the file has {names}"
                raise UserError(f"{self.path}: {text}")
        factors = [1.0 if place is None else place.factor for place in places]
        indices = [None if place is None else place.number for place in places]
        for where, cells in self.cells(indices):
            values = []
            for column, cell, factor in zip(columns, cells, factors, strict=True):
                try:
                    number = column.kind == "number" and self.separator != ","
                    values.append(column.value(with_point(cell) if number else cell, factor))
                except ValueError as error:
                    raise UserError(f"{where}: {column.name}: {error}") from None
            yield FileRow(where, tuple(values))

    def cells(self, indices: Sequence[int | None]) -> Iterator[Row]:
        """Where each row stands, and its raw cells of some columns; ``None``: of no column."""
        raise NotImplementedError


class FileTable(ForeignTable):
    """A table in a file: ``.parquet``, or else text. ``titles`` are those of its columns; a text
    without a header has none. ``uneven``: rows of a text may have more or fewer cells than the
    header; of known formats only, whose columns stand in their order.

    Raises UserError for a file that cannot be read.
    """

    def __init__(self, path: Path, *, uneven: bool = False) -> None:
        self.path, self._uneven = path, uneven
        check_is_file(path)
        self._is_text = path.suffix != ".parquet"
        if not self._is_text:
            with parquet.opened(path) as file:
                self.titles = _printable(path, file.schema_arrow.names)
            self.columns = len(self.titles)
            return
        comment, content = "", list[str]()
        with _lines(path) as lines:
            for line in map(str.strip, lines):
                if line.startswith("#"):
                    comment = comment if content else line.strip("# ")
                elif line.strip(EMPTY):
                    content.append(line)
                if len(content) == 2:
                    break
        if not content and not comment:
            raise UserError(f"{path}: is empty")
        first, second = [*content, "", ""][:2]
        mark = next((mark for mark in MARKS if mark in first), BLANKS)
        if mark == BLANKS and not uneven and len(first.split()) != len(second.split()):
            mark = ";"  # blanks in the title of a single column
        self.separator, cells = mark, _split(first, mark)
        self.columns = len(cells)
        self._has_header = not all(map(_is_number_cell, cells))
        if self._has_header:
            self.titles = _printable(path, cells)
        elif len(titles := _split(comment, mark)) == self.columns:
            self.titles = _printable(path, titles)

    def cells(self, indices: Sequence[int | None]) -> Iterator[Row]:
        if self._is_text:
            for where, cells in self._of_text():
                yield where, [None if index is None else cells[index] for index in indices]
        else:
            yield from self._of_parquet(indices)

    def _of_text(self) -> Iterator[Row]:
        with _lines(self.path) as lines:
            rows: Iterator[tuple[int, list[str]]]
            if self.separator == BLANKS:
                rows = ((number, line.split()) for number, line in enumerate(lines, 1))
            else:
                reader = csv.reader(lines, delimiter=self.separator, strict=True)
                rows = ((reader.line_num, [*map(str.strip, cells)]) for cells in reader)
            rows = (row for row in rows if any(row[1]) and not row[1][0].startswith("#"))
            if self._has_header:
                next(rows, None)
            for number, cells in rows:
                extra = cells[self.columns :]
                if not self._uneven and (any(extra) or len(cells) < self.columns):
                    text = f"has {len(cells)} values, the header {self.columns}"
                    raise UserError(f"{self.path}: line {number}: {text}")
                yield f"{self.path}: line {number}", cells + [""] * (self.columns - len(cells))

    def _of_parquet(self, indices: Sequence[int | None]) -> Iterator[Row]:
        names = ["" if index is None else self.titles[index] for index in indices]
        number = 0
        for batch in parquet.batches(self.path, [*filter(None, names)], BATCH_ROWS):
            for cells in zip(*(batch[name] for name in names), strict=True):
                number += 1
                yield f"{self.path}: row {number}", list(cells)


class DataFrameTable(ForeignTable):
    """A pandas DataFrame as a table; ``name`` begins its errors."""

    def __init__(self, frame: "pandas.DataFrame", name: str) -> None:
        self.path, self._frame = Path(name), frame
        self.titles = _printable(self.path, map(str, frame.columns))

    def cells(self, indices: Sequence[int | None]) -> Iterator[Row]:
        frame = self._frame.astype(object).where(self._frame.notna(), None)
        empty = [None] * len(frame)
        columns = [empty if at is None else frame.iloc[:, at].tolist() for at in indices]
        for number, cells in enumerate(zip(*columns, strict=True), start=1):
            yield f"{self.path}: row {number}", list(cells)


def _printable(path: Path, titles: Iterable[str]) -> tuple[str, ...]:
    """The titles of a table. Raises UserError for one that nobody can see as it is, which no column
    is called.
    """
    found = tuple(titles)
    for title in found:
        if not title.isprintable():
            raise UserError(f"{path}: title {short_repr(title)}: has characters that are no text")
    return found


def with_point(cell: Any) -> Any:
    """A number with a decimal comma, written with a point."""
    if isinstance(cell, str) and cell.count(",") == 1 and "." not in cell:
        return cell.replace(",", ".")
    return cell


@contextmanager
def _lines(path: Path) -> Iterator[Iterator[str]]:
    """The lines of a text. What its bytes, its quotes or its size have wrong becomes a
    ``UserError``.
    """
    what = f"{path}: not a readable CSV file"
    with (
        usable(path, "cannot be read"),
        as_user_error(f"{what}: save it as UTF-8", UnicodeError),
        as_user_error(what, csv.Error, EOFError, zlib.error, gzip.BadGzipFile),
        gzip.open(path) if is_gzip(path) else path.open("rb") as data,
    ):
        mark = data.read(2)
        data.seek(0)
        is_utf_16 = mark in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        text = io.TextIOWrapper(data, "utf-16" if is_utf_16 else "utf-8-sig", newline="")
        yield _bounded(text, path)


def _bounded(text: io.TextIOBase, path: Path) -> Iterator[str]:
    """The lines of a text, as long as they are no attack on the memory."""
    size, limit = 0, MAX_CHARACTERS
    if is_gzip(path):
        limit = min(limit, max(SMALL_CHARACTERS, MAX_EXPANSION * path.stat().st_size))
    while line := text.readline(MAX_LINE):
        size += len(line)
        if len(line) == MAX_LINE:
            raise UserError(f"{path}: has a line of {MAX_LINE:,} characters or more")
        if size > limit:
            raise UserError(f"{path}: has more than {limit:,} characters")
        yield line


def is_gzip(path: Path) -> bool:
    """Whether a file is compressed by gzip."""
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


def _split(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    while len(cells) > 1 and not cells[-1]:
        cells.pop()  # separators at the end
    return cells


def _is_number_cell(cell: object) -> bool:
    """Whether a cell holds a number, infinite or none of them included."""
    try:
        plain_number(with_point(cell))
    except ValueError:
        return False
    return True
