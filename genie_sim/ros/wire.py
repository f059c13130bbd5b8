"""What two Genies say to each other inside TLS: frames of a length (uint32, big-endian) and that many bytes.

A frame holds the length of a JSON text, the text, and a message's bytes; a frame with an empty text says "still here".
The text names the message's type and that type's checksum. A message counts only if its topic has this very type here:
definitions do not travel.
"""

import json
import math
import struct
from collections.abc import Callable
from typing import Any

from genie_sim.messages import CameraPose
from genie_sim.ros.codec import Codec
from genie_sim.ros.gateway import REMOTE
from genie_sim.ros.message import RosMessage

LENGTH = struct.Struct(">I")
MAX_FRAME_BYTES = 64 * 2**20
MAX_TEXT = 256  # signs of a name or topic
PING = LENGTH.pack(0)

CodecOf = Callable[[str], Codec | None]


def encode(topic: str, message: RosMessage) -> bytes:
    """The frame of a message, without the frame's length."""
    said: dict[str, Any] = {"topic": topic, "type": message.codec.type[:2], "origin": message.header.origin}
    said |= {"source": message.source, "served_by": message.served_by}
    if message.pose is not None:
        said |= {"pose": message.pose, "fov_rad": message.horizontal_fov_rad}
    text = json.dumps(said).encode()
    return LENGTH.pack(len(text)) + text + message.encoded()


def decode(frame: bytes, codec_of: CodecOf) -> tuple[str, RosMessage] | None:
    """Topic and message; ``None`` for "still here". Raises ValueError for anything that is no message."""
    if frame == PING:
        return None
    try:
        end = LENGTH.size + int(LENGTH.unpack_from(frame)[0])
        said = json.loads(frame[LENGTH.size : end])
        topic, origin, source, served_by = (_text(said, name) for name in ("topic", "origin", "source", "served_by"))
        codec = codec_of(topic.removesuffix(REMOTE))
        if codec is None or list(codec.type[:2]) != said["type"]:
            raise ValueError(f"{topic}: a type that is not the one here: {str(said['type'])[:MAX_TEXT]!r}")
        pose = None if said.get("pose") is None else CameraPose(*map(float, said["pose"]))
        fov_rad = float(said.get("fov_rad", 0.0))
    except (TypeError, KeyError, OverflowError, RecursionError, struct.error) as error:
        raise ValueError(f"nothing that a Genie says: {error!r}") from error
    if not all(map(math.isfinite, (*(pose or ()), fov_rad))):
        raise ValueError(f"{topic}: a view that is not finite")
    read = RosMessage.of(frame[end:], codec, origin, answer=codec.holds_objects)
    return topic, RosMessage(
        read.header, read.payload, codec, pose, fov_rad, read.objects, read.read, source, served_by
    )


def _text(said: Any, name: str) -> str:
    value = said[name]
    if not isinstance(value, str) or len(value) > MAX_TEXT or not (value.isprintable()):
        raise ValueError(f"{name} is no printable text of at most {MAX_TEXT} signs")
    return value
