"""What is wrong in a drive is refused or told whichever reader reads it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from genie_sim.base.classes import CANONICAL
from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.core.messages import CameraPose
from genie_sim.data.intake import ImportedCar, traces, write_cars
from genie_sim.data.reader_frames import new_detection, scan_frame
from genie_sim.data.truth import TruthObject
from tests.data.made_drives import CHECKS, READERS, cases, steady, told


@pytest.mark.parametrize(("reader", "check"), cases(*READERS))
def test_what_is_wrong_is_refused_or_told_by_every_reader(tmp_path: Path, reader: str, check: str):
    drive, message, is_refused, _ = CHECKS[check]
    refused, lines = told(READERS[reader], drive, tmp_path)
    assert any(re.search(message, line) for line in lines), lines
    assert refused == is_refused and not any("\n" in line for line in lines)


@pytest.mark.parametrize("reader", READERS)
def test_of_a_drive_that_is_right_nothing_is_told(tmp_path: Path, reader: str):
    assert told(READERS[reader], steady(), tmp_path) == (False, [])


def car_with(*there: tuple[float, str, float], report: ImportReport) -> ImportedCar:
    """A car at 1 m/s: when its frames were taken [s], what is detected 8 m ahead, and how far ahead
    that is told to be [m].
    """
    frames = [
        scan_frame(
            camera="sensor",
            stamp_ns=round(time_s * 1e9),
            size_bytes=960_000,
            key=str(number),
            pose=CameraPose(time_s, 0.0, 0.0, 0.0),
            horizontal_fov_rad=6.0,
            detections=[
                new_detection(label, 0.5, None, np.array([time_s + 8.0, 0.0, 0.0]), placed_by="x")
            ],
        )
        for number, (time_s, label, _) in enumerate(there)
    ]
    objects = [
        [TruthObject(number, label, False, True, time_s + ahead_m, 0.0, 0.0)]
        for number, (time_s, label, ahead_m) in enumerate(there)
    ]
    return traces(
        {"car1": frames},
        origin=(0.0, 0.0, 0.0),
        provenance={},
        report=report,
        truth={"car1": objects},
    )["car1"]


def test_truth_goes_with_its_frames_however_they_are_ordered_and_numbered():
    there = (7.0, "car", 8.0), (5.0, "bus", 9.0), (5.0002, "car", 9.0), (6.0, "car", 8.0)
    imported = car_with(*there, report=ImportReport("made up"))
    trace, table = imported
    assert table is not None and table.trace == trace.digest
    rows = [(row.frame, row.stamp_ns, row.object, row.label, row.east_m) for row in table.rows]
    assert rows == [
        (0, 0, 1, "car", 14.0),
        (1, 10**9, 3, "car", 14.0),
        (2, 2 * 10**9, 0, "car", 15.0),
    ]
    assert [frame.stamp_ns for frame in trace.frames["sensor"]] == [0, 10**9, 2 * 10**9]


def test_features_that_another_sensor_has_not_are_told_as_left_out():
    there = (0.0, "car", 8.0), (1.0, "car", 8.0)
    (lidar,) = car_with(*there, report=ImportReport("x")).trace.frames.values()
    other = [replace(frame, camera="other", features={"own": b"1"}) for frame in lidar]
    report = ImportReport("x")
    asked: dict[str, Any] = {"origin": (0.0, 0.0, 0.0), "provenance": {}, "report": report}
    (car,) = traces({"car1": [*lidar, *other]}, **asked).values()
    assert not any(frame.features for of in car.trace.frames.values() for frame in of)
    assert [count for why, count in report.left_out.items() if "'own' of other" in why] == [2]


@pytest.mark.parametrize("file", ["car2.parquet", "car2.truth.parquet"])
def test_a_file_of_somebody_else_is_found_before_anything_is_written(tmp_path: Path, file: str):
    imported = car_with((0.0, "car", 8.0), (1.0, "car", 8.0), report=ImportReport("made up"))
    (tmp_path / file).write_text("mine")
    with pytest.raises(UserError, match=f"{file}: is there already"):
        write_cars(tmp_path, {"car1": imported, "car2": imported})
    assert [path.name for path in tmp_path.iterdir()] == [file]


@pytest.mark.parametrize(
    ("label", "ahead_m", "told"),
    [
        ("bench", 8.0, "frame 0: object 0: label: unknown class 'bench'"),
        ("car", float("inf"), "at no place on Earth"),
        ("car", 300.0, "no object is ever within 50 m of a car"),
    ],
)
def test_truth_that_cannot_be_is_refused_of_every_reader(label: str, ahead_m: float, told: str):
    with pytest.raises(UserError, match=told):
        car_with((0.0, label, ahead_m), (1.0, label, ahead_m), report=ImportReport("x"))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"truth": {"car1": []}}, "truth: has the objects of car1 in 0 frames, but there are 2"),
        ({"range_m": 2000.0}, "range_m 2000.0 is no length up to 1000"),
        ({"range_m": 0}, "range_m 0 is no length up to 1000"),
    ],
)
def test_truth_that_no_run_can_use_is_refused_of_every_reader(changes: dict[str, Any], told: str):
    there = (0.0, "car", 8.0), (1.0, "car", 8.0)
    (camera,) = car_with(*there, report=ImportReport("x")).trace.frames.values()
    asked = {"truth": {"car1": [[], []]}, "origin": (0.0, 0.0, 0.0), "provenance": {}, **changes}
    with pytest.raises(UserError, match=f"x: .*{told}"):
        traces({"car1": camera}, report=ImportReport("x"), **asked)


def test_labels_that_are_no_classes_are_told_and_refused_where_most_are(monkeypatch):
    monkeypatch.setitem(CANONICAL, "Vehicle", "car")
    report = ImportReport("x")
    labels = ["car", "car", "Vehicle"]
    car_with(*((float(n), label, 8.0) for n, label in enumerate(labels)), report=report)
    assert any("1 of 3 detections have labels that are no classes" in w for w in report.warnings)
    with pytest.raises(UserError, match="2 of 2 detections have labels that are no classes"):
        car_with((0.0, "Vehicle", 8.0), (1.0, "Vehicle", 8.0), report=ImportReport("x"))
