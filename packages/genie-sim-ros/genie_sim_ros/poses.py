"""Where the camera is, from a pose topic."""

import math
from collections import deque

from genie_sim.base.errors import UserError
from genie_sim.core.messages import CameraPose
from genie_sim_ros.codec import WireType, codec_of
from genie_sim_ros.message import checked_pose
from genie_sim_ros.typestore import stamp_ns

POSE_TYPES = (
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovarianceStamped",
    "nav_msgs/Odometry",
)
MAX_AGE_NS = 500_000_000  # assumed: at 10 m/s a pose this old is 5 m off
MAX_POSES = 100


class Poses:
    """The last poses received, by their stamps. The pose is taken for the camera's, its x axis for
    the optical axis.
    """

    def __init__(self, ros: int) -> None:
        self._codecs = {name: codec_of(WireType(name), ros) for name in POSE_TYPES}
        for codec in self._codecs.values():
            codec.prepare()
        self._received: deque[tuple[int, CameraPose]] = deque(maxlen=MAX_POSES)

    def at(self, stamp_ns: int) -> CameraPose | None:
        """The pose nearest in time, ``None`` if there is none within half a second."""
        received = tuple(self._received)  # another thread may add to it meanwhile
        if not received:
            return None
        nearest_ns, pose = min(received, key=lambda entry: abs(entry[0] - stamp_ns))
        return pose if abs(nearest_ns - stamp_ns) <= MAX_AGE_NS else None

    def receive(self, type_name: str, payload: bytes) -> None:
        """A message of the pose topic. Raises UserError for a type without a pose, ValueError for
        no pose.
        """
        codec = self._codecs.get(type_name.replace("/msg/", "/"))
        if codec is None:
            raise UserError(f"pose topic: {type_name} has no pose; known: {', '.join(POSE_TYPES)}")
        message = codec.read(payload)
        pose = getattr(message.pose, "pose", message.pose)  # beside a covariance
        at, turn = pose.position, pose.orientation
        heading_rad = math.atan2(
            2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2)
        )
        pose = checked_pose(at.x, at.y, at.z, heading_rad)
        self._received.append((stamp_ns(message.header), pose))
