"""Files of what is seen or there in the world: what a file must say of itself, and its columns."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest

from genie_sim.base import parquet
from genie_sim.base.errors import UserError
from genie_sim.data import world_table

SCHEMA = pa.schema([("t_ns", pa.int64()), ("label", pa.string())])
ROWS: list[dict[str, Any]] = [{"t_ns": 1, "label": "car"}]
ABOUT = {
    "format_version": world_table.FORMAT_VERSION,
    "origin": [49.0, 8.0, 112.0],
    "digest": "abc",
    "provenance": {"drive": "x"},
    "trace": "def",
}


def test_what_is_written_is_read():
    path = Path("new/table.parquet")
    origin, about = (49.0, 8.0, 112.0), {"drive": "x"}
    content = SimpleNamespace(origin=origin, digest="abc", provenance=about, trace="def", more=None)
    world_table.write(path, SCHEMA, ROWS, content, ["trace", "more"])
    world_table.check_replaceable(path, ["trace", "more"])
    with pytest.raises(UserError, match=r"new/table.parquet: is there already"):
        world_table.check_replaceable(path, ["name", "more"])
    table, told = world_table.read(path, "truth table", SCHEMA, "trace")
    assert table.to_pylist() == ROWS and told["origin"] == origin
    assert told["provenance"] == about and told["trace"] == "def"
    world_table.check_digest(path, "abc", told)
    with pytest.raises(UserError, match=r"new/table.parquet"):
        world_table.check_digest(path, "abd", told)


@pytest.mark.parametrize(
    ("schema", "rows", "about", "message"),
    [
        (pa.schema([("t_ns", pa.int64())]), [{"t_ns": 1}], {}, "column label: missing, or not"),
        (SCHEMA, [{"t_ns": 1, "label": None}], {}, "column 'label' has empty values"),
        (SCHEMA, ROWS, {"format_version": 99}, "format_version: truth table has version 99"),
        (SCHEMA, ROWS, {"trace": None}, "metadata: 'trace' is missing or not a str"),
        (SCHEMA, ROWS, {"origin": [91.0, 8.0, 0.0]}, "is not latitude, longitude, altitude"),
        (SCHEMA, ROWS, {"provenance": []}, "metadata: 'provenance' is missing or not a dict"),
    ],
)
def test_a_file_that_is_none_is_one_line(schema: Any, rows: Any, about: Any, message: str):
    path = Path("table.parquet")
    parquet.write(path, schema, rows, {**ABOUT, **about})
    with pytest.raises(UserError, match=r"^table.parquet: ") as error:
        world_table.read(path, "truth table", SCHEMA, "trace")
    assert message in str(error.value) and "\n" not in str(error.value)
