"""What a run writes down comes back as it was, byte for byte the same each time, in little
memory.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genie_sim.base.errors import UserError
from genie_sim.core.messages import Header
from genie_sim.record import tables
from genie_sim.record.open_frame import OpenFrame
from genie_sim.record.records import FRAMES, OBJECTS, POSES, RESOURCES, SCHEMAS
from genie_sim.record.tables import Column, Schema, Table
from tests import make

MS = 1_000_000


def a_short_drive(frames: int = 3) -> Table:
    """Car 1 is answered from its cache, car 2 waits for its detector, and the last frame of each is
    dropped.
    """
    table = Table(FRAMES)
    for frame in range(frames):
        for car in ("car2", "car1"):
            stamp_ns = frame * 100 * MS
            row = OpenFrame("genie", Header(stamp_ns, "camera_02", car), frame)
            row.received_ns = stamp_ns + 3 * MS
            if frame == frames - 1:
                row.drop = f"{car}/detector:/image_raw"
            else:
                row.first_answer_ns = stamp_ns + 12 * MS
                row.source = "own_cache" if car == "car1" else "map"
                row.image_hit = car == "car1"
                row.objects_served = 3
            table.append(row.values())
    return table


def one_of_each() -> list[Table]:
    poses = Table(POSES)
    poses.append(("genie", "car1", "camera_02", 0, 0, 12.5, -3.0, 0.25, 1.4))
    objects = Table(OBJECTS)
    objects.append(("genie", 9, "car1/genie", 7, "car", 30.0, -1.0, 0.66))
    return [a_short_drive(), make.lookups(1, 2), make.resources(1, 2), poses, objects]


def test_frames_are_sorted_by_method_car_stream_and_frame():
    frames = a_short_drive().to_frame()
    keys = list(zip(frames.method, frames.car, frames.stream, frames.frame, strict=True))
    assert keys == sorted(keys) and keys[0][1] == "car1"


def test_events_keep_their_order():
    table = Table(OBJECTS)
    for t_ns, genie in ((3, "c"), (7, "b"), (7, "a"), (7, "d")):
        table.append(("genie", t_ns, genie, 7, "car", 1.0, -1.0, 0.5))
    assert list(table.to_frame().genie) == ["c", "b", "a", "d"]


def test_rows_with_a_value_too_few_or_too_many_are_refused():
    table, row = Table(OBJECTS), ("genie", 0, "car1/genie", 7, "car", 1.0, -1.0, 0.5)
    for values in (row[:-1], (*row, 0.5)):
        for add in (table.append, table.extend):
            with pytest.raises(
                ValueError, match=r"^objects: . values are no whole rows of 8 columns"
            ):
                add(values)
    table.extend(row * 3)
    assert len(table) == 3


def some_objects(table: Table, at_once: int = 1) -> Table:
    rows = []
    for t_ns in range(27_000):
        label = "car" if t_ns % 3 else "bus"
        rows += ("genie", t_ns, f"car{9 - t_ns // 3_600}/genie", 7, label, float(t_ns), -1.0, 0.5)
        if t_ns % at_once == at_once - 1:
            table.extend(rows)
            rows = []
    return table


def test_rows_that_went_to_the_file_at_once_are_the_same_rows(tmp_path, monkeypatch):
    """And most of them are there before it is written: that is what it is for."""
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 12_288)
    here, spilled = (
        some_objects(Table(OBJECTS)),
        some_objects(Table(OBJECTS, tmp_path / "objects.partial")),
    )
    assert len(spilled) == len(here) == 27_000
    before_bytes = (tmp_path / "objects.partial").stat().st_size
    spilled.write(tmp_path / "objects.parquet")
    assert before_bytes > 0.8 * (tmp_path / "objects.parquet").stat().st_size
    pd.testing.assert_frame_equal(spilled.to_frame(), here.to_frame())
    assert [path.name for path in tmp_path.iterdir()] == ["objects.parquet"]
    told = pq.ParquetFile(tmp_path / "objects.parquet").metadata
    assert [told.row_group(place).num_rows for place in range(told.num_row_groups)] == [
        12_288,
        12_288,
        2_424,
    ]
    assert list(spilled.to_frame().genie.cat.categories) == sorted(here.to_frame().genie.unique())
    some_objects(Table(OBJECTS, tmp_path / "partial"), at_once=30).write(tmp_path / "in_thirties")
    assert (tmp_path / "in_thirties").read_bytes() == (tmp_path / "objects.parquet").read_bytes()


def test_rows_of_other_tables_can_follow_and_leave_the_same_bytes(tmp_path, monkeypatch):
    """Wherever the rows of one end and those of the next begin, in memory or in a file."""
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 12_288)
    whole = some_objects(Table(OBJECTS, tmp_path / "whole.partial"))
    whole.write(tmp_path / "whole")
    columns = tables.read(tmp_path / "whole", OBJECTS)
    for name, spill in (("here", None), ("spilled", tmp_path / "spilled.partial")):
        joined = Table(OBJECTS, spill)
        for rows in (slice(0, 14_001), slice(14_001, 14_001), slice(14_001, None)):
            joined.extend_columns(columns.rows(rows))
        assert len(joined) == 27_000
        joined.write(tmp_path / name)
    some_objects(Table(OBJECTS)).write(tmp_path / "in memory")
    assert (tmp_path / "here").read_bytes() == (tmp_path / "in memory").read_bytes()
    assert (tmp_path / "spilled").read_bytes() == (tmp_path / "whole").read_bytes()


@pytest.mark.parametrize("table", one_of_each(), ids=lambda table: table.name)
def test_what_is_unknown_stays_unknown_where_rows_follow(table, tmp_path):
    table.write(tmp_path / "first")
    joined = Table(table.schema)
    joined.extend_columns(tables.read(tmp_path / "first", table.schema))
    joined.write(tmp_path / "second")
    assert (tmp_path / "second").read_bytes() == (tmp_path / "first").read_bytes()


def test_a_table_that_is_sorted_stays_in_memory(tmp_path):
    with pytest.raises(ValueError, match="frames"):
        Table(FRAMES, tmp_path / "frames.partial")


def test_more_that_becomes_known_of_a_frame_after_all_is_entered():
    table = a_short_drive()
    row = table.take(method="genie", car="car2", stream="camera_02", stamp_ns=200 * MS)
    late = OpenFrame("", Header(0, "", ""))
    late.__dict__.update(row)
    assert late.drop == "car2/detector:/image_raw" and late.image_hit is None and len(table) == 5
    late.source = "own_detector"
    table.append(late.values())
    frames = table.to_frame()
    assert [*frames.source] == [*["own_cache"] * 2, "none", *["map"] * 2, "own_detector"]
    assert (
        table.take(method="genie", car="car3", stream="camera_02", stamp_ns=0) is None
        and len(table) == 6
    )


@pytest.mark.parametrize("table", one_of_each(), ids=lambda table: table.name)
def test_the_file_holds_the_table_with_units_and_descriptions(table, tmp_path):
    path = tmp_path / "table.parquet"
    table.write(path)
    assert tables.read(path, table.schema).to_frame().equals(table.to_frame())
    schema = pq.read_schema(path)
    for column in table.schema.columns:
        field = schema.field(column.name)
        assert field.nullable == column.nullable
        assert field.metadata[b"unit"].decode() == column.unit
        assert field.metadata[b"description"].decode() == column.description != ""
        if column.name.endswith("_ns"):
            assert column.unit == "ns"


@pytest.mark.parametrize("schema", SCHEMAS.values(), ids=lambda schema: schema.name)
def test_a_table_without_rows_is_a_table(schema, tmp_path):
    Table(schema).write(tmp_path / "empty.parquet")
    empty = tables.read(tmp_path / "empty.parquet", schema)
    assert len(empty) == 0 and empty.names == [column.name for column in schema.columns]
    assert empty.names[0] == "method"


def test_many_rows_go_to_several_row_groups_in_order(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "ROWS_PER_GROUP", 4)
    table = a_short_drive(frames=5)
    table.write(tmp_path / "frames.parquet")
    file = pq.ParquetFile(tmp_path / "frames.parquet")
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [4, 4, 2]
    assert list(file.read().to_pandas().frame) == [*range(5), *range(5)]


def test_a_column_that_is_never_empty_refuses_none():
    for column in ({"stamp_ns": None}, {"car": None}):
        table = Table(FRAMES)
        frame = OpenFrame("genie", Header(0, "camera_02", "car1"))
        frame.__dict__.update(column)
        table.append(frame.values())
        with pytest.raises(TypeError, match="is never empty"):
            table.to_frame()


ONE_OF_EACH = Schema(
    "one",
    "a row",
    tuple(
        Column(kind + "?" * nullable, kind, "", "", nullable)
        for kind in ("int64", "int32", "float64", "bool", "text")
        for nullable in (False, True)
    ),
)


def test_every_kind_of_column_keeps_its_values():
    rows = [
        (2**63 - 1, None, -(2**31), 3, math.inf, None, True, None, "a", None),
        (-(2**63) + 1, 5, 2**31 - 1, None, 1e-300, 2, False, True, "", "a"),
    ]
    table = Table(ONE_OF_EACH)
    for row in rows:
        table.append(row)
    frame = table.to_frame()
    for name, *expected in zip(frame.columns, *rows, strict=True):
        values = frame[name].astype(object)
        assert [None if pd.isna(value) else value for value in values] == expected, name


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("int64", "text"),
        ("int64", 1.5),
        ("int64", 2**63),
        ("int64?", 1.5),
        ("int32", 2**31),
        ("int32?", -(2**31) - 1),
        ("float64", "text"),
        ("float64?", 10**400),
        ("bool", 200),
        ("text", [1]),
        ("text?", [1]),
    ],
)
def test_what_a_column_cannot_hold_is_refused(column, value):
    row = dict(
        zip(
            [one.name for one in ONE_OF_EACH.columns],
            (1, 1, 1, 1, 1.0, 1.0, True, True, "a", "a"),
            strict=True,
        )
    )
    table = Table(ONE_OF_EACH)
    table.append(tuple((row | {column: value}).values()))
    with pytest.raises(TypeError):
        table.to_frame()


def test_a_wrong_file_is_named_in_one_line(tmp_path):
    missing, broken, other = (
        tmp_path / "missing.parquet",
        tmp_path / "broken.parquet",
        tmp_path / "other.parquet",
    )
    broken.write_bytes(b"PAR1 not really")
    Table(RESOURCES).write(other)
    for path, problem in (
        (missing, "no such file"),
        (broken, "not a readable"),
        (other, "'resources', expected"),
    ):
        with pytest.raises(UserError, match=problem) as caught:
            tables.read(path, FRAMES)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_small_file_with_very_many_rows_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """60 million equal rows are 1.7 MB on the disk and 4 GB in memory."""
    path = tmp_path / "objects.parquet"
    schema = OBJECTS.arrow()
    columns = {
        field.name: np.zeros(1_000_000, field.type.to_pandas_dtype())
        for field in schema
        if field.type in (pa.int64(), pa.int32(), pa.float64())
    }
    texts = {
        name: pa.DictionaryArray.from_arrays(np.zeros(1_000_000, np.int32), [name])
        for name in ("method", "genie", "label")
    }
    batch = pa.table({name: {**columns, **texts}[name] for name in schema.names}).cast(schema)
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:
        for _ in range(20):
            writer.write_table(batch)
    assert path.stat().st_size < 1_000_000
    monkeypatch.setattr(pq.ParquetFile, "read", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(
        UserError, match=r"objects\.parquet: 20,000,000 rows in [\d,]+ bytes"
    ) as caught:
        tables.read(path, OBJECTS)
    assert "\n" not in str(caught.value)


def test_a_large_table_of_a_run_is_read(tmp_path, monkeypatch):
    """However large it is: what it takes grows with the file."""
    monkeypatch.setattr("genie_sim.base.parquet.MAX_SMALL_BYTES", 0)
    path = tmp_path / "objects.parquet"
    some_objects(Table(OBJECTS), at_once=30).write(path)
    assert len(tables.read(path, OBJECTS)) == 27_000
