"""Tables that somebody else wrote, as text or Parquet: rows of typed values, and errors that name
file, line and column.

Text is in UTF-8 or UTF-16, plain or compressed by gzip. What separates its columns, the decimal
mark and the units are found in the file: ``time_ms``, ``Time [ms]`` and ``time (s)`` all are the
column ``time_s``.
"""

import codecs
import csv
import gzip
import io
import math
import re
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, NamedTuple, cast

from genie_sim.base import parquet, units
from genie_sim.base.errors import UserError, as_user_error, short_repr
from genie_sim.base.paths import usable

FLAGS = {"true": True, "false": False, "1": True, "0": False}
MAX_TEXT = 100
BATCH_ROWS = 65_536  # of a Parquet file, in memory at once
HEAD_BYTES = 65_536  # of a text, in which the header stands and its separator is found
SAMPLE_LINES = 20  # that tell the separator
GZIP = b"\x1f\x8b"  # how a file begins that is compressed so
MAX_UNPACKED_BYTES = 2 * 10**9
MAX_LINE_BYTES = 1_000_000
BLANKS = " "  # separates columns: any number of spaces and tabs
SURE = "\t;,"  # separate columns wherever they stand
MARKS = ",; \t\r\n"  # a line of nothing else is empty
# What is text, but no table, by how it begins.
OTHERS = {
    "JSON": ("{", "["),
    "XML": ("<",),
    "sentences of NMEA 0183": ("$GP", "$GN", "$GL", "$GA", "$GB"),
}
SAYS_SEPARATOR = re.compile("sep=(.)")  # Excel's first line

# What a unit in a title measures, and how many of the smallest unit it is.
UNITS: dict[str, tuple[str, float]] = {
    **{name: ("time", float(value)) for name, value in units.DURATIONS.items()},
    **{name: ("length", float(value)) for name, value in units.LENGTHS.items()},
    **{name.lower(): ("rate", float(value)) for name, value in units.RATES.items()},
    **{f"{mark}bps": ("rate", 10.0**power) for mark, power in (("", 0), ("k", 3), ("m", 6))},
    **{f"{mark}b/s": ("rate", 10.0**power) for mark, power in (("", 0), ("k", 3), ("m", 6))},
    "gbps": ("rate", 1e9),
    "gb/s": ("rate", 1e9),
    "sec": ("time", 1e9),
    "seconds": ("time", 1e9),
    "msec": ("time", 1e6),
    "milliseconds": ("time", 1e6),
    "μs": ("time", 1e3),
    "microseconds": ("time", 1e3),
    "nanoseconds": ("time", 1.0),
    "meters": ("length", 1.0),
    "metres": ("length", 1.0),
    "deg": ("angle", 1.0),
    "°": ("angle", 1.0),
    "degrees": ("angle", 1.0),
    "rad": ("angle", math.degrees(1.0)),
    "radians": ("angle", math.degrees(1.0)),
}
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
    must be finite and from ``lowest`` to ``highest``. An optional column may be missing, and its
    values may be empty: they read as ``None``.
    """

    name: str
    kind: Literal["number", "text", "flag"] = "number"
    lowest: float = -math.inf
    highest: float = math.inf
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

    def _number(self, raw: object, factor: float) -> float:
        try:  # what most cells hold
            number = float(raw if type(raw) is str and raw.isascii() and "_" not in raw else "")
        except ValueError:
            number = plain_number(raw)
        if factor != 1.0:
            number *= factor
        if not (math.isfinite(number) and self.lowest <= number <= self.highest):
            limits = ""
            if math.isfinite(self.highest):
                limits = f" from {self.lowest:g} to {self.highest:g}"
            elif math.isfinite(self.lowest):
                limits = f" of at least {self.lowest:g}"
            raise ValueError(f"must be a number{limits}, not {short_repr(raw)}")
        return number


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


class FileTable:
    """A table in a file: ``.parquet``, or else text. ``titles`` are those of its columns; a text
    without a header has none. ``uneven``: rows of a text may have more or fewer cells than the
    header; of known formats only, whose columns stand in their order.

    Raises UserError for a file that cannot be read.
    """

    def __init__(self, path: Path, *, uneven: bool = False) -> None:
        self.path = path
        if not path.is_file():
            raise UserError(f"{path}: no such file")
        self.is_text = path.suffix != ".parquet"
        if self.is_text:
            self._text = _TextLayout(path, uneven)
            self.titles = self._text.titles
        else:
            with parquet.opened(path) as file:
                self.titles = tuple(file.schema_arrow.names)

    @property
    def columns(self) -> int:
        """How many columns there are, with or without titles."""
        return self._text.columns if self.is_text else len(self.titles)

    def place(self, column: FileColumn) -> _ColumnPlace | None:
        """Where a column stands; ``None`` where there is none. Raises UserError for one that is
        there twice, or whose unit nobody tells.
        """
        wanted, name = title_of(column.name), column.name
        count = self.titles.count(name)
        if count > 1:
            raise UserError(f"{self.path}: column {name!r} is there {count} times")
        if count:
            return _ColumnPlace(self.titles.index(name), 1.0)
        kind, factor = UNITS.get(wanted.unit, ("", 1.0))
        same = [
            _ColumnPlace(index, UNITS[title.unit][1] / factor if title.unit else 1.0)
            for index, title in enumerate(map(title_of, self.titles))
            if title.stem == wanted.stem and UNITS.get(title.unit, ("", 1.0))[0] == kind
        ]
        if len(same) > 1:
            among = ", ".join(short_repr(self.titles[place.number]) for place in same)
            raise UserError(f"{self.path}: column {name!r} could be each of {among}: keep one")
        if same:
            return same[0]
        for title in self.titles:
            if wanted.unit and title.lower() == wanted.stem:
                raise UserError(
                    f"{self.path}: column {name!r} is missing; {short_repr(title)} has no unit: "
                    f"call it {name}, or {wanted.stem}_ and its unit"
                )
        return None

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
                raise UserError(f"{self.path}: {_missing(column.name, self.titles)}")
        factors = [1.0 if place is None else place.factor for place in places]
        indices = [None if place is None else place.number for place in places]
        with_comma = self.is_text and self._text.separator != ","
        numbers = [with_comma and column.kind == "number" for column in columns]
        for where, cells in self.cells(indices):
            if with_comma:
                cells = [
                    with_point(cell) if number else cell
                    for cell, number in zip(cells, numbers, strict=True)
                ]
            try:
                values = tuple(map(FileColumn.value, columns, cells, factors))
            except ValueError:
                raise _error(where, columns, cells, factors) from None
            yield FileRow(where, values)

    def cells(self, indices: Sequence[int | None]) -> Iterator[tuple[str, list[Any]]]:
        """Where each row stands, and its raw cells of some columns; ``None``: of no column."""
        if not self.is_text:
            yield from self._parquet_cells(indices)
            return
        begin = f"{self.path}: line "
        for number, cells in self._text.rows():
            yield (
                f"{begin}{number}",
                [None if index is None else cells[index].strip() for index in indices],
            )

    def _parquet_cells(self, indices: Sequence[int | None]) -> Iterator[tuple[str, list[Any]]]:
        names = ["" if index is None else self.titles[index] for index in indices]
        number = 0
        for batch in parquet.batches(self.path, [*filter(None, names)], BATCH_ROWS):
            for cells in zip(*(batch[name] for name in names), strict=True):
                number += 1
                yield f"{self.path}: row {number}", list(cells)


def read_rows(path: Path, columns: Sequence[FileColumn]) -> Iterator[FileRow]:
    """``FileTable.rows`` of a file."""
    return FileTable(path).rows(columns)


def _error(
    where: str, columns: Sequence[FileColumn], raw: Sequence[object], factors: Sequence[float]
) -> UserError:
    """What is wrong in a row with a wrong value."""
    for column, cell, factor in zip(columns, raw, factors, strict=True):
        try:
            column.value(cell, factor)
        except ValueError as error:
            return UserError(f"{where}: {column.name}: {error}")
    raise AssertionError("no value of the row is wrong")


def _missing(name: str, header: Sequence[str]) -> str:
    names = ", ".join(short_repr(title) for title in header[:12])
    return f"column {name!r} is missing; the file has {names or 'none'}"


def with_point(cell: Any) -> Any:
    """A number with a decimal comma, written with a point."""
    if isinstance(cell, str) and cell.count(",") == 1 and "." not in cell:
        return cell.replace(",", ".")
    return cell


class _TextLayout:
    """How a text is written: its encoding, its separator, its titles, and where its rows begin."""

    def __init__(self, path: Path, uneven: bool) -> None:
        self.path, self._uneven = path, uneven
        with self._readable():
            self._is_packed = is_gzip(path)
            self._check_size()
            with self._opened() as file:
                head = file.read(HEAD_BYTES)
            is_utf_16 = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            self.encoding = "utf-16" if is_utf_16 else "utf-8-sig"
            is_whole = len(head) < HEAD_BYTES
            text = codecs.getincrementaldecoder(self.encoding)().decode(head, final=is_whole)
        for what, begins in OTHERS.items():
            if text.lstrip().startswith(begins):
                raise UserError(f"{path}: is no table: it holds {what}")
        lines = list(io.StringIO(text, newline=""))
        if not is_whole:
            lines = lines[:-1] or lines  # the last one is cut off
        comment, said = "", ""
        self._skipped = 0
        for line in map(str.strip, lines):
            if line.startswith("#"):
                comment = line.strip("# ")
            elif found := SAYS_SEPARATOR.fullmatch(line):
                said = found[1]
            elif line.strip(MARKS):
                break
            self._skipped += 1
        self._skipped += _before_header(lines[self._skipped :][:SAMPLE_LINES])
        sample = [line for line in lines[self._skipped :][:SAMPLE_LINES] if line.strip(MARKS)]
        self.separator = said or _separator(sample[:1] if uneven else sample)
        header = _split(sample[0], self.separator) if sample else []
        self.columns = len(header)
        self.titles: tuple[str, ...] = ()
        if not all(map(is_number, header)):
            self.titles = tuple(header)
            self._skipped += 1
        elif len(titles := _split(comment, self.separator)) == len(header):
            self.titles = tuple(titles)

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The number of each line that is not empty, and its cells. Raises UserError for one with
        another number of cells than the header.
        """
        with (
            self._readable(),
            self._opened() as data,
            io.TextIOWrapper(data, encoding=self.encoding, newline="") as file,
        ):
            for _ in range(self._skipped):
                next(file, "")
            for number, cells in _numbered(file, self.separator, self._skipped):
                if len(cells) != self.columns:
                    if not "".join(cells).strip():
                        continue
                    if self._uneven:
                        yield number, cells + [""] * (self.columns - len(cells))
                        continue
                    if "".join(cells[self.columns :]) or len(cells) < self.columns:
                        raise UserError(
                            f"{self.path}: line {number}: has {len(cells)} values, "
                            f"the header {self.columns}"
                        )
                elif not cells[0] and not "".join(cells).strip():
                    continue
                yield number, cells

    def _opened(self) -> IO[bytes]:
        if self._is_packed:
            return cast(IO[bytes], gzip.open(self.path))
        return self.path.open("rb")

    def _check_size(self) -> None:
        """Raises UserError for a file that unpacks to too much or has a line without an end: before
        anything is parsed.
        """
        size = begun = 0
        with self._opened() as file:
            while chunk := file.read(HEAD_BYTES):
                size += len(chunk)
                if self._is_packed and size > MAX_UNPACKED_BYTES:
                    raise UserError(
                        f"{self.path}: unpacks to more than {MAX_UNPACKED_BYTES:,} bytes"
                    )
                end = max(chunk.rfind(b"\n"), chunk.rfind(b"\r"))
                begun = len(chunk) - end - 1 + (begun if end < 0 else 0)
                if begun > MAX_LINE_BYTES:
                    raise UserError(
                        f"{self.path}: has a line of more than {MAX_LINE_BYTES:,} bytes"
                    )

    @contextmanager
    def _readable(self) -> Iterator[None]:
        """What the file's bytes or quotes have wrong becomes a UserError."""
        what = f"{self.path}: not a readable CSV file"
        with (
            usable(self.path, "cannot be read"),
            as_user_error(f"{what}: save it as UTF-8", UnicodeError),
            as_user_error(what, csv.Error, EOFError, zlib.error, gzip.BadGzipFile),
        ):
            yield


def is_gzip(path: Path) -> bool:
    """Whether a file is compressed by gzip."""
    with path.open("rb") as file:
        return file.read(len(GZIP)) == GZIP


def _numbered(file: IO[str], separator: str, before: int) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line of a file of which ``before`` lines have been read."""
    if separator == BLANKS:
        for number, line in enumerate(file, before + 1):
            yield number, line.split()
        return
    rows = csv.reader(file, delimiter=separator, strict=True)
    for cells in rows:
        yield before + rows.line_num, cells


def _before_header(lines: Sequence[str]) -> int:
    """How many of some lines stand before the header: those without a separator, such as a date,
    where lines with several follow.
    """
    plain = next((at for at, line in enumerate(lines) if any(mark in line for mark in SURE)), 0)
    is_table = lines and any(lines[plain].count(mark) > 1 for mark in SURE)
    return plain if is_table else 0


def _separator(lines: Sequence[str]) -> str:
    """What separates the columns of some lines, the first of which is the header: what gives all
    of them the same number of columns. A table without any has one column.
    """
    marks = [mark for mark in SURE if lines and mark in lines[0]]
    for mark in [*marks, BLANKS]:
        counts = {len(_split(line, mark)) for line in lines}
        if len(counts) == 1 and counts != {1}:
            return mark
    return marks[0] if marks else ";"


def _split(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return line.split()
    cells = next(csv.reader([line.strip("\r\n")], delimiter=separator), [])
    while len(cells) > 1 and not cells[-1].strip():
        cells.pop()  # separators at the end
    return [cell.strip() for cell in cells]


def is_number(cell: object) -> bool:
    """Whether a cell holds a number, infinite or none of them included."""
    try:
        plain_number(with_point(cell))
    except ValueError:
        return False
    return True
