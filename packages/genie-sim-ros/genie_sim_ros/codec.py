"""Messages of ROS 1 and ROS 2 as bytes. Only what a Genie needs is read, by rosbags; the rest stays
as it came.

In both, a message with a header begins with it: four bytes (ROS 1: a number, ROS 2: the byte
order), seconds and nanoseconds of 32 bits, and the frame as a string: uint32 length and that many
bytes (ROS 2: with a closing zero).
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.units import NS_PER_S
from genie_sim.core.messages import Box, Detection, Header, Location
from genie_sim_ros.typestore import TIME, class_of, message, stamp_ns, time, typestore

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

HEADER_TYPES = ("Header", "std_msgs/Header", "roslib/Header")
ABSOLUTE_FRAMES = ("map", "world")  # frames whose coordinates are the object map's
IMAGE, OBJECTS = "sensor_msgs/msg/Image", "autoware_msgs/msg/DetectedObjectArray"
MARKER, MARKERS = "visualization_msgs/msg/Marker", "visualization_msgs/msg/MarkerArray"
CUBE, ADD, DELETE_ALL = 1, 0, 3
CHANNELS = {
    "mono8": 1,
    "8UC1": 1,
    "bgr8": 3,
    "8UC3": 3,
    "rgb8": 3,
    "bgra8": 4,
    "8UC4": 4,
    "rgba8": 4,
}
MAX_COORDINATE_M = 4e7  # once around the Earth
HEADER_BYTES = 16  # without the frame


class WireType(NamedTuple):
    """A message type. ``checksum`` is ROS 1's md5sum or ROS 2's type hash; ROS 2 states no
    ``definition``.
    """

    name: str
    checksum: str = ""
    definition: str = ""


Types = dict[str, WireType | None]  # by topic; ``None`` where nobody knows


@dataclass(unsafe_hash=True)
class RosObject(Detection):
    """A detection with the ROS object that it was read from (``raw``): no field gets lost."""

    raw: Any = field(default=None, compare=False)

    def with_confidence(self, confidence: float) -> "RosObject":
        return replace(self, confidence=confidence)


def begins_with_header(definition: str) -> bool:
    """Does a ROS 1 message definition (as in a connection header) begin with a std_msgs/Header?"""
    for line in definition.split("\n" + "=" * 80)[0].splitlines():
        field = line.partition("#")[0].split()
        if field and "=" not in line.partition("#")[0]:
            return field[0] in HEADER_TYPES
    return False


@lru_cache
def codec_of(wire_type: WireType, ros: int) -> "Codec":
    """The codec of a type of ROS 1 or 2. Raises UserError for a ROS 1 type without a header."""
    if wire_type.definition and not begins_with_header(wire_type.definition):
        raise UserError(
            f"{wire_type.name}: messages of this type have no header to find an answer by"
        )
    name = _full(wire_type.name)
    codec_class = {OBJECTS: ObjectsCodec, MARKERS: MarkersCodec}.get(name, Codec)
    codec = codec_class(wire_type, ros)
    if name in (IMAGE, OBJECTS, MARKERS):
        codec.prepare()
    return codec


class Codec:
    """Messages of one type that begin with a header. ValueError: the bytes are no such message."""

    holds_objects = False

    def __init__(self, wire_type: WireType, ros: int) -> None:
        self.type = wire_type
        self._ros = ros
        self._stamp_format = "II" if ros == 1 else "iI"
        self._name = _full(wire_type.name)

    @cached_property
    def _store(self) -> "Typestore":
        return typestore(self._ros, self.type.definition if self.holds_objects else "", self._name)

    def prepare(self) -> None:
        """Has rosbags make its reader now: it takes a tenth of a second, which the first message
        would have to wait.
        """
        self._store.get_msgdef(self._name)

    def stamp(self, payload: bytes) -> tuple[int, str]:
        """Stamp [ns] and frame of the message's header."""
        order, end = self._header(payload)
        seconds, nanoseconds = struct.unpack_from(order + self._stamp_format, payload, 4)
        if nanoseconds >= NS_PER_S:
            raise ValueError(f"a stamp of {nanoseconds} ns beside the seconds")
        frame = payload[HEADER_BYTES:end]
        if self._ros == 2:
            frame = frame.rstrip(b"\0")
        return seconds * NS_PER_S + nanoseconds, frame.decode("utf-8", "surrogateescape")

    def restamped(
        self, payload: bytes, stamp_ns: int, frame_id: str, seq: int | None = None
    ) -> bytes:
        """The message under another header. ``seq`` numbers it in ROS 1; ROS 2 headers have no
        number.
        """
        order, end = self._header(payload)
        first = payload[:4] if seq is None else struct.pack("<I", seq & 0xFFFFFFFF)
        try:
            stamp = struct.pack(order + self._stamp_format, *divmod(stamp_ns, NS_PER_S))
        except struct.error as error:
            raise ValueError(f"a stamp of {stamp_ns} ns does not fit into a message") from error
        if self.stamp(payload)[1] == frame_id:
            return first + stamp + payload[12:]
        if self._ros == 1:
            frame = frame_id.encode("utf-8", "surrogateescape")
            return first + stamp + struct.pack("<I", len(frame)) + frame + payload[end:]
        return _restamped_by_rclpy(self.type.name, payload, stamp_ns, frame_id)

    def content(self, payload: bytes) -> bytes:
        """What is behind the header: equal for equal messages taken at different times."""
        return payload[self._header(payload)[1] :]

    def dhash(self, payload: bytes) -> int:
        """The 64-bit difference hash of an image; equal to the one in a perception trace."""
        from genie_sim.data.encoding import difference_hash

        if self._name != IMAGE:
            raise UserError(f"dhash: {self.type.name} is no {IMAGE}")
        return difference_hash(picture(self.read(payload)))

    def objects(self, payload: bytes) -> tuple[Detection, ...] | None:
        """The objects of an answer, ``None`` for a type that holds none."""
        return None

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        """The message with other objects; ``payload`` may be empty."""
        raise TypeError(f"{self.type.name} holds no objects")

    def read(self, payload: bytes) -> Any:
        """The message as an object with fields."""
        from rosbags.serde import SerdeError

        try:
            read = self._store.deserialize_ros1 if self._ros == 1 else self._store.deserialize_cdr
            return read(payload, self._name)
        except (SerdeError, ValueError, KeyError, IndexError) as error:
            raise ValueError(f"no {self.type.name}: {error}") from error

    def _time(self, stamp_ns: int) -> Any:
        return message(self._store, TIME, **time(stamp_ns))

    def _serialized(self, message: Any) -> bytes:
        write = self._store.serialize_ros1 if self._ros == 1 else self._store.serialize_cdr
        try:
            return bytes(write(message, self._name))
        except (struct.error, OverflowError) as error:
            raise ValueError(f"no {self.type.name}: {error}") from error

    def _header(self, payload: bytes) -> tuple[str, int]:
        """The byte order, and where the header ends."""
        if len(payload) < HEADER_BYTES:
            raise ValueError(f"a message of {len(payload)} bytes has no header")
        order = "<" if self._ros == 1 or payload[1] & 1 else ">"
        end = HEADER_BYTES + int(struct.unpack_from(order + "I", payload, 12)[0])
        if end > len(payload):
            raise ValueError("a message that ends inside its header")
        return order, end


class ObjectsCodec(Codec):
    """autoware_msgs/DetectedObjectArray, as the publisher on this machine defines it: no catkin
    workspace is needed.

    An object has a location if its pose is given in an absolute frame (``map``, ``world``);
    positions relative to a sensor would need a transform that the message does not carry. ``score``
    is the object's confidence: it is read as the detector's score, and written with what the object
    map has made of it.
    """

    holds_objects = True

    def objects(self, payload: bytes) -> tuple[Detection, ...]:
        array = self.read(payload)
        return tuple(_detected(raw, array.header.frame_id) for raw in array.objects)

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        array = self.read(payload) if payload else message(self._store, self._name)
        array.header.stamp, array.header.frame_id = self._time(header.stamp_ns), header.frame_id
        array.objects = [self._object(detection, array.header) for detection in objects]
        return self._serialized(array)

    def _object(self, detection: Detection, header: Any) -> Any:
        if isinstance(detection, RosObject):
            return replace(detection.raw, score=detection.confidence)
        return message(
            self._store,
            OBJECTS.removesuffix("Array"),
            header=header,
            pose=_pose(detection),
            label=detection.label,
            valid=True,
            space_frame=ABSOLUTE_FRAMES[0],
            score=detection.confidence,
        )


class MarkersCodec(Codec):
    """visualization_msgs/MarkerArray: each marker an object, its class in ``ns``, its confidence in
    ``color.a``.

    An array has no header of its own. It is the first marker's; a marker with the action DELETEALL
    stands for the header of an array that may be empty. An array without any marker belongs to no
    request.
    """

    holds_objects = True

    def stamp(self, payload: bytes) -> tuple[int, str]:
        markers = self.read(payload).markers
        return (stamp_ns(markers[0].header), markers[0].header.frame_id) if markers else (0, "")

    def restamped(
        self, payload: bytes, stamp_ns: int, frame_id: str, seq: int | None = None
    ) -> bytes:
        return self._stamped(self.read(payload), stamp_ns, frame_id)

    def content(self, payload: bytes) -> bytes:
        return self.restamped(payload, 0, "")

    def objects(self, payload: bytes) -> tuple[Detection, ...]:
        return tuple(
            _object(
                marker,
                label=marker.ns,
                score=marker.color.a,
                box=None,
                location=_location(marker.pose, marker.header.frame_id),
            )
            for marker in self.read(payload).markers
            if marker.action == ADD
        )

    def with_objects(self, payload: bytes, header: Header, objects: Sequence[Detection]) -> bytes:
        markers = [message(self._store, MARKER, action=DELETE_ALL)]
        markers += [self._marker(number, detection) for number, detection in enumerate(objects)]
        array = message(self._store, self._name, markers=markers)
        return self._stamped(array, header.stamp_ns, header.frame_id)

    def _marker(self, number: int, detection: Detection) -> Any:
        if isinstance(detection, RosObject):
            color = replace(detection.raw.color, a=detection.confidence)
            return replace(detection.raw, color=color)
        return message(  # from the object map
            self._store,
            MARKER,
            ns=detection.label,
            id=number,
            type=CUBE,
            pose=_pose(detection),
            color={"a": detection.confidence},
        )

    def _stamped(self, array: Any, stamp_ns: int, frame_id: str) -> bytes:
        for marker in array.markers:
            stamp = self._time(stamp_ns)
            marker.header = replace(marker.header, stamp=stamp, frame_id=frame_id)
        return self._serialized(array)


def _detected(raw: Any, array_frame: str) -> RosObject:
    location = _location(raw.pose, raw.space_frame or raw.header.frame_id or array_frame)
    return _object(
        raw,
        label=raw.label,
        score=raw.score,
        box=(float(raw.x), float(raw.y), float(raw.x + raw.width), float(raw.y + raw.height)),
        location=location if location and any(location) else None,
    )


def _object(
    raw: Any, *, label: str, score: float, box: Box | None, location: Location | None
) -> RosObject:
    """A detection from a ROS object.

    Parameters
    ----------
    raw : object
        The ROS object.
    label : str
        Its class.
    score : float
        Its confidence; one that is not finite counts as 0.
    box : tuple, optional
        Left, top, right and bottom [px].
    location : tuple, optional
        Its place in the map frame [m].
    """
    confidence = float(score) if math.isfinite(score) else 0.0
    return RosObject(
        label=label,
        score=confidence,
        box=box,
        location=location,
        confidence=confidence,
        placed_by="ros",
        raw=raw,
    )


def _location(pose: Any, frame: str) -> Location | None:
    location = (pose.position.x, pose.position.y, pose.position.z)
    is_absolute = frame.strip("/") in ABSOLUTE_FRAMES
    return location if is_absolute and is_place(location) else None


def is_place(coordinates_m: Sequence[float]) -> bool:
    """Are these coordinates in the map frame finite, and on Earth?"""
    return all(abs(coordinate_m) <= MAX_COORDINATE_M for coordinate_m in coordinates_m)


def _pose(detection: Detection) -> dict[str, Any]:
    position = dict(zip("xyz", detection.location or (0.0, 0.0, 0.0), strict=True))
    return {"position": position, "orientation": {"w": 1.0}}


def _restamped_by_rclpy(name: str, payload: bytes, stamp_ns: int, frame_id: str) -> bytes:
    """A message of any ROS 2 type under another header, whose frame may have another length."""
    from rclpy.serialization import deserialize_message, serialize_message

    try:
        message = deserialize_message(payload, class_of(name))
    except Exception as error:  # rclpy raises its own C++ exceptions, which share no base
        raise ValueError(f"no {name}: {error}") from error
    header = message.header
    header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, NS_PER_S)
    header.frame_id = frame_id
    return bytes(serialize_message(message))


def _full(name: str) -> str:
    """``sensor_msgs/Image`` is ``sensor_msgs/msg/Image`` in ROS 2 and in rosbags."""
    package, _, kind = name.rpartition("/")
    return f"{package.removesuffix('/msg')}/msg/{kind}"


def picture(message: Any) -> np.ndarray:
    """An image message as (height, width, 3) bytes: blue, green, red.

    Raises UserError for an encoding that has no plain colours, ValueError for data too short for
    the image.
    """
    encoding, width, height, step = message.encoding, message.width, message.height, message.step
    if encoding not in CHANNELS:
        raise UserError(unknown("image encoding", encoding, CHANNELS))
    channels = CHANNELS[encoding]
    if len(message.data) < height * step or step < width * channels or not (height and width):
        raise ValueError(f"an image of {width}x{height} with {len(message.data)} bytes")
    rows = np.frombuffer(bytes(message.data), np.uint8, height * step).reshape(height, step)
    pixels = rows[:, : width * channels].reshape(height, width, channels)
    if channels == 1:
        return np.repeat(pixels, 3, axis=2)
    return np.ascontiguousarray(
        pixels[:, :, 2::-1] if encoding.startswith("rgb") else pixels[:, :, :3]
    )
