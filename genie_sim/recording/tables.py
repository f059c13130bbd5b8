"""Tables in compact column buffers, streamed to Parquet files whose bytes depend on their rows alone.

(And on the pyarrow that wrote them, which signs its files with its version.)
"""

import json
import struct
from array import array
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from genie_sim import parquet
from genie_sim.errors import UserError, short_repr
from genie_sim.recording.columns import NO_TEXT, Array, Columns, Text

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

FORMAT_VERSION = 2
ROWS_PER_GROUP = 65_536
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a formula of a spreadsheet begins

Value = int | float | str | bool | None

# Kind of a column: the array's type code and the value that stands for None in the buffer only.
_BUFFERS: dict[str, tuple[str, int | float]] = {
    "int64": ("q", -(2**63)),
    "int32": ("i", -(2**31)),
    "float64": ("d", float("nan")),
    "bool": ("b", -1),
    "text": ("i", -1),
}
_BUFFERED = (
    4096  # rows that go into the columns at once, which is several times faster than one by one
)


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
    """A table's name, what one row of it is, its columns, and by which of them it is sorted (none: rows keep the order
    in which they were added)."""

    name: str
    description: str
    columns: tuple[Column, ...]
    sorted_by: tuple[str, ...] = ()

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
            about = {"unit": column.unit, "description": column.description}
            fields.append(
                pa.field(column.name, types.get(column.kind, text), column.nullable, about)
            )
        told = json.dumps({"format_version": FORMAT_VERSION, "table": self.name}, sort_keys=True)
        return pa.schema(fields, metadata={parquet.METADATA_KEY: told.encode()})


class _Codes(dict[str, int]):
    """Text -> the small integer that stands for it, counted up as new ones come."""

    def __missing__(self, text: str) -> int:
        if text is None:
            raise TypeError
        self[text] = code = len(self)
        return code


class _Buffer:
    """The values of one column; text is kept as small integers."""

    def __init__(self, column: Column) -> None:
        code, self._none = _BUFFERS[column.kind]
        self.about = column
        self.values = array(code)
        self.codes = _Codes()
        self._is_text = column.kind == "text"

    def extend(self, values: Sequence[Any]) -> None:
        """Raises TypeError for a None in a column that is never empty."""
        none, codes = self._none, self.codes
        try:
            if not self.about.nullable:
                kept = list(map(codes.__getitem__, values) if self._is_text else values)
            elif self._is_text:
                kept = [none if value is None else codes[value] for value in values]
            else:
                kept = [none if value is None else value for value in values]
            self.values.frombytes(
                struct.pack(f"{len(kept)}{self.values.typecode}", *kept)
            )  # the fastest way of them
        except (TypeError, struct.error) as error:
            raise TypeError(
                f"column {self.about.name!r} is never empty" if None in values else str(error)
            ) from None

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
        """These values as ``read`` finds them in a file."""
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
        """These values for a file. From buffers: of an array or a list, pyarrow looks whether it is one of pandas',
        and imports that, which takes as long as to simulate."""
        import pyarrow as pa

        validity = None
        if self.about.nullable:
            known = ~np.isnan(values) if self.about.kind == "float64" else values != self._none
            validity = pa.py_buffer(np.packbits(known, bitorder="little"))
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
    """Rows of one ``schema``: in memory first, in a Parquet file afterwards.

    With ``spill``, a path, rows go to a file there as they come, 65,536 at a time, and few are in memory at any time.
    ``write`` gives the file its name. That is for tables that keep the order in which rows were added.
    """

    def __init__(self, schema: Schema, spill: Path | None = None) -> None:
        if spill is not None and schema.sorted_by:
            raise ValueError(f"{schema.name}: rows that are to be sorted have to stay in memory")
        self.schema, self.name = schema, schema.name
        self._buffers = {column.name: _Buffer(column) for column in schema.columns}
        self._new: list[Value] = []  # of rows that are not in the columns yet, row by row
        self._width = len(schema.columns)
        self._rows = 0
        self._spill = spill
        self._spilled = 0
        self._writer: pq.ParquetWriter | None = None
        self._open = ExitStack()
        self._written: Path | None = None

    def __len__(self) -> int:
        return self._spilled + self._rows + len(self._new) // self._width

    def append(self, values: Sequence[Value]) -> None:
        """Adds a row, or several one after the other; their values are in the order of the columns."""
        self._new += values
        room = _BUFFERED * self._width
        while len(self._new) >= room:
            self._store(room)

    def _store(self, most: int | None = None) -> None:
        """Moves the new rows into the columns, at most so many values."""
        new = self._new[:most]
        del self._new[:most]
        for place, buffer in enumerate(self._buffers.values()):
            buffer.extend(new[place :: self._width])
        self._rows += len(new) // self._width
        if self._spill is not None and self._rows >= ROWS_PER_GROUP:
            self._spill_rows(self._spill)

    def take(self, **known: Value) -> tuple[Value, ...] | None:
        """Takes the row with these values out again, ``None`` if there is none; slow. The last row takes its place."""
        self._store()
        found = np.ones(self._rows, dtype=bool)
        for name, value in known.items():
            buffer = self._buffers[name]
            is_text = buffer.about.kind == "text"
            found &= buffer.numpy(self._rows) == (
                buffer.codes.get(str(value), -1) if is_text else value
            )
        if not found.any():
            return None
        row, values = int(found.argmax()), []
        for buffer in self._buffers.values():
            values.append(buffer.decode(buffer.values[row]))
            buffer.values[row] = buffer.values[-1]
            buffer.values.pop()
        self._rows -= 1
        return tuple(values)

    @property
    def size_bytes(self) -> int:
        """Memory the rows take."""
        self._store()
        return sum(len(buffer.values) * buffer.values.itemsize for buffer in self._buffers.values())

    def write(self, path: Path) -> None:
        """Writes the table: zstd, groups of 65,536 rows, no time, no host. A table that spilled is complete then.

        Raises OSError where the file cannot be written. What shall be there whole or not at all is written within
        ``paths.atomic_write`` or ``provenance.result_folder``.
        """
        self._store()
        if self._writer is not None and self._spill is not None:
            self._write_rows(self._writer)
            self._open.close()
            self._written = self._spill.replace(path)
            return
        with path.open("wb") as file, self._parquet(file) as writer:
            self._write_rows(writer)

    def columns(self) -> Columns:
        """The same columns that ``read`` finds in the file."""
        if self._spilled:
            assert self._written is not None, "what went to a file is read when all of it is there"
            return read(self._written, self.schema)
        self._store()
        order, buffers = self._order(), self._buffers.items()
        return Columns(
            {name: buffer.column(buffer.numpy(self._rows)[order]) for name, buffer in buffers}
        )

    def to_frame(self) -> "pd.DataFrame":
        """The same as a pandas table. Text is categorical, an unknown number NaN."""
        return self.columns().to_frame()

    def _parquet(self, file: BinaryIO) -> "pq.ParquetWriter":
        """A writer into an open file: of a path pyarrow makes a URI, and of a leading "~" a home."""
        import pyarrow.parquet as pq

        texts = [column.name for column in self.schema.columns if column.kind == "text"]
        return pq.ParquetWriter(
            file, self.schema.arrow(), compression="zstd", version="2.6", use_dictionary=texts
        )

    def _write_rows(self, writer: "pq.ParquetWriter") -> None:
        for batch in self._batches():
            writer.write_batch(batch, row_group_size=ROWS_PER_GROUP)

    def _spill_rows(self, spill: Path) -> None:
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
        """The places of the rows, sorted if the schema wants it."""
        keys = []
        for name in reversed(self.schema.sorted_by):
            key = self._buffers[name].column(self._buffers[name].numpy(self._rows))
            keys.append(key.codes if isinstance(key, Text) else key)
        return np.lexsort(keys) if keys else np.arange(self._rows)

    def _batches(self) -> "Iterator[pa.RecordBatch]":
        import pyarrow as pa

        schema, order = self.schema.arrow(), self._order()
        for start in range(0, self._rows, ROWS_PER_GROUP):
            part = order[start : start + ROWS_PER_GROUP]
            arrays = [
                buffer.arrow(buffer.numpy(self._rows)[part]) for buffer in self._buffers.values()
            ]
            yield pa.RecordBatch.from_arrays(arrays, schema=schema)


def other_format(path: Path, found: object, reads: int) -> str:
    """What is wrong with results of another format, and what to do."""
    if isinstance(found, int) and found < reads:
        return f"{path}: made by an older genie-sim: format {found}, this one reads {reads}; run it again"
    return f"{path}: format {short_repr(found)}, this genie-sim reads {reads}"


def read(path: Path, schema: Schema) -> Columns:
    """The rows of a file that a table of this schema wrote.

    Raises UserError for a missing, truncated or foreign file, another table or another format version.
    """
    table, about = parquet.read(path, "file")
    if about.get("table") != schema.name:
        raise UserError(f"{path}: holds the table {about.get('table')!r}, expected {schema.name!r}")
    if about.get("format_version") != FORMAT_VERSION:
        raise UserError(other_format(path, about.get("format_version"), FORMAT_VERSION))
    parquet.check_columns(path, table, schema.arrow())
    return Columns({field.name: _read_column(table.column(field.name)) for field in table.schema})


def harmless(cell: Any) -> Any:
    """A cell for CSV: a text that a spreadsheet would take for a formula gets an apostrophe in front."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


def _read_column(column: "pa.ChunkedArray") -> Any:
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        return column.to_numpy()
    whole = (
        column.unify_dictionaries().combine_chunks()
    )  # the groups of a file may know different names
    codes = whole.indices.to_numpy(zero_copy_only=False)
    return Text.of(np.nan_to_num(codes, nan=NO_TEXT).astype(np.int32), whole.dictionary.to_pylist())
