"""A ROS message as it came over the wire: bytes, and what a Genie needs to know of them."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from genie_sim.core.messages import CameraPose, Detection, Header, Look
from genie_sim_ros.codec import Codec, is_place


def checked_pose(x_m: float, y_m: float, z_m: float, heading_rad: float) -> CameraPose:
    """A camera's pose in the map frame. Raises ValueError for one that is nowhere on Earth."""
    if not (is_place((x_m, y_m, z_m)) and math.isfinite(heading_rad)):
        raise ValueError("a pose whose numbers are not finite, or larger than the Earth")
    return CameraPose(x_m, y_m, z_m, heading_rad)


@dataclass(frozen=True)
class RosMessage:
    """A request or an answer (``messages.Message``, ``messages.Answer``) whose payload stays the
    bytes that came.

    A new header or other objects are written into the bytes only when the message leaves
    (``encoded``). ``read`` are the objects that the payload holds.
    """

    header: Header
    payload: bytes
    codec: Codec
    pose: CameraPose | None = None
    horizontal_fov_rad: float = 0.0
    objects: Sequence[Detection] | None = None
    read: Sequence[Detection] | None = None
    source: str = "detector"
    served_by: str = ""
    look: None = None  # ROS messages carry none
    valid_ns: None = None
    seen_in: None = None

    @classmethod
    def of(cls, payload: bytes, codec: Codec, origin: str, answer: bool) -> "RosMessage":
        """A message from its bytes. Objects are read from answers only. Raises ValueError for bytes
        that are no message.
        """
        stamp_ns, frame_id = codec.stamp(payload)
        objects = codec.objects(payload) if answer else None
        header = Header(stamp_ns, frame_id, origin)
        return cls(header, payload, codec, objects=objects, read=objects)

    @property
    def size_bytes(self) -> int:
        return len(self.payload)

    @cached_property
    def digest(self) -> str:
        return hashlib.sha256(self.codec.content(self.payload)).hexdigest()

    @property
    def dhash(self) -> int:
        return self.codec.dhash(self.payload)

    def restamped(self, header: Header) -> "RosMessage":
        return replace(self, header=header)

    def with_objects(self, objects: Sequence[Detection]) -> "RosMessage":
        return replace(self, objects=tuple(objects))

    def with_look(self, look: Look | None, valid_ns: int | None) -> "RosMessage":
        return self

    def credited(self, source: str, by: str, header: Header | None = None) -> "RosMessage":
        header = self.header if header is None else header
        return replace(self, source=source, served_by=by, header=header)

    def encoded(self, seq: int | None = None) -> bytes:
        """The bytes to send: with this header, these objects, and the number ``seq`` if there is
        one.
        """
        payload = self.payload
        if self.objects is not None and (self.objects is not self.read or not payload):
            payload = self.codec.with_objects(payload, self.header, self.objects)
        stamp = (self.header.stamp_ns, self.header.frame_id)
        if seq is None and self.codec.stamp(payload) == stamp:
            return payload
        return self.codec.restamped(payload, *stamp, seq)
