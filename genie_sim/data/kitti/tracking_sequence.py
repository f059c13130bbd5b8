"""KITTI's tracking benchmark: where the camera of a sequence was at each frame, and in which frame
its labels are. It has no time stamps, and needs no pictures.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.geometry import Array, Geodetic, inverse, rigid
from genie_sim.data.kitti.number_files import matrices, named_rows
from genie_sim.data.kitti.oxts import read_oxts, world_SE3_imu

CAMERA = "02"  # the benchmark's labels and detections are those of the left colour camera
# Matrices, as KITTI spells them (the benchmark's files do it in two ways), and how many columns
# they have.
CALIBRATION = (
    (("P2",), 4),
    (("R0_rect", "R_rect"), 3),
    (("Tr_velo_to_cam", "Tr_velo_cam"), 4),
    (("Tr_imu_to_velo", "Tr_imu_velo"), 4),
)


@dataclass(frozen=True, slots=True)
class TrackingSequence:
    """One sequence: where the rectified camera 0, whose frame the labels are in, was at each frame.

    ``intrinsics`` are those of camera 2 and ``camera2_SE3_camera0`` where it looks from.
    """

    name: str
    origin: Geodetic
    world_SE3_camera0: tuple[Array, ...]
    camera2_SE3_camera0: Array
    camera2_SE3_velo: Array
    intrinsics: Array

    def world_SE3_camera2(self, frame: int) -> Array:
        return self.world_SE3_camera0[frame] @ inverse(self.camera2_SE3_camera0)


def sequences(training: Path) -> list[str]:
    """The names of all sequences in ``training``, which holds ``oxts``."""
    return sorted(path.stem for path in (training / "oxts").glob("*.txt"))


def open_sequence(
    training: str | Path, sequence: str, origin: Geodetic | None = None
) -> TrackingSequence:
    """A sequence such as ``0005``; ``training`` holds ``oxts`` and ``calib``. UserError for files
    that are broken.
    """
    training = Path(training)
    choices = sequences(training)
    if sequence not in choices:
        raise UserError(f"{training}: {unknown('tracking sequence', sequence, choices)}")
    oxts = read_oxts(training / "oxts" / f"{sequence}.txt")
    path = training / "calib" / f"{sequence}.txt"
    projection, rectification, velo, imu = matrices(path, named_rows(path), CALIBRATION)
    intrinsics, shift = projection[:, :3], projection[:, 3]
    camera0_SE3_velo = rigid(rectification, (0, 0, 0)) @ rigid(velo[:, :3], velo[:, 3])
    # rotations of these files are rounded: their transposes are not quite their inverses
    imu_SE3_camera0 = np.linalg.inv(camera0_SE3_velo @ rigid(imu[:, :3], imu[:, 3]))
    if origin is None:
        latitude, longitude, altitude = oxts[0, :3].tolist()
        origin = (latitude, longitude, altitude)
    camera2_SE3_camera0 = rigid(np.eye(3), np.linalg.solve(intrinsics, shift))
    return TrackingSequence(
        name=sequence,
        origin=origin,
        world_SE3_camera0=tuple(world_SE3_imu(packet, origin) @ imu_SE3_camera0 for packet in oxts),
        camera2_SE3_camera0=camera2_SE3_camera0,
        camera2_SE3_velo=camera2_SE3_camera0 @ camera0_SE3_velo,
        intrinsics=intrinsics,
    )
