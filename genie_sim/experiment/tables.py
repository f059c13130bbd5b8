"""Tables in compact column buffers, streamed to Parquet files whose bytes depend on their rows alone.

(And on the pyarrow that wrote them, which signs its files with its version.)
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from genie_sim.errors import UserError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    import pyarrow as pa

FORMAT_VERSION = 1
METADATA_KEY = b"genie_sim"
ROWS_PER_GROUP = 65_536

Value = int | float | str | bool | None

# Kind of a column: the array's type code and the value that stands for None in the buffer only.
_BUFFERS: dict[str, tuple[str, int | float]] = {
    "int64": ("q", -(2**63)),
    "int32": ("i", -(2**31)),
    "float64": ("d", float("nan")),
    "bool": ("b", -1),
    "text": ("i", -1),
}
_GROWTH = 4096  # rows by which the columns that are filled in later grow at once


@dataclass(frozen=True, slots=True)
class Column:
    """A column's name, type, unit and meaning; ``default`` is what a row holds until something is known."""

    name: str
    kind: str
    unit: str
    description: str
    nullable: bool = False
    default: Value = None


class _Buffer:
    """The values of one column; text is kept as small integers."""

    def __init__(self, column: Column) -> None:
        code, self._none = _BUFFERS[column.kind]
        self.column = column
        self.values = array(code)
        self.codes: dict[str, int] = {}
        self._is_text = column.kind == "text"

    def encode(self, value: Any) -> Any:
        if value is not None:
            return self.codes.setdefault(value, len(self.codes)) if self._is_text else value
        if not self.column.nullable:
            raise TypeError(f"column {self.column.name!r} is never empty")
        return self._none

    def decode(self, value: Any) -> Any:
        if value == self._none or value != value:
            return None
        if self._is_text:
            return list(self.codes)[value]
        return bool(value) if self.column.kind == "bool" else value

    def appender(self) -> Callable[[Any], None]:
        """Appends one value; a number that is never empty goes straight into the array, which refuses None."""
        append, encode = self.values.append, self.encode
        return append if not (self._is_text or self.column.nullable) else lambda value: append(encode(value))

    def grow(self) -> None:
        default = self.encode(self.column.default)
        self.values.extend(array(self.values.typecode, [default]) * _GROWTH)

    def numpy(self, rows: int) -> np.ndarray[Any, np.dtype[Any]]:
        import numpy as np

        return np.frombuffer(self.values, dtype=self.values.typecode, count=rows)

    def rank(self, rows: int) -> np.ndarray[Any, np.dtype[Any]]:
        """Numbers that sort as the column's values do."""
        import numpy as np

        values = self.numpy(rows)
        if not self._is_text:
            return values
        return np.argsort(np.argsort(np.array(list(self.codes), dtype=str)))[values] if rows else values

    def arrow(self, values: np.ndarray[Any, np.dtype[Any]]) -> pa.Array:
        import numpy as np
        import pyarrow as pa

        unknown = np.isnan(values) if self.column.kind == "float64" else values == self._none
        mask = unknown if self.column.nullable else None
        if self.column.kind == "bool":
            return pa.array(values == 1, mask=mask)
        if not self._is_text:
            return pa.array(values, mask=mask)
        names = sorted(self.codes)
        place = {self.codes[name]: index for index, name in enumerate(names)}
        new_codes = np.array([place[code] for code in range(len(names))] + [0], dtype=np.int32)
        indices = pa.array(new_codes[values], mask=mask)
        return pa.DictionaryArray.from_arrays(indices, pa.array(names, type=pa.string()))


class Table:
    """Rows in memory, a Parquet file afterwards. Subclasses name their columns and give ``add`` its arguments."""

    name: ClassVar[str]
    columns: ClassVar[tuple[Column, ...]]
    filled_later: ClassVar[int] = 0  # how many of the last columns ``add`` leaves at their default
    sorted_by: ClassVar[tuple[str, ...]] = ()  # none: in order of ``add``

    def __init__(self) -> None:
        buffers = [_Buffer(column) for column in self.columns]
        self._buffers = {buffer.column.name: buffer for buffer in buffers}
        split = len(buffers) - self.filled_later
        self._appends = [buffer.appender() for buffer in buffers[:split]]
        self._later = buffers[split:]
        self._rows = 0
        self._grown = 0

    def __len__(self) -> int:
        return self._rows

    def _append(self, *values: Value) -> int:
        row = self._rows
        for append, value in zip(self._appends, values, strict=True):
            append(value)
        if self._later and row == self._grown:
            for buffer in self._later:
                buffer.grow()
            self._grown += _GROWTH
        self._rows = row + 1
        return row

    @property
    def size_bytes(self) -> int:
        """Memory the rows take."""
        return sum(len(buffer.values) * buffer.values.itemsize for buffer in self._buffers.values())

    def write(self, path: Path) -> None:
        """Writes the table beside ``path`` and renames it: zstd, groups of 65,536 rows, no time, no host.

        Raises OSError where the folder cannot be written.
        """
        import pyarrow.parquet as pq

        beside = path.with_name(path.name + ".partial")
        try:
            # An open file: of a path pyarrow makes a URI, and of a leading "~" a home.
            with (
                beside.open("wb") as file,
                pq.ParquetWriter(
                    file,
                    self.schema(),
                    compression="zstd",
                    version="2.6",
                    use_dictionary=[column.name for column in self.columns if column.kind == "text"],
                ) as writer,
            ):
                for batch in self._batches():
                    writer.write_batch(batch, row_group_size=ROWS_PER_GROUP)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)

    def to_frame(self) -> pd.DataFrame:
        """The same table that ``read`` finds in the file. Text is categorical, an unknown number NaN."""
        import pyarrow as pa

        frame: pd.DataFrame = pa.Table.from_batches(self._batches(), schema=self.schema()).to_pandas()
        return frame

    @classmethod
    def schema(cls) -> pa.Schema:
        """Types, with unit and description beside each column."""
        import pyarrow as pa

        types = {"int64": pa.int64(), "int32": pa.int32(), "float64": pa.float64(), "bool": pa.bool_()}
        text = pa.dictionary(pa.int32(), pa.string())
        fields = [
            pa.field(
                column.name,
                types.get(column.kind, text),
                nullable=column.nullable,
                metadata={"unit": column.unit, "description": column.description},
            )
            for column in cls.columns
        ]
        about = json.dumps({"format_version": FORMAT_VERSION, "table": cls.name}, sort_keys=True)
        return pa.schema(fields, metadata={METADATA_KEY: about.encode()})

    def _batches(self) -> Iterator[pa.RecordBatch]:
        import numpy as np
        import pyarrow as pa

        schema, rows = self.schema(), self._rows
        order = None
        if self.sorted_by:
            order = np.lexsort([self._buffers[name].rank(rows) for name in reversed(self.sorted_by)])
        for start in range(0, rows, ROWS_PER_GROUP):
            part: Any = slice(start, min(start + ROWS_PER_GROUP, rows))
            if order is not None:
                part = order[part]
            arrays = [buffer.arrow(buffer.numpy(rows)[part]) for buffer in self._buffers.values()]
            yield pa.record_batch(arrays, schema=schema)


def read(path: Path, kind: type[Table]) -> pd.DataFrame:
    """The rows of a file that ``kind`` wrote.

    Raises UserError for a missing, truncated or foreign file, another table or another format version.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        raise UserError(f"{path}: no such file")
    try:
        # ParquetFile reads exactly this file; read_table would take "a=1" in a folder's name for a partition.
        table = pq.ParquetFile(path).read()
        about = json.loads((table.schema.metadata or {})[METADATA_KEY])
    except KeyError:
        raise UserError(f"{path}: a Parquet file, but not written by genie-sim") from None
    except (pa.ArrowException, OSError, ValueError) as error:
        raise UserError(f"{path}: not a readable Parquet file: {str(error).strip().splitlines()[0]}") from error
    if about.get("table") != kind.name:
        raise UserError(f"{path}: holds the table {about.get('table')!r}, expected {kind.name!r}")
    if about.get("format_version") != FORMAT_VERSION:
        version = about.get("format_version")
        raise UserError(f"{path}: format_version {version!r}, this genie-sim reads {FORMAT_VERSION}")
    frame: pd.DataFrame = table.to_pandas()
    return frame
