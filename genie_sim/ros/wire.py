"""What two Genies say to each other over TCP: framing, proof of a shared key, authenticated messages. No sockets here.

Every frame is a length (uint32, big-endian) and that many bytes, up to a limit. The side that dials speaks first:

=========  ==================================================================================================
dialler    greeting: version, name, role, 32 random bytes
listener   greeting: the same of its own
dialler    HMAC-SHA256 of both greetings under the shared key, so that a stranger who dials learns nothing
listener   the same, of another label, so that a proof cannot be sent back to whom it came from
both       sealed frames: body, HMAC-SHA256 of its number and the body under a key of this session and direction
=========  ==================================================================================================

So nobody without the key gets in, and a frame that is altered, repeated, left out or taken from another session ends
the connection before anything in it is looked at. Frames are authenticated, not encrypted.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import secrets
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from genie_sim.errors import UserError
from genie_sim.messages import CameraPose
from genie_sim.ros.gateway import Peer
from genie_sim.ros.message import Codec, RosMessage, WireType

VERSION = 1
MAX_GREETING_BYTES = 1024  # nobody who has not proved the key makes us hold more
MAX_FRAME_BYTES = 64 * 2**20
MAX_TYPES = 64
MIN_KEY_BYTES = 16
PROOF_BYTES = hashlib.sha256().digest_size
LENGTH = struct.Struct(">I")


class Refused(Exception):
    """The other side has not proved the key, or talks nonsense. The connection ends."""


def read_key(path: str) -> bytes:
    """The shared key: the bytes of a file that only its owner may read. Raises UserError."""
    try:
        key, mode = Path(path).read_bytes().strip(), Path(path).stat().st_mode
    except OSError as error:
        raise UserError(f"{path}: key: {error.strerror}") from error
    if mode & 0o077:
        raise UserError(f"{path}: key: others may read it; chmod 600 {path}")
    if len(key) < MIN_KEY_BYTES:
        raise UserError(f"{path}: key: {len(key)} bytes are too few; make one: openssl rand -hex 32 > {path}")
    return key


def frame_length(prefix: bytes, limit: int) -> int:
    """The length of the frame that follows. Raises Refused beyond ``limit``."""
    length = int(LENGTH.unpack(prefix)[0])
    if length > limit:
        raise Refused(f"a frame of {length} bytes; the limit is {limit}")
    return length


class Handshake:
    """One side's way from a greeting to a session."""

    def __init__(self, key: bytes, me: Peer, dialling: bool) -> None:
        self._key = key
        self._me = me
        self._dialling = dialling
        nonce = secrets.token_hex(32)
        self.greeting = json.dumps({"genie": VERSION, "name": me.name, "role": me.role, "nonce": nonce}).encode()
        self._transcript = b""

    def meet(self, greeting: bytes) -> Peer:
        """Who the other side says it is; proved by ``check`` only. Raises Refused."""
        said = _json(greeting)
        peer = Peer(_text(said, "name"), _text(said, "role"))
        if said.get("genie") != VERSION:
            raise Refused(f"version {said.get('genie')!r} of the link; this is {VERSION}")
        if peer.role not in ("car", "edge") or peer.role == self._me.role == "car":
            raise Refused(f"a {peer.role} has nothing to say to a {self._me.role}")
        if peer.name == self._me.name:
            raise Refused(f"the other Genie is called {peer.name!r}, too")
        first, second = (self.greeting, greeting) if self._dialling else (greeting, self.greeting)
        self._transcript = LENGTH.pack(len(first)) + first + LENGTH.pack(len(second)) + second
        return peer

    def proof(self) -> bytes:
        return self._mac(b"dialler" if self._dialling else b"listener")

    def check(self, proof: bytes) -> Session:
        """The session, if the other side has the key. Raises Refused."""
        if not hmac.compare_digest(proof, self._mac(b"listener" if self._dialling else b"dialler")):
            raise Refused("no proof of the shared key")
        there, back = self._mac(b"session, dialler to listener"), self._mac(b"session, listener to dialler")
        return Session(there, back) if self._dialling else Session(back, there)

    def _mac(self, label: bytes) -> bytes:
        return hmac.digest(self._key, label + b"\0" + self._transcript, "sha256")


class Session:
    """Seals what is sent and opens what is received; both sides count frames, so each fits in one place only."""

    def __init__(self, send_key: bytes, receive_key: bytes) -> None:
        self._send_key, self._receive_key = send_key, receive_key
        self._sent = self._received = 0

    def seal(self, body: bytes) -> bytes:
        """The frame, length included."""
        proof = _numbered(self._send_key, self._sent, body)
        self._sent += 1
        return LENGTH.pack(len(body) + PROOF_BYTES) + body + proof

    def open(self, frame: bytes) -> bytes:
        """The body of a frame that came without its length. Raises Refused."""
        body, proof = frame[:-PROOF_BYTES], frame[-PROOF_BYTES:]
        if not hmac.compare_digest(proof, _numbered(self._receive_key, self._received, body)):
            raise Refused("a frame that was altered, repeated or made up")
        self._received += 1
        return body


class Writer:
    """Messages to bodies. A type is announced once, before the first message that has it."""

    def __init__(self) -> None:
        self._types: dict[WireType, int] = {}

    def bodies(self, topic: str, message: RosMessage) -> list[bytes]:
        wire_type, bodies = message.codec.type, []
        if wire_type not in self._types:
            self._types[wire_type] = len(self._types)
            bodies.append(_body({"kind": "type", **wire_type._asdict()}))
        said: dict[str, Any] = {"kind": "message", "type": self._types[wire_type], "topic": topic}
        said |= {"origin": message.header.origin, "source": message.source, "served_by": message.served_by}
        if message.pose is not None:
            said |= {"pose": list(message.pose), "fov_rad": message.horizontal_fov_rad}
        return [*bodies, _body(said, message.encoded())]


class Reader:
    """Bodies to messages. Whatever does not fit is Refused: a peer that has the key makes no mistakes."""

    def __init__(self, codec_of: Callable[[WireType], Codec]) -> None:
        self._codec_of = codec_of
        self._codecs: list[Codec] = []

    def message(self, body: bytes) -> tuple[str, RosMessage] | None:
        """Topic and message; ``None`` for a body that is for the link only."""
        try:
            end = LENGTH.size + LENGTH.unpack_from(body)[0]
            said = _json(body[LENGTH.size : end])
            if said.get("kind") == "type" and len(self._codecs) < MAX_TYPES:
                names = ("name", "md5sum", "definition")
                self._codecs.append(self._codec_of(WireType(*(_text(said, name) for name in names))))
            elif said.get("kind") == "message":
                return _text(said, "topic"), self._read(said, body[end:])
            elif said.get("kind") != "ping":
                raise Refused(f"a frame of kind {said.get('kind')!r}")
        except (ValueError, TypeError, IndexError, struct.error, UserError) as error:
            raise Refused(f"a message that cannot be read: {error}") from error
        return None

    def _read(self, said: dict[str, Any], payload: bytes) -> RosMessage:
        codec = self._codecs[int(said["type"])] if said.get("type") in range(len(self._codecs)) else None
        if codec is None:
            raise Refused("a message of a type that was not announced")
        read = RosMessage.of(payload, codec, _text(said, "origin"), answer=codec.holds_objects)
        pose = None if said.get("pose") is None else CameraPose(*map(float, said["pose"]))
        return RosMessage(
            read.header, payload, codec, pose, float(said.get("fov_rad", 0.0)), read.objects, read.read,
            _text(said, "source"), _text(said, "served_by"),
        )


PING = LENGTH.pack(len(b'{"kind": "ping"}')) + b'{"kind": "ping"}'


def _body(said: dict[str, Any], payload: bytes = b"") -> bytes:
    text = json.dumps(said).encode()
    return LENGTH.pack(len(text)) + text + payload


def _json(text: bytes) -> dict[str, Any]:
    try:
        said = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Refused("no JSON") from error
    if not isinstance(said, dict):
        raise Refused("no JSON object")
    return said


def _text(said: dict[str, Any], name: str) -> str:
    value = said.get(name)
    if not isinstance(value, str):
        raise Refused(f"{name} is missing")
    return value


def _numbered(key: bytes, number: int, body: bytes) -> bytes:
    mac = hmac.new(key, number.to_bytes(8, "big"), "sha256")
    mac.update(body)
    return mac.digest()
