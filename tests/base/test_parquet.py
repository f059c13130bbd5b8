"""Parquet files: what a file says of itself, and which files are refused in one line."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
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


def every(found: pa.Schema, _: Any) -> list[str]:
    return list(found.names)


def read(path: Path, kind: str) -> Any:
    return parquet.read(path, kind, every)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "new folder" / "table.parquet"
    parquet.write(file, SCHEMA, ROWS, ABOUT)
    return file


def test_rows_and_what_a_file_says_of_itself_come_back(path: Path, tmp_path: Path):
    table, about = read(path, "trace")
    assert table.to_pylist() == ROWS and about == ABOUT == parquet.described(path, "trace")[1]
    again = tmp_path / "again.parquet"
    parquet.write(again, SCHEMA, iter(ROWS), dict(reversed(ABOUT.items())))
    assert again.read_bytes() == path.read_bytes(), "whatever the order of its description"


def refused(message: str, read: Any, *arguments: Any) -> None:
    with pytest.raises(UserError, match=message) as error:
        read(*arguments)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("read", [read, parquet.described])
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
    parquet.check_columns(path, SCHEMA, SCHEMA)
    parquet.check_columns(path, SCHEMA, pa.schema([("name", pa.string())]))
    for column, kind in (("t_ns", pa.float64()), ("late_ns", pa.int64())):
        wrong = pa.schema([("name", pa.string()), (column, kind)])
        refused(
            f"column {column}: missing, or not {kind}$", parquet.check_columns, path, SCHEMA, wrong
        )


def test_a_small_file_may_not_claim_much_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A million equal numbers take 8 MB of cells; the file has a few kilobytes. What is small
    anyway is read, however small the file, and what nobody asks for does not count.
    """
    path, count = tmp_path / "table.parquet", 1_000_000
    metadata = {parquet.METADATA_KEY: b"{}"}
    columns = {name: np.full(count, 7) for name in ("t_ns", "other")}
    pq.write_table(pa.table(columns).replace_schema_metadata(metadata), path)
    needed = 9 * count
    monkeypatch.setattr(parquet, "MAX_SMALL_BYTES", needed)
    assert parquet.read(path, "trace", lambda *_: ["t_ns"])[0].num_rows == count
    size = f"{path.stat().st_size:,}"
    line = f"1,000,000 rows in {size} bytes would take 15 MB of memory: more than 100 times"
    refused(re.escape(line), read, path, "trace")
    monkeypatch.setattr(parquet, "MAX_EXPANSION", -(-2 * needed // path.stat().st_size))
    assert read(path, "trace")[0].num_rows == count


def long_texts() -> pa.Array:
    return pa.DictionaryArray.from_arrays(np.zeros(20_000, np.int32), ["a" * 10**6])


def list_of_nulls() -> pa.Array:
    return pa.ListArray.from_arrays([0, 10**7], pa.nulls(10**7, pa.float64()))


def zeros() -> pa.Array:
    return pa.array(np.zeros(10**7, np.int64))


BOMBS = {
    "a long text in each row": (long_texts, {"store_schema": False}),
    "a long text in each row, told by number": (long_texts, {}),
    "a list of nulls": (list_of_nulls, {}),
    "a page of zeros": (zeros, {"use_dictionary": False, "data_page_size": 2**30}),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_a_file_of_a_few_bytes_is_refused_before_it_fills_the_memory(
    bomb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """What counts is what the chosen columns come to, not what the footer tells of rows."""
    column, options = BOMBS[bomb]
    path = tmp_path / "bomb.parquet"
    table = pa.table({"x": column()}).replace_schema_metadata({parquet.METADATA_KEY: b"{}"})
    with pq.ParquetWriter(path, table.schema, compression="zstd", **options) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({parquet.METADATA_KEY.decode(): "{}"})
    monkeypatch.setattr(parquet, "MAX_SMALL_BYTES", 2**25)
    resource = pytest.importorskip("resource", reason="Windows does not tell the memory")
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    message = "more than 100 times the file$|or there is not enough memory$"
    refused(message, read, path, "trace")
    assert parquet.read(path, "trace", lambda *_: [])[0].num_columns == 0
    if "by number" not in bomb:
        refused(message, lambda: list(parquet.batches(path, ["x"], 65_536)))
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 2**19


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


THREADS = """
import os, sys
from pathlib import Path
import pyarrow.parquet
from genie_sim.base import parquet
before = len(os.listdir("/proc/self/task"))
with parquet.opened(Path(sys.argv[1])) as file:
    file.read(use_threads=False)
print(len(os.listdir("/proc/self/task")) - before)
"""


@pytest.mark.process
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs /proc")
def test_no_thread_is_started_that_may_abort_the_process_at_its_end(tmp_path):
    pq.write_table(pa.table({"a": [1, 2]}), tmp_path / "a.parquet")
    command = [sys.executable, "-c", THREADS, str(tmp_path / "a.parquet")]
    surroundings = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, capture_output=True, text=True, env=surroundings)
    assert done.stdout == "0\n", done.stderr
