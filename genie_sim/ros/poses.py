"""Where the camera is, from a pose topic."""

from __future__ import annotations

import math
import struct
import threading
from collections import deque

from genie_sim.errors import UserError
from genie_sim.messages import CameraPose
from genie_sim.ros.message import WireType
from genie_sim.ros.ros1_codec import OpaqueCodec

POSE_TYPES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", "nav_msgs/Odometry")
MAX_AGE_NS = 500_000_000  # assumed: at 10 m/s a pose this old is 5 m off
KEPT = 100


class Poses:
    """The last poses heard, by their stamps. The pose is taken for the camera's, its x axis for the optical axis."""

    def __init__(self) -> None:
        self._heard: deque[tuple[int, CameraPose]] = deque(maxlen=KEPT)
        self._lock = threading.Lock()

    def at(self, stamp_ns: int) -> CameraPose | None:
        """The pose nearest in time, ``None`` if there is none within half a second."""
        with self._lock:
            nearest = min(self._heard, key=lambda heard: abs(heard[0] - stamp_ns), default=None)
        if nearest is None or abs(nearest[0] - stamp_ns) > MAX_AGE_NS:
            return None
        return nearest[1]

    def heard(self, type_name: str, payload: bytes) -> None:
        """A ROS 1 message of the pose topic. Raises UserError for a type without a pose, ValueError for bad bytes."""
        if type_name not in POSE_TYPES:
            raise UserError(f"pose topic: {type_name} has no pose; known: {', '.join(POSE_TYPES)}")
        codec = OpaqueCodec(WireType(type_name))
        stamp_ns, _ = codec.stamp(payload)
        content = codec.content(payload)
        try:
            offset = 4 + struct.unpack_from("<I", content)[0] if type_name == "nav_msgs/Odometry" else 0
            x, y, z, *quaternion = struct.unpack_from("<7d", content, offset)
        except struct.error as error:
            raise ValueError(str(error)) from error
        self.add(stamp_ns, CameraPose(x, y, z, heading_of_quaternion(*quaternion)))

    def add(self, stamp_ns: int, pose: CameraPose) -> None:
        with self._lock:
            self._heard.append((stamp_ns, pose))


def heading_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """The heading of the rotated x axis [rad], counter-clockwise from east."""
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
