"""KITTI's odometry benchmark and KITTI-360 give what the same drive gives in the raw layout."""

from __future__ import annotations

import shutil

import cv2
import numpy as np
import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.data.detector import DetectorSettings
from genie_sim.data.perceive import DriveFrames, images, perceive
from tests.kitti_folder import (
    CENTRE_X,
    CENTRE_Y,
    DATE,
    FOCAL,
    HEIGHT,
    WIDTH,
    make_network,
    make_street,
)

FRAMES = 3
DRIVE_360 = "2013_05_28_drive_0003_sync"
# The laser has x ahead, y left, z up; the camera x right, y down, z ahead.
CAMERA_R_VELO = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])
# The unit of KITTI-360 has x ahead, y right, z down.
IMU_R_CAMERA = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
WORLD_R_IMU = np.diag([1, -1, -1])


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


def make_360(root, folder):
    pictures = root / "data_2d_raw" / DRIVE_360 / "image_00"
    scans = root / "data_3d_raw" / DRIVE_360 / "velodyne_points"
    shutil.copytree(folder / "image_02" / "data", pictures / "data_rect")
    shutil.copy(folder / "image_02" / "timestamps.txt", pictures / "timestamps.txt")
    shutil.copytree(folder / "velodyne_points" / "data", scans / "data")
    calibration, poses = root / "calibration", root / "data_poses" / DRIVE_360
    calibration.mkdir()
    poses.mkdir(parents=True)
    # before they were rectified the cameras looked 0.01 rad to the side
    turn = np.array([[np.cos(0.01), 0, np.sin(0.01)], [0, 1, 0], [-np.sin(0.01), 0, np.cos(0.01)]])
    flat = " ".join(map(str, turn.ravel()))
    lines = [
        f"P_rect_0{k}: {PROJECTION}\nR_rect_0{k}: {flat}\nS_rect_0{k}: {WIDTH} {HEIGHT}"
        for k in (0, 1)
    ]
    (calibration / "perspective.txt").write_text("\n".join(["calib_time: now", *lines]) + "\n")
    mount = text(IMU_R_CAMERA @ turn)
    (calibration / "calib_cam_to_pose.txt").write_text(f"image_00: {mount}\nimage_01: {mount}\n")
    laser = text(CAMERA_R_VELO.T @ turn)
    (calibration / "calib_cam_to_velo.txt").write_text(f"{laser}\n")
    rows = [f"{k} {text(WORLD_R_IMU, (k, 0, 0))}" for k in range(FRAMES)]
    (poses / "poses.txt").write_text("\n".join(rows) + "\n")


@pytest.mark.parametrize(
    ("make", "drive", "camera"),
    [(make_odometry, "odometry/05", "02"), (make_360, "kitti360/0003", "00")],
)
def test_it_gives_what_the_raw_drive_gives(tmp_path, raw, make, drive, camera):
    root, folder, weights = raw
    make(tmp_path, folder)
    detector = DetectorSettings(weights=weights)
    same = perceive(root, DriveFrames(f"{DATE}/0005", ["02"]), detector)
    report = ImportReport(tmp_path)
    trace = perceive(tmp_path, DriveFrames(drive, [camera]), detector, report=report)
    assert len(trace.frames[camera]) == FRAMES
    for frame, there in zip(trace.frames[camera], same.frames["02"], strict=True):
        assert frame.stamp_ns == there.stamp_ns
        assert tuple(frame.pose) == pytest.approx(tuple(there.pose), abs=0.01)
        (car,), (other,) = frame.detections, there.detections
        assert car.location == pytest.approx(other.location, abs=0.01)
        assert (car.score, car.method) == (other.score, "scan")
    assert trace.name == drive.replace("/", "_") and "KITTI" in trace.provenance["data"]
    assert "path 2 m, top speed 10 m/s" in " ".join(report.lines())
    assert len(images(tmp_path, drive, [camera])) == FRAMES


@pytest.mark.parametrize(
    ("make", "drive", "camera", "broken", "message"),
    [
        (make_odometry, "odometry/11", "02", None, "unknown sequence '11'.*known: 05"),
        (make_odometry, "odometry/05", "02", "dataset/poses/05.txt", "poses of sequences 00 to 10"),
        (make_odometry, "odometry/05", "05", None, "unknown camera '05'"),
        (make_odometry, "odometry/05", "03", None, "image_3: no images"),
        (make_odometry, "odometry/05", "02", "dataset/sequences/05/velodyne/000001.bin", "missing"),
        (make_odometry, "odometry/05", "02", "dataset/sequences/05/times.txt", "times.txt: cannot"),
        (make_360, "kitti360/0004", "00", None, "unknown drive '0004'.*known: 0003"),
        (make_360, "kitti360/0003", "02", None, "unknown camera '02'.*known: 00, 01"),
        (make_360, "kitti360/0003", "00", "calibration/perspective.txt", "perspective.txt: cannot"),
    ],
)
def test_what_is_missing_is_one_line(tmp_path, raw, make, drive, camera, broken, message):
    _, folder, weights = raw
    make(tmp_path, folder)
    if broken is not None:
        (tmp_path / broken).unlink()
    with pytest.raises(UserError, match=message) as error:
        perceive(tmp_path, DriveFrames(drive, [camera]), DetectorSettings(weights=weights))
    assert "\n" not in str(error.value)


def test_frames_without_a_pose_are_counted(tmp_path, raw):
    """KITTI-360 gives poses only where the car moves."""
    _, folder, weights = raw
    make_360(tmp_path, folder)
    path = tmp_path / "data_poses" / DRIVE_360 / "poses.txt"
    path.write_text("\n".join(path.read_text().splitlines()[1:]) + "\n")
    report, selection = ImportReport(tmp_path), DriveFrames("kitti360/0003", ["00"])
    trace = perceive(tmp_path, selection, DetectorSettings(weights=weights), report=report)
    assert [frame.index for frame in trace.frames["00"]] == [1, 2]
    assert report.left_out == {"frames without a pose": 1}


def make_unsynced(root, folder):
    """The drive as it was recorded: positions at 100 Hz, scans 20 ms late with numbers of their
    own, pictures twice as large, to be rectified.
    """
    target = root / DATE / f"{DATE}_drive_0005_extract"
    shutil.copytree(folder.parent, root / DATE, ignore=shutil.ignore_patterns("*_sync"))
    for part in ("image_02/data", "oxts/data", "velodyne_points/data"):
        (target / part).mkdir(parents=True)
    shutil.copy(folder / "image_02/timestamps.txt", target / "image_02/timestamps.txt")
    for path in (folder / "image_02/data").iterdir():
        large = cv2.resize(cv2.imread(str(path)), None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
        cv2.imwrite(str(target / "image_02/data" / path.name), large)
    first_s, stamp = 32.345808896, "2011-09-26 13:04:{:012.9f}"
    scan = np.fromfile(folder / "velodyne_points/data/0000000000.bin", np.float32).reshape(-1, 4)
    stamps = [stamp.format(first_s + 0.1 * k - 0.08) for k in range(FRAMES + 1)]
    (target / "velodyne_points/timestamps.txt").write_text("\n".join(stamps) + "\n")
    for k in range(FRAMES + 1):
        np.savetxt(target / f"velodyne_points/data/{k:010d}.txt", scan, fmt="%.3f")
    stamps = [stamp.format(first_s + 0.01 * k) for k in range(10 * FRAMES)]
    (target / "oxts/timestamps.txt").write_text("\n".join(stamps) + "\n")
    packets = [(folder / f"oxts/data/{k:010d}.txt").read_text().split() for k in range(FRAMES)]
    for k in range(10 * FRAMES):
        longitude = np.interp(k / 10, range(FRAMES), [float(row[1]) for row in packets])
        if k >= 10 * (FRAMES - 1):
            longitude = float(packets[-1][1])
        values = [packets[0][0], f"{longitude:.12f}", *packets[0][2:]]
        (target / f"oxts/data/{k:010d}.txt").write_text(" ".join(values) + "\n")
    path = root / DATE / "calib_cam_to_cam.txt"
    matrix = f"{2 * FOCAL} 0 {2 * CENTRE_X + 0.5} 0 {2 * FOCAL} {2 * CENTRE_Y + 0.5} 0 0 1"
    path.write_text(
        path.read_text() + f"S_02: {2 * WIDTH} {2 * HEIGHT}\nK_02: {matrix}\n"
        f"D_02: 0 0 0 0 0\nS_rect_02: {WIDTH} {HEIGHT}\n"
    )
    return target


def test_a_drive_that_is_not_in_step_gives_what_the_other_gives(tmp_path, raw):
    root, folder, weights = raw
    make_unsynced(tmp_path, folder)
    selection, report = DriveFrames(f"{DATE}/0005", ["02"]), ImportReport(tmp_path)
    detector = DetectorSettings(weights=weights)
    same = perceive(root, selection, detector)
    trace = perceive(tmp_path, selection, detector, report=report)
    assert report.chosen == ["drive: _extract, not _sync"]
    for frame, there in zip(trace.frames["02"], same.frames["02"], strict=True):
        assert (frame.stamp_ns, frame.width, frame.height) == (there.stamp_ns, WIDTH, HEIGHT)
        assert tuple(frame.pose) == pytest.approx(tuple(there.pose), abs=0.01)
        (car,), (other,) = frame.detections, there.detections
        assert car.box == pytest.approx(other.box, abs=1)
        assert car.location == pytest.approx(other.location, abs=0.1) and car.method == "scan"


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        ("velodyne_points/data", "no scan was taken within 60 ms of it"),
        ("oxts/data", "oxts/data: no .txt files"),
        ("oxts/timestamps.txt", "timestamps.txt: cannot be read"),
        ("image_02/data", "no images"),
        ("calib", "D_02 is missing or not five numbers"),
    ],
)
def test_what_a_drive_out_of_step_lacks_is_one_line(tmp_path, raw, broken, message):
    _, folder, weights = raw
    target = make_unsynced(tmp_path, folder)
    if broken == "calib":
        path = tmp_path / DATE / "calib_cam_to_cam.txt"
        path.write_text(path.read_text().replace("D_02", "D_05"))
    elif (target / broken).is_dir():
        shutil.rmtree(target / broken)
    else:
        (target / broken).unlink()
    selection = DriveFrames(f"{DATE}/0005", ["02"])
    with pytest.raises(UserError, match=message) as error:
        perceive(tmp_path, selection, DetectorSettings(weights=weights))
    assert "\n" not in str(error.value)
