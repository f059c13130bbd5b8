"""Where the parts of a KITTI drive are, and what its files tell: raw drives and sequences of the
odometry benchmark.

pykitti reads calibration and poses. Its time stamps (the OXTS unit's, cut to microseconds) and its
lists of files (which shift after the first missing one) do not fit a simulator: here every camera
has its own stamps in nanoseconds, and files are found by frame number. pykitti would wait for a
pipe for ever, so files are looked at first.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.geometry import Array, Geodetic, inverse, rigid
from genie_sim.base.paths import regular
from genie_sim.data.kitti.drive_name import DriveName
from genie_sim.data.kitti.number_files import (
    are_plausible,
    numbers,
    size_of,
    unbroken_lines,
)
from genie_sim.data.kitti.oxts import read_oxts, world_SE3_imu
from genie_sim.data.world_table import SOMEWHERE

CAMERAS = ("00", "01", "02", "03")
CALIBRATION_FILES = ("calib_cam_to_cam.txt", "calib_imu_to_velo.txt", "calib_velo_to_cam.txt")
ODOMETRY_FOLDERS = (".", "dataset", "odometry", "odometry/dataset")  # where ``sequences`` may be
# The first camera's x is right, y down, z ahead; ahead is east, where nothing tells otherwise.
WORLD_SE3_FIRST = rigid([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (0.0, 0.0, 0.0))
# Width and height of the pictures of each of KITTI's five days, by focal length [px].
PICTURE_SIZES = {
    721.5377: (1242, 375),  # 2011_09_26
    707.0493: (1224, 370),  # 2011_09_28
    718.3351: (1238, 374),  # 2011_09_29
    707.0912: (1226, 370),  # 2011_09_30
    718.856: (1241, 376),  # 2011_10_03
}
SAME_FOCAL_PX = 0.02  # two of the days differ by 0.04
BROKEN = (OSError, LookupError, TypeError, ValueError)  # what pykitti and numpy make of a file
STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, raw data: A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "
    "'Vision meets Robotics: The KITTI Dataset', IJRR 2013, "
    "https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)
ATTRIBUTION_OF_ODOMETRY = (
    "KITTI Vision Benchmark Suite, odometry: A. Geiger, P. Lenz, R. Urtasun, 'Are we ready for "
    "Autonomous Driving?', CVPR 2012, https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)


@dataclass(frozen=True)
class Layout:
    """Where the parts of a drive are, and what it tells of itself.

    ``pictures`` and ``stamps`` are the folder and the file of the time stamps of a camera, which
    ``read_stamps_ns`` reads; ``world_SE3_imu`` are poses by frame number and ``pose_files`` where
    each was read. ``calibration`` is pykitti's, ``decisive`` are further files that decide what the
    drive shows.
    """

    attribution: str
    origin: Geodetic
    calibration: Any
    velo_SE3_imu: Array
    sizes: Mapping[str, tuple[int, int] | None]
    pictures: Mapping[str, Path]
    stamps: Mapping[str, Path]
    read_stamps_ns: Callable[[Path], Sequence[int]]
    scans: Path
    world_SE3_imu: Mapping[int, Array]
    pose_files: Mapping[int, Path]
    decisive: Sequence[Path]


def raw_drives(root: Path) -> list[DriveName]:
    """All raw drives in KITTI's folder."""
    names = (DriveName.match(path.name) for path in root.glob("*/*_sync"))
    return sorted(name for name in names if name and (root / name.folder).is_dir())


def _drive_folder(root: Path, drive: DriveName) -> Path:
    if not root.is_dir():
        raise UserError(f"{root}: no such KITTI folder")
    drives = raw_drives(root)
    if not drives:
        raise UserError(
            f"{root}: no drives here; expected folders like 2011_09_26/2011_09_26_drive_0005_sync"
        )
    if drive not in drives:
        raise UserError(f"{root}: {unknown('drive', str(drive), map(str, drives))}")
    return root / drive.folder


def raw_layout(
    root: Path, drive: DriveName, cameras: Sequence[str], origin: Geodetic | None
) -> Layout:
    """Of a raw drive."""
    import pykitti

    folder = _drive_folder(root, drive)
    calibration_files = [folder.parent / name for name in CALIBRATION_FILES]
    _check_regular([*calibration_files, folder / "oxts" / "timestamps.txt"])
    with np.errstate(all="ignore"), as_user_error(f"{folder.parent}: calibration", *BROKEN):
        calibration = pykitti.raw(str(root), *drive, frames=()).calib
        rows = pykitti.utils.read_calib_file(calibration_files[0])
    _check_calibration(folder.parent, calibration)
    pose_files = numbered(folder / "oxts" / "data", "txt")
    if not pose_files:
        raise UserError(f"{folder / 'oxts' / 'data'}: no .txt files")
    packets = {index: _packet(path) for index, path in pose_files.items()}
    if origin is None:
        latitude, longitude, altitude = packets[min(packets)][:3].tolist()
        origin = (latitude, longitude, altitude)
    return Layout(
        attribution=ATTRIBUTION,
        origin=origin,
        calibration=calibration,
        velo_SE3_imu=calibration.T_velo_imu,
        sizes={camera: size_of(rows, f"S_rect_{camera}") for camera in cameras},
        pictures={camera: folder / f"image_{camera}" / "data" for camera in cameras},
        stamps={camera: folder / f"image_{camera}" / "timestamps.txt" for camera in cameras},
        read_stamps_ns=_stamps_ns,
        scans=folder / "velodyne_points" / "data",
        world_SE3_imu={index: world_SE3_imu(packet, origin) for index, packet in packets.items()},
        pose_files=pose_files,
        decisive=calibration_files,
    )


def odometry_layout(
    root: Path, drive: DriveName, cameras: Sequence[str], origin: Geodetic | None
) -> Layout:
    """Of a sequence of the odometry benchmark."""
    import pykitti

    number = drive.number
    places = [root / name for name in ODOMETRY_FOLDERS if (root / name / "sequences").is_dir()]
    if not places:
        raise UserError(f"{root}: no folder 'sequences' of KITTI's odometry benchmark")
    base = places[0]
    choices = [path.name for path in (base / "sequences").iterdir() if path.is_dir()]
    if number not in choices:
        raise UserError(f"{base}: {unknown('sequence', number, choices)}")
    folder, poses = base / "sequences" / number, base / "poses" / f"{number}.txt"
    if not poses.is_file():
        raise UserError(f"{poses}: no such file: KITTI gives poses of sequences 00 to 10 only")
    calibration_file, times = folder / "calib.txt", folder / "times.txt"
    _check_regular([calibration_file, times, poses])
    with np.errstate(all="ignore"), as_user_error(f"{folder}: cannot be read", *BROKEN):
        sequence = pykitti.odometry(str(base), number)
    calibration = sequence.calib
    _check_calibration(folder, calibration)
    if not are_plausible(sequence.poses):
        raise UserError(f"{poses}: a number is not finite, or too large")
    sizes: dict[str, tuple[int, int] | None] = {}
    for camera in cameras:
        sizes[camera] = picture_size(float(rectified_intrinsics(calibration, camera)[0, 0]))
    return Layout(
        attribution=ATTRIBUTION_OF_ODOMETRY,
        origin=origin or SOMEWHERE,
        calibration=calibration,
        velo_SE3_imu=inverse(calibration.T_cam0_velo),
        sizes=sizes,
        pictures={camera: folder / f"image_{int(camera)}" for camera in cameras},
        stamps=dict.fromkeys(cameras, times),
        read_stamps_ns=_times_ns,
        scans=folder / "velodyne",
        world_SE3_imu={index: WORLD_SE3_FIRST @ pose for index, pose in enumerate(sequence.poses)},
        pose_files={},
        decisive=[calibration_file, poses],
    )


def picture_size(focal_px: float) -> tuple[int, int] | None:
    """Width and height of KITTI's pictures with a focal length; ``None`` where no day has it."""
    nearest = min(PICTURE_SIZES, key=lambda focal: abs(focal - focal_px))
    return PICTURE_SIZES[nearest] if abs(nearest - focal_px) <= SAME_FOCAL_PX else None


def rectified_intrinsics(calibration: Any, camera: str) -> Array:
    """The matrix (3, 3) of a rectified camera."""
    intrinsics: Array = getattr(calibration, f"K_cam{int(camera)}")
    return intrinsics


def rectified_SE3_velo(calibration: Any, camera: str) -> Array:
    """From the laser's frame to that of a rectified camera."""
    camera_SE3_velo: Array = getattr(calibration, f"T_cam{int(camera)}_velo")
    return camera_SE3_velo


def _check_regular(paths: Iterable[Path]) -> None:
    """Raises UserError for a file that is missing, or that a reader may wait for."""
    for path in paths:
        with regular(path):
            pass


def _check_calibration(folder: Path, calibration: Any) -> None:
    """Raises UserError for a matrix that cannot be inverted, or whose numbers are none."""
    for camera in CAMERAS:
        intrinsics = rectified_intrinsics(calibration, camera)
        matrices = {"K": intrinsics, "T_velo": rectified_SE3_velo(calibration, camera)}
        for name, matrix in matrices.items():
            if not are_plausible(matrix) or abs(np.linalg.det(matrix)) < 1e-9:
                raise UserError(
                    f"{folder}: calibration: {name} of camera {camera} cannot be inverted"
                )
        if intrinsics[0, 0] <= 0:
            raise UserError(f"{folder}: calibration: camera {camera} has no focal length")


def _packet(path: Path) -> Array:
    """The one OXTS packet of a file."""
    packets = read_oxts(path)
    if len(packets) != 1:
        raise UserError(f"{path}: {len(packets)} packets, expected one")
    packet: Array = packets[0]
    return packet


def numbered(folder: Path, extension: str) -> dict[int, Path]:
    """Files by frame number."""
    paths = sorted(folder.glob(f"*.{extension}"))
    return {int(path.stem): path for path in paths if path.stem.isdecimal()}


def _stamps_ns(path: Path) -> list[int]:
    """Time stamps by frame number, in Unix nanoseconds. There may be more of them than images."""
    lines = []
    for number, fields in unbroken_lines(path):
        lines.append(" ".join(fields))
        if not STAMP.fullmatch(lines[-1]):
            raise UserError(f"{path}: line {number}: {lines[-1]!r} is not a time stamp")
    with as_user_error(f"{path}: is not a list of time stamps", ValueError):
        stamps_ns: list[int] = np.array(lines, "datetime64[ns]").astype(np.int64).tolist()
    return stamps_ns


def _times_ns(path: Path) -> list[int]:
    """As ``_stamps_ns``, of a file with seconds since the first frame."""
    return [round(time_s * 1e9) for time_s in numbers(path, 1)[:, 0].tolist()]
