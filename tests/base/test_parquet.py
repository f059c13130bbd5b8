"""Parquet files: what a file says of itself, and which files are refused in one line."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genie_sim.base import parquet
from genie_sim.base.errors import UserError
from genie_sim.record import tables
from genie_sim.record.records import SCHEMAS

SCHEMA = pa.schema([("t_ns", pa.int64()), ("name", pa.string())])
ROWS = [{"t_ns": 1, "name": "a"}, {"t_ns": 2, "name": "b"}]
ABOUT: dict[str, Any] = {"kind": "trace", "answer": [1, None]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "new folder" / "table.parquet"
    parquet.write(file, SCHEMA, ROWS, ABOUT)
    return file


def test_rows_and_what_a_file_says_of_itself_come_back(path: Path, tmp_path: Path):
    table, about = parquet.read(path, "trace")
    assert table.to_pylist() == ROWS and about == ABOUT == parquet.about(path, "trace")
    again = tmp_path / "again.parquet"
    parquet.write(again, SCHEMA, iter(ROWS), dict(reversed(ABOUT.items())))
    assert again.read_bytes() == path.read_bytes(), "whatever the order of its description"


def refused(message: str, read: Any, *arguments: Any) -> None:
    with pytest.raises(UserError, match=message) as error:
        read(*arguments)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("read", [parquet.read, parquet.about])
def test_files_that_are_no_such_file(read: Any, path: Path, tmp_path: Path):
    missing, foreign, broken = (tmp_path / name for name in ("missing", "foreign", "broken"))
    refused("missing: no such trace$", read, missing, "trace")
    pq.write_table(pa.table({"t_ns": [1]}), foreign)
    refused("foreign: a Parquet file, but not a trace of genie-sim$", read, foreign, "trace")
    broken.write_bytes(path.read_bytes()[:-20])
    refused("broken: not a readable Parquet file: ", read, broken, "trace")
    schema = SCHEMA.with_metadata({parquet.METADATA_KEY: b"[1"})
    pq.write_table(pa.Table.from_pylist(ROWS, schema), foreign)
    refused("foreign: its metadata cannot be read: ", read, foreign, "trace")


def test_every_column_must_be_there_with_its_type(path: Path):
    table, _ = parquet.read(path, "trace")
    parquet.check_columns(path, table, SCHEMA)
    parquet.check_columns(path, table, pa.schema([("name", pa.string())]))
    for column, kind in (("t_ns", pa.float64()), ("late_ns", pa.int64())):
        wrong = pa.schema([("name", pa.string()), (column, kind)])
        refused(
            f"column {column}: missing, or not {kind}$", parquet.check_columns, path, table, wrong
        )


def test_a_small_file_may_not_claim_much_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A million equal numbers take 8 MB of cells; the file has a few kilobytes. What is small
    anyway is read, however small the file.
    """
    path, count = tmp_path / "table.parquet", 1_000_000
    metadata = {parquet.METADATA_KEY: b"{}"}
    table = pa.table({"t_ns": pa.array([7] * count, pa.int64())}).replace_schema_metadata(metadata)
    pq.write_table(table, path)
    footer = pq.ParquetFile(path).metadata
    needed = 8 * count + footer.row_group(0).total_byte_size
    monkeypatch.setattr(parquet, "MAX_SMALL_BYTES", needed)
    assert parquet.read(path, "trace")[0].num_rows == count
    monkeypatch.setattr(parquet, "MAX_SMALL_BYTES", needed - 1)
    size = f"{path.stat().st_size:,}"
    line = f"1,000,000 rows in {size} bytes would take 8 MB of memory: more than 100 times the file"
    refused(re.escape(line) + "$", parquet.read, path, "trace")
    monkeypatch.setattr(parquet, "MAX_EXPANSION", -(-needed // path.stat().st_size))
    assert parquet.read(path, "trace")[0].num_rows == count


def test_what_a_run_has_just_written_is_read_whatever_it_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A parked car repeats itself: its table is far smaller than its rows."""
    monkeypatch.setattr(parquet, "MAX_SMALL_BYTES", 0)
    monkeypatch.setattr(parquet, "MAX_EXPANSION", 1)
    table = tables.Table(SCHEMAS["poses"], spill=tmp_path / "spill")
    row = [0 if column.kind != "text" else "car1" for column in SCHEMAS["poses"].columns]
    for _ in range(70_000):
        table.append(row)
    table.write(tmp_path / "poses.parquet")
    assert len(table.columns()) == 70_000
    refused("more than 1 times the file", tables.read, tmp_path / "poses.parquet", SCHEMAS["poses"])
