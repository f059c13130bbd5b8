"""What is wrong in a drive is refused or told whichever reader reads it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.core.messages import CameraPose
from genie_sim.data.importers.trace_import import ImportedCar, scan_frame, traces
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


def with_truth(*there: tuple[float, str, float]) -> ImportedCar:
    """A car at 1 m/s, of whose frames at some times [s] is told what is so far ahead [m]."""
    frames = [
        scan_frame(
            camera="sensor",
            stamp_ns=round(time_s * 1e9),
            size_bytes=960_000,
            key=str(number),
            pose=CameraPose(time_s, 0.0, 0.0, 0.0),
            horizontal_fov_rad=6.0,
            detections=(),
        )
        for number, (time_s, _, _) in enumerate(there)
    ]
    objects = [
        [TruthObject(number, label, False, True, time_s + ahead_m, 0.0, 0.0)]
        for number, (time_s, label, ahead_m) in enumerate(there)
    ]
    report = ImportReport("made up")
    return traces(
        {"car1": frames},
        origin=(0.0, 0.0, 0.0),
        provenance={},
        report=report,
        truth={"car1": objects},
    )["car1"]


def test_truth_goes_with_its_frames_however_they_are_ordered_and_numbered():
    imported = with_truth(
        (7.0, "car", 8.0), (5.0, "bus", 9.0), (5.0002, "car", 9.0), (6.0, "car", 8)
    )
    trace, table = imported
    assert table is not None and table.trace == trace.digest
    rows = [(row.frame, row.stamp_ns, row.object, row.label, row.east_m) for row in table.rows]
    assert rows == [
        (0, 0, 1, "car", 14.0),
        (1, 10**9, 3, "car", 14.0),
        (2, 2 * 10**9, 0, "car", 15.0),
    ]
    assert [frame.stamp_ns for frame in trace.frames["sensor"]] == [0, 10**9, 2 * 10**9]


@pytest.mark.parametrize(
    ("label", "ahead_m", "told"),
    [
        ("Vehicle", 8.0, "object 0 at 0 s: label: unknown class 'Vehicle'"),
        ("car", float("inf"), "at no place on Earth"),
        ("car", 300.0, "no object is ever within 50 m of a car"),
    ],
)
def test_truth_that_cannot_be_is_refused_of_every_reader(label: str, ahead_m: float, told: str):
    with pytest.raises(UserError, match=told):
        with_truth((0.0, label, ahead_m), (1.0, label, ahead_m))
