"""Where KITTI's OXTS unit was, of raw drives and of tracking sequences.

pykitti's poses (Mercator around each drive's first fix) do not fit a simulator: here all drives are
around one origin. Nor does its reader of packets, which names no line of a file.
"""

from pathlib import Path

import numpy as np

from genie_sim.base.errors import UserError
from genie_sim.base.geometry import Array, Geodetic, rigid, rotation_from_rpy
from genie_sim.data.geodesy import enu_SE3_enu
from genie_sim.data.kitti.number_files import numbers

OXTS_VALUES = 30  # of a packet; the first six say where the unit is and how it is turned
MAX_OXTS = np.array([90.0, 180.0, 1e5, 7.0, 7.0, 7.0])  # angles in radians: a turn at most


def read_oxts(path: Path) -> Array:
    """Latitude, longitude [deg], altitude [m], roll, pitch, yaw [rad] of each packet in a file, (n,
    6).

    Raises UserError for a file without packets, and for values that no place on Earth has.
    """
    packets = numbers(path, OXTS_VALUES)[:, :6]
    if not len(packets):
        raise UserError(f"{path}: the file is empty")
    wrong = np.argwhere(np.abs(packets) > MAX_OXTS)
    if len(wrong):
        packet, value = wrong[0]
        raise UserError(
            f"{path}: packet {packet + 1}: value {value + 1} is {packets[packet, value]:.15g}, "
            "out of range"
        )
    return packets


def world_SE3_imu(packet: Array, origin: Geodetic) -> Array:
    """The pose of the OXTS unit: its angles are relative to east, north and up where the car is,
    not at the origin.
    """
    latitude_deg, longitude_deg, altitude_m, roll, pitch, yaw = packet.tolist()
    world_SE3_here = enu_SE3_enu(origin, (latitude_deg, longitude_deg, altitude_m))
    return world_SE3_here @ rigid(rotation_from_rpy(roll, pitch, yaw), (0.0, 0.0, 0.0))
