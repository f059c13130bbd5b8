"""KITTI's labels: the tracklets of a raw drive and the ``label_02`` of a tracking sequence.

Both become the same records, in the pictures and the world of a trace.
"""

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.geometry import Array, project, rotation_from_rpy, transform
from genie_sim.base.paths import read_bytes
from genie_sim.core.messages import Box, Location
from genie_sim.data.files import lines, within
from genie_sim.data.kitti import TRACKLETS, drive_folders, open_drive
from genie_sim.data.trace import Trace
from genie_sim.data.tracking import CAMERA, TRACKING, TrackingDrive, open_sequence

RAW_DRIVE = re.compile(r"\d{4}_\d{2}_\d{2}/\d{4}", re.ASCII)
BEHIND = 99  # KITTI's code of truncation for what is partly behind the image plane
# A trace's camera this near to a sequence's, at the same frame, has recorded the same drive.
SAME_PLACE_M = 1.0


class KittiLabel(NamedTuple):
    """One labelled object in one picture.

    ``kind`` is KITTI's type, ``truncation`` and ``occlusion`` are KITTI's codes (-1 in an area of
    kind ``DontCare``), and ``centre`` is in the world.
    """

    camera: str
    frame: int
    track: int
    kind: str
    truncation: int
    occlusion: int
    box: Box
    centre: Location


def read_labels(root: Path, drive: str, trace: Trace) -> Iterator[KittiLabel]:
    """The labels of a drive in the pictures of a trace.

    Raises UserError for labels that are missing or broken, and where they are not of the trace's
    drive.
    """
    if drive.startswith(TRACKING):
        return _in_sequence(root, drive, trace)
    return _in_raw_drive(root, drive, trace)


def labelled_cameras(drive: str, trace: Trace) -> list[str]:
    """The cameras of a trace in whose pictures a drive has labels."""
    if drive.startswith(TRACKING):
        return [camera for camera in trace.frames if camera == CAMERA]
    return list(trace.frames)


def label_file(root: Path, drive: str) -> Path:
    """The file with the labels of a drive: tracklets of ``2011_09_26/0005``, ``label_02`` of
    ``tracking/0000``.

    Raises UserError, naming the labelled drives of both kinds, where there is none.
    """
    path = _label_path(root, drive)
    if path is None or not path.is_file():
        choices = [
            name for name, folder in drive_folders(root).items() if (folder / TRACKLETS).is_file()
        ]
        choices += [f"{TRACKING}{file.stem}" for file in _label_02(root).glob("*.txt")]
        missing = "" if path is None else f"{path.relative_to(root)}: no such file; "
        raise UserError(
            f"{root}: {missing}{unknown('labelled drive', drive, choices)} (tracklets of a raw "
            "drive DATE/NUMBER, or label_02 of a sequence tracking/NUMBER)"
        )
    return path


def _label_path(root: Path, drive: str) -> Path | None:
    date, _, number = drive.partition("/")
    if drive.startswith(TRACKING):
        return _label_02(root) / f"{number}.txt"
    if RAW_DRIVE.fullmatch(drive):
        return root / date / f"{date}_drive_{number}_sync" / TRACKLETS
    return None


def _label_02(root: Path) -> Path:
    return root / "tracking" / "training" / "label_02"


def _in_raw_drive(root: Path, name: str, trace: Trace) -> Iterator[KittiLabel]:
    objects = tracklets(label_file(root, name))
    drive = open_drive(
        root, name, sorted(trace.frames), origin=trace.origin, allow_missing_scans=True
    )
    for camera, frames in trace.frames.items():
        taken = {frame.index: frame for frame in drive.frames[camera]}
        camera_SE3_velo = drive.camera_SE3_velo(camera)
        for frame in frames:
            if frame.index not in taken:
                raise UserError(
                    f"{root}: drive {name}: has no frame {frame.index} of camera {camera}"
                )
            size = (frame.width, frame.height)
            intrinsics = taken[frame.index].intrinsics_of(size)
            for track, item in enumerate(objects):
                i = frame.index - item.first
                if not 0 <= i < len(item.centres):
                    continue
                corners = transform(camera_SE3_velo, item.corners(i))
                box = _box_of(corners, intrinsics, size)
                if box is None:
                    continue
                centre = transform(drive.world_SE3_velo(frame.index), item.centres[i])
                yield KittiLabel(
                    camera=camera,
                    frame=frame.index,
                    track=track,
                    kind=item.kind,
                    truncation=item.truncation[i] if corners[:, 2].min() > 0 else BEHIND,
                    occlusion=item.occlusion[i],
                    box=box,
                    centre=_location(centre),
                )


def _in_sequence(root: Path, name: str, trace: Trace) -> Iterator[KittiLabel]:
    path = label_file(root, name)
    training, sequence = root / "tracking" / "training", name.removeprefix(TRACKING)
    drive = open_sequence(training, sequence, trace.origin)
    frames = trace.frames.get(CAMERA)
    if frames is None:
        cameras = ", ".join(trace.frames)
        raise UserError(f"{training}: labels are those of camera {CAMERA}, the trace has {cameras}")
    for frame in frames:
        if not _is_at(drive, frame.index, frame.pose[:3]):
            raise UserError(
                f"{training}: sequence {sequence} is not the drive of this trace "
                f"(frame {frame.index})"
            )
    indices = {frame.index for frame in frames}
    return (label for label in tracking_labels(path, drive) if label.frame in indices)


def _is_at(drive: TrackingDrive, frame: int, place: Location) -> bool:
    """Whether the camera of a sequence is at a place when a frame is taken."""
    if frame >= len(drive.world_SE3_camera0):
        return False
    return math.dist(place, drive.world_SE3_camera2(frame)[:3, 3].tolist()) <= SAME_PLACE_M


def tracking_labels(path: Path, drive: TrackingDrive) -> list[KittiLabel]:
    """Every line of the ``label_02`` file of a sequence. Raises UserError."""
    labels = []
    for number, fields in lines(path):
        where = f"{path}: line {number}"
        with as_user_error(f"{where}: not a tracking label", IndexError, ValueError, OverflowError):
            frame, track, kind, truncation, occlusion = fields[:5]
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, (*fields[6:13], *fields[13:16]))
            bounded = within([x1, y1, x2, y2, height_m, x, y, z])
            label = KittiLabel(
                camera=CAMERA,
                frame=int(frame),
                track=int(track),
                kind=kind,
                truncation=int(float(truncation)),
                occlusion=int(occlusion),
                box=(x1, y1, x2, y2),
                centre=(x, y - height_m / 2, z),
            )
        if not bounded:
            raise UserError(f"{where}: not a tracking label: a number is not finite, or too large")
        if not 0 <= label.frame < len(drive.world_SE3_camera0):
            raise UserError(f"{where}: frame {label.frame} has no line in oxts")
        centre = transform(drive.world_SE3_camera0[label.frame], label.centre)
        labels.append(label._replace(centre=_location(centre)))
    return labels


@dataclass(frozen=True, slots=True)
class Tracklet:
    """One object of a ``tracklet_labels.xml``, from frame ``first`` on, in the laser's frame.

    ``size_m`` is height, width, length; ``centres`` (n, 3); ``turns_rad`` (n,) about the laser's z
    axis, 0 where the length lies along x. ``occlusion`` and ``truncation`` are KITTI's codes, given
    for camera 2.
    """

    kind: str
    first: int
    size_m: tuple[float, float, float]
    centres: Array
    turns_rad: Array
    occlusion: tuple[int, ...]
    truncation: tuple[int, ...]

    def corners(self, i: int) -> Array:
        """The eight corners (8, 3) of its box at the i-th of its frames, in the laser's frame."""
        height_m, width_m, length_m = self.size_m
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
        turn = rotation_from_rpy(0.0, 0.0, float(self.turns_rad[i]))
        corners: Array = signs * [length_m, width_m, height_m] @ turn.T + self.centres[i]
        return corners


def tracklets(path: Path) -> list[Tracklet]:
    """All objects of a ``tracklet_labels.xml``. Raises UserError where it is missing or something
    else.
    """
    broken = ElementTree.ParseError, ValueError, LookupError, OverflowError
    with as_user_error(f"{path}: not KITTI tracklets", *broken):
        tree = ElementTree.fromstring(read_bytes(path))
        return [_tracklet(item) for item in tree.findall("tracklets/item")]


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [
        [float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")
    ]
    table = np.array(poses).reshape(-1, len(names))
    height_m, width_m, length_m = (float(item.findtext(name, "")) for name in "hwl")
    if not within([height_m, width_m, length_m, *table.ravel()]):
        raise ValueError("a number is not finite, or too large")
    return Tracklet(
        kind=str(item.findtext("objectType")),
        first=int(item.findtext("first_frame", "")),
        size_m=(height_m, width_m, length_m),
        centres=table[:, :3] + np.array([0.0, 0.0, height_m / 2]),
        turns_rad=table[:, 3],
        occlusion=tuple(map(int, table[:, 4])),
        truncation=tuple(map(int, table[:, 5])),
    )


def _box_of(corners: Array, intrinsics: Array, size: tuple[int, int]) -> Box | None:
    """The part of the picture that a box in space covers; ``None`` where it covers nothing."""
    pixels = project(intrinsics, corners)
    if np.isnan(pixels).all():
        return None
    low = np.clip(np.nanmin(pixels, axis=0), 0, size)
    high = np.clip(np.nanmax(pixels, axis=0), 0, size)
    if (high - low < 1).any():
        return None
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _location(place: Array) -> Location:
    east_m, north_m, up_m = place.tolist()
    return east_m, north_m, up_m
