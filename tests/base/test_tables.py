"""Tables that somebody else wrote: every way to write one gives the same rows."""

from __future__ import annotations

import gzip

import pytest

from genie_sim.base import tables
from genie_sim.base.errors import UserError
from genie_sim.base.tables import FileColumn, FileTable, title_of

COLUMNS = (
    FileColumn("time_s"),
    FileColumn("up_mbps", lowest=0),
    FileColumn("note", "text", optional=True),
)
RIGHT = [(0.0, 12.5, "a"), (0.5, 1.0, "b")]


@pytest.mark.parametrize(
    "content",
    [
        b"time_s,up_mbps,note\n0,12.5,a\n0.5,1,b",
        b"\xef\xbb\xbftime_s,up_mbps,note\r\n0,12.5,a\r\n0.5,1,b\r\n",
        "time_s;up_mbps;note\n0;12,5;a\n0,5;1;b\n".encode("utf-16"),
        b";;\r\ntime_s;up_mbps;note\r\n0,0;12,5;a\r\n0,5;1,0;b\r\n",
        b"time_s\tup_mbps\tnote\n0\t12.5\ta\n\n   \n0.5\t1\tb\n\n",
        b"# a logger\n# of mine\ntime_s   up_mbps note\n  0  12.5   a\n0.5\t1 b\n",
        b"time_s, up_mbps, note,\n0, 12.5, a,\n,,,\n0.5, 1, b,\n",
        b'"note","Time [ms]","up (kbit/s)"\n"a","0","12500"\n"b",500,1000\n',
        b"UP_Mbps,n,time (us),note\n12.5,1,0,a\n1,2,500000,b\n",
        b"time_s,up_bps,note\n0,12500000,a\n0.5,1e6,b\n",
        gzip.compress("time_s;up_mbps;note\n0;12,5;a\n0,5;1;b\n".encode("utf-16"), mtime=0),
    ],
)
def test_every_way_to_write_a_table_gives_its_rows(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    assert [row.values for row in FileTable(path).rows(COLUMNS)] == RIGHT


def test_titles_of_numpy_stand_in_a_comment(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("# time_s up_mbps\n0 12.5\n0.5 1\n")
    assert [row.values[:2] for row in FileTable(path).rows(COLUMNS)] == [(0.0, 12.5), (0.5, 1.0)]


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"time,up_mbps\n0,1\n", "column 'time_s' is missing; 'time' has no unit"),
        (b"time_ms,Time [s],up_mbps\n0,0,1\n", "column 'time_s'"),
        (b"time_s,up_MB/s\n0,1\n", "column 'up_mbps'"),  # bytes are no bits
        (b"time_m,up_mbps\n0,1\n", "column 'time_s'"),  # no time
        (b"time_s,up_mbps\n0,1\n1,2,3\n", "line 3"),
        (b"time_s,up_mbps\n0,1\n\n1\n", "line 4"),
        (b'time_s,up_mbps\n"1,5",2\n', "line 2: time_s"),
        (b"time_s;up_mbps\n1.234,5;2\n", "line 2: time_s"),
        (b"time_s,up_mbps\n0,-1\n", "line 2: up_mbps"),
        (b"time_s,up_mbps\n\xff,1\n", "not a readable CSV file"),
        (b"", "is empty"),
        (b"time_s,up_mbps\n0," + b"1" * 2_000_000, "has a line of"),
        (gzip.compress(b"time_s,up_mbps\n0,1\n", mtime=0)[:-9], "not a readable CSV file"),
    ],
)
def test_what_is_wrong_names_file_line_and_column(tmp_path, content, place):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(UserError) as error:
        list(FileTable(path).rows(COLUMNS))
    assert str(error.value).startswith(f"{path}: {place}") and "\n" not in str(error.value)


@pytest.mark.parametrize("bound", ["MAX_CHARACTERS", "SMALL_CHARACTERS"])
def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, bound):
    """Of any text, and of a packed one of a few bytes."""
    monkeypatch.setattr(tables, bound, 10**5)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(b"time_s,up_mbps\n" + b"0,1\n" * 30_000, mtime=0))
    with pytest.raises(UserError, match=r"a.csv.gz: has more than 100,000 characters"):
        for _ in FileTable(path).rows(COLUMNS[:2]):
            pass


def test_a_single_column_may_have_blanks_in_its_title(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Time of a frame [ms]\n12.5\n1\n")
    assert FileTable(path).titles == ("Time of a frame [ms]",)
    assert [row.values for row in FileTable(path).rows([FileColumn("time of a frame_ms")])] == [
        (12.5,),
        (1.0,),
    ]


@pytest.mark.parametrize(
    ("text", "stem", "unit"),
    [
        ("latency_ms", "latency", "ms"),
        ("Latency [ms]", "latency", "ms"),
        ("GPU latency (µs)", "gpu latency", "µs"),
        ("heading [°]", "heading", "°"),
        ("RATE(MBit/s)", "rate", "mbit/s"),
        ("up_kbps", "up", "kbps"),
        ("up_kBps", "up_kbps", ""),
        ("score", "score", ""),
        ("items", "items", ""),
    ],
)
def test_a_title_is_a_name_and_a_unit(text, stem, unit):
    assert title_of(text) == (stem, unit)


def test_a_column_that_nobody_asked_for_is_known(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("n,time_ms,up_mbps,rest\n1,2,3,4\n")
    assert FileTable(path).unused(COLUMNS) == ["n", "rest"]


def test_rows_of_a_known_format_may_be_uneven(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("time_s up_mbps note\n0 12.5 a b c\n0.5 1\n")
    assert [row.values for row in FileTable(path, uneven=True).rows(COLUMNS)] == [
        (0.0, 12.5, "a"),
        (0.5, 1.0, None),
    ]
    path.write_text("time_s up_mbps note\n0\n")
    with pytest.raises(UserError, match="line 2: up_mbps: is empty"):
        list(FileTable(path, uneven=True).rows(COLUMNS))


@pytest.mark.parametrize("name", ["street.bag", "street.mcap", "street/metadata.yaml"])
def test_a_bag_is_named_with_what_reads_it(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("")
    given = path.parent if name.endswith(".yaml") else path
    with pytest.raises(UserError, match=r"street.*: is a ROS bag, .*genie-sim-ros"):
        FileTable(given)
