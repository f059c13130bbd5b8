"""One KITTI drive: frames, camera poses and laser scans, all in one east-north-up world."""

import contextlib
import hashlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array, Geodetic, inverse
from genie_sim.base.import_report import ImportReport
from genie_sim.base.paths import read_bytes, regular, sha256_of
from genie_sim.data.kitti.drive_name import ODOMETRY, DriveName
from genie_sim.data.kitti.layouts import (
    CAMERAS,
    Layout,
    numbered,
    odometry_layout,
    raw_layout,
    rectified_intrinsics,
    rectified_SE3_velo,
)
from genie_sim.data.kitti.number_files import are_plausible

log = logging.getLogger(__name__)

POINT_BYTES = 16
LAST_BYTES = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9"}


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

    name: DriveName
    layout: Layout = field(repr=False)
    frames: Mapping[str, tuple[CameraFrame, ...]]
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
        return rectified_SE3_velo(self.layout.calibration, camera)

    def world_SE3_velo(self, index: int) -> Array:
        """From the laser's frame to the world, at a frame that has a position."""
        return self.layout.world_SE3_imu[index] @ inverse(self.layout.velo_SE3_imu)

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
    if not cameras or len(set(cameras)) != len(cameras) or not {*cameras} <= {*CAMERAS}:
        raise UserError(
            f"cameras: {', '.join(map(str, cameras)) or 'none'}: name each camera once, "
            f"out of {', '.join(CAMERAS)}"
        )
    name = DriveName.parse(drive)
    layout_of = odometry_layout if name.part == ODOMETRY else raw_layout
    layout = layout_of(root, name, cameras, origin)
    pictures = {camera: _pictures(layout.pictures[camera], camera, report) for camera in cameras}
    indices = sorted({index for sequence in pictures.values() for index in sequence})
    scans = numbered(layout.scans, "bin")
    if not allow_missing_scans:
        _check_scans(layout.scans, indices, scans)
    for index in indices:
        if index not in layout.world_SE3_imu:
            log.warning("%s: frame %d has no position: it is left out", root / drive, index)
            report.leave_out("frames without a position")
    frames = {camera: _frames(layout, camera, pictures[camera]) for camera in cameras}
    decisive = [*layout.decisive, *(layout.stamps[camera] for camera in cameras)]
    decisive += [frame.image_path for sequence in frames.values() for frame in sequence]
    used = sorted(layout.world_SE3_imu.keys() & set(indices))
    decisive += [
        paths[index] for paths in (layout.pose_files, scans) for index in used if index in paths
    ]
    return KittiDrive(
        name=name,
        layout=layout,
        frames=frames,
        scan_paths=scans,
        _decisive_files=tuple(
            (path.relative_to(root).as_posix(), path) for path in dict.fromkeys(decisive)
        ),
    )


def read_image(path: Path) -> tuple[np.ndarray, bytes]:
    """A picture as (height, width, 3) bytes in OpenCV's order blue, green, red, and the bytes of
    its file. UserError for an unreadable one.
    """
    import cv2

    data = read_bytes(path)
    # Some versions of OpenCV show the upper half of half a file, so its end is looked at first.
    whole = data.endswith(LAST_BYTES[path.suffix])
    image = None
    if whole:
        with contextlib.suppress(cv2.error):  # of a picture of more pixels than OpenCV takes
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise UserError(f"{path}: not a readable image, or cut short ({len(data)} bytes)")
    return image, data


def _pictures(folder: Path, camera: str, report: ImportReport) -> dict[int, Path]:
    """The pictures of a camera, by frame number: PNG or JPEG, whichever each frame has. Raises
    UserError for a folder without any.
    """
    png, jpg = numbered(folder, "png"), numbered(folder, "jpg")
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


def _frames(layout: Layout, camera: str, pictures: Mapping[int, Path]) -> tuple[CameraFrame, ...]:
    """The frames of a camera that have a position, in order of time. Raises UserError for stamps
    that do not fit.
    """
    path = layout.stamps[camera]
    stamps_ns = layout.read_stamps_ns(path)
    if max(pictures) >= len(stamps_ns):
        raise UserError(
            f"{path}: {len(stamps_ns)} time stamps, but there is an image of frame {max(pictures)}"
        )
    camera_SE3_imu = rectified_SE3_velo(layout.calibration, camera) @ layout.velo_SE3_imu
    imu_SE3_camera = inverse(camera_SE3_imu)
    frames: list[CameraFrame] = []
    for index, image_path in pictures.items():
        if index not in layout.world_SE3_imu:
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
                world_SE3_camera=layout.world_SE3_imu[index] @ imu_SE3_camera,
                intrinsics=rectified_intrinsics(layout.calibration, camera),
                size=layout.sizes[camera],
            )
        )
    if not frames:
        raise UserError(
            f"{layout.pictures[camera]}: none of the frames of camera {camera} has a position"
        )
    return tuple(frames)
