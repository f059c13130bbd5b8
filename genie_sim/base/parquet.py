"""Parquet files of genie-sim: each says what it is in its schema's metadata, and is written whole
or not at all.
"""

import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.parallel import limited_memory
from genie_sim.base.paths import atomic_write, regular

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

METADATA_KEY = b"genie_sim"
# What a file may take in memory that this program has not just written: so much anyway, or so many
# times its size. Tables of runs take up to 25 times their size, those of parked cars more; a file
# of 2 MB can claim 60 million rows.
MAX_SMALL_BYTES = 2**28
MAX_EXPANSION = 100
CELL_BYTES = 8  # of a number, or of a text's place among the texts that occur
LISTED_BYTES = 64  # of a value in a list: each becomes an object of Python
READING = 3  # so many times that much is taken while a file is read

ColumnChoice = Callable[["pa.Schema", Mapping[str, Any]], Sequence[str]]


def write(
    path: Path, schema: "pa.Schema", rows: Iterable[Mapping[str, Any]], about: Mapping[str, Any]
) -> None:
    """Writes rows, and what the file says of itself; the same give the same bytes with the same
    pyarrow.

    Raises UserError where the folder cannot be written, or holds another kind of file of that name.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pylist(
        list(rows), schema.with_metadata({METADATA_KEY: json.dumps(about, sort_keys=True)})
    )
    check_replaceable(path, about)
    with atomic_write(path) as partial:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:  # pyarrow would take a path for a URI
            pq.write_table(table, file, compression="zstd")


def check_replaceable(path: Path, about: Collection[str]) -> None:
    """Raises ``UserError`` for a file that is there, unless it is empty, a link, or tells the same
    of itself: what is named in ``about``.
    """
    if path.is_symlink() or not path.is_file() or not path.stat().st_size:
        return
    told = {""}  # of a file of others
    with suppress(UserError):
        told = {*described(path, "file")[1]}
    if not (told <= {*about} or told >= {*about}):
        raise UserError(f"{path}: is there already, and holds something else; say where else")


def read(
    path: Path, kind: str, chosen: ColumnChoice, *, trusted: bool = False
) -> "tuple[pa.Table, dict[str, Any]]":
    """The chosen columns of a file, and what the file says of itself.

    Parameters
    ----------
    path : Path
        A regular file.
    kind : str
        What it should be, for errors.
    chosen : callable
        Of the schema and what the file says of itself, before any row is read: the names of the
        columns to read. Raises ``UserError`` for a file of other columns.
    trusted : bool
        What this program has just written may take any memory.

    Raises
    ------
    UserError
        For a missing, truncated or foreign file, and one that would take far more memory than it
        has bytes, as its footer says or as turns out while it is read.
    """
    with opened(path, f"no such {kind}", trusted=trusted) as file:
        told = _about(path, kind, file.schema_arrow)
        names = list(chosen(file.schema_arrow, told))
        if not trusted:
            _check_size(path, file.metadata, names)
        table = file.read(names, use_threads=False)
        if not trusted:
            _check_texts(path, table)
    return table, told


def described(path: Path, kind: str) -> "tuple[pa.Schema, dict[str, Any]]":
    """The schema of a file, and what it says of itself, without its rows. Raises UserError."""
    with opened(path, f"no such {kind}") as file:
        schema = file.schema_arrow
    return schema, _about(path, kind, schema)


def batches(path: Path, names: Sequence[str], rows: int) -> Iterator[dict[str, list[Any]]]:
    """Columns of anybody's table, so many rows at a time, and ``""``, which is ``None`` in each.
    Raises UserError as ``read`` does.
    """
    import pyarrow.parquet as pq

    with regular(path) as file:
        with _readable(path):
            parquet_file = pq.ParquetFile(_bytes_of(file))
            _check_size(path, parquet_file.metadata, names)
            read_batches = parquet_file.iter_batches(rows, columns=list(names), use_threads=False)
        rows_left = parquet_file.metadata.num_rows
        while rows_left > 0:
            with _readable(path):
                batch = next(read_batches)
                columns = {name: batch.column(name).to_pylist() for name in names}
            rows_left -= batch.num_rows
            yield columns | {"": [None] * batch.num_rows}


def _about(path: Path, kind: str, schema: "pa.Schema") -> dict[str, Any]:
    metadata = (schema.metadata or {}).get(METADATA_KEY)
    if metadata is None:
        raise UserError(f"{path}: a Parquet file, but not a {kind} of genie-sim")
    with as_user_error(
        f"{path}: its metadata cannot be read", ValueError, TypeError, RecursionError
    ):
        content: dict[str, Any] = dict(json.loads(metadata))
    return content


@contextmanager
def opened(
    path: Path, missing: str = "no such file", *, trusted: bool = False
) -> "Iterator[pq.ParquetFile]":
    """An open Parquet file. Raises UserError, also for what fails while it is read, and, unless it
    is ``trusted``, where far more memory is asked for within than the file has bytes.
    """
    import pyarrow.parquet as pq

    if not os.path.exists(path):  # whatever the name  # noqa: PTH110
        raise UserError(f"{path}: {missing}")
    with regular(path) as file, _readable(path, trusted=trusted):
        yield pq.ParquetFile(_bytes_of(file))


def _bytes_of(file: BinaryIO) -> "pa.BufferReader":
    """Exactly this open file: pyarrow takes a path for a URI, and read_table takes a folder "a=1"
    for a partition. Its bytes, since of a Python file a thread of pyarrow's reads, which may abort
    the process at its end (apache/arrow 34314, 50482).
    """
    import pyarrow as pa

    return pa.BufferReader(file.read())


@contextmanager
def _readable(path: Path, *, trusted: bool = False) -> Iterator[None]:
    """What pyarrow says of a file within it becomes a UserError."""
    import pyarrow as pa

    with (
        as_user_error(
            f"{path}: not a readable Parquet file",
            *(pa.ArrowException, OSError, ValueError, MemoryError),
        ),
        nullcontext() if trusted else limited_memory(READING * _allowed_bytes(path)),
    ):
        yield


def _allowed_bytes(path: Path) -> int:
    """What the rows of a file may take in memory."""
    return max(MAX_SMALL_BYTES, MAX_EXPANSION * path.stat().st_size)


def _check_size(path: Path, footer: "pq.FileMetaData", names: Sequence[str]) -> None:
    """Raises UserError for columns that would take too much memory, as the footer tells."""
    memory_bytes = 0
    for group in map(footer.row_group, range(footer.num_row_groups)):
        for column in map(group.column, range(group.num_columns)):
            name, *nested = column.path_in_schema.split(".")
            if name in names:
                cell_bytes = LISTED_BYTES if nested else CELL_BYTES
                memory_bytes += column.total_uncompressed_size + column.num_values * cell_bytes
    _refuse_size(path, memory_bytes, f"{footer.num_rows:,} rows")


def _check_texts(path: Path, table: "pa.Table") -> None:
    """Raises UserError for texts that would take too much memory when each row has its own, as in a
    page or a CSV.
    """
    import numpy as np

    memory_bytes = table.nbytes
    for column in table.columns:
        for chunk in column.chunks if hasattr(column.type, "index_type") else ():
            lengths = [len(text or "") for text in chunk.dictionary.to_pylist()]
            places = chunk.indices.drop_null().to_numpy()
            memory_bytes += int(
                np.bincount(places, minlength=len(lengths)) @ np.array(lengths, int)
            )
    _refuse_size(path, memory_bytes, f"{table.num_rows:,} rows with texts")


def _refuse_size(path: Path, memory_bytes: int, rows: str) -> None:
    if memory_bytes > _allowed_bytes(path):
        raise UserError(
            f"{path}: {rows} in {path.stat().st_size:,} bytes would take "
            f"{memory_bytes / 2**20:,.0f} MB of memory: more than {MAX_EXPANSION} times the file"
        )


def check_columns(path: Path, found: "pa.Schema", schema: "pa.Schema") -> None:
    """Raises UserError unless a file has every column of ``schema``, with its type."""
    for field in schema:
        at = found.get_field_index(field.name)
        if at < 0 or found.field(at).type != field.type:
            raise UserError(f"{path}: column {field.name}: missing, or not {field.type}")
