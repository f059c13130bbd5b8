"""KITTI's odometry benchmark gives what the same drive gives in the raw layout."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detectors.detector import DetectorSettings
from genie_sim.data.kitti.drive import open_drive
from genie_sim.data.kitti.perceive import FrameSelection, perceive
from tests.kitti_folder import (
    CENTRE_X,
    CENTRE_Y,
    DATE,
    FOCAL,
    make_network,
    make_street,
)

FRAMES = 3
DRIVE = "odometry/05"
# The laser has x ahead, y left, z up; the camera x right, y down, z ahead.
CAMERA_R_VELO = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])


def text(rotation, translation=(0, 0, 0)) -> str:
    matrix = np.column_stack([rotation, translation])
    return " ".join(f"{value:e}" for value in matrix.ravel())


PROJECTION = text([[FOCAL, 0, CENTRE_X], [0, FOCAL, CENTRE_Y], [0, 0, 1]])


@pytest.fixture(scope="module")
def raw(tmp_path_factory):
    """A raw drive that goes east a metre a frame, with a car 15 m ahead."""
    root = tmp_path_factory.mktemp("raw")
    folder = make_street(root, FRAMES)
    return root, folder, make_network(root / "yolox_nano.onnx")


def make_odometry(root, folder):
    sequence = root / "dataset" / "sequences" / "05"
    for source, name in (("image_02/data", "image_2"), ("velodyne_points/data", "velodyne")):
        (sequence / name).mkdir(parents=True)
        for path in (folder / source).iterdir():
            shutil.copy(path, sequence / name / f"{int(path.stem):06d}{path.suffix}")
    lines = [f"P{number}: {PROJECTION}" for number in range(4)]
    (sequence / "calib.txt").write_text("\n".join([*lines, f"Tr: {text(CAMERA_R_VELO)}"]) + "\n")
    (sequence / "times.txt").write_text("".join(f"{k * 0.1:e}\n" for k in range(FRAMES)))
    poses = root / "dataset" / "poses"
    poses.mkdir()
    ahead = [text(np.eye(3), (0, 0, k)) for k in range(FRAMES)]
    (poses / "05.txt").write_text("\n".join(ahead) + "\n")


def test_it_gives_what_the_raw_drive_gives(tmp_path, raw):
    root, folder, weights = raw
    make_odometry(tmp_path, folder)
    detector = DetectorSettings(weights=weights)
    same = perceive(root, FrameSelection(f"{DATE}/0005", ["02"]), detector)
    report = ImportReport(tmp_path)
    trace = perceive(tmp_path, FrameSelection(DRIVE, ["02"]), detector, report=report)
    assert len(trace.frames["02"]) == FRAMES
    for frame, there in zip(trace.frames["02"], same.frames["02"], strict=True):
        assert frame.stamp_ns == there.stamp_ns
        assert tuple(frame.pose) == pytest.approx(tuple(there.pose), abs=0.01)
        (car,), (other,) = frame.detections, there.detections
        assert car.location == pytest.approx(other.location, abs=0.01)
        assert (car.score, car.placed_by) == (other.score, "scan")
    assert trace.name == "odometry_05" and "KITTI" in trace.provenance["data"]
    assert "path 2 m, top speed 10 m/s" in " ".join(report.lines())


@pytest.mark.parametrize(
    ("drive", "camera", "broken", "place"),
    [
        ("odometry/11", "02", None, ": 05"),
        (DRIVE, "02", "dataset/poses/05.txt", "poses/05.txt: "),
        (DRIVE, "05", None, "cameras: 05: name each camera"),
        (DRIVE, "03", None, "image_3: "),
        (DRIVE, "02", "dataset/sequences/05/velodyne/000001.bin", "000001.bin: missing"),
        (DRIVE, "02", "dataset/sequences/05/times.txt", "times.txt: "),
        (DRIVE, "02", "dataset/sequences/05/calib.txt", "calib.txt: "),
    ],
)
def test_what_is_missing_is_one_line(tmp_path, raw, drive, camera, broken, place):
    _, folder, weights = raw
    make_odometry(tmp_path, folder)
    if broken is not None:
        (tmp_path / broken).unlink()
    with pytest.raises(UserError) as error:
        perceive(tmp_path, FrameSelection(drive, [camera]), DetectorSettings(weights=weights))
    assert place in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("dataset/poses/05.txt", "1 0 0\n", "sequences/05: cannot be read: cannot reshape"),
        ("dataset/poses/05.txt", "nan " * 12 + "\n", "poses/05.txt: a number is not finite"),
        ("dataset/sequences/05/calib.txt", "P0: 1\n", "sequences/05: cannot be read: "),
        ("dataset/sequences/05/times.txt", "0\n0\n0\n", "times.txt: line 2: time stamp does not"),
    ],
)
def test_what_is_broken_is_one_line(tmp_path, raw, name, content, message):
    _, folder, _ = raw
    make_odometry(tmp_path, folder)
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=message) as error:
        open_drive(tmp_path, DRIVE, ["02"])
    assert "\n" not in str(error.value)


def test_frames_without_a_pose_are_counted(tmp_path, raw):
    _, folder, _ = raw
    make_odometry(tmp_path, folder)
    path = tmp_path / "dataset" / "poses" / "05.txt"
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    report = ImportReport(tmp_path)
    drive = open_drive(tmp_path, DRIVE, ["02"], report=report)
    assert [frame.index for frame in drive.frames["02"]] == [0, 1]
    assert report.left_out == {"frames without a position": 1}
