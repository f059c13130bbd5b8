"""The tracklets of KITTI's raw drives: boxes in space, in the pictures of a trace."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genie_sim.base.errors import as_user_error
from genie_sim.base.geometry import Array, project, rotation_from_rpy, transform
from genie_sim.base.paths import read_bytes
from genie_sim.core.messages import Box
from genie_sim.data.kitti.drive import open_drive
from genie_sim.data.kitti.drive_name import DriveName
from genie_sim.data.kitti.label import ObjectLabel, PictureKey, check_drive, object_label
from genie_sim.data.kitti.number_files import are_plausible
from genie_sim.data.trace import Trace

BEHIND = 99  # KITTI's code of truncation for what is partly behind the image plane


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
        listed = ElementTree.fromstring(read_bytes(path)).find("tracklets")
        if listed is None:
            raise ValueError("has no <tracklets>")
        return [_tracklet(item) for item in listed.findall("item")]


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [
        [float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")
    ]
    table = np.array(poses).reshape(-1, len(names))
    height_m, width_m, length_m = (float(item.findtext(name, "")) for name in "hwl")
    if not are_plausible([height_m, width_m, length_m, *table.ravel()]):
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


def labels_of_drive(
    root: Path, name: DriveName, path: Path, trace: Trace
) -> Iterator[tuple[PictureKey, ObjectLabel]]:
    """The labels in a file of tracklets for the pictures of a trace of the same drive. Raises
    UserError where it is another.
    """
    objects = tracklets(path)
    drive = open_drive(
        root, str(name), sorted(trace.frames), origin=trace.origin, allow_missing_scans=True
    )
    for camera, frames in trace.frames.items():
        frames_by_index = {frame.index: frame for frame in drive.frames[camera]}
        camera_SE3_velo = drive.camera_SE3_velo(camera)
        poses = {index: frame.world_SE3_camera for index, frame in frames_by_index.items()}
        check_drive(f"{root}: drive {name}", frames, poses)
        for frame in frames:
            size = (frame.width, frame.height)
            picture = frames_by_index[frame.index]
            picture.check_size(size)
            for track, item in enumerate(objects):
                i = frame.index - item.first
                if not 0 <= i < len(item.centres):
                    continue
                corners = transform(camera_SE3_velo, item.corners(i))
                box = _box_of(corners, picture.intrinsics, size)
                if box is None:
                    continue
                centre = transform(drive.world_SE3_velo(frame.index), item.centres[i])
                yield (
                    (camera, frame.index),
                    object_label(
                        track,
                        item.kind,
                        box,
                        truncation=item.truncation[i] if corners[:, 2].min() > 0 else BEHIND,
                        occlusion=item.occlusion[i],
                        centre=centre,
                    ),
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
