"""What one Genie sends to another: a message's bytes, and beside them a JSON text that says which
topic, type and Genie they belong to.

A message counts only if its topic has this very type here: definitions do not travel. Whatever
comes is measured before it is parsed.
"""

import json
import math
from collections.abc import Callable
from typing import Any

from genie_sim_ros.codec import Codec
from genie_sim_ros.gateway import REMOTE
from genie_sim_ros.message import RosMessage, checked_pose

MAX_NAME = 256  # characters of a name or a topic
MAX_TEXT_BYTES = 4096
MAX_MESSAGE_BYTES = 64 * 2**20
MAX_OBJECTS_BYTES = 4 * 2**20  # of a message whose objects are read

CodecOf = Callable[[str], Codec | None]


def encode(topic: str, message: RosMessage) -> tuple[bytes, bytes]:
    """The JSON text and the bytes of a message. Raises ValueError for one that is too long."""
    fields: dict[str, Any] = {
        "topic": topic,
        "type": message.codec.type[:2],
        "origin": message.header.origin,
        "source": message.source,
        "served_by": message.served_by,
    }
    if message.pose is not None:
        fields |= {"pose": message.pose, "fov_rad": message.horizontal_fov_rad}
    text, payload = json.dumps(fields).encode(), message.encoded()
    _check_size(topic, text, payload, message.codec)
    return text, payload


def decode(text: bytes, payload: bytes, codec_of: CodecOf) -> tuple[str, RosMessage]:
    """Topic and message from what ``encode`` returned. Raises ValueError for anything else."""
    if len(text) > MAX_TEXT_BYTES:
        raise ValueError(f"a text of {len(text)} bytes; the limit is {MAX_TEXT_BYTES}")
    try:
        fields = json.loads(text)
        topic, origin, source, served_by = (
            _name(fields, key) for key in ("topic", "origin", "source", "served_by")
        )
        codec = codec_of(topic.removesuffix(REMOTE))
        if codec is None or list(codec.type[:2]) != fields["type"]:
            type_text = str(fields["type"])[:MAX_NAME]
            raise ValueError(f"{topic}: a type that is not the one here: {type_text!r}")
        pose = None if fields.get("pose") is None else checked_pose(*map(float, fields["pose"]))
        fov_rad = float(fields.get("fov_rad", 0.0))
    except (TypeError, KeyError, OverflowError, RecursionError) as error:
        raise ValueError(f"not a valid Genie message: {error!r}") from error
    if not math.isfinite(fov_rad):
        raise ValueError(f"{topic}: a field of view that is not finite")
    _check_size(topic, text, payload, codec)
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


def _check_size(topic: str, text: bytes, payload: bytes, codec: Codec) -> None:
    limits = {
        MAX_TEXT_BYTES: len(text),
        MAX_OBJECTS_BYTES if codec.holds_objects else MAX_MESSAGE_BYTES: len(payload),
    }
    for limit, size_bytes in limits.items():
        if size_bytes > limit:
            raise ValueError(f"{topic}: {size_bytes} bytes; the limit is {limit}")


def _name(fields: Any, key: str) -> str:
    name = fields[key]
    if not isinstance(name, str) or len(name) > MAX_NAME or not name.isprintable():
        raise ValueError(f"{key} is no printable text of at most {MAX_NAME} characters")
    return name
