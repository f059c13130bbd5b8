"""KITTI raw drives: frames, camera poses and laser scans of one drive, all in one east-north-up
world.

pykitti reads the calibration files. Its loaders of drives do not fit a simulator: here positions
come from WGS 84 around one origin for all drives (pykitti: Mercator around each drive's first fix),
every camera has its own time stamps in nanoseconds (pykitti: those of the OXTS unit, cut to
microseconds), and files are looked up by frame number (pykitti: by position in a list, which shifts
after the first missing file).
"""

import functools
import hashlib
import logging
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError, short_repr, unknown
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_bytes, read_text, sha256_of
from genie_sim.core.geometry import Array, Geodetic, inverse, rigid
from genie_sim.data.files import matrices, numbers, size_of, within
from genie_sim.data.geodesy import read_oxts, world_SE3_imu

log = logging.getLogger(__name__)

CAMERAS = ("00", "01", "02", "03")
CALIBRATION_FILES = ("calib_cam_to_cam.txt", "calib_imu_to_velo.txt", "calib_velo_to_cam.txt")
TRACKLETS = "tracklet_labels.xml"
SAME_SHAPE = 0.02  # width by height may differ by this share
STAMP = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d(\.\d{1,9})?", re.ASCII)
LAST_BYTES = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9"}
ATTRIBUTION = (
    "KITTI Vision Benchmark Suite, raw data: A. Geiger, P. Lenz, C. Stiller, R. Urtasun, "
    "'Vision meets Robotics: The KITTI Dataset', IJRR 2013, "
    "https://www.cvlibs.net/datasets/kitti/, CC BY-NC-SA 3.0"
)


@dataclass(frozen=True, slots=True)
class SensorCalibration:
    """Where the sensors of a day's drives are mounted (4x4 transforms), and the 3x3 intrinsics of
    the rectified cameras, by camera. ``sizes``: the width and height [px] of their pictures, where
    the calibration tells.
    """

    velo_SE3_imu: Array
    camera_SE3_velo: Mapping[str, Array]
    intrinsics: Mapping[str, Array]
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class Rectification:
    """How pictures of ``size`` (width, height) of a camera become rectified ones of the size
    ``to``: by its matrix (3, 3), its five coefficients of distortion, its turn (3, 3), and the
    matrix (3, 3) of the rectified camera.
    """

    matrix: Array
    distortion: Array
    turn: Array
    rectified: Array
    size: tuple[int, int]
    to: tuple[int, int]

    @functools.cached_property
    def _maps(self) -> tuple[np.ndarray, np.ndarray]:
        import cv2

        arguments = (self.matrix, self.distortion, self.turn, self.rectified, self.to)
        across, down = cv2.initUndistortRectifyMap(*arguments, cv2.CV_32FC1)
        return across, down

    def __call__(self, path: Path, image: np.ndarray) -> np.ndarray:
        """A picture rectified. Raises UserError for one of another size."""
        import cv2

        height, width = image.shape[:2]
        if (width, height) != self.size:
            known = f"{self.size[0]}x{self.size[1]}"
            raise UserError(f"{path}: has {width}x{height} pixels, the calibration {known}")
        rectified: np.ndarray = cv2.remap(image, *self._maps, cv2.INTER_LINEAR)
        return rectified


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """One picture on disk: its frame number, its camera's own time stamp, and where the camera was.

    ``stamp_ns`` is Unix time as KITTI's file gives it. ``intrinsics`` is the 3x3 matrix of the
    rectified camera, for pictures of ``size`` (width, height; ``None``: whatever they have).
    ``scan`` is the number of the scan taken with it, if there is one. Where there is a
    ``rectification``, the picture on disk needs it.
    """

    camera: str
    index: int
    stamp_ns: int
    image_path: Path
    world_SE3_camera: Array
    intrinsics: Array
    size: tuple[int, int] | None = None
    scan: int | None = None
    rectification: Rectification | None = None

    def intrinsics_of(self, size: tuple[int, int]) -> Array:
        """The matrix for a picture of this width and height, which somebody may have made smaller.
        Raises UserError for one of another shape.
        """
        if self.size is None or size == self.size:
            return self.intrinsics
        scale = np.array([size[0] / self.size[0], size[1] / self.size[1]])
        if abs(scale[0] / scale[1] - 1) > SAME_SHAPE:
            raise UserError(
                f"{self.image_path}: has {size[0]}x{size[1]} pixels; the calibration is for "
                f"{self.size[0]}x{self.size[1]}, another shape: nobody knows what was cut off"
            )
        scaled: Array = self.intrinsics * np.array([[scale[0]], [scale[1]], [1.0]])
        return scaled


@dataclass(frozen=True, slots=True)
class KittiDrive:
    """One drive, opened and checked by ``open_drive``: frames by camera, poses and scans by frame
    number.
    """

    name: str
    origin: Geodetic
    frames: Mapping[str, tuple[CameraFrame, ...]]
    world_SE3_imu: Mapping[int, Array]
    calibration: SensorCalibration = field(repr=False)
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
        path = self.scan_paths.get(index)
        if path is None:
            return None
        if path.suffix == ".txt":
            return numbers(path, 4)[:, :3]
        data = read_bytes(path)
        if len(data) % 16:
            raise UserError(
                f"{path}: {len(data)} bytes are not a whole number of 16-byte points: truncated?"
            )
        columns = (
            np.frombuffer(data, np.float32).reshape(-1, 4)[:, :3].T.astype(np.float64, order="C")
        )
        if not within(columns):
            raise UserError(f"{path}: the scan has points that are not finite numbers")
        # so that each coordinate of all points lies together, which is how they are used
        points: Array = columns.T
        return points

    def camera_SE3_velo(self, camera: str) -> Array:
        """From the laser's frame to that of a rectified camera."""
        return self.calibration.camera_SE3_velo[camera]

    def world_SE3_velo(self, index: int) -> Array:
        """From the laser's frame to the world, at a frame that has a position."""
        return self.world_SE3_imu[index] @ inverse(self.calibration.velo_SE3_imu)

    def digest(self) -> str:
        """sha256 over the names and bytes of every file that decides what this drive shows."""
        total = hashlib.sha256()
        for name, path in sorted(self._decisive_files):
            total.update(f"{name} {sha256_of(path)}\n".encode())
        return total.hexdigest()


def open_drive(
    root: str | Path,
    drive: str,
    cameras: Sequence[str] = ("02", "03"),
    *,
    origin: Geodetic | None = None,
    allow_missing_scans: bool = False,
    report: ImportReport | None = None,
) -> KittiDrive:
    """Open a drive such as ``2011_09_26/0005`` of a folder in KITTI's raw layout, with JPEG or PNG
    images.

    Raises UserError, naming the file and what is wrong with it, for anything missing, cut short or
    out of order, before a frame is read. A frame whose OXTS packet is missing is left out, and a
    warning says so.

    Parameters
    ----------
    root : KITTI's folder
    drive : date and number
    cameras : which to open
    origin : latitude [deg], longitude [deg], altitude [m] of the world's origin; ``None``: the
        drive's first GPS fix
    allow_missing_scans : whether frames may have no laser scan
    report : is told what is left out and chosen
    """
    root = Path(root)
    report = report or ImportReport(root)
    folder = _drive_folder(root, drive)
    day = folder.parent
    if not cameras or len(set(cameras)) != len(cameras):
        raise UserError(
            f"cameras: {', '.join(cameras) or 'none'}: name each camera once, "
            f"out of {', '.join(CAMERAS)}"
        )
    calibration = day_calibration(day)
    check_cameras(folder, cameras, CAMERAS)
    images = {
        camera: numbered_images(folder / f"image_{camera}" / "data", camera, report)
        for camera in cameras
    }
    indices = sorted({index for sequence in images.values() for index in sequence})
    scan_paths = numbered(folder / "velodyne_points" / "data", "bin")
    if not allow_missing_scans:
        check_scans(folder / "velodyne_points" / "data", indices, scan_paths)
    oxts = folder / "oxts" / "data"
    oxts_paths = numbered(oxts, "txt")
    origin, poses = _positions(oxts_paths, indices, folder=oxts, origin=origin, report=report)
    frames = {
        camera: tuple(_frames(folder, camera, images[camera], calibration=calibration, poses=poses))
        for camera in cameras
    }
    decisive = [day / name for name in CALIBRATION_FILES]
    decisive += [folder / f"image_{camera}" / "timestamps.txt" for camera in cameras]
    decisive += [frame.image_path for sequence in frames.values() for frame in sequence]
    used = sorted(poses.keys() & set(indices))
    decisive += [
        paths[index] for paths in (oxts_paths, scan_paths) for index in used if index in paths
    ]
    return KittiDrive(
        name=drive,
        origin=origin,
        frames=frames,
        world_SE3_imu=poses,
        calibration=calibration,
        scan_paths=scan_paths,
        _decisive_files=named_below(root, decisive),
    )


def check_cameras(where: object, cameras: Iterable[str], known: Collection[str]) -> None:
    """Raises UserError for a camera that a drive cannot have."""
    for camera in cameras:
        if camera not in known:
            raise UserError(f"{where}: {unknown('camera', camera, known)}")


def named_below(root: Path, paths: Iterable[Path]) -> tuple[tuple[str, Path], ...]:
    """Each file with its path below ``root``, by which it counts wherever the data lies."""
    return tuple((path.relative_to(root).as_posix(), path) for path in paths)


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
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if whole else None
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


def numbered(folder: Path, extension: str) -> dict[int, Path]:
    """Files by frame number, in ascending order."""
    paths = [path for path in folder.glob(f"*.{extension}") if path.stem.isdecimal()]
    return {int(path.stem): path for path in sorted(paths, key=lambda path: int(path.stem))}


def numbered_images(data: Path, camera: str, report: ImportReport) -> dict[int, Path]:
    """The pictures of a camera, by frame number: PNG or JPEG, whichever each frame has. Raises
    UserError for a folder without any.
    """
    png, jpg = numbered(data, "png"), numbered(data, "jpg")
    if not (png or jpg):
        raise UserError(f"{data}: no images (0000000000.png or .jpg) of camera {camera}")
    both = len(png.keys() & jpg.keys())
    report.leave_out(f"JPEG images of {camera} that are there as PNG, too", both)
    images = jpg | png
    return {index: images[index] for index in sorted(images)}


def _positions(
    paths: Mapping[int, Path],
    needed: Sequence[int],
    *,
    folder: Path,
    origin: Geodetic | None,
    report: ImportReport,
) -> tuple[Geodetic, dict[int, Array]]:
    """The world's origin, and ``world_SE3_imu`` of each frame that has an OXTS packet; the others
    are warned of. ``folder`` is where the packets' files at ``paths`` are.
    """
    if not paths:
        raise UserError(f"{folder}: no .txt files")
    packets: dict[int, Array] = {}
    for index, path in paths.items():
        lines = read_oxts(path)
        if len(lines) != 1:
            raise UserError(f"{path}: {len(lines)} lines, expected one")
        packets[index] = lines[0]
    for index in needed:
        if index not in packets:
            log.warning("%s: missing: frame %d is left out", folder / f"{index:010d}.txt", index)
            report.leave_out("frames without a position")
    if origin is None:
        latitude, longitude, altitude = packets[min(packets)][:3].tolist()
        origin = (latitude, longitude, altitude)
    return origin, {index: world_SE3_imu(packet, origin) for index, packet in packets.items()}


def check_scans(data: Path, indices: Sequence[int], scan_paths: Mapping[int, Path]) -> None:
    """Raises UserError unless each frame has a scan."""
    if not scan_paths:
        raise UserError(f"{data}: no .bin files")
    missing = [index for index in indices if index not in scan_paths]
    if missing:
        digits = len(next(iter(scan_paths.values())).stem)
        name = data / f"{missing[0]:0{digits}d}.bin"
        raise UserError(f"{name}: missing ({len(missing)} of {len(indices)} frames have none)")


def day_calibration(folder: Path) -> SensorCalibration:
    """The calibration of a day. Raises UserError, naming the file and the matrix that is wrong."""
    cameras, imu_to_velo, velo_to_cam = (folder / name for name in CALIBRATION_FILES)
    names = [((f"P_rect_{camera}",), 4) for camera in CAMERAS]
    names += [((f"R_rect_{camera}",), 3) for camera in CAMERAS]
    rows = _calibration_rows(cameras)
    camera_matrices = matrices(cameras, rows, names)
    projections = camera_matrices[: len(CAMERAS)]
    rectification = camera_matrices[len(CAMERAS)]
    camera0_SE3_velo = rigid(rectification, (0.0, 0.0, 0.0)) @ _rigid_of(velo_to_cam)
    camera_SE3_velo = {}
    sizes = {}
    for camera, projection in zip(CAMERAS, projections, strict=True):
        size = size_of(rows, f"S_rect_{camera}")
        if size is not None:
            sizes[camera] = size
        if projection[0, 0] <= 0:
            raise UserError(f"{cameras}: P_rect_{camera}: its focal length is not positive")
        beside_m = projection[0, 3] / projection[0, 0]
        camera_SE3_velo[camera] = rigid(np.eye(3), (beside_m, 0.0, 0.0)) @ camera0_SE3_velo
    return SensorCalibration(
        velo_SE3_imu=_rigid_of(imu_to_velo),
        camera_SE3_velo=camera_SE3_velo,
        intrinsics={
            camera: projection[:, :3]
            for camera, projection in zip(CAMERAS, projections, strict=True)
        },
        sizes=sizes,
    )


def _rigid_of(path: Path) -> Array:
    """The transform in a calibration file of a rotation R and a translation T."""
    rotation, translation = matrices(path, _calibration_rows(path), [(("R",), 3), (("T",), 1)])
    return rigid(rotation, translation[:, 0])


def _calibration_rows(path: Path) -> Mapping[str, Array]:
    """The numbers in a calibration file, by name. Raises UserError for anything else."""
    from pykitti.utils import read_calib_file

    read_text(path)  # refuses what is missing or no regular text file
    try:
        rows: Mapping[str, Array] = read_calib_file(str(path))
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: is no calibration file: {short_repr(str(error))}") from error
    return rows


def drive_frames(
    path: Path,
    camera: str,
    images: Mapping[int, Path],
    stamps_ns: Sequence[int],
    *,
    calibration: SensorCalibration,
    poses: Mapping[int, Array],
) -> list[CameraFrame]:
    """The frames of a camera that have a position, in order of time. Raises UserError for stamps
    that do not fit.

    Parameters
    ----------
    path : of the time stamps, to begin errors with
    camera : such as ``02``
    images : the pictures, by frame number
    stamps_ns : by frame number
    calibration : of the drive's day
    poses : ``world_SE3_imu`` by frame number
    """
    if max(images) >= len(stamps_ns):
        raise UserError(
            f"{path}: {len(stamps_ns)} time stamps, but there is an image of frame {max(images)}"
        )
    imu_SE3_camera = inverse(calibration.camera_SE3_velo[camera] @ calibration.velo_SE3_imu)
    frames: list[CameraFrame] = []
    for index, image_path in images.items():
        if index not in poses:
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
                world_SE3_camera=poses[index] @ imu_SE3_camera,
                intrinsics=calibration.intrinsics[camera],
                size=calibration.sizes.get(camera),
                scan=index,
            )
        )
    return frames


def _frames(
    folder: Path,
    camera: str,
    images: Mapping[int, Path],
    *,
    calibration: SensorCalibration,
    poses: Mapping[int, Array],
) -> list[CameraFrame]:
    """The frames of a camera of a raw drive that have a position, in order of time. The arguments
    are those of ``drive_frames``; ``folder`` is the drive's.
    """
    path = folder / f"image_{camera}" / "timestamps.txt"
    stamps_ns = stamps_ns_of(path)
    frames = drive_frames(path, camera, images, stamps_ns, calibration=calibration, poses=poses)
    if not frames:
        raise UserError(
            f"{folder / 'oxts' / 'data'}: none of the frames of camera {camera} has a file here"
        )
    return frames


def stamps_ns_of(path: Path) -> list[int]:
    """Time stamps by frame number, in Unix nanoseconds. There may be more of them than images."""
    stamps_ns = []
    for number, line in enumerate(read_text(path).split("\n"), start=1):
        if not line.strip():
            continue
        try:
            if not STAMP.fullmatch(line.strip()):
                raise ValueError("of another form")
            stamps_ns.append(
                int(np.datetime64(line.strip().replace(" ", "T"), "ns").astype(np.int64))
            )
        except ValueError as error:
            raise UserError(
                f"{path}: line {number}: {line.strip()!r} is not a time stamp"
            ) from error
    return stamps_ns
