"""Parquet files of genie-sim: each says what it is in its schema's metadata, and is written whole
or not at all.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.base.errors import UserError, as_user_error
from genie_sim.base.paths import atomic_write

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

METADATA_KEY = b"genie_sim"
# What a file may take in memory that this program has not just written: so much anyway, or so many
# times its size. Tables of runs take up to 25 times their size, those of parked cars more; a file
# of 2 MB can claim 60 million rows.
MAX_SMALL_BYTES = 2**30
MAX_EXPANSION = 100
CELL_BYTES = 8  # of a number, or of a text's place among the texts that occur


def write(
    path: Path, schema: "pa.Schema", rows: Iterable[Mapping[str, Any]], about: Mapping[str, Any]
) -> None:
    """Writes rows, and what the file says of itself; the same give the same bytes with the same
    pyarrow.

    Raises UserError where the folder cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pylist(
        list(rows), schema.with_metadata({METADATA_KEY: json.dumps(about, sort_keys=True)})
    )
    with atomic_write(path) as partial:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:  # pyarrow would take a path for a URI
            pq.write_table(table, file, compression="zstd")


def read(path: Path, kind: str, *, trusted: bool = False) -> "tuple[pa.Table, dict[str, Any]]":
    """The table in a file, and what the file says of itself.

    Raises UserError for a missing, truncated or foreign file, and, unless it is ``trusted``, for
    one that would take far more memory than it has bytes; ``kind`` is what it should be.
    """
    if not path.is_file():
        raise UserError(f"{path}: no such {kind}")
    with opened(path, trusted=trusted) as file:
        # No threads: after reading a Python file they can abort the process at its end
        # (apache/arrow 34314, 50482).
        table = file.read(use_threads=False)
    return table, _about(path, kind, table.schema)


def about(path: Path, kind: str) -> dict[str, Any]:
    """What a file says of itself, without its rows. Raises UserError."""
    if not path.is_file():
        raise UserError(f"{path}: no such {kind}")
    with opened(path) as file:
        schema = file.schema_arrow
    return _about(path, kind, schema)


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
def opened(path: Path, *, trusted: bool = False) -> "Iterator[pq.ParquetFile]":
    """An open Parquet file. Raises UserError, also for what fails while it is read, and, unless it
    is ``trusted``, for a file that would take far more memory than it has bytes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    broken = as_user_error(
        f"{path}: not a readable Parquet file", pa.ArrowException, OSError, ValueError
    )
    # Exactly this open file: pyarrow takes a path for a URI, and read_table takes a folder "a=1"
    # for a partition.
    with broken, path.open("rb") as file:
        parquet_file = pq.ParquetFile(file)
        if not trusted:
            _check_size(path, parquet_file.metadata)
        yield parquet_file


def _check_size(path: Path, footer: "pq.FileMetaData") -> None:
    """Raises UserError for a table that would take too much memory, as its footer tells."""
    encoded_bytes = sum(
        footer.row_group(group).total_byte_size for group in range(footer.num_row_groups)
    )
    memory_bytes = encoded_bytes + footer.num_rows * footer.num_columns * CELL_BYTES
    file_bytes = path.stat().st_size
    if memory_bytes > max(MAX_SMALL_BYTES, MAX_EXPANSION * file_bytes):
        raise UserError(
            f"{path}: {footer.num_rows:,} rows in {file_bytes:,} bytes would take "
            f"{memory_bytes / 2**20:,.0f} MB of memory: more than {MAX_EXPANSION} times the file"
        )


def check_columns(path: Path, table: "pa.Table", schema: "pa.Schema") -> None:
    """Raises UserError unless the table has every column of ``schema``, with its type."""
    for field in schema:
        at = table.schema.get_field_index(field.name)
        if at < 0 or table.schema.field(at).type != field.type:
            raise UserError(f"{path}: column {field.name}: missing, or not {field.type}")
