"""Truth tables: what is written is read, and files with something wrong are refused in one line."""

from __future__ import annotations

import json
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from genie_sim.base import files
from genie_sim.base.errors import UserError
from genie_sim.base.parquet import METADATA_KEY
from genie_sim.data.kitti.drive import open_drive
from genie_sim.data.kitti.drive_truth import make_truth
from genie_sim.data.sources import RecordedDrives, encoded_beside
from genie_sim.data.trace import Trace, read_trace, write_trace
from genie_sim.data.truth import (
    RecordedTruth,
    TruthRow,
    TruthTable,
    path_beside,
    read_truth_table,
    truth_beside,
    write_truth,
)
from tests.judge.judging import is_there


@pytest.fixture(scope="module")
def trace() -> Trace:
    return read_trace(files.find(files.TRACE, "kitti_0005"))


def made_up(trace: Trace, **changes) -> TruthTable:
    row = TruthRow("02", 0, 0, 7, "car", False, True, 10.0, 2.0, 0.5)._replace(**changes)
    return TruthTable(trace.digest, trace.origin, (row,), {"drive": "x", "trace": trace.name})


def with_metadata(path, **changes):
    table = pq.ParquetFile(path).read()
    metadata = json.loads(table.schema.metadata[METADATA_KEY]) | changes
    pq.write_table(table.replace_schema_metadata({METADATA_KEY: json.dumps(metadata)}), path)


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"provenance": {"drive": "x"}}, "metadata: provenance: 'trace'"),
        ({"provenance": {"drive": "x", "trace": 5}}, "metadata: provenance: 'trace'"),
        ({"digest": 7}, "metadata: 'digest'"),
        ({"digest": "0" * 64}, "content does not match its own digest"),
        ({"origin": [49.0, 8.4]}, "origin"),
        ({"format_version": 99}, "format_version: "),
        ({"cameras": 2}, "metadata: cameras 2 are no names"),
        ({"cameras": [["02"]]}, "metadata: cameras [['02']] are no names"),
        ({"cameras": ["02"]}, "content does not match its own digest"),
    ],
)
def test_a_table_with_other_metadata_is_refused(trace, tmp_path, changes, place):
    path = tmp_path / "a.truth.parquet"
    write_truth(path, made_up(trace))
    with_metadata(path, **changes)
    with pytest.raises(UserError) as error:
        read_truth_table(path)
    line = str(error.value)
    assert line.startswith(f"{path}: ") and place in line and "\n" not in line


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"label": None}, "column 'label'"),
        ({"east_m": None}, "column 'east_m'"),
        ({"up_m": float("inf")}, "camera '02', frame 0: object 7 "),
    ],
)
def test_an_impossible_row_is_refused_even_with_a_right_digest(
    trace, tmp_path, monkeypatch, changes, place
):
    path = tmp_path / "a.truth.parquet"
    with monkeypatch.context() as unchecked:
        unchecked.setattr("genie_sim.data.truth.check", lambda *_: None)
        write_truth(path, made_up(trace, **changes))
    with pytest.raises(UserError, match=place):
        read_truth_table(path)


def test_a_table_without_its_trace_s_name_stops_a_run_in_one_line(run_cli, trace, tmp_path):
    path = tmp_path / "mine.parquet"
    write_trace(path, trace)
    write_truth(path_beside(path), made_up(trace))
    assert list(RecordedDrives(trace, path=path).provenance()) == []
    with_metadata(path_beside(path), provenance={"drive": "x"})
    done = run_cli("run", "street_1car_hetero", "--set", f"perception.trace={path}")
    assert done.returncode == 1
    assert done.stderr.startswith(f"genie-sim: {path_beside(path)}: metadata: provenance: 'trace'")
    assert done.stderr.count("\n") == 1


def test_one_trace_has_one_truth(trace, tmp_path):
    for name, east_m in (("a", 10.0), ("b", 11.0), ("c", 10.0)):
        write_trace(tmp_path / f"{name}.parquet", trace)
        write_truth(tmp_path / f"{name}.truth.parquet", made_up(trace, east_m=east_m))
    drives = RecordedDrives(trace, path=tmp_path / "a.parquet")
    one, other = (
        drives.drive(car, path, 0) for car, path in (("1", None), ("2", f"{tmp_path}/c.parquet"))
    )
    assert drives.truth_of(one) is not None and drives.truth_of(other) is not None
    with pytest.raises(UserError, match=r"b\.parquet: is the trace in .*a\.parquet, whose truth"):
        drives.drive("3", f"{tmp_path}/b.parquet", 0)


@pytest.mark.parametrize("drive", ["0009", "../x/0009", "tracking/../0000", "2011_09_26/5", 5])
def test_what_is_no_name_of_a_drive_tells_which_kinds_there_are(trace, tmp_path, drive):
    for read in (lambda: make_truth(tmp_path, drive, trace), lambda: open_drive(tmp_path, drive)):
        with pytest.raises(
            UserError, match=rf"^drive '?{drive}'?: must be a raw .* odometry/05 or"
        ):
            read()


@pytest.mark.parametrize("drive", ["2011_09_26/0009", "tracking/0001", "odometry/05"])
def test_a_drive_without_labels_names_both_kinds_of_labels(trace, tmp_path, drive):
    sync = tmp_path / "2011_09_26" / "2011_09_26_drive_0005_sync"
    (sync.parent / "2011_09_26_drive_0009_sync").mkdir(parents=True)  # without tracklets
    label_02 = tmp_path / "tracking" / "training" / "label_02"
    for path in (sync / "tracklet_labels.xml", label_02 / "0000.txt"):
        path.parent.mkdir(parents=True)
        path.write_text("")
    with pytest.raises(UserError) as error:
        make_truth(tmp_path, drive, trace)
    message = str(error.value)
    assert f"unknown labelled drive '{drive}'" in message
    assert ": 2011_09_26/0005, tracking/0000 (tracklets of a raw drive" in message
    assert "\n" not in message


def test_a_table_says_how_far_its_labels_reach(trace, tmp_path):
    usual, far = made_up(trace), replace(made_up(trace), range_m=100.0, cameras=("02",))
    path = tmp_path / "a.truth.parquet"
    write_truth(path, far)
    again = read_truth_table(path)
    assert again == far and again.digest != usual.digest
    assert again.rebased((49.0, 8.0, 100.0)).range_m == 100.0
    truth, frame = RecordedTruth(again), trace.frames["02"][0]
    assert truth.range_m == 100.0
    assert is_there(truth, frame, "car", 11.9, 2.0) and not is_there(truth, frame, "car", 12.1, 2.0)
    assert is_there(truth, frame, "truck", 11.9, 2.0), "compared as a car"


@pytest.mark.parametrize("changes", [{"range_m": 0}, {"range_m": "2 m"}, {"range_m": 1e9}])
def test_an_impossible_ruler_is_refused(trace, tmp_path, changes):
    path = tmp_path / "a.truth.parquet"
    write_truth(path, made_up(trace))
    with_metadata(path, **changes)
    (name,) = changes
    with pytest.raises(UserError, match=f"metadata: {name} .* is no length up to 1000"):
        read_truth_table(path)


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"range_m": 2000.0}, "range_m 2000.0 is no length"),
        ({"range_m": 0.0}, "range_m 0.0 is no length"),
        ({"provenance": {"drive": "x"}}, "provenance: 'trace'"),
        ({"cameras": ("03",)}, "cameras .* are not those of its rows"),
        ({"rows": (TruthRow("02", 0, 0, 7, "car", True, True, 1e9, 0.0, 0.0),)}, "frame 0: object"),
    ],
)
def test_what_no_run_reads_is_not_written(trace, tmp_path, changes, place):
    path = tmp_path / "a.truth.parquet"
    with pytest.raises(UserError, match=f"^{path}: .*{place}"):
        write_truth(path, replace(made_up(trace), **changes))
    assert not path.exists()


def test_the_second_street_is_shipped_whole():
    """Its truth is of its frames, and its encoded pictures are those of its frames."""
    path = files.find(files.TRACE, "kitti_0013")
    trace = read_trace(path)
    assert trace.provenance["drive"] == "2011_09_26/0013" and len(trace.frames["02"]) == 144
    table = truth_beside(path, trace)
    assert table is not None and len({row.object for row in table.rows}) == 9
    assert len({row.object for row in table.rows if row.moving}) == 3
    assert encoded_beside(path, trace, "jpeg90").frames["02"][0].digest == (
        trace.frames["02"][0].digest
    )
