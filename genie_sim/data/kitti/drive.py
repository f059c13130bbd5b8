"""KITTI's raw drives and its odometry benchmark: frames, camera poses and laser scans of one drive,
all in one east-north-up world.

pykitti reads calibration, poses and scans. Its time stamps (the OXTS unit's, cut to
microseconds) and its lists of files (which shift after the first missing one) do not fit a
simulator: here every camera has its own stamps in nanoseconds, and files are found by frame number.
pykitti would wait for a pipe for ever, so files are looked at first.
"""

import contextlib
import hashlib
import logging
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.geometry import Array, Geodetic, inverse, rigid
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_bytes, regular, sha256_of
from genie_sim.data.kitti.number_files import (
    are_plausible,
    numbers,
    picture_size,
    size_of,
    unbroken_lines,
)
from genie_sim.data.kitti.oxts import read_oxts, world_SE3_imu
from genie_sim.data.world_table import SOMEWHERE

log = logging.getLogger(__name__)

CAMERAS = ("00", "01", "02", "03")
CALIBRATION_FILES = ("calib_cam_to_cam.txt", "calib_imu_to_velo.txt", "calib_velo_to_cam.txt")
TRACKLETS = "tracklet_labels.xml"
ODOMETRY = "odometry/"
ODOMETRY_FOLDERS = (".", "dataset", "odometry", "odometry/dataset")  # where ``sequences`` may be
# The first camera's x is right, y down, z ahead; ahead is east, where nothing tells otherwise.
WORLD_SE3_FIRST = rigid([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], (0.0, 0.0, 0.0))
BROKEN = (OSError, LookupError, TypeError, ValueError)  # what pykitti and numpy make of a file
POINT_BYTES = 16
STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)
LAST_BYTES = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9"}
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, raw data: A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "
    "'Vision meets Robotics: The KITTI Dataset', IJRR 2013, "
    "https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)
ATTRIBUTION_OF_ODOMETRY = (
    "KITTI Vision Benchmark Suite, odometry: A. Geiger, P. Lenz, R. Urtasun, 'Are we ready for "
    "Autonomous Driving?', CVPR 2012, https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """One picture on disk: its frame number, its camera's own time stamp, and where the camera was.

    ``stamp_ns`` is Unix time as KITTI's file gives it. ``intrinsics`` is the 3x3 matrix of the
    rectified camera, whose pictures have this ``size`` (width, height; ``None``: nobody tells).
    """

    camera: str
    index: int
    stamp_ns: int
    image_path: Path
    world_SE3_camera: Array
    intrinsics: Array
    size: tuple[int, int] | None = None

    def check_size(self, size: tuple[int, int]) -> None:
        """Raises UserError for a picture that was made smaller, or cut."""
        if self.size is not None and size != self.size:
            raise UserError(
                f"{self.image_path}: has {size[0]}x{size[1]} pixels; the calibration is for "
                f"{self.size[0]}x{self.size[1]}"
            )


@dataclass(frozen=True, slots=True)
class KittiDrive:
    """One drive, opened and checked by ``open_drive``: frames by camera, poses and scans by frame
    number. Of the odometry benchmark the first camera stands for the IMU.
    """

    name: str
    origin: Geodetic
    frames: Mapping[str, tuple[CameraFrame, ...]]
    world_SE3_imu: Mapping[int, Array]
    velo_SE3_imu: Array
    calibration: Any = field(repr=False)  # pykitti's
    scan_paths: Mapping[int, Path] = field(repr=False)
    _decisive_files: tuple[tuple[str, Path], ...] = field(repr=False)

    @property
    def first_stamp_ns(self) -> int:
        """The earliest stamp of any of the opened cameras."""
        return min(sequence[0].stamp_ns for sequence in self.frames.values())

    def scan(self, index: int) -> Array | None:
        """Points (n, 3) of the laser scan of a frame, in the laser's frame; ``None`` where the
        drive has no scan.
        """
        import pykitti

        path = self.scan_paths.get(index)
        if path is None:
            return None
        with regular(path):
            size_bytes = path.stat().st_size
            if size_bytes % POINT_BYTES:
                raise UserError(
                    f"{path}: {size_bytes} bytes are not a whole number of {POINT_BYTES}-byte "
                    "points: truncated?"
                )
            points = pykitti.utils.load_velo_scan(path)
        columns = points[:, :3].T.astype(np.float64, order="C")
        if not are_plausible(columns):
            raise UserError(f"{path}: the scan has points that are not finite numbers")
        # so that each coordinate of all points lies together, which is how they are used
        by_coordinate: Array = columns.T
        return by_coordinate

    def camera_SE3_velo(self, camera: str) -> Array:
        """From the laser's frame to that of a rectified camera."""
        return _camera_SE3_velo(self.calibration, camera)

    def world_SE3_velo(self, index: int) -> Array:
        """From the laser's frame to the world, at a frame that has a position."""
        return self.world_SE3_imu[index] @ inverse(self.velo_SE3_imu)

    def digest(self) -> str:
        """sha256 over the names and bytes of every file that decides what this drive shows."""
        total = hashlib.sha256()
        for name, path in sorted(self._decisive_files):
            total.update(f"{name} {sha256_of(path)}\n".encode())
        return total.hexdigest()


@dataclass(frozen=True)
class _Layout:
    """Where the parts of a drive are, and what it tells of itself.

    ``pictures`` and ``stamps`` are the folder and the file of the time stamps of a camera, which
    ``read_stamps_ns`` reads; ``poses`` are ``world_SE3_imu`` by frame number and ``pose_files``
    where each was read. ``decisive`` are further files that decide what the drive shows.
    """

    origin: Geodetic
    calibration: Any
    velo_SE3_imu: Array
    sizes: Mapping[str, tuple[int, int] | None]
    pictures: Mapping[str, Path]
    stamps: Mapping[str, Path]
    read_stamps_ns: Callable[[Path], Sequence[int]]
    scans: Path
    poses: Mapping[int, Array]
    pose_files: Mapping[int, Path]
    decisive: Sequence[Path]


def open_drive(
    root: str | Path,
    drive: str,
    cameras: Sequence[str] = ("02", "03"),
    *,
    origin: Geodetic | None = None,
    allow_missing_scans: bool = False,
    report: ImportReport | None = None,
) -> KittiDrive:
    """Open a raw drive such as ``2011_09_26/0005`` or a sequence such as ``odometry/05``, with JPEG
    or PNG images.

    Raises UserError, naming the file and what is wrong with it, for anything missing, cut short or
    out of order, before a frame is read. A frame without a position is left out, and a warning says
    so.

    Parameters
    ----------
    root : KITTI's folder
    drive : date and number, or ``odometry/`` and the sequence
    cameras : which to open
    origin : latitude [deg], longitude [deg], altitude [m] of the world's origin; ``None``: the
        drive's first GPS fix
    allow_missing_scans : whether frames may have no laser scan
    report : is told what is left out and chosen
    """
    root = Path(root)
    report = report or ImportReport(root)
    if not cameras or len(set(cameras)) != len(cameras):
        raise UserError(
            f"cameras: {', '.join(cameras) or 'none'}: name each camera once, "
            f"out of {', '.join(CAMERAS)}"
        )
    for camera in cameras:
        if camera not in CAMERAS:
            raise UserError(f"{drive}: {unknown('camera', camera, CAMERAS)}")
    layout = (_odometry if drive.startswith(ODOMETRY) else _raw)(root, drive, cameras, origin)
    pictures = {camera: _pictures(layout.pictures[camera], camera, report) for camera in cameras}
    indices = sorted({index for sequence in pictures.values() for index in sequence})
    scans = _numbered(layout.scans, "bin")
    if not allow_missing_scans:
        _check_scans(layout.scans, indices, scans)
    for index in indices:
        if index not in layout.poses:
            log.warning("%s: frame %d has no position: it is left out", root / drive, index)
            report.leave_out("frames without a position")
    frames = {camera: _frames(layout, camera, pictures[camera]) for camera in cameras}
    decisive = [*layout.decisive, *(layout.stamps[camera] for camera in cameras)]
    decisive += [frame.image_path for sequence in frames.values() for frame in sequence]
    used = sorted(layout.poses.keys() & set(indices))
    decisive += [
        paths[index] for paths in (layout.pose_files, scans) for index in used if index in paths
    ]
    return KittiDrive(
        name=drive,
        origin=layout.origin,
        frames=frames,
        world_SE3_imu=layout.poses,
        velo_SE3_imu=layout.velo_SE3_imu,
        calibration=layout.calibration,
        scan_paths=scans,
        _decisive_files=tuple(
            (path.relative_to(root).as_posix(), path) for path in dict.fromkeys(decisive)
        ),
    )


def read_image(path: Path) -> np.ndarray:
    """A picture as (height, width, 3) bytes in OpenCV's order blue, green, red. UserError for an
    unreadable file.
    """
    return decode_image(path, read_bytes(path))


def decode_image(path: Path, data: bytes) -> np.ndarray:
    """As ``read_image``, of a file whose bytes have been read."""
    import cv2

    # Some versions of OpenCV show the upper half of half a file, so its end is looked at first.
    whole = data.endswith(LAST_BYTES[path.suffix])
    image = None
    if whole:
        with contextlib.suppress(cv2.error):  # of a picture of more pixels than OpenCV takes
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise UserError(f"{path}: not a readable image, or cut short ({len(data)} bytes)")
    return image


def drive_folders(root: Path) -> dict[str, Path]:
    """The folders of all raw drives, by names such as ``2011_09_26/0005``."""
    folders = {}
    for folder in root.glob("*/*_sync"):
        match = re.fullmatch(r"(.+)_drive_(\d+)_sync", folder.name)
        if match:
            folders[f"{match[1]}/{match[2]}"] = folder
    return folders


def _drive_folder(root: Path, drive: str) -> Path:
    if not root.is_dir():
        raise UserError(f"{root}: no such KITTI folder")
    folders = drive_folders(root)
    if not folders:
        raise UserError(
            f"{root}: no drives here; expected folders like 2011_09_26/2011_09_26_drive_0005_sync"
        )
    if drive not in folders:
        raise UserError(f"{root}: {unknown('drive', drive, folders)}")
    return folders[drive]


def _raw(root: Path, drive: str, cameras: Sequence[str], origin: Geodetic | None) -> _Layout:
    """Of a raw drive."""
    import pykitti

    folder = _drive_folder(root, drive)
    date, number = drive.split("/")
    calibration_files = [folder.parent / name for name in CALIBRATION_FILES]
    _check_regular([*calibration_files, folder / "oxts" / "timestamps.txt"])
    with np.errstate(all="ignore"), as_user_error(f"{folder.parent}: calibration", *BROKEN):
        calibration = pykitti.raw(str(root), date, number, frames=()).calib
        rows = pykitti.utils.read_calib_file(calibration_files[0])
    _check_calibration(folder.parent, calibration)
    pose_files = _numbered(folder / "oxts" / "data", "txt")
    if not pose_files:
        raise UserError(f"{folder / 'oxts' / 'data'}: no .txt files")
    packets = {index: _packet(path) for index, path in pose_files.items()}
    if origin is None:
        latitude, longitude, altitude = packets[min(packets)][:3].tolist()
        origin = (latitude, longitude, altitude)
    return _Layout(
        origin=origin,
        calibration=calibration,
        velo_SE3_imu=calibration.T_velo_imu,
        sizes={camera: size_of(rows, f"S_rect_{camera}") for camera in cameras},
        pictures={camera: folder / f"image_{camera}" / "data" for camera in cameras},
        stamps={camera: folder / f"image_{camera}" / "timestamps.txt" for camera in cameras},
        read_stamps_ns=_stamps_ns,
        scans=folder / "velodyne_points" / "data",
        poses={index: world_SE3_imu(packet, origin) for index, packet in packets.items()},
        pose_files=pose_files,
        decisive=calibration_files,
    )


def _odometry(root: Path, drive: str, cameras: Sequence[str], origin: Geodetic | None) -> _Layout:
    """Of a sequence of the odometry benchmark."""
    import pykitti

    number = drive.removeprefix(ODOMETRY)
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
        sizes[camera] = picture_size(float(_intrinsics(calibration, camera)[0, 0]))
    return _Layout(
        origin=origin or SOMEWHERE,
        calibration=calibration,
        velo_SE3_imu=inverse(calibration.T_cam0_velo),
        sizes=sizes,
        pictures={camera: folder / f"image_{int(camera)}" for camera in cameras},
        stamps=dict.fromkeys(cameras, times),
        read_stamps_ns=_times_ns,
        scans=folder / "velodyne",
        poses={index: WORLD_SE3_FIRST @ pose for index, pose in enumerate(sequence.poses)},
        pose_files={},
        decisive=[calibration_file, poses],
    )


def _intrinsics(calibration: Any, camera: str) -> Array:
    """The matrix (3, 3) of a rectified camera."""
    intrinsics: Array = getattr(calibration, f"K_cam{int(camera)}")
    return intrinsics


def _camera_SE3_velo(calibration: Any, camera: str) -> Array:
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
        intrinsics = _intrinsics(calibration, camera)
        matrices = {"K": intrinsics, "T_velo": _camera_SE3_velo(calibration, camera)}
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


def _numbered(folder: Path, extension: str) -> dict[int, Path]:
    """Files by frame number."""
    paths = sorted(folder.glob(f"*.{extension}"))
    return {int(path.stem): path for path in paths if path.stem.isdecimal()}


def _pictures(folder: Path, camera: str, report: ImportReport) -> dict[int, Path]:
    """The pictures of a camera, by frame number: PNG or JPEG, whichever each frame has. Raises
    UserError for a folder without any.
    """
    png, jpg = _numbered(folder, "png"), _numbered(folder, "jpg")
    if not (png or jpg):
        raise UserError(
            f"{folder}: no images (0000000000.png or .jpg) of camera {camera}; --cameras names "
            "those that there are"
        )
    twice = len(png.keys() & jpg.keys())
    report.leave_out(f"JPEG images of {camera} that are there as PNG, too", twice)
    images = jpg | png
    return {index: images[index] for index in sorted(images)}


def _check_scans(folder: Path, indices: Sequence[int], scans: Mapping[int, Path]) -> None:
    """Raises UserError unless each frame has a scan."""
    advice = "--allow-missing-scans places objects by the ground alone"
    if not scans:
        raise UserError(f"{folder}: no .bin files; {advice}")
    without_scan = [index for index in indices if index not in scans]
    if without_scan:
        digits = len(next(iter(scans.values())).stem)
        name = folder / f"{without_scan[0]:0{digits}d}.bin"
        raise UserError(
            f"{name}: missing ({len(without_scan)} of {len(indices)} frames have none); {advice}"
        )


def _frames(layout: _Layout, camera: str, pictures: Mapping[int, Path]) -> tuple[CameraFrame, ...]:
    """The frames of a camera that have a position, in order of time. Raises UserError for stamps
    that do not fit.
    """
    path = layout.stamps[camera]
    stamps_ns = layout.read_stamps_ns(path)
    if max(pictures) >= len(stamps_ns):
        raise UserError(
            f"{path}: {len(stamps_ns)} time stamps, but there is an image of frame {max(pictures)}"
        )
    camera_SE3_imu = _camera_SE3_velo(layout.calibration, camera) @ layout.velo_SE3_imu
    imu_SE3_camera = inverse(camera_SE3_imu)
    frames: list[CameraFrame] = []
    for index, image_path in pictures.items():
        if index not in layout.poses:
            continue
        if frames and stamps_ns[index] <= frames[-1].stamp_ns:
            raise UserError(
                f"{path}: line {index + 1}: time stamp does not follow that of frame "
                f"{frames[-1].index}"
            )
        frames.append(
            CameraFrame(
                camera=camera,
                index=index,
                stamp_ns=stamps_ns[index],
                image_path=image_path,
                world_SE3_camera=layout.poses[index] @ imu_SE3_camera,
                intrinsics=_intrinsics(layout.calibration, camera),
                size=layout.sizes[camera],
            )
        )
    if not frames:
        raise UserError(
            f"{layout.pictures[camera]}: none of the frames of camera {camera} has a position"
        )
    return tuple(frames)


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
