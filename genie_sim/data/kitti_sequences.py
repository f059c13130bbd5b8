"""KITTI's odometry benchmark and KITTI-360: as the raw drives, from other folders and with poses
instead of fixes.

``odometry/05`` is ``sequences/05`` with ``poses/05.txt``; the car looks east where it begins.
``kitti360/0003`` is the drive 0003 of ``data_2d_raw``, in the east-north-up frame of its poses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.import_report import ImportReport
from genie_sim.core.geometry import Array, Geodetic, inverse, rigid
from genie_sim.data.files import matrices, named_rows, numbers, size_of
from genie_sim.data.kitti import (
    CAMERAS,
    CameraFrame,
    KittiDrive,
    SensorCalibration,
    check_cameras,
    check_scans,
    drive_frames,
    named_below,
    numbered,
    numbered_images,
    stamps_ns_of,
)
from genie_sim.data.tracking import PICTURE_SIZES, SAME_FOCAL_PX

ODOMETRY, KITTI_360 = "odometry/", "kitti360/"
ODOMETRY_FOLDERS = (".", "dataset", "odometry", "odometry/dataset")  # where ``sequences`` may be
# The first camera's x is right, y down, z ahead; ahead is east, where nothing tells otherwise.
WORLD_SE3_FIRST = rigid([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (0.0, 0.0, 0.0))
SOMEWHERE: Geodetic = (0.0, 0.0, 0.0)
# Of the Mercator plane of KITTI-360's poses (kitti360Scripts, convertOxtsPose).
ORIGIN_360: Geodetic = (48.9843445, 8.4295857, 0.0)
CAMERAS_360 = ("00", "01")
ATTRIBUTIONS = {
    ODOMETRY: (
        "KITTI Vision Benchmark Suite, odometry: A. Geiger, P. Lenz, R. Urtasun, 'Are we ready for "
        "Autonomous Driving?', CVPR 2012, https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
    ),
    KITTI_360: (
        "KITTI-360: Y. Liao, J. Xie, A. Geiger, 'KITTI-360: A Novel Dataset and Benchmarks for "
        "Urban Scene Understanding in 2D and 3D', PAMI 2022, "
        "https://www.cvlibs.net/datasets/kitti-360/, CC BY-NC-SA 3.0"
    ),
}
POSE_COLUMNS = 12  # three rows of a transform


@dataclass(frozen=True)
class _Files:
    """Where the files of a sequence are: of each camera its pictures and its time stamps [ns] with
    their file, the scans, and what else decides what it shows.
    """

    pictures: Mapping[str, Path]
    stamps: Mapping[str, tuple[Path, Sequence[int]]]
    scans: Path
    others: tuple[Path, ...]


def open_sequence_of(
    root: Path,
    drive: str,
    cameras: Sequence[str],
    *,
    origin: Geodetic | None = None,
    allow_missing_scans: bool = False,
    report: ImportReport,
) -> KittiDrive:
    """Opens ``odometry/NUMBER`` or ``kitti360/NUMBER``; the arguments and errors are those of
    ``kitti.open_drive``. ``origin``: where on Earth the frame of the poses lies.
    """
    is_360 = drive.startswith(KITTI_360)
    known = CAMERAS_360 if is_360 else CAMERAS
    check_cameras(drive, cameras, known)
    read = _kitti_360 if is_360 else _odometry
    files, poses, calibration = read(root, drive.partition("/")[2], cameras)
    images = {camera: numbered_images(files.pictures[camera], camera, report) for camera in cameras}
    indices = sorted({index for of_camera in images.values() for index in of_camera})
    scan_paths = numbered(files.scans, "bin")
    if not allow_missing_scans:
        check_scans(files.scans, indices, scan_paths)
    report.leave_out("frames without a pose", sum(index not in poses for index in indices))
    frames: dict[str, tuple[CameraFrame, ...]] = {}
    for camera in cameras:
        path, stamps_ns = files.stamps[camera]
        of_camera = drive_frames(
            path, camera, images[camera], stamps_ns, calibration=calibration, poses=poses
        )
        if not of_camera:
            raise UserError(f"{root}: {drive}: none of the frames of camera {camera} has a pose")
        frames[camera] = tuple(of_camera)
    decisive = [*files.others, *(path for path, _ in files.stamps.values())]
    decisive += [frame.image_path for of_camera in frames.values() for frame in of_camera]
    decisive += [scan_paths[index] for index in indices if index in scan_paths and index in poses]
    return KittiDrive(
        name=drive,
        origin=origin or (ORIGIN_360 if is_360 else SOMEWHERE),
        frames=frames,
        world_SE3_imu=poses,
        calibration=calibration,
        scan_paths=scan_paths,
        _decisive_files=named_below(root, dict.fromkeys(decisive)),
    )


def _odometry(
    root: Path, number: str, cameras: Sequence[str]
) -> tuple[_Files, dict[int, Array], SensorCalibration]:
    """A sequence of the benchmark; what stands for the IMU is the first camera."""
    places = [root / name for name in ODOMETRY_FOLDERS if (root / name / "sequences").is_dir()]
    if not places:
        raise UserError(f"{root}: no folder 'sequences' of KITTI's odometry benchmark")
    base = places[0]
    folder, poses_path = base / "sequences" / number, base / "poses" / f"{number}.txt"
    if not folder.is_dir():
        choices = [path.name for path in (base / "sequences").iterdir() if path.is_dir()]
        raise UserError(f"{base}: {unknown('sequence', number, choices)}")
    if not poses_path.is_file():
        raise UserError(f"{poses_path}: no such file: KITTI gives poses of sequences 00 to 10 only")
    path = folder / "calib.txt"
    rows = named_rows(path)
    names: list[tuple[tuple[str, ...], int]] = [((f"P{int(name)}",), 4) for name in CAMERAS]
    *projections, laser = matrices(path, rows, [*names, (("Tr", "Tr_velo_to_cam"), 4)])
    camera0_SE3_velo = rigid(laser[:, :3], laser[:, 3])
    camera_SE3_velo, intrinsics, sizes = {}, {}, {}
    for camera, projection in zip(CAMERAS, projections, strict=True):
        beside = rigid(np.eye(3), np.linalg.solve(projection[:, :3], projection[:, 3]))
        camera_SE3_velo[camera] = beside @ camera0_SE3_velo
        intrinsics[camera] = projection[:, :3]
        nearest = min(PICTURE_SIZES, key=lambda focal: abs(focal - projection[0, 0]))
        if abs(nearest - projection[0, 0]) <= SAME_FOCAL_PX:
            sizes[camera] = PICTURE_SIZES[nearest]
    calibration = SensorCalibration(inverse(camera0_SE3_velo), camera_SE3_velo, intrinsics, sizes)
    table = numbers(poses_path, POSE_COLUMNS).reshape(-1, 3, 4)
    poses = {
        index: WORLD_SE3_FIRST @ rigid(pose[:, :3], pose[:, 3]) for index, pose in enumerate(table)
    }
    times = folder / "times.txt"
    stamps_ns = [round(time_s * 1e9) for time_s in numbers(times, 1)[:, 0].tolist()]
    files = _Files(
        pictures={camera: folder / f"image_{int(camera)}" for camera in cameras},
        stamps=dict.fromkeys(cameras, (times, stamps_ns)),
        scans=folder / "velodyne",
        others=(path, poses_path),
    )
    return files, poses, calibration


def _kitti_360(
    root: Path, number: str, cameras: Sequence[str]
) -> tuple[_Files, dict[int, Array], SensorCalibration]:
    """A drive of KITTI-360. Its poses are those of the GPS unit; pictures are rectified, while
    cameras are mounted as they were before.
    """
    folders = {
        path.name.split("_drive_")[1].removesuffix("_sync"): path
        for path in sorted((root / "data_2d_raw").glob("*_drive_*_sync"))
    }
    if number not in folders:
        raise UserError(f"{root / 'data_2d_raw'}: {unknown('drive', number, folders)}")
    folder, where = folders[number], root / "calibration"
    cameras_path, mounts_path, laser_path = (
        where / name
        for name in ("perspective.txt", "calib_cam_to_pose.txt", "calib_cam_to_velo.txt")
    )
    rows = named_rows(cameras_path)
    names: list[tuple[tuple[str, ...], int]] = [((f"P_rect_{one}",), 4) for one in CAMERAS_360]
    names += [((f"R_rect_{one}",), 3) for one in CAMERAS_360]
    parts = matrices(cameras_path, rows, names)
    mounts = matrices(
        mounts_path, named_rows(mounts_path), [((f"image_{one}",), 4) for one in CAMERAS_360]
    )
    (laser,) = numbers(laser_path, POSE_COLUMNS)[:1].reshape(-1, 3, 4)
    velo_SE3_first = rigid(laser[:, :3], laser[:, 3])
    imu_SE3_first = rigid(mounts[0][:, :3], mounts[0][:, 3])
    camera_SE3_velo, intrinsics, sizes = {}, {}, {}
    for at, camera in enumerate(CAMERAS_360):
        imu_SE3_mounted = rigid(mounts[at][:, :3], mounts[at][:, 3])
        rectified = rigid(parts[at + len(CAMERAS_360)], (0.0, 0.0, 0.0))
        camera_SE3_imu = rectified @ inverse(imu_SE3_mounted)
        camera_SE3_velo[camera] = camera_SE3_imu @ imu_SE3_first @ inverse(velo_SE3_first)
        intrinsics[camera] = parts[at][:, :3]
        size = size_of(rows, f"S_rect_{camera}")
        if size is not None:
            sizes[camera] = size
    velo_SE3_imu = velo_SE3_first @ inverse(imu_SE3_first)
    calibration = SensorCalibration(velo_SE3_imu, camera_SE3_velo, intrinsics, sizes)
    poses_path = root / "data_poses" / folder.name / "poses.txt"
    table = numbers(poses_path, 1 + POSE_COLUMNS)
    poses = {
        int(row[0]): rigid(row[1:].reshape(3, 4)[:, :3], row[1:].reshape(3, 4)[:, 3])
        for row in table
    }
    stamps = {camera: folder / f"image_{camera}" / "timestamps.txt" for camera in cameras}
    files = _Files(
        pictures={camera: folder / f"image_{camera}" / "data_rect" for camera in cameras},
        stamps={camera: (path, stamps_ns_of(path)) for camera, path in stamps.items()},
        scans=root / "data_3d_raw" / folder.name / "velodyne_points" / "data",
        others=(cameras_path, mounts_path, laser_path, poses_path),
    )
    return files, poses, calibration
