"""Raw drives of KITTI as they were recorded (``_extract``): every sensor has stamps and numbers of
its own, and pictures are not rectified.

Positions are interpolated between OXTS packets, a picture gets the scan that is nearest in time,
and is rectified when it is read.
"""

import bisect
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError
from genie_sim.base.import_report import ImportReport
from genie_sim.core.geometry import Array, Geodetic, inverse
from genie_sim.data.files import matrices, named_rows, size_of, within
from genie_sim.data.geodesy import read_oxts, world_SE3_imu
from genie_sim.data.kitti import (
    CALIBRATION_FILES,
    CAMERAS,
    CameraFrame,
    KittiDrive,
    Rectification,
    SensorCalibration,
    check_cameras,
    day_calibration,
    drive_folders,
    named_below,
    numbered,
    numbered_images,
    stamps_ns_of,
)

BEYOND_NS = 50_000_000  # before the first and after the last packet a position is known so long
SCAN_WITHIN_NS = 60_000_000  # half a turn of the laser, and a little


def unsynced_folder(root: Path, drive: str) -> Path | None:
    """The folder of a drive that is there in this form only, else ``None``."""
    date, _, number = drive.partition("/")
    folder = root / date / f"{date}_drive_{number}_extract"
    return folder if folder.is_dir() and drive not in drive_folders(root) else None


def open_unsynced(
    root: Path,
    drive: str,
    cameras: Sequence[str],
    *,
    origin: Geodetic | None = None,
    allow_missing_scans: bool = False,
    report: ImportReport,
) -> KittiDrive:
    """Opens a drive; the arguments and errors are those of ``kitti.open_drive``."""
    folder = unsynced_folder(root, drive)
    assert folder is not None
    calibration = day_calibration(folder.parent)
    check_cameras(folder, cameras, CAMERAS)
    report.choose("drive", "_extract", ["_extract", "_sync"])
    oxts_paths = numbered(folder / "oxts" / "data", "txt")
    oxts_ns, packets = _packets(folder / "oxts", oxts_paths, report)
    scan_paths = numbered(folder / "velodyne_points" / "data", "txt")
    scans_ns = _by_number(folder / "velodyne_points" / "timestamps.txt", scan_paths)
    if origin is None:
        latitude, longitude, altitude = packets[0, :3].tolist()
        origin = (latitude, longitude, altitude)
    calibration_path = folder.parent / CALIBRATION_FILES[0]
    frames: dict[str, tuple[CameraFrame, ...]] = {}
    poses: dict[int, Array] = {}
    decisive = [folder.parent / name for name in CALIBRATION_FILES]
    for camera in cameras:
        images = numbered_images(folder / f"image_{camera}" / "data", camera, report)
        path = folder / f"image_{camera}" / "timestamps.txt"
        stamps_ns = _by_number(path, images)
        imu_SE3_camera = inverse(calibration.camera_SE3_velo[camera] @ calibration.velo_SE3_imu)
        rectification = _rectification(calibration_path, camera, calibration)
        of_camera: list[CameraFrame] = []
        for index, image_path in images.items():
            stamp_ns = stamps_ns[index]
            if not oxts_ns[0] - BEYOND_NS <= stamp_ns <= oxts_ns[-1] + BEYOND_NS:
                report.leave_out("frames without a position")
                continue
            if of_camera and stamp_ns <= of_camera[-1].stamp_ns:
                raise UserError(f"{path}: line {index + 1}: does not follow the stamp before")
            scan = _nearest(scans_ns, stamp_ns)
            if scan is None and not allow_missing_scans:
                raise UserError(f"{image_path}: no scan was taken within 60 ms of it")
            pose = world_SE3_imu(_at(oxts_ns, packets, stamp_ns), origin)
            poses.setdefault(index, pose)
            of_camera.append(
                CameraFrame(
                    camera=camera,
                    index=index,
                    stamp_ns=stamp_ns,
                    image_path=image_path,
                    world_SE3_camera=pose @ imu_SE3_camera,
                    intrinsics=calibration.intrinsics[camera],
                    scan=scan,
                    rectification=rectification,
                )
            )
            decisive += [image_path, *([] if scan is None else [scan_paths[scan]])]
        if not of_camera:
            raise UserError(f"{folder}: camera {camera} has no frame while a position is known")
        frames[camera] = tuple(of_camera)
        decisive.append(path)
    return KittiDrive(
        name=drive,
        origin=origin,
        frames=frames,
        world_SE3_imu=poses,
        calibration=calibration,
        scan_paths=scan_paths,
        _decisive_files=named_below(root, [*dict.fromkeys(decisive), *oxts_paths.values()]),
    )


def _packets(
    folder: Path, paths: Mapping[int, Path], report: ImportReport
) -> tuple[list[int], Array]:
    """The stamps of all packets [ns] in order, and the packets (n, 6) with angles that go on over
    half a turn. Raises UserError.
    """
    if not paths:
        raise UserError(f"{folder / 'data'}: no .txt files")
    by_number = _by_number(folder / "timestamps.txt", paths)
    rows: dict[int, Array] = {}
    for number, path in paths.items():
        lines = read_oxts(path)
        if len(lines) != 1:
            raise UserError(f"{path}: {len(lines)} lines, expected one")
        rows[by_number[number]] = lines[0]
    report.dropped("OXTS packets", len(rows), len(paths), "the stamp of another")
    stamps_ns = sorted(rows)
    report.gaps("OXTS packets", [stamp_ns / 1e9 for stamp_ns in stamps_ns])
    packets = np.array([rows[stamp_ns] for stamp_ns in stamps_ns])
    packets[:, 3:] = np.unwrap(packets[:, 3:], axis=0)
    return stamps_ns, packets


def _at(stamps_ns: Sequence[int], packets: Array, stamp_ns: int) -> Array:
    """The packet of an instant, between two."""
    times_s = (np.array(stamps_ns) - stamps_ns[0]) / 1e9
    time_s = (stamp_ns - stamps_ns[0]) / 1e9
    return np.array([np.interp(time_s, times_s, column) for column in packets.T])


def _by_number(path: Path, files: Mapping[int, Path]) -> dict[int, int]:
    """The stamp of each numbered file [ns]. Raises UserError where one has none."""
    if not files:
        return {}
    stamps_ns = stamps_ns_of(path)
    if max(files) >= len(stamps_ns):
        raise UserError(f"{path}: {len(stamps_ns)} time stamps, but there is a file {max(files)}")
    return {number: stamps_ns[number] for number in files}


def _nearest(stamps_ns: Mapping[int, int], stamp_ns: int) -> int | None:
    """The number whose stamp is nearest; ``None``: none is near."""
    numbers = list(stamps_ns)
    after = bisect.bisect_left(numbers, stamp_ns, key=lambda number: stamps_ns[number])
    beside = numbers[max(after - 1, 0) : after + 1]
    nearest = min(beside, key=lambda number: abs(stamps_ns[number] - stamp_ns), default=None)
    is_near = nearest is not None and abs(stamps_ns[nearest] - stamp_ns) <= SCAN_WITHIN_NS
    return nearest if is_near else None


def _rectification(path: Path, camera: str, calibration: SensorCalibration) -> Rectification:
    """How pictures of a camera are rectified. Raises UserError for what the calibration lacks."""
    rows = named_rows(path)
    names: list[tuple[tuple[str, ...], int]] = [((f"K_{camera}",), 3), ((f"R_rect_{camera}",), 3)]
    matrix, turn = matrices(path, rows, names)
    sizes = []
    for name in (f"S_{camera}", f"S_rect_{camera}"):
        size = size_of(rows, name)
        if size is None:
            raise UserError(f"{path}: {name} is missing or no width and height of a picture")
        sizes.append(size)
    try:
        distortion = np.array([float(text) for text in rows.get(f"D_{camera}", ())])
    except ValueError:
        distortion = np.empty(0)
    if len(distortion) != 5 or not within(distortion):
        raise UserError(f"{path}: D_{camera} is missing or not five numbers")
    return Rectification(
        matrix, distortion, turn, calibration.intrinsics[camera], size=sizes[0], to=sizes[1]
    )
