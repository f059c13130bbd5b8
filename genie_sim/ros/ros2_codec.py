"""ROS 2 messages as bytes (CDR). Their classes must be importable, as in any sourced ROS 2 workspace.

After four bytes that tell the byte order a message with a header holds int32 seconds, uint32 nanoseconds, and the
frame as a string: uint32 length with a closing zero. Headers have no number in ROS 2.
"""

from __future__ import annotations

import importlib
import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from genie_sim.errors import UserError
from genie_sim.messages import Detection, Header
from genie_sim.ros.images import difference_hash
from genie_sim.ros.message import Codec, RosObject, WireType
from genie_sim.ros.ros1_codec import ABSOLUTE_FRAMES, NS_PER_S

MARKERS = "visualization_msgs/msg/MarkerArray"
ENCAPSULATION = 4


def class_of(name: str) -> Any:
    """``sensor_msgs/msg/Image``. Raises UserError where the package is not there."""
    package, _, kind = name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except (ImportError, AttributeError) as error:
        raise UserError(f"{name}: no such ROS 2 message here ({error})") from error


def has_header(name: str) -> bool:
    """Do messages of this type have a header to find an answer by?"""
    first = next(iter(class_of(name).get_fields_and_field_types().items()), None)
    return name == MARKERS or first == ("header", "std_msgs/Header")


@lru_cache
def codec_of(wire_type: WireType) -> Codec:
    """The codec of a type. Raises UserError for one without a header."""
    if not has_header(wire_type.name):
        raise UserError(f"{wire_type.name}: messages of this type have no header to find an answer by")
    return MarkersCodec(wire_type) if wire_type.name == MARKERS else CdrCodec(wire_type)


class CdrCodec:
    """Any message that begins with a header; images can be hashed."""

    holds_objects = False

    def __init__(self, wire_type: WireType) -> None:
        self.type = wire_type
        self._class = class_of(wire_type.name)

    def stamp(self, payload: bytes) -> tuple[int, str]:
        order = _order(payload)
        try:
            seconds, nanoseconds, length = struct.unpack_from(order + "iII", payload, ENCAPSULATION)
        except struct.error as error:
            raise ValueError(f"no {self.type.name}: {error}") from error
        frame = payload[ENCAPSULATION + 12 : ENCAPSULATION + 12 + length]
        if len(frame) < length:
            raise ValueError(f"no {self.type.name}: it ends inside its header")
        return seconds * NS_PER_S + nanoseconds, frame.rstrip(b"\0").decode("utf-8", "surrogateescape")

    def restamped(self, payload: bytes, stamp_ns: int, frame_id: str, seq: int | None = None) -> bytes:
        if self.stamp(payload)[1] == frame_id:
            stamp = struct.pack(_order(payload) + "iI", *divmod(stamp_ns, NS_PER_S))
            return payload[:ENCAPSULATION] + stamp + payload[ENCAPSULATION + len(stamp) :]
        message = self.read(payload)  # a frame of another length moves all that follows
        _set(message.header, stamp_ns, frame_id)
        return self.written(message)

    def content(self, payload: bytes) -> bytes:
        order = _order(payload)
        return payload[ENCAPSULATION + 12 + int(struct.unpack_from(order + "I", payload, ENCAPSULATION + 8)[0]) :]

    def dhash(self, payload: bytes) -> int:
        if self.type.name != "sensor_msgs/msg/Image":
            raise UserError(f"dhash: {self.type.name} is no sensor_msgs/msg/Image")
        image = self.read(payload)
        return difference_hash(image.height, image.width, image.encoding, image.step, bytes(image.data))

    def objects(self, payload: bytes) -> tuple[Detection, ...] | None:
        return None

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        raise TypeError(f"{self.type.name} holds no objects")

    def read(self, payload: bytes) -> Any:
        from rclpy.serialization import deserialize_message

        try:
            return deserialize_message(payload, self._class)
        except Exception as error:  # rclpy raises its own C++ exceptions, which share no base
            raise ValueError(f"no {self.type.name}: {error}") from error

    def written(self, message: Any) -> bytes:
        from rclpy.serialization import serialize_message

        return bytes(serialize_message(message))


class MarkersCodec(CdrCodec):
    """visualization_msgs/MarkerArray: each marker an object, its class in ``ns``, its confidence in ``color.a``.

    An array has no header of its own. It is the first marker's; a marker with the action DELETEALL stands for the
    header of an array that may be empty. An array without any marker belongs to no request.
    """

    holds_objects = True

    def stamp(self, payload: bytes) -> tuple[int, str]:
        markers = self.read(payload).markers
        if not markers:
            return 0, ""
        header = markers[0].header
        return header.stamp.sec * NS_PER_S + header.stamp.nanosec, header.frame_id

    def restamped(self, payload: bytes, stamp_ns: int, frame_id: str, seq: int | None = None) -> bytes:
        array = self.read(payload)
        for marker in array.markers:
            _set(marker.header, stamp_ns, frame_id)
        return self.written(array)

    def content(self, payload: bytes) -> bytes:
        return self.restamped(payload, 0, "")

    def objects(self, payload: bytes) -> tuple[Detection, ...]:
        markers = self.read(payload).markers
        return tuple(_detection(marker) for marker in markers if marker.action == marker.ADD)

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        marker_class = class_of("visualization_msgs/msg/Marker")
        array = self._class(markers=[marker_class(action=marker_class.DELETEALL)])
        for number, one in enumerate(objects):
            if isinstance(one, RosObject):
                marker = self.read(self.written(self._class(markers=[one.raw]))).markers[0]  # a copy
            else:  # from the object map
                marker = marker_class(ns=one.label, id=number, type=marker_class.CUBE)
                if one.location is not None:
                    place = marker.pose.position
                    place.x, place.y, place.z = one.location
            marker.color.a = one.confidence
            array.markers.append(marker)
        for marker in array.markers:
            _set(marker.header, header.stamp_ns, header.frame_id)
        return self.written(array)


def _detection(marker: Any) -> RosObject:
    place, score = marker.pose.position, float(marker.color.a)
    located = marker.header.frame_id.strip("/") in ABSOLUTE_FRAMES
    return RosObject(marker.ns, score, None, (place.x, place.y, place.z) if located else None, score, "ros", marker)


def _set(header: Any, stamp_ns: int, frame_id: str) -> None:
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, NS_PER_S)
    header.frame_id = frame_id


def _order(payload: bytes) -> str:
    if len(payload) < ENCAPSULATION:
        raise ValueError(f"a message of {len(payload)} bytes has no header")
    return "<" if payload[1] & 1 else ">"
