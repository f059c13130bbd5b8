"""What two Genies say to each other inside TLS: frames, as bytes.

A frame is a length (uint32, big-endian) and that many bytes: the length of a JSON text, the text,
and a message's bytes. The text names the message's type and that type's checksum. A message counts
only if its topic has this very type here: definitions do not travel.

A frame without a text is no message. Alone it says "still here"; with bytes behind it, these say
why the sender refuses the connection.
"""

import json
import math
import struct
from collections.abc import Callable
from typing import Any

from genie_sim.ros.codec import Codec
from genie_sim.ros.gateway import REMOTE
from genie_sim.ros.message import RosMessage, checked_pose
from genie_sim.text import one_line

LENGTH = struct.Struct(">I")
MAX_FRAME_BYTES = 64 * 2**20
MAX_TEXT = 256  # characters of a name, a topic or a reason
MAX_FIRST_FRAME_BYTES = LENGTH.size + MAX_TEXT  # "still here" or a refusal
PING = LENGTH.pack(0)

CodecOf = Callable[[str], Codec | None]


def framed(body: bytes) -> bytes:
    """A frame with its length in front, as it is sent."""
    return LENGTH.pack(len(body)) + body


def refusal(reason: str) -> bytes:
    """The frame that tells the other side why it is refused."""
    return PING + reason.encode("ascii", "backslashreplace")[:MAX_TEXT]


def refusal_reason(frame: bytes | bytearray) -> str:
    """What a refusal says, printable and short; empty for any other frame."""
    if not frame.startswith(PING):
        return ""
    return one_line(frame[LENGTH.size :][:MAX_TEXT].decode("ascii", "replace"))


def encode(topic: str, message: RosMessage) -> bytes:
    """The frame of a message. Raises ValueError for one that is too long for a frame."""
    fields: dict[str, Any] = {
        "topic": topic,
        "type": message.codec.type[:2],
        "origin": message.header.origin,
        "source": message.source,
        "served_by": message.served_by,
    }
    if message.pose is not None:
        fields |= {"pose": message.pose, "fov_rad": message.horizontal_fov_rad}
    text = json.dumps(fields).encode()
    frame = LENGTH.pack(len(text)) + text + message.encoded()
    if len(frame) > MAX_FRAME_BYTES:
        raise ValueError(f"{topic}: {len(frame)} bytes; the limit is {MAX_FRAME_BYTES}")
    return frame


def decode(frame: bytes | bytearray, codec_of: CodecOf) -> tuple[str, RosMessage]:
    """Topic and message of a frame. Raises ValueError for anything that is no message."""
    try:
        end = LENGTH.size + int(LENGTH.unpack_from(frame)[0])
        fields = json.loads(frame[LENGTH.size : end])
        topic, origin, source, served_by = (
            _text(fields, name) for name in ("topic", "origin", "source", "served_by")
        )
        codec = codec_of(topic.removesuffix(REMOTE))
        if codec is None or list(codec.type[:2]) != fields["type"]:
            type_text = str(fields["type"])[:MAX_TEXT]
            raise ValueError(f"{topic}: a type that is not the one here: {type_text!r}")
        pose = None if fields.get("pose") is None else checked_pose(*map(float, fields["pose"]))
        fov_rad = float(fields.get("fov_rad", 0.0))
    except (TypeError, KeyError, OverflowError, RecursionError, struct.error) as error:
        raise ValueError(f"not a valid Genie message: {error!r}") from error
    if not math.isfinite(fov_rad):
        raise ValueError(f"{topic}: a field of view that is not finite")
    payload = bytes(memoryview(frame)[end:])
    message = RosMessage.of(payload, codec, origin, answer=codec.holds_objects)
    return topic, RosMessage(
        header=message.header,
        payload=payload,
        codec=codec,
        pose=pose,
        horizontal_fov_rad=fov_rad,
        objects=message.objects,
        read=message.read,
        source=source,
        served_by=served_by,
    )


def _text(fields: Any, name: str) -> str:
    text = fields[name]
    if not isinstance(text, str) or len(text) > MAX_TEXT or not text.isprintable():
        raise ValueError(f"{name} is no printable text of at most {MAX_TEXT} characters")
    return text
