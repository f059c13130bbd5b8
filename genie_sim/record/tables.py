"""Tables in compact column buffers, written to Parquet files.

The bytes of a file depend on its rows and on the version of pyarrow, which signs its files.
"""

import json
import struct
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, get_args, get_origin, get_type_hints

import numpy as np

from genie_sim.base import parquet
from genie_sim.base.docstrings import docstring
from genie_sim.base.errors import UserError, short_repr
from genie_sim.base.paths import usable
from genie_sim.record.columns import NO_TEXT, Array, Codes, Columns, Text

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

ROWS_PER_GROUP = 65_536
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # of formulas in spreadsheets

Value = int | float | str | bool | None

# Kind of a column: the array's type code and the value that stands for None in the buffer only.
_BUFFERS: dict[str, tuple[str, int | float]] = {
    "int64": ("q", -(2**63)),
    "int32": ("i", -(2**31)),
    "float64": ("d", float("nan")),
    "bool": ("b", -1),
    "text": ("i", -1),
}
_NO_CODE = -2  # of a text that no row has
_ROWS_AT_ONCE = 4096  # go into the buffers: several times faster than one by one


Int32 = Annotated[int, "int32"]  # a count that 32 bits hold
_KINDS = {int: "int64", float: "float64", bool: "bool", str: "text"}


@dataclass(frozen=True, slots=True)
class Column:
    """A column's name, type, unit and meaning."""

    name: str
    kind: str
    unit: str
    description: str
    nullable: bool = False


@dataclass(frozen=True, slots=True)
class Schema:
    """A table's name, what one row of it is, its columns, by which of them it is sorted (none: rows
    keep the order in which they were added), and the one whose instant [ns] tells whether a row is
    after the warm-up (empty: all rows count).
    """

    name: str
    description: str
    columns: tuple[Column, ...]
    sorted_by: tuple[str, ...] = ()
    instant: str = ""

    @classmethod
    def of_rows(
        cls, name: str, row: type, *, instant: str = "", sorted_by: tuple[str, ...] = ()
    ) -> "Schema":
        """Returns the schema of a class whose instances are rows: its docstring tells what a row
        is, and a field ``Annotated[type, unit, description]`` is a column.
        """
        hints = get_type_hints(row, include_extras=True)
        columns = [
            _column(field, hint) for field, hint in hints.items() if get_origin(hint) is Annotated
        ]
        meaning = " ".join(docstring(row).split())
        return cls(name, meaning, tuple(columns), sorted_by=sorted_by, instant=instant)

    def arrow(self) -> "pa.Schema":
        """Types, with unit and description beside each column."""
        import pyarrow as pa

        types = {
            "int64": pa.int64(),
            "int32": pa.int32(),
            "float64": pa.float64(),
            "bool": pa.bool_(),
        }
        text = pa.dictionary(pa.int32(), pa.string())
        fields = []
        for column in self.columns:
            kind = types.get(column.kind, text)
            metadata = {"unit": column.unit, "description": column.description}
            fields.append(pa.field(column.name, kind, column.nullable, metadata))
        about = json.dumps({"table": self.name})
        return pa.schema(fields, metadata={parquet.METADATA_KEY: about.encode()})


def _column(name: str, hint: Any) -> Column:
    """Returns the column that an annotated field describes."""
    *_, unit, description = hint.__metadata__
    alternatives = get_args(hint.__origin__)  # of a union
    value_types = [kind for kind in alternatives if kind is not NoneType] or [hint]
    (value_type,) = value_types
    if "int32" in getattr(value_type, "__metadata__", ()):
        kind = "int32"
    else:
        kind = _KINDS[getattr(value_type, "__origin__", value_type)]
    return Column(name, kind, unit, description, nullable=NoneType in alternatives)


class _Buffer:
    """The values of one column; text is kept as small integers."""

    def __init__(self, column: Column) -> None:
        typecode, self._none = _BUFFERS[column.kind]
        self.about = column
        self.values = array(typecode)
        self.codes = Codes()
        self._is_text = column.kind == "text"

    def extend(self, values: Sequence[Any], first: int, step: int) -> None:
        """Adds every ``step``-th value from the ``first`` one on. Raises TypeError for a None in a
        column that is never empty.
        """
        cells, codes, none = values[first::step], self.codes, self._none
        try:
            if not self.about.nullable:
                encoded = list(map(codes.__getitem__, cells)) if self._is_text else cells
            elif self._is_text:
                encoded = [none if cell is None else codes[cell] for cell in cells]
            else:
                encoded = [none if cell is None else cell for cell in cells]
            # several times faster than array.extend
            made = struct.pack(f"{len(encoded)}{self.values.typecode}", *encoded)
        except (TypeError, OverflowError, struct.error) as error:
            is_empty = None in cells
            raise TypeError(
                f"column {self.about.name!r} is never empty" if is_empty else str(error)
            ) from None
        self.values.frombytes(made)

    def extend_column(self, values: Any) -> None:
        """Adds values at the end, as ``column`` returns them."""
        if self._is_text:
            # Names that no row has would go into the file.
            names = values.unique()
            codes = np.array([*(self.codes[name] for name in names), self._none])
            encoded = codes[values.codes_in(names)]  # NO_TEXT is the last
        elif not self.about.nullable or self.about.kind == "float64":
            encoded = values
        else:
            is_known = [value is not None and value == value for value in values.tolist()]
            encoded = np.where(is_known, values, self._none)
        self.values.frombytes(encoded.astype(self.values.typecode).tobytes())

    def encode(self, value: Any) -> Any:
        """What stands for a value in the buffer; a text that is not there has a code of its own."""
        return self.codes.get(value, _NO_CODE) if self._is_text else value

    def decode(self, value: Any) -> Any:
        """What ``extend`` was given for it."""
        if self.about.nullable and (value == self._none or value != value):
            return None
        if self._is_text:
            return list(self.codes)[value]
        return bool(value) if self.about.kind == "bool" else value

    def numpy(self, rows: int) -> Array:
        return np.frombuffer(self.values, dtype=self.values.typecode, count=rows)

    def column(self, values: Array) -> Any:
        """Returns values of this column as ``read`` finds them in a file."""
        if self._is_text:
            return Text.of(values, list(self.codes))
        if self.about.kind == "float64":
            return values
        unknown = values == self._none if self.about.nullable else None
        if self.about.kind == "bool":
            values = values == 1
        if unknown is None or not unknown.any():
            return values
        values = values.astype(object if self.about.kind == "bool" else "float64")
        values[unknown] = None
        return values

    def arrow(self, values: Array) -> "pa.Array":
        """Returns values of this column for a file.

        Made from buffers: given an array or a list, pyarrow imports pandas to see whether it is one
        of pandas', and that import takes as long as a short run.
        """
        import pyarrow as pa

        validity = None
        if self.about.nullable:
            valid = ~np.isnan(values) if self.about.kind == "float64" else values != self._none
            validity = pa.py_buffer(np.packbits(valid, bitorder="little"))
        if self._is_text:
            text = Text.of(values, list(self.codes))
            encoded = [name.encode() for name in text.names]
            ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
            names = pa.StringArray.from_buffers(
                len(encoded), pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))
            )
            codes = pa.Array.from_buffers(
                pa.int32(), len(values), [validity, pa.py_buffer(np.maximum(text.codes, 0))]
            )
            return pa.DictionaryArray.from_arrays(codes, names)
        if self.about.kind == "bool":
            bits = np.packbits(values == 1, bitorder="little")
            return pa.Array.from_buffers(pa.bool_(), len(values), [validity, pa.py_buffer(bits)])
        kind = getattr(pa, self.about.kind)()
        return pa.Array.from_buffers(
            kind, len(values), [validity, pa.py_buffer(np.ascontiguousarray(values))]
        )


class Table:
    """Rows of one schema: in memory first, in a Parquet file afterwards.

    Parameters
    ----------
    schema : Schema
        The columns.
    spill : Path, optional
        A file to which rows go as they come, 65,536 at a time, so that few are in memory at any
        time; ``write`` gives it its name. Only for tables that keep the order of their rows.
    """

    def __init__(self, schema: Schema, spill: Path | None = None) -> None:
        if spill is not None and schema.sorted_by:
            raise ValueError(f"{schema.name}: rows that will be sorted stay in memory")
        self.schema, self.name = schema, schema.name
        self._buffers = {column.name: _Buffer(column) for column in schema.columns}
        self._new: list[Value] = []  # of rows that are not in the columns yet, row by row
        self._width = len(schema.columns)
        self._room = _ROWS_AT_ONCE * self._width  # for new values
        self._rows = 0
        self._warm_up_ns = 0
        self._spill = spill
        self._spilled = 0
        self._writer: pq.ParquetWriter | None = None
        self._open = ExitStack()
        self._written: Path | None = None

    def __len__(self) -> int:
        return self._spilled + self._rows + len(self._new) // self._width

    def leave_out(self, warm_up_ns: int) -> None:
        """From now on rows whose instant is before the end of the warm-up are not added; those
        without one are.
        """
        self._warm_up_ns = warm_up_ns if self.schema.instant else 0

    def _counted(self, values: Sequence[Value]) -> list[Value]:
        """Returns the rows that are added of those given."""
        place = [column.name for column in self.schema.columns].index(self.schema.instant)
        counted: list[Value] = []
        for begin in range(0, len(values), self._width):
            instant_ns = values[begin + place]
            if instant_ns is None or instant_ns >= self._warm_up_ns:  # type: ignore[operator]
                counted += values[begin : begin + self._width]
        return counted

    def append(self, row: Sequence[Value]) -> None:
        """Adds a row; its values are in the order of the columns. Raises ``ValueError`` unless each
        column has one.
        """
        self.extend(row)

    def extend(self, values: Sequence[Value]) -> None:
        """Adds rows; their values stand one after the other, in the order of the columns. Raises
        ``ValueError`` unless each column has as many.
        """
        if len(values) % self._width:
            text = f"{len(values)} values are no whole rows of {self._width} columns"
            raise ValueError(f"{self.name}: {text}")
        self._new += self._counted(values) if self._warm_up_ns else values
        while len(self._new) >= self._room:
            self._store(self._room)

    def extend_columns(self, columns: Columns) -> None:
        """Adds the rows of a table with the same columns, as ``read`` or ``columns`` gives them."""
        self._store()
        if self._warm_up_ns:
            columns = columns.rows(~(columns.floats(self.schema.instant) < self._warm_up_ns))
        begin, count = 0, len(columns)
        while begin < count:
            end = min(begin + ROWS_PER_GROUP - self._rows % ROWS_PER_GROUP, count)
            for name, buffer in self._buffers.items():
                buffer.extend_column(columns[name][begin:end])
            self._rows += end - begin
            self._spill_full_group()
            begin = end

    def _store(self, max_values: int | None = None) -> None:
        """Moves the new rows into the buffers, at most so many values."""
        new = self._new[:max_values]
        del self._new[:max_values]
        for place, buffer in enumerate(self._buffers.values()):
            buffer.extend(new, place, self._width)
        self._rows += len(new) // self._width
        self._spill_full_group()

    def _spill_full_group(self) -> None:
        if self._spill is not None and self._rows >= ROWS_PER_GROUP:
            self._spill_rows(self._spill)

    def take(self, **cells: Value) -> dict[str, Any] | None:
        """Takes the row with these cells out again, by column; ``None`` if there is none. Slow. The
        last row takes its place.
        """
        self._store()
        matches = np.ones(self._rows, dtype=bool)
        for name, value in cells.items():
            buffer = self._buffers[name]
            matches &= buffer.numpy(self._rows) == buffer.encode(value)
        if not matches.any():
            return None
        place, row = int(matches.argmax()), {}
        for name, buffer in self._buffers.items():
            row[name] = buffer.decode(buffer.values[place])
            buffer.values[place] = buffer.values[-1]
            buffer.values.pop()
        self._rows -= 1
        return row

    def write(self, path: Path) -> None:
        """Writes the table: zstd, groups of 65,536 rows, no time, no host. No row can be added
        afterwards to a table that spilled.

        Raises UserError where the file cannot be written. Use it within ``paths.atomic_write`` or
        ``folders.result_folder``, so that no half table is left.
        """
        self._store()
        if self._writer is not None and self._spill is not None:
            with usable(path):
                self._write_rows(self._writer)
                self._open.close()
                self._written = self._spill.replace(path)
            return
        with usable(path), path.open("wb") as file, self._parquet(file) as writer:
            self._write_rows(writer)

    def columns(self) -> Columns:
        """Returns the columns as ``read`` finds them in the file."""
        if self._spilled:
            assert self._written is not None, "a table that spilled is written before it is read"
            return read(self._written, self.schema, trusted=True)
        self._store()
        order = self._order()
        columns = {}
        for name, buffer in self._buffers.items():
            columns[name] = buffer.column(buffer.numpy(self._rows)[order])
        return Columns(columns)

    def to_frame(self) -> "pd.DataFrame":
        """Returns a pandas table. Text is categorical, an unknown number NaN."""
        return self.columns().to_frame()

    def _parquet(self, file: BinaryIO) -> "pq.ParquetWriter":
        """Returns a writer into an open file; a path would be taken for a URI by pyarrow."""
        import pyarrow.parquet as pq

        texts = [column.name for column in self.schema.columns if column.kind == "text"]
        return pq.ParquetWriter(
            file, self.schema.arrow(), compression="zstd", version="2.6", use_dictionary=texts
        )

    def _write_rows(self, writer: "pq.ParquetWriter") -> None:
        for batch in self._batches():
            writer.write_batch(batch, row_group_size=ROWS_PER_GROUP)

    def _spill_rows(self, spill: Path) -> None:
        with usable(spill):
            if self._writer is None:
                self._writer = self._open.enter_context(
                    self._parquet(self._open.enter_context(spill.open("wb")))
                )
            self._write_rows(self._writer)
        for buffer in self._buffers.values():
            del buffer.values[:]
        self._spilled += self._rows
        self._rows = 0

    def _order(self) -> Array:
        """Returns the indices of the rows, sorted if the schema says so."""
        keys = []
        for name in reversed(self.schema.sorted_by):
            key = self._buffers[name].column(self._buffers[name].numpy(self._rows))
            keys.append(key.codes if isinstance(key, Text) else key)
        return np.lexsort(keys) if keys else np.arange(self._rows)

    def _batches(self) -> "Iterator[pa.RecordBatch]":
        import pyarrow as pa

        schema, order = self.schema.arrow(), self._order()
        for start in range(0, self._rows, ROWS_PER_GROUP):
            rows = order[start : start + ROWS_PER_GROUP]
            arrays = [
                buffer.arrow(buffer.numpy(self._rows)[rows]) for buffer in self._buffers.values()
            ]
            yield pa.RecordBatch.from_arrays(arrays, schema=schema)


def write(path: Path, schema: Schema, columns: Columns) -> None:
    """Writes columns as ``Table.write`` writes the same rows. Raises UserError."""
    table = Table(schema)
    table.extend_columns(columns)
    table.write(path)


def read(path: Path, schema: Schema, *, trusted: bool = False) -> Columns:
    """Returns the rows of a file that a table of this schema wrote. What this program has just
    written is ``trusted``: it may take any memory.

    Raises UserError for a missing, truncated or foreign file, another table or other columns.
    """

    def columns(found: "pa.Schema", about: Mapping[str, Any]) -> list[str]:
        if about.get("table") != schema.name:
            raise UserError(
                f"{path}: holds the table {about.get('table')!r}, expected {schema.name!r}"
            )
        parquet.check_columns(path, found, schema.arrow())
        return [column.name for column in schema.columns]

    table, _ = parquet.read(path, "file", columns, trusted=trusted)
    return Columns({field.name: _read_column(table.column(field.name)) for field in table.schema})


def check_rows(path: Path, schema: Schema, rows: Columns, count: object) -> None:
    """Raises ``UserError`` unless a file that was ``read`` has this ``count`` of rows, and each of
    those that a key sorts once.
    """
    if len(rows) != count:
        told = "no number of them" if count is None else short_repr(count)
        raise UserError(f"{path}: holds {len(rows):,} rows, but run.json says {told}")
    if not schema.sorted_by:
        return
    is_later, is_equal = np.zeros((2, max(len(rows) - 1, 0)), dtype=bool)
    is_equal[:] = True
    for name in schema.sorted_by:
        column = rows[name]
        steps = np.diff(column.codes if isinstance(column, Text) else column)
        is_later |= is_equal & (steps > 0)
        is_equal &= steps == 0
    if not is_later.all():
        place = int(is_later.argmin()) + 1
        keys = ", ".join(schema.sorted_by)
        raise UserError(f"{path}: row {place}: {keys}: not after that of the row before")


def harmless(cell: Any) -> Any:
    """Returns a cell for CSV: a text that a spreadsheet would take for a formula gets an apostrophe
    in front.
    """
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA_STARTS) else cell


def _read_column(column: "pa.ChunkedArray") -> Any:
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        return column.to_numpy()
    # The row groups of a file may have different dictionaries.
    combined = column.unify_dictionaries().combine_chunks()
    codes = np.nan_to_num(combined.indices.to_numpy(zero_copy_only=False), nan=NO_TEXT)
    return Text.of(codes.astype(np.int32), combined.dictionary.to_pylist())
