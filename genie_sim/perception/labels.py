"""KITTI's own labels as its two kinds of files have them; ``truth`` makes one of them.

KITTI labels what its annotators saw in the laser scans; objects far away or never labelled are missing, so an object
without a label nearby is not always a ghost.
"""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from genie_sim.core.geometry import Array, rotation_from_rpy
from genie_sim.errors import UserError, as_user_error
from genie_sim.messages import Box, Location
from genie_sim.paths import read_bytes
from genie_sim.perception.files import lines, within

GROUPS = {  # KITTI's types by what a detector can tell apart; others (Misc, Tram, DontCare) are no objects here
    "Car": "vehicles",
    "Van": "vehicles",
    "Truck": "vehicles",
    "Pedestrian": "persons",
    "Person": "persons",
    "Person_sitting": "persons",
    "Person (sitting)": "persons",
    "Cyclist": "persons",
}

@dataclass(frozen=True, slots=True)
class Tracklet:
    """One object of a ``tracklet_labels.xml``, from frame ``first`` on, in the laser's frame.

    ``size_m`` is height, width, length; ``centres`` (n, 3); ``turns_rad`` (n,) about the laser's z axis, 0 where the
    length lies along x. ``occlusion`` and ``truncation`` are KITTI's codes, given for camera 2.
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


class TrackingLabel(NamedTuple):
    """One line of a ``label_02`` file: a box in the picture of camera 2, a centre in the rectified camera 0's frame.

    ``truncation`` and ``occlusion`` are KITTI's codes; -1 in an area of kind ``DontCare``.
    """

    frame: int
    track: int
    kind: str
    truncation: int
    occlusion: int
    box: Box
    centre: Location


def tracking_labels(path: Path, frames: int) -> list[TrackingLabel]:
    """Every line of a ``label_02`` file of a sequence of so many frames. Raises UserError."""
    labels = []
    for number, fields in lines(path):
        with as_user_error(f"{path}: line {number}: not a tracking label", IndexError, ValueError, OverflowError):
            frame, track, kind, truncation, occlusion = int(fields[0]), int(fields[1]), fields[2], *fields[3:5]
            x1, y1, x2, y2, height_m, _, _, x, y, z = map(float, (*fields[6:13], *fields[13:16]))
            bounded = within([x1, y1, x2, y2, height_m, x, y, z])
            label = TrackingLabel(
                frame, track, kind, int(float(truncation)), int(occlusion), (x1, y1, x2, y2), (x, y - height_m / 2, z)
            )
        if not bounded:
            raise UserError(f"{path}: line {number}: not a tracking label: a number is not finite, or too large")
        if not 0 <= frame < frames:
            raise UserError(f"{path}: line {number}: frame {frame} has no line in oxts")
        labels.append(label)
    return labels


def tracklets(path: Path) -> list[Tracklet]:
    """All objects of a ``tracklet_labels.xml``. Raises UserError where it is missing or something else."""
    with as_user_error(f"{path}: not KITTI tracklets", ElementTree.ParseError, ValueError, LookupError, OverflowError):
        return [_tracklet(item) for item in ElementTree.fromstring(read_bytes(path)).findall("tracklets/item")]


def _tracklet(item: ElementTree.Element) -> Tracklet:
    names = ("tx", "ty", "tz", "rz", "occlusion", "truncation")
    poses = [[float(pose.findtext(name, "")) for name in names] for pose in item.findall("poses/item")]
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
