"""One TLS connection to another Genie: one thread reads, one writes.

What two Genies say inside TLS are frames of a length (uint32, big-endian) and that many bytes. A frame holds the length
of a JSON text, the text, and a message's bytes; a frame with an empty text says "still here". The text names the
message's type and that type's checksum. A message counts only if its topic has this very type here: definitions do not
travel.
"""

import contextlib
import json
import math
import select
import socket
import ssl
import struct
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from genie_sim.messages import CameraPose
from genie_sim.ros.certificates import Refused, identity
from genie_sim.ros.codec import Codec
from genie_sim.ros.gateway import REMOTE, Peer
from genie_sim.ros.message import RosMessage

PING_S = 1.0
SILENCE_S = 5.0  # after which a link counts as cut
QUEUED_REQUESTS = 2  # of a topic: images that a slow link holds; the oldest goes first
QUEUED_ANSWERS = 10
LENGTH = struct.Struct(">I")
MAX_FRAME_BYTES = 64 * 2**20
MAX_TEXT = 256  # signs of a name or topic
PING = LENGTH.pack(0)

CodecOf = Callable[[str], Codec | None]
OnMessage = Callable[[Peer, str, RosMessage], None]


class Connection:
    """A connection after its handshake; ``up`` from its first frame on. Raises Refused for a certificate that is no
    Genie's. ``requests`` are the topics of images, ``warn`` gets log lines."""

    def __init__(
        self, sock: ssl.SSLSocket, requests: frozenset[str], warn: Callable[[str], None]
    ) -> None:
        fields = sock.getpeercert() or {}
        self.peer = identity(fields)
        self.certificate = sock.getpeercert(True)
        self.up = False
        self._ends_s = ssl.cert_time_to_seconds(str(fields["notAfter"]))
        self._sock = sock
        self._requests = requests
        self._warn = warn
        self._queue: list[tuple[str, RosMessage]] = []
        self._changed = threading.Condition()
        self._tls = threading.Lock()  # OpenSSL serves one thread at a time
        self._closed = False

    def send(self, topic: str, message: RosMessage) -> None:
        """Returns at once. What a slow link cannot take is dropped, the oldest first."""
        limit = QUEUED_REQUESTS if topic in self._requests else QUEUED_ANSWERS
        with self._changed:
            same = [index for index, (its_topic, _) in enumerate(self._queue) if its_topic == topic]
            if len(same) >= limit:
                del self._queue[same[0]]
            self._queue.append((topic, message))
            self._changed.notify()

    def close(self) -> None:
        """Wakes both threads; ``run`` ends."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        # ``SSLSocket.shutdown`` would let a thread that uses the connection go on in plain text.
        with contextlib.suppress(OSError):
            socket.socket.shutdown(self._sock, socket.SHUT_RDWR)

    def run(
        self, codec_of: CodecOf, on_message: OnMessage, on_up: "Callable[[Connection], None]"
    ) -> None:
        """Reads until the connection ends, which raises. ``on_up`` may refuse it at its first frame."""
        self._sock.settimeout(0)
        writer = threading.Thread(target=self._write, daemon=True)
        writer.start()
        try:
            while True:
                frame = self._frame()
                if time.time() > self._ends_s:
                    raise Refused("its certificate has expired")
                if not self.up:
                    on_up(self)
                    self.up = True
                try:
                    found = decode(frame, codec_of)
                    if found is not None:
                        on_message(self.peer, *found)
                except Exception as error:  # a peer's message must not end anything here
                    self._warn(f"link: dropped a message of {self.peer.name}: {error}")
        finally:
            self.close()
            writer.join()

    def _write(self) -> None:
        body: bytes | None = PING
        with contextlib.suppress(OSError):
            while body is not None:
                view = memoryview(LENGTH.pack(len(body)) + body)
                while view:
                    view = view[self._when_ready(partial(self._sock.send, view)) :]
                body = self._next()
        self.close()

    def _next(self) -> bytes | None:
        """The next frame to be sent, in time; ``None`` at the end."""
        with self._changed:
            if not self._queue and not self._closed:
                self._changed.wait(PING_S)
            if self._closed:
                return None
            following = self._queue.pop(0) if self._queue else None
        try:
            return PING if following is None else encode(*following)
        except Exception as error:  # nothing that cannot be written ends the link
            self._warn(f"link: a message to {self.peer.name} cannot be written: {error}")
            return PING

    def _frame(self) -> bytes:
        length = int(LENGTH.unpack(self._read(LENGTH.size))[0])
        if length > MAX_FRAME_BYTES:
            raise Refused(f"a frame of {length} bytes; the limit is {MAX_FRAME_BYTES}")
        return self._read(length)

    def _read(self, length: int) -> bytes:
        buffer = bytearray(length)
        view = memoryview(buffer)
        while view:
            count = self._when_ready(partial(self._sock.recv_into, view))
            if count == 0:
                raise ConnectionResetError("closed by the other side")
            view = view[count:]
        return bytes(buffer)

    def _when_ready(self, operation: Callable[[], int]) -> int:
        """What ``operation`` returns once the socket lets it. Raises OSError when it does not for too long."""
        while True:
            try:
                with self._tls:
                    return operation()
            except ssl.SSLWantReadError:
                event = select.POLLIN
            except ssl.SSLWantWriteError:
                event = select.POLLOUT
            poll = select.poll()
            poll.register(self._sock, event)
            if not poll.poll(SILENCE_S * 1000):
                raise TimeoutError(f"silent for {SILENCE_S:.0f} s")


def encode(topic: str, message: RosMessage) -> bytes:
    """The frame of a message, without the frame's length."""
    said: dict[str, Any] = {
        "topic": topic,
        "type": message.codec.type[:2],
        "origin": message.header.origin,
    }
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
        topic, origin, source, served_by = (
            _text(said, name) for name in ("topic", "origin", "source", "served_by")
        )
        codec = codec_of(topic.removesuffix(REMOTE))
        if codec is None or list(codec.type[:2]) != said["type"]:
            raise ValueError(
                f"{topic}: a type that is not the one here: {str(said['type'])[:MAX_TEXT]!r}"
            )
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
