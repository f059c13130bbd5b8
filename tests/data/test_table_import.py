"""Tables of poses and detections become traces, whose cars share a clock; what is wrong in a table
is told with file, line and column.
"""

from __future__ import annotations

import io
import math
import re

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.table_import import Sensor, cars_of_tables
from genie_sim.data.trace import read_trace
from genie_sim.data.truth import read_truth_table
from tests.data.pose_tables import DETECTIONS, POSES, TRUTH, TRUTH_HEADER


@pytest.fixture
def tables(tmp_path):
    """Writes tables, and imports what has been written."""

    def write(poses=POSES, detections=DETECTIONS, truth=None, **settings):
        paths = []
        for name, text in (("poses", poses), ("detections", detections), ("truth", truth)):
            path = None if text is None else tmp_path / f"{name}.csv"
            if path is not None:
                path.write_text(text, encoding="utf-8")
            paths.append(path)
        return cars_of_tables(*paths, **settings)

    return write


def test_each_pose_is_a_frame_with_the_detections_of_its_time(tables):
    frames = tables()["a"].trace.frames["sensor"]
    assert [frame.stamp_ns for frame in frames] == [0, 100_000_000, 200_000_000]
    assert [len(frame.detections) for frame in frames] == [0, 2, 0]
    best, other = frames[1].detections
    assert (best.label, best.score, best.location) == ("truck", 0.75, (9.0, 15.0, 0.0))
    assert (other.label, other.score, other.location) == ("car", 0.5, (12.0, 25.0, 0.0))
    assert frames[0].pose[:3] == (10.0, 5.0, 0.0)
    assert frames[0].pose.heading_rad == pytest.approx(math.pi / 2, abs=1e-6)
    assert frames[2].pose.heading_rad == pytest.approx(math.pi / 2, abs=1e-6)


def test_cars_share_one_clock_and_one_sequence(tables):
    cars = tables()
    assert list(cars) == ["a", "b"]
    b = cars["b"].trace
    assert [frame.stamp_ns for frame in b.frames["sensor"]] == [250_000_000, 350_000_000]
    assert b.sequence is not None and b.sequence == cars["a"].trace.sequence
    pictures = {f.digest for r in cars.values() for f in r.trace.frames["sensor"]}
    assert len(pictures) == 5


def test_a_table_without_cars_has_one(tables):
    poses = "time_s,east_m,north_m,heading_deg,up_m\n-1,2,3,-90,4\n"
    detections = "label,score,time_s,east_m,north_m,extra\ncar,1,-1,2,-9,x\n"
    (car,) = tables(poses, detections).values()
    trace = car.trace
    assert (trace.name, trace.sequence) == ("car1", None)
    (frame,) = trace.frames["sensor"]
    assert frame.pose[:3] == (2.0, 3.0, 4.0)
    assert frame.pose.heading_rad == pytest.approx(-math.pi / 2, abs=1e-6)
    assert frame.detections[0].location == (2.0, -9.0, 0.0)


def test_the_sensor_is_as_told_and_detections_outside_its_view_are_counted(tables):
    sensor, report = Sensor(fov_rad=math.radians(20), size_bytes=777), ImportReport("x")
    cars = tables(sensor=sensor, report=report)
    frame = cars["a"].trace.frames["sensor"][0]
    assert frame.size_bytes == 777 and frame.kind == "lidar"
    assert frame.horizontal_fov_rad == pytest.approx(math.radians(20), abs=1e-6)
    assert not any("outside" in line for line in report.warnings)
    # As compass bearings, the same headings point elsewhere.
    turned = POSES.replace(",90\n", ",0\n").replace(",450\n", ",0\n")
    tables(turned, sensor=sensor, report=report)
    assert "2 of 3 detections are outside of the field of view" in report.warnings[-1]


def test_parquet_tables_give_the_traces_of_csv_tables(tables, tmp_path):
    by_csv = tables(truth=TRUTH)
    (tmp_path / "parquet").mkdir()
    paths = []
    for name, text in (("poses", POSES), ("detections", DETECTIONS), ("truth", TRUTH)):
        header, *lines = (line.split(",") for line in text.splitlines())
        columns = dict(zip(header, zip(*lines, strict=True), strict=True))
        for column in columns.keys() - {"car", "label", "object"}:
            columns[column] = [float(value) for value in columns[column]]
        paths.append(tmp_path / "parquet" / f"{name}.parquet")
        pq.write_table(pa.table(columns), paths[-1])
    by_parquet = cars_of_tables(*paths)
    for name, car in by_csv.items():
        ours, other = car.trace, by_parquet[name].trace
        for frame, its in zip(ours.frames["sensor"], other.frames["sensor"], strict=True):
            assert (frame.stamp_ns, frame.pose, frame.detections) == (
                its.stamp_ns,
                its.pose,
                its.detections,
            )
        assert car.truth.rows == by_parquet[name].truth.rows


def test_data_frames_give_the_traces_of_files(tables):
    texts = {"poses": POSES, "detections": DETECTIONS, "truth": TRUTH}
    frames = {name: pd.read_csv(io.StringIO(text)) for name, text in texts.items()}
    by_file = tables(**texts)
    by_frame = cars_of_tables(*frames.values(), provenance={"data": "mine"})
    unjudged = tables(POSES, DETECTIONS)
    assert by_frame.keys() == by_file.keys()
    for name, car in by_frame.items():
        pairs = zip(*(of[name].trace.frames["sensor"] for of in (by_frame, by_file)), strict=True)
        for frame, there in pairs:
            assert (frame.stamp_ns, frame.pose) == (there.stamp_ns, there.pose)
            assert frame.detections == there.detections
        assert car.truth.rows == by_file[name].truth.rows
        assert by_file[name].trace.digest == unjudged[name].trace.digest, "whatever the truth"
        assert car.trace.provenance["data"] == "mine"
    assert len({car.trace.sequence for car in by_frame.values()}) == 1


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("time_s", 1.7e12, "^poses: row 1: time_s: .* milliseconds since 1970"),
        ("north_m", math.nan, "^poses: row 1: north_m: is empty"),
        ("heading_deg", "east", "^poses: row 1: heading_deg: must be a number"),
    ],
)
def test_a_row_of_a_data_frame_is_named_by_its_number(column, value, message):
    poses = pd.read_csv(io.StringIO(POSES)).astype(object)
    poses.loc[0, column] = value
    with pytest.raises(UserError, match=message):
        cars_of_tables(poses, pd.read_csv(io.StringIO(DETECTIONS)))


@pytest.mark.parametrize("step", [1, -1], ids=["in order of time", "in another order"])
def test_the_truth_is_there_for_every_frame_of_every_car(tables, step):
    cars = tables(truth=TRUTH_HEADER + "".join(TRUTH.splitlines(keepends=True)[1:][::step]))
    rows = {(row.frame, row.label): row for row in cars["b"].truth.rows}
    # The bus, a vehicle like a car, drives 10 m in the second; b's first frame is at 0.25 s.
    bus = rows[0, "car"]
    assert bus.location == (10.0, 27.5, 0.0) and bus.moving and bus.visible
    assert rows[1, "car"].location == (10.0, 28.5, 0.0)
    walker = rows[0, "person"]
    assert walker.location == (-3.0, 20.06, 0.0) and not walker.moving
    assert rows[0, "person"].object != bus.object
    assert rows[0, "person"].object == rows[1, "person"].object


def test_an_object_counts_in_the_field_of_view_and_in_range(tables):
    def visible(**settings):
        sensor = Sensor(**settings)
        table = tables(truth=TRUTH, sensor=sensor)["a"].truth
        assert table.range_m == sensor.range_m
        return [(row.frame, row.label, row.visible) for row in table.rows if row.frame == 0]

    # From (10, 5): the bus 20 m ahead, the walker 19.8 m away and 41 degrees to the left.
    assert visible() == [(0, "car", True), (0, "person", True)]
    assert visible(fov_rad=math.radians(60)) == [(0, "car", True), (0, "person", False)]
    assert visible(range_m=19.9) == [(0, "car", False), (0, "person", True)]
    assert visible(range_m=9.9) == [(0, "person", False)], "20 m is beyond 9.9 m and the margin"


def test_an_object_is_not_there_outside_its_rows_nor_in_long_gaps(tables):
    truth = TRUTH_HEADER + "1000,o,car,10,25\n"
    later = "1000.15,x,car,0,25\n1000.4,x,car,0,25\n1001.3,o,car,10,25\n"
    rows = tables(truth=truth + later)["a"].truth.rows
    assert [(row.frame, row.object) for row in rows] == [(0, 1), (2, 2)]


def test_an_object_that_has_just_come_moves_by_its_speed(tables):
    """At the first frame only half a second of its way is known: 0.4 m, or 0.2 m."""
    truth = TRUTH_HEADER + "".join(
        f"{1000 + t},{name},person,10,{20 + speed_mps * t}\n"
        for name, speed_mps in (("walker", 0.8), ("waiter", 0.4))
        for t in (0, 1)
    )
    rows = tables(truth=truth)["a"].truth.rows
    assert {(row.object, row.moving) for row in rows if row.frame == 0} == {(1, True), (2, False)}


def test_an_object_moves_up_to_a_gap_in_its_rows(tables):
    truth = TRUTH_HEADER + "".join(
        f"{time_s},o,car,10,{20 + 10 * (time_s - 1000)}\n"
        for time_s in (999.8, 1000, 1000.001, 1000.15, 1003, 1003.1)
    )
    poses = POSES.replace("1000.2,", "1003.05,")
    detections = DETECTIONS
    rows = tables(poses, detections, truth=truth)["a"].truth.rows
    assert [(row.frame, row.moving) for row in rows] == [(0, True), (1, True), (2, True)]


def test_of_two_tables_of_one_name_the_later_is_named(tmp_path):
    texts = {"x/a.csv": POSES, "y/a.csv": DETECTIONS, "z/t.csv": TRUTH}
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=r"^\S*y/a\.csv: has the name of \S*x/a\.csv; rename it$"):
        cars_of_tables(*(tmp_path / name for name in texts))


def test_what_the_table_says_of_moving_and_visible_holds(tables):
    truth = (
        "car,time_s,object,label,east_m,north_m,moving,visible\n"
        "a,1000,o,car,10,25,true,\na,1000.1,o,car,10,25,FALSE,0\na,1000.2,o,car,10,25,,1\n"
    )
    cars = tables(truth=truth)
    assert [(row.moving, row.visible) for row in cars["a"].truth.rows] == [
        (True, True),
        (False, False),
        (False, True),
    ]
    assert cars["b"].truth.rows == (), "which sees nothing"


@pytest.mark.parametrize(
    ("table", "rows", "place"),
    [
        ("poses", "a,1700000000000,1,1,0", "line 7: time_s"),
        ("poses", "a,1000.3,1,1,1e308", "line 7: heading_deg"),
        ("poses", "a,1000.3,1,nan,0", "line 7: north_m"),
        ("poses", "a,1000.3,1,,0", "line 7: north_m"),
        ("poses", "a,1000.3,1,1_0,0", "line 7: north_m: must be a number, not '1_0'"),
        ("poses", "a,1000.3,1,5e7,0", "line 7: north_m"),
        ("poses", "a,1000.3,1", "line 7"),
        ("poses", "a,1000.1,1,1,0", "line 7: time_s"),
        ("poses", "../a,1,1,1,0", "line 7: car"),
        ("poses", "edges,1,1,1,0", "line 7: car"),
        ("poses", 'a,"1000.3', "not a readable CSV file"),
        ("detections", "a,1000,car,1e300,1,1", "line 5: east_m"),
        ("detections", "c,1000,car,1,1,1", "line 5: car: unknown"),
        ("detections", "b,1000.27,car,1,1,1", "line 5: time_s"),
        ("detections", "a,1000,car,1,1,1.5", "line 5: score"),
        ("detections", "a,1000, ,1,1,1", "line 5: label"),
        ("truth", "1002,o,tram,1,1", "line 6: label: unknown"),
        ("truth", "1001,bus 7,bus,1,1", "line 6: time_s"),
        ("truth", "1002,bus 7,person,1,1", "line 6: label"),
    ],
)
def test_a_wrong_row_is_named_by_line_and_column(tables, tmp_path, table, rows, place):
    texts = {"poses": POSES, "detections": DETECTIONS, "truth": TRUTH}
    refused(tables, tmp_path / f"{table}.csv", place, {table: f"{texts[table]}{rows}\n"})


@pytest.mark.parametrize(
    ("table", "text", "place"),
    [
        ("poses", POSES.replace("north_m", "north"), "column 'north_m'"),
        ("poses", POSES[:38], "has no poses"),
        ("poses", "", "is empty"),
        ("poses", f"car,{POSES}", "column 'car'"),
        ("truth", TRUTH_HEADER, "has no objects"),
        (
            "truth",
            f"{TRUTH_HEADER}998.9,o,car,1,1\n",
            "time_s: no row within 1 s of 3 of 3 poses of a",
        ),
        ("truth", f"car,moving,{TRUTH_HEADER}a,yes,1000,o,car,1,1\n", "line 2: moving"),
        ("truth", f"car,{TRUTH_HEADER}a,1000,o,car,1,1\n,1000,p,car,1,1\n", "line 3: car"),
        ("truth", f"{TRUTH_HEADER}1000,o,car,1,1\n1000.0009,o,car,1,1\n", "line 3: time_s"),
    ],
)
def test_a_wrong_table_is_named_by_its_column(tables, tmp_path, table, text, place):
    refused(tables, tmp_path / f"{table}.csv", place, {table: text})


def refused(tables, path, place, changes):
    """The tables are refused in one line, of this file and place."""
    with pytest.raises(UserError) as error:
        tables(**changes)
    assert str(error.value).startswith(f"{path}: {place}") and "\n" not in str(error.value)


def test_files_that_are_none_are_refused(tmp_path):
    good = tmp_path / "poses.csv"
    good.write_text(POSES)
    for name, content, message in (
        ("a.txt", b"x", "column 'time_s' is missing; the file has 'x'"),
        ("a.csv", b"car\xff,time_s\n", "not a readable CSV file"),
        ("a.parquet", b"PAR1 nonsense", "not a readable Parquet file"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UserError, match=message):
            cars_of_tables(good, tmp_path / name)
    with pytest.raises(UserError, match=r"detections\.csv: no such file"):
        cars_of_tables(good, tmp_path / "detections.csv")


def test_the_command_writes_traces_that_a_scenario_takes(run_cli, tmp_path):
    """And what it writes is what was imported; two cars meet on one clock."""
    for name, text in (("poses", POSES), ("detections", DETECTIONS), ("truth", TRUTH)):
        (tmp_path / f"{name}.csv").write_text(text)
    tables = ("import", "tables", "poses.csv", "detections.csv")
    done = run_cli(*tables, "--truth", "truth.csv", "--out", "t", "--fov", "200 deg")
    assert done.returncode == 0, done.stderr
    assert re.search(
        r"t/a\.parquet: 3 frames, 2 detections, content \w+, objects visible 6 times\n", done.stdout
    )
    trace = read_trace(tmp_path / "t" / "a.parquet")
    assert read_truth_table(tmp_path / "t" / "a.truth.parquet").trace == trace.digest
    (tmp_path / "two.yaml").write_text(
        "perception: {trace: t/a.parquet}\nmethods: [remote]\nstart_jitter: 0 s\n"
        "cameras: [{name: lidar, recording: sensor}]\n"
        "edges: [{name: edge1, device: agx_xavier}]\n"
        "cars:\n  - {name: a, device: jetson_tx2, edge: edge1}\n"
        "  - {name: b, device: jetson_tx2, edge: edge1, route: {trace: t/b.parquet}}\n"
    )
    ran = run_cli("run", "two.yaml", "--no-report", "--out", "r")
    assert ran.returncode == 0, ran.stderr
    (folder,) = (tmp_path / "r").iterdir()
    frames = pq.read_table(folder / "frames.parquet", columns=["car", "stamp_ns"]).to_pylist()
    stamps_ms = {(row["car"], row["stamp_ns"] // 1_000_000) for row in frames}
    assert stamps_ms == {("a", 0), ("a", 100), ("a", 200), ("b", 250), ("b", 350)}
    again = run_cli(*tables, "--out", "t")
    assert again.returncode == 1
    assert again.stderr.startswith("genie-sim: t/a.truth.parquet: is of another import")
    for option, value in (("--fov", "400 deg"), ("--frame-size", "0 B"), ("--range", "40")):
        refused = run_cli(*tables, "--out", "u", option, value)
        assert refused.returncode == 1 and f"{option}: " in refused.stderr
    assert not (tmp_path / "u").exists()


def test_a_row_of_a_parquet_table_is_named_by_its_number(tmp_path):
    path = tmp_path / "poses.parquet"
    columns = {"time_s": [1.0, math.nan], "east_m": [0.0, 1.0], "north_m": [0.0, 1.0]}
    pq.write_table(pa.table({"car": ["a", "a"], **columns, "heading_deg": [0.0, 0.0]}), path)
    with pytest.raises(UserError, match=r"poses.parquet: row 2\b"):
        cars_of_tables(path, path)


def drive(speed_mps: float, count: int = 30, heading_deg: float = 0.0, factor: float = 1.0) -> str:
    rows = [f"{k / 10},{k / 10 * speed_mps * factor:.9f},0,{heading_deg}" for k in range(count)]
    return "\n".join(["time_s,east_m,north_m,heading_deg", *rows]) + "\n"


ROUND = "time_s,east_m,north_m,heading_deg\n" + "".join(  # a circle, its headings in radians
    f"{k / 10},{20 * math.sin(k / 20)},{20 - 20 * math.cos(k / 20)},{k / 20 % math.tau}\n"
    for k in range(120)
)
AHEAD = "time_s,label,east_m,north_m,score\n0,{label},{east},0,0.9\n0.1,{label},{east},0,0.9\n"


@pytest.mark.parametrize(
    ("poses", "detections", "message"),
    [
        (drive(1500), AHEAD.format(label="car", east=20), "steps are faster than 100 m/s"),
        (drive(10, factor=1e-5), AHEAD.format(label="car", east=20), "are places in degrees"),
        (
            "time_s,east_m,north_m,heading_deg\n"
            + "".join(f"{k / 10},0,{k},1.5708\n" for k in range(9)),
            AHEAD.format(label="car", east=20),
            "the heading fits the way driven as radians",
        ),
        (drive(10), AHEAD.format(label="Car", east=20), "2 of 2 detections have labels that are"),
        (drive(10), AHEAD.format(label="car", east=900), "all 2 detections are 899 m or more"),
        (
            drive(10),
            AHEAD.format(label="car", east=900) + "0,car,9,0,0.9\n",
            r"(detections\.csv|warning): 2 of 3 objects are more than 250 m away",
        ),
        (
            "time_s,east_m,north_m,heading_deg\n"
            + "".join(f"{20 * k},{k},0,0\n" for k in range(9)),
            AHEAD.format(label="car", east=20).replace("0.1,", "20,"),
            "a row every 20 s; in between it drives straight",
        ),
        (
            ROUND,
            AHEAD.format(label="car", east=20),
            "the heading fits the way driven as radians",
        ),
        (
            drive(10),
            AHEAD.format(label="car", east=0) + "0,person,0,0,0.9\n0.1,bus,0,0,0.9\n" * 7,
            "14 of 16 detections are at the very place of another",
        ),
        (
            drive(10, factor=1e-3),
            AHEAD.format(label="car", east=0.02),
            "all 2 detections are within 0.02 m of their cars",
        ),
        (
            drive(10) + "1700000000,0,0,0\n",
            AHEAD.format(label="car", east=20),
            "a gap of 1.7e.09 s",
        ),
    ],
)
def test_what_cannot_be_is_refused_unless_accepted(tmp_path, poses, detections, message):
    files = tmp_path / "poses.csv", tmp_path / "detections.csv"
    for path, text in zip(files, (poses, detections), strict=True):
        path.write_text(text)
    with pytest.raises(UserError, match=message):
        cars_of_tables(*files)
    report = ImportReport("x", accept=True)
    cars_of_tables(*files, report=report)
    assert any(re.search(message, line) for line in report.lines())


def test_what_is_unusual_is_told(tmp_path):
    """Kilometres under metres, kilobytes under bytes, and a column that nobody reads."""
    files = tmp_path / "poses.csv", tmp_path / "detections.csv"
    rows = drive(10, factor=1e-3).splitlines()
    files[0].write_text("\n".join(["vehicle," + rows[0], *(f"a,{row}" for row in rows[1:])]))
    files[1].write_text(AHEAD.format(label="car", east=20))
    truth = tmp_path / "truth.csv"
    truth.write_text(TRUTH_HEADER + "1,o,car,5,0\n")
    report = ImportReport("x")
    cars_of_tables(*files, truth, sensor=Sensor(size_bytes=960), report=report)
    told = "\n".join(report.lines())
    for text in (
        "never faster than 0.01 m/s",
        "a frame takes",
        "column 'vehicle' of poses.csv",
        "truth.csv: time_s: no row within 1 s of 9 of 30 poses of car1",
    ):
        assert text in told


def test_a_title_with_what_is_no_text_is_refused(tmp_path):
    """A column of another name would be left out: all cars would be one."""
    for name in ("\0car", "ca\u202er"):
        (tmp_path / "poses.csv").write_text(
            f"{name},time_s,east_m,north_m,heading_deg\na,0,0,0,0\n"
        )
        with pytest.raises(UserError, match=r"poses.csv: title .*: has characters that are no"):
            cars_of_tables(tmp_path / "poses.csv", tmp_path / "poses.csv")


def test_a_label_is_taken_for_the_class_that_it_is_mapped_to(tmp_path):
    files = [tmp_path / f"{name}.csv" for name in ("poses", "detections", "truth")]
    files[0].write_text(drive(10))
    files[1].write_text(AHEAD.format(label="vehicle.car", east=20) + "0,cone,1,1,0.5\n")
    files[2].write_text(TRUTH_HEADER + "1,o,vehicle.car,5,0\n1,c,cone,1,1\n")
    report, classes = ImportReport("x"), {"vehicle.car": "car", "cone": "none"}
    (car,) = cars_of_tables(*files, classes=classes, report=report).values()
    found = [d.label for frame in car.trace.frames["sensor"] for d in frame.detections]
    assert found == ["car", "car"] and report.unused == {"none": 1}
    assert [*report.left_out.values()] == [1], "of the truth, no detection"


def test_the_report_is_told_and_kept(run_cli, tmp_path):
    rows = drive(10, 40, heading_deg=90).splitlines()
    (tmp_path / "poses.csv").write_text("\n".join(rows[:11] + rows[31:] + rows[12:14]))
    (tmp_path / "detections.csv").write_text(AHEAD.format(label="car", east=20) + "0,tram,9,1,1\n")
    done = run_cli("import", "tables", "poses.csv", "detections.csv", "--out", "t")
    assert done.returncode == 0, done.stderr
    told = [line.strip() for line in done.stdout.splitlines()[1:]]
    assert told == [
        "read: 22 poses, 2 detections",
        "labels not used: tram (1); --map LABEL=CLASS takes them for a class",
        "ranges: times 0 to 3.9 s, east 0 to 39 m, north 0 to 0 m, objects 19 to 20 m away",
        "ways: car1: 3.9 s at 5.38 Hz, path 39 m, top speed 10 m/s",
        "warning: car1: 1 rows are earlier than the one before: sorted by time",
        "warning: car1: a gap of 1.8 s",
        "warning: car1: the heading is 90 degrees beside the way driven: it must count "
        "counter-clockwise from east; a compass bearing does not",
    ]
    kept = read_trace(tmp_path / "t" / "car1.parquet").provenance["import"]
    assert kept["labels_not_used"] == {"tram": 1} and len(kept["warnings"]) == 3
