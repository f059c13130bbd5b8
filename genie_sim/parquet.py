"""Parquet files of genie-sim: each says what it is in its schema's metadata, and is written whole or not at all."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from genie_sim.errors import UserError, as_user_error
from genie_sim.paths import atomic_write

if TYPE_CHECKING:
    import pyarrow as pa

METADATA_KEY = b"genie_sim"


def write(
    path: Path, schema: "pa.Schema", rows: Iterable[Mapping[str, Any]], about: Mapping[str, Any]
) -> None:
    """Writes rows, and what the file says of itself; the same give the same bytes with the same pyarrow.

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


def read(path: Path, what: str) -> "tuple[pa.Table, dict[str, Any]]":
    """The table in a file, and what the file says of itself.

    Raises UserError for a missing, truncated or foreign file; ``what`` it should be is in the message.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        raise UserError(f"{path}: no such {what}")
    # Exactly this open file: pyarrow takes a path for a URI, and read_table takes a folder "a=1" for a partition.
    # No threads: after reading a Python file they can abort the process at its end (apache/arrow 34314, 50482).
    broken = as_user_error(
        f"{path}: not a readable Parquet file", pa.ArrowException, OSError, ValueError
    )
    with broken, path.open("rb") as file:
        table = pq.ParquetFile(file).read(use_threads=False)
    told = (table.schema.metadata or {}).get(METADATA_KEY)
    if told is None:
        raise UserError(f"{path}: a Parquet file, but not a {what} of genie-sim")
    with as_user_error(
        f"{path}: its metadata cannot be read", ValueError, TypeError, RecursionError
    ):
        about: dict[str, Any] = dict(json.loads(told))
    return table, about


def check_columns(path: Path, table: "pa.Table", schema: "pa.Schema") -> None:
    """Raises UserError unless the table has every column of ``schema``, with its type."""
    for field in schema:
        at = table.schema.get_field_index(field.name)
        if at < 0 or table.schema.field(at).type != field.type:
            raise UserError(f"{path}: column {field.name}: missing, or not {field.type}")
