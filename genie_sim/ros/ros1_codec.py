"""ROS 1 messages as bytes. Opaque types and images need no ROS at all; objects need genpy.

Every ROS 1 message that has a header begins with it: uint32 seq, uint32 seconds, uint32 nanoseconds, and the frame as
a string, which is a uint32 length and its bytes; all little-endian.
"""

from __future__ import annotations

import copy
import io
import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from genie_sim.errors import UserError
from genie_sim.messages import Detection, Header
from genie_sim.ros.images import difference_hash
from genie_sim.ros.message import Codec, RosObject, WireType
from genie_sim.units import NS_PER_S

HEADER_TYPES = ("Header", "std_msgs/Header", "roslib/Header")
ABSOLUTE_FRAMES = ("map", "world")  # frames whose coordinates are the object map's


def begins_with_header(definition: str) -> bool:
    """Does a message definition (as in a connection header) begin with a std_msgs/Header?"""
    for line in definition.split("\n" + "=" * 80)[0].splitlines():
        field = line.partition("#")[0].split()
        if field and "=" not in line.partition("#")[0]:
            return field[0] in HEADER_TYPES
    return False


@lru_cache
def codec_of(wire_type: WireType) -> Codec:
    """The codec of a type. Raises UserError for a type without a header."""
    if wire_type.definition and not begins_with_header(wire_type.definition):
        raise UserError(f"{wire_type.name}: messages of this type have no header to find an answer by")
    if wire_type.name == "autoware_msgs/DetectedObjectArray":
        return ObjectsCodec(wire_type)
    return ImageCodec(wire_type) if wire_type.name == "sensor_msgs/Image" else OpaqueCodec(wire_type)


class OpaqueCodec:
    """Any message with a header; what is behind the header is never read."""

    holds_objects = False

    def __init__(self, wire_type: WireType) -> None:
        self.type = wire_type

    def stamp(self, payload: bytes) -> tuple[int, str]:
        end = _end_of_header(payload)
        seconds, nanoseconds = struct.unpack_from("<II", payload, 4)
        return seconds * NS_PER_S + nanoseconds, payload[16:end].decode("utf-8", "surrogateescape")

    def restamped(self, payload: bytes, stamp_ns: int, frame_id: str, seq: int | None = None) -> bytes:
        end = _end_of_header(payload)
        return _header(_seq(payload) if seq is None else seq, stamp_ns, frame_id) + payload[end:]

    def content(self, payload: bytes) -> bytes:
        return payload[_end_of_header(payload) :]

    def dhash(self, payload: bytes) -> int:
        raise UserError(f"dhash: {self.type.name} is no sensor_msgs/Image")

    def objects(self, payload: bytes) -> tuple[Detection, ...] | None:
        return None

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        raise TypeError(f"{self.type.name} holds no objects")


class ImageCodec(OpaqueCodec):
    """sensor_msgs/Image: height, width, encoding, is_bigendian, step, data."""

    def dhash(self, payload: bytes) -> int:
        try:
            offset = _end_of_header(payload)
            height, width, length = struct.unpack_from("<III", payload, offset)
            offset += 12
            encoding = payload[offset : offset + length].decode()
            _bigendian, step, size = struct.unpack_from("<BII", payload, offset + length)
        except struct.error as error:
            raise ValueError(f"no sensor_msgs/Image: {error}") from error
        offset += length + 9
        return difference_hash(height, width, encoding, step, payload[offset : offset + size])


class ObjectsCodec(OpaqueCodec):
    """autoware_msgs/DetectedObjectArray. The classes come from the definition on the wire, so no catkin is needed.

    An object has a location if its pose is given in an absolute frame (``map``, ``world``); positions relative to a
    sensor would need a transform that the message does not carry. ``score`` is the object's confidence: it is read as
    the detector's score, and written with what the object map has made of it.
    """

    holds_objects = True

    def __init__(self, wire_type: WireType) -> None:
        from genpy.dynamic import generate_dynamic

        super().__init__(wire_type)
        classes = generate_dynamic(wire_type.name, wire_type.definition)
        self._array = classes[wire_type.name]
        self._object = classes["autoware_msgs/DetectedObject"]

    def objects(self, payload: bytes) -> tuple[Detection, ...]:
        array = self._read(payload)
        return tuple(_detection(one, array.header.frame_id) for one in array.objects)

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        array = self._read(payload) if payload else self._array()
        array.header.stamp.secs, array.header.stamp.nsecs = divmod(header.stamp_ns, NS_PER_S)
        array.header.frame_id = header.frame_id
        array.objects = [self._ros_object(one, array.header) for one in objects]
        buffer = io.BytesIO()
        array.serialize(buffer)
        return buffer.getvalue()

    def _read(self, payload: bytes) -> Any:
        import genpy

        try:
            return self._array().deserialize(payload)
        except (genpy.DeserializationError, struct.error) as error:
            raise ValueError(f"no {self.type.name}: {error}") from error

    def _ros_object(self, one: Detection, header: Any) -> Any:
        if isinstance(one, RosObject):
            made = copy.copy(one.raw)
        else:  # from the object map
            made = self._object(header=header, label=one.label, valid=True, space_frame=ABSOLUTE_FRAMES[0])
            if one.location is not None:
                made.pose.position.x, made.pose.position.y, made.pose.position.z = one.location
            made.pose.orientation.w = 1.0
        made.score = one.confidence
        return made


def _detection(one: Any, array_frame: str) -> RosObject:
    frame = (one.space_frame or one.header.frame_id or array_frame).strip("/")
    position = one.pose.position
    location = (position.x, position.y, position.z)
    placed = frame in ABSOLUTE_FRAMES and any(location)
    box = (float(one.x), float(one.y), float(one.x + one.width), float(one.y + one.height))
    return RosObject(one.label, one.score, box, location if placed else None, one.score, "ros", one)


def _seq(payload: bytes) -> int:
    return int(struct.unpack_from("<I", payload)[0])


def _end_of_header(payload: bytes) -> int:
    if len(payload) < 16:
        raise ValueError(f"a message of {len(payload)} bytes has no header")
    end = 16 + int(struct.unpack_from("<I", payload, 12)[0])
    if end > len(payload):
        raise ValueError("a message that ends inside its header")
    return end


def _header(seq: int, stamp_ns: int, frame_id: str) -> bytes:
    frame = frame_id.encode("utf-8", "surrogateescape")
    seconds, nanoseconds = divmod(stamp_ns, NS_PER_S)
    return struct.pack("<IIII", seq & 0xFFFFFFFF, seconds, nanoseconds, len(frame)) + frame
