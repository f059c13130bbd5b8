"""KITTI raw drives: frames, camera poses and laser scans of one drive, all in one east-north-up world.

pykitti reads calibration, OXTS packets and scans. Three things it does otherwise than a simulator needs are done here:
positions come from WGS 84 around one origin for all drives (pykitti: Mercator around each drive's first fix), every
camera has its own time stamps in nanoseconds (pykitti: those of the OXTS unit, cut to microseconds), and everything
is found by frame number (pykitti: by position in a list, which shifts after the first missing file).
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pykitti

from genie_sim.core.geometry import Array, Geodetic, inverse, rigid, rotation_from_rpy
from genie_sim.errors import UserError, unknown
from genie_sim.perception.geodesy import enu_SE3_enu

CAMERAS = ("00", "01", "02", "03")
CALIBRATION_FILES = ("calib_cam_to_cam.txt", "calib_imu_to_velo.txt", "calib_velo_to_cam.txt")
CAM_TO_CAM_KEYS = tuple(f"{matrix}_rect_{camera}" for matrix in "PR" for camera in CAMERAS)
OXTS_VALUES = 30
MOST_CALIBRATION = 1e6  # KITTI's largest number is a focal length of about 720 pixels
STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)
LAST_BYTES = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9"}
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, raw data: A. Geiger, P. Lenz, C. Stiller, R. Urtasun, 'Vision meets Robotics: The "
    "KITTI Dataset', IJRR 2013, https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """One picture on disk: its frame number, its camera's own time stamp, and where the camera was.

    ``stamp_ns`` is Unix time as KITTI's file gives it. ``intrinsics`` is the 3x3 matrix of the rectified camera.
    """

    camera: str
    index: int
    stamp_ns: int
    image_path: Path
    world_SE3_camera: Array
    intrinsics: Array


@dataclass(frozen=True, slots=True)
class KittiDrive:
    """One drive, opened and checked by ``open_drive``."""

    name: str
    origin: Geodetic
    frames: Mapping[str, tuple[CameraFrame, ...]]
    world_SE3_imu: Mapping[int, Array]
    calibration: Any = field(repr=False)  # pykitti's CalibData
    scan_paths: Mapping[int, Path] = field(repr=False)
    _decisive_files: tuple[tuple[str, Path], ...] = field(repr=False)

    @property
    def first_stamp_ns(self) -> int:
        """The earliest stamp of any of the opened cameras."""
        return min(sequence[0].stamp_ns for sequence in self.frames.values())

    def scan(self, index: int) -> Array | None:
        """Points (n, 3) of the laser scan of a frame, in the laser's frame; ``None`` where the drive has no scan."""
        path = self.scan_paths.get(index)
        if path is None:
            return None
        if path.stat().st_size % 16:
            raise UserError(f"{path}: {path.stat().st_size} bytes are not a whole number of 16-byte points: truncated?")
        columns = pykitti.utils.load_velo_scan(str(path))[:, :3].T.astype(np.float64, order="C")
        if not np.isfinite(columns).all():
            raise UserError(f"{path}: the scan has points that are not finite numbers")
        return columns.T  # so that each coordinate of all points lies together, which is how they are used

    def camera_SE3_velo(self, camera: str) -> Array:
        """From the laser's frame to that of a rectified camera."""
        return np.asarray(getattr(self.calibration, f"T_cam{int(camera)}_velo"), dtype=np.float64)

    def digest(self) -> str:
        """sha256 over the names and bytes of every file that decides what this drive shows."""
        total = hashlib.sha256()
        for name, path in sorted(self._decisive_files):
            total.update(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
        return total.hexdigest()


def open_drive(
    root: str | Path,
    drive: str,
    cameras: Sequence[str] = ("02", "03"),
    origin: Geodetic | None = None,
    allow_missing_scans: bool = False,
) -> KittiDrive:
    """Open a drive such as ``2011_09_26/0005`` of a folder in KITTI's raw layout, with JPEG or PNG images.

    ``origin`` is the world's geodetic origin, by default the drive's first GPS fix. Raises UserError, naming the file
    and what is wrong with it, for anything missing, cut short or out of order, before a frame is read.
    """
    root = Path(root)
    date, folder = _drive_folder(root, drive)
    for name in CALIBRATION_FILES:
        _need_file(root / date / name, "calibration")
    if not cameras or len(set(cameras)) != len(cameras):
        raise UserError(f"cameras: {', '.join(cameras) or 'none'}: name each camera once, out of {', '.join(CAMERAS)}")
    images = {camera: _images(folder, camera) for camera in cameras}
    oxts_paths = _numbered(folder / "oxts" / "data", "txt")
    for path in oxts_paths.values():
        _check_oxts(path)
    scan_paths = _numbered(folder / "velodyne_points" / "data", "bin")
    _check_every_frame(folder, images, oxts_paths, scan_paths, allow_missing_scans)

    raw = _pykitti_raw(root, date, drive.split("/")[1])
    packets = {index: oxts.packet for index, oxts in zip(oxts_paths, raw.oxts, strict=True)}
    first = packets[min(packets)]
    origin = (float(first.lat), float(first.lon), float(first.alt)) if origin is None else origin
    world_SE3_imu = {index: _pose(packet, origin) for index, packet in packets.items()}
    frames = {camera: tuple(_frames(folder, camera, images[camera], raw.calib, world_SE3_imu)) for camera in cameras}
    numbers = {index for sequence in images.values() for index in sequence}
    decisive = [root / date / name for name in CALIBRATION_FILES]
    decisive += [folder / f"image_{camera}" / "timestamps.txt" for camera in cameras]
    decisive += [path for sequence in images.values() for path in sequence.values()]
    decisive += [paths[i] for paths in (oxts_paths, scan_paths) for i in sorted(numbers & paths.keys())]
    named = tuple((path.relative_to(root).as_posix(), path) for path in decisive)
    return KittiDrive(drive, origin, frames, world_SE3_imu, raw.calib, scan_paths, named)


def read_image(path: Path) -> np.ndarray:
    """A picture as (height, width, 3) bytes in OpenCV's order blue, green, red. UserError for an unreadable file."""
    return decode_image(path, path.read_bytes())


def decode_image(path: Path, data: bytes) -> np.ndarray:
    """As ``read_image``, of a file whose bytes have been read."""
    import cv2

    # Some versions of OpenCV show the upper half of half a file, so its end is looked at first.
    whole = data.endswith(LAST_BYTES[path.suffix])
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if whole else None
    if image is None:
        raise UserError(f"{path}: not a readable image, or cut short ({len(data)} bytes)")
    return image


def _drive_folder(root: Path, drive: str) -> tuple[str, Path]:
    if not root.is_dir():
        raise UserError(f"{root}: no such KITTI folder")
    found = sorted(
        f"{m[1]}/{m[2]}" for p in root.glob("*/*_sync") if (m := re.fullmatch(r"(.+)_drive_(\d+)_sync", p.name))
    )
    if drive not in found:
        if not found:
            raise UserError(f"{root}: no drives here; expected folders like 2011_09_26/2011_09_26_drive_0005_sync")
        raise UserError(f"{root}: {unknown('drive', drive, found)}")
    date, number = drive.split("/")
    return date, root / date / f"{date}_drive_{number}_sync"


def _need_file(path: Path, what: str) -> None:
    if not path.is_file():
        raise UserError(f"{path}: {what} file is missing")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: not a readable text file: {error}") from error


def _numbered(folder: Path, extension: str) -> dict[int, Path]:
    """Files by frame number, in ascending order."""
    paths = [path for path in folder.glob(f"*.{extension}") if path.stem.isdigit()]
    return {int(path.stem): path for path in sorted(paths, key=lambda path: int(path.stem))}


def _images(folder: Path, camera: str) -> dict[int, Path]:
    if camera not in CAMERAS:
        raise UserError(f"{folder}: {unknown('camera', camera, CAMERAS)}")
    data = folder / f"image_{camera}" / "data"
    images = _numbered(data, "png") or _numbered(data, "jpg")
    if not images:
        raise UserError(f"{data}: no images (0000000000.png or .jpg) of camera {camera}")
    return images


def _check_oxts(path: Path) -> None:
    text = _text(path)
    try:
        values = [float(value) for value in text.split()]
    except ValueError as error:
        raise UserError(f"{path}: {error}") from error
    if len(values) != OXTS_VALUES or len(text.strip().splitlines()) != 1 or not all(map(math.isfinite, values)):
        raise UserError(f"{path}: {len(values)} values, expected {OXTS_VALUES} finite numbers in one line")


def _check_every_frame(
    folder: Path,
    images: Mapping[str, Mapping[int, Path]],
    oxts_paths: Mapping[int, Path],
    scan_paths: Mapping[int, Path],
    allow_missing_scans: bool,
) -> None:
    """Each image needs a position, and a scan unless these may be missing."""
    numbers = sorted({index for sequence in images.values() for index in sequence})
    needed = [("oxts", "txt", oxts_paths)]
    if not allow_missing_scans:
        needed.append(("velodyne_points", "bin", scan_paths))
    for name, extension, paths in needed:
        if not paths:
            raise UserError(f"{folder / name / 'data'}: no .{extension} files")
        missing = [index for index in numbers if index not in paths]
        if missing:
            raise UserError(
                f"{folder / name / 'data' / f'{missing[0]:010d}.{extension}'}: missing "
                f"({len(missing)} of {len(numbers)} frames have none)"
            )


def _pykitti_raw(root: Path, date: str, number: str) -> Any:
    """pykitti's view of the drive; its exceptions carry no file name, so the calibration is checked first."""
    for name, keys in zip(CALIBRATION_FILES, (CAM_TO_CAM_KEYS, ("R", "T"), ("R", "T")), strict=True):
        path = root / date / name
        sizes = {"P": 12, "R": 9, "T": 3}
        try:
            values = pykitti.utils.read_calib_file(str(path))
        except ValueError as error:
            raise UserError(f"{path}: not a KITTI calibration file: {error}") from error
        for key in keys:
            if (
                key not in values
                or values[key].size != sizes[key[0]]
                or not (abs(values[key]) < MOST_CALIBRATION).all()
            ):
                raise UserError(f"{path}: {key} is missing or has not {sizes[key[0]]} numbers")
    stamps = root / date / f"{date}_drive_{number}_sync" / "oxts" / "timestamps.txt"
    _need_file(stamps, "time stamp")
    try:
        return pykitti.raw(str(root), date, number)
    except ValueError as error:
        raise UserError(f"{stamps}: {error}") from error


def _pose(packet: Any, origin: Geodetic) -> Array:
    """``world_SE3_imu``: OXTS angles are relative to east, north and up where the car is, not at the origin."""
    world_SE3_here = enu_SE3_enu(origin, (packet.lat, packet.lon, packet.alt))
    return world_SE3_here @ rigid(rotation_from_rpy(packet.roll, packet.pitch, packet.yaw), (0.0, 0.0, 0.0))


def _frames(
    folder: Path, camera: str, images: Mapping[int, Path], calibration: Any, world_SE3_imu: Mapping[int, Array]
) -> list[CameraFrame]:
    path = folder / f"image_{camera}" / "timestamps.txt"
    stamps_ns = _stamps_ns(path)
    if max(images) >= len(stamps_ns):
        raise UserError(f"{path}: {len(stamps_ns)} time stamps, but there is an image of frame {max(images)}")
    imu_SE3_camera = inverse(np.asarray(getattr(calibration, f"T_cam{int(camera)}_imu"), dtype=np.float64))
    intrinsics = np.asarray(getattr(calibration, f"K_cam{int(camera)}"), dtype=np.float64)
    frames: list[CameraFrame] = []
    for index, image_path in images.items():
        if frames and stamps_ns[index] <= frames[-1].stamp_ns:
            raise UserError(f"{path}: line {index + 1}: time stamp does not follow that of frame {frames[-1].index}")
        pose = world_SE3_imu[index] @ imu_SE3_camera
        frames.append(CameraFrame(camera, index, stamps_ns[index], image_path, pose, intrinsics))
    return frames


def _stamps_ns(path: Path) -> list[int]:
    """Time stamps by frame number, in Unix nanoseconds. There may be more of them than images."""
    _need_file(path, "time stamp")
    stamps_ns = []
    for number, line in enumerate(_text(path).split("\n"), start=1):
        if not line.strip():
            continue
        try:
            if not STAMP.fullmatch(line.strip()):
                raise ValueError("of another form")
            stamps_ns.append(int(np.datetime64(line.strip().replace(" ", "T"), "ns").astype(np.int64)))
        except ValueError as error:
            raise UserError(f"{path}: line {number}: {line.strip()!r} is not a time stamp") from error
    return stamps_ns
