"""One TLS connection to another Genie, as a protocol of asyncio.

TLS works on memory here (``ssl.SSLObject``), so that what it has to tell the other side, such as
the alert that refuses a certificate, is sent before the socket is closed. Bytes are read in pieces,
and reading pauses while a frame is being delivered: a connection holds at most one frame.
"""

import asyncio
import contextlib
import socket
import ssl
import time
from collections import deque
from typing import Protocol, cast

from genie_sim.ros.certificates import Certificate, Credentials, Refused, reason
from genie_sim.ros.frames import (
    LENGTH,
    MAX_FIRST_FRAME_BYTES,
    MAX_FRAME_BYTES,
    PING,
    encode,
    framed,
    refusal,
    refusal_reason,
)
from genie_sim.ros.gateway import Peer
from genie_sim.ros.message import RosMessage

HANDSHAKE_S = 2.0  # until the other side has shown its certificate
PING_S = 1.0
SILENCE_S = 5.0  # after which a link counts as cut
FRAME_S = 30.0  # from the first byte of a frame to its last; a slow link brings 1 MB in 10 s
LINGER_S = 1.0  # how long a refused peer has for reading why
QUEUED_REQUESTS = 2  # of a topic: images that a slow link holds; the oldest goes first
QUEUED_ANSWERS = 10
PIECE_BYTES = 2**16


class ConnectionOwner(Protocol):
    """What a connection needs of the links that it belongs to. The two checks raise Refused."""

    def admit(self, connection: "Connection") -> None:
        """The other side has shown its certificate."""

    def take_up(self, connection: "Connection") -> None:
        """The other side has sent its first frame."""

    def deliver(self, connection: "Connection", frame: bytearray) -> None:
        """A message has come. The next one is read after ``Connection.delivered``."""

    def ended(self, connection: "Connection", error: Exception) -> None:
        """The connection is over."""

    def closed(self, connection: "Connection") -> None:
        """Its socket is closed."""

    def warn(self, text: str) -> None:
        """Writes a line of the log."""


class Connection(asyncio.Protocol):
    """A connection from its first byte to its last. Used in the event loop's thread only.

    Its three stages: in its handshake; with a ``certificate`` that is checked; ``up``, from the
    other side's first frame on. A dialler is through with its handshake before the listener has
    seen who it is, so only a frame shows that the listener has agreed.

    Parameters
    ----------
    credentials : Credentials
        The own key and certificate.
    links : ConnectionOwner
        Decide whether the other side is welcome, and get what it says.
    requests : frozenset of str
        Topics of images, of which a slow link holds fewer than of others.
    where : str
        The other side's address, for the log.
    expected : str, optional
        The name that a dialler expects; ``None`` for a connection that was accepted.
    """

    def __init__(
        self,
        credentials: Credentials,
        links: ConnectionOwner,
        requests: frozenset[str],
        where: str,
        expected: str | None = None,
    ) -> None:
        self.credentials = credentials
        self.where = where
        self.expected = expected
        self.certificate: Certificate | None = None
        self.made_s = time.monotonic()
        self.up = False
        self.has_spoken = False
        self.error: Exception | None = None  # why it ended
        self.opened: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._links = links
        self._requests = requests
        accepted = expected is None
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = (credentials.listening if accepted else credentials.dialling).wrap_bio(
            self._incoming, self._outgoing, server_side=accepted
        )
        self._transport: asyncio.Transport | None = None
        self._frame = bytearray()  # what has come of the length, then of the frame
        self._length: int | None = None
        self._delivering = False
        self._queue: deque[tuple[str, RosMessage]] = deque()
        self._unsent = memoryview(b"")  # the rest of the frame that is being sent
        self._writable = True
        self._unwritten_bytes = 0
        self._heard_s = self._sent_s = self._moved_s = self.made_s
        self._ended_s = 0.0
        self._frame_begun_s: float | None = None

    @property
    def peer(self) -> Peer:
        """Who the other side is, once its certificate is known."""
        assert self.certificate is not None
        return self.certificate.owner

    # What asyncio calls

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(high=0)  # the queue is here, not in the transport
        # a small message behind another one would wait for an acknowledgement, 44 ms
        sock = transport.get_extra_info("socket")
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._proceed()

    def data_received(self, data: bytes) -> None:
        self.has_spoken = True
        self._heard_s = time.monotonic()
        if self.error is None:
            self._incoming.write(data)
            self._proceed()

    def eof_received(self) -> None:
        self.end(ConnectionResetError("closed by the other side"))

    def connection_lost(self, exc: Exception | None) -> None:
        self.end(exc or ConnectionResetError("closed by the other side"))
        self._links.closed(self)

    def pause_writing(self) -> None:
        self._writable = False

    def resume_writing(self) -> None:
        self._writable = True
        self._write()

    # What its links call

    def send(self, topic: str, message: RosMessage) -> None:
        """Sends without waiting. What a slow link cannot take is dropped, the oldest first."""
        limit = QUEUED_REQUESTS if topic in self._requests else QUEUED_ANSWERS
        same_topic = [entry for entry in self._queue if entry[0] == topic]
        if len(same_topic) >= limit:
            self._queue.remove(same_topic[0])
        self._queue.append((topic, message))
        self._write()

    def delivered(self) -> None:
        """The last frame is dealt with: goes on reading."""
        self._delivering = False
        self._heard_s = time.monotonic()
        if self.error is None and self._transport is not None:
            self._transport.resume_reading()
            self._proceed()

    def check(self, now_s: float) -> None:
        """Ends the connection if a deadline has passed, and says "still here". To be called a few
        times a second.
        """
        if self.error is not None:
            if now_s > self._ended_s + LINGER_S:
                self.abort()
        elif self.certificate is None:
            if now_s > self.made_s + HANDSHAKE_S:
                self.end(TimeoutError(f"no certificate within {HANDSHAKE_S:.0f} s"))
        elif now_s > self._heard_s + SILENCE_S and not self._delivering:
            self.end(TimeoutError(f"silent for {SILENCE_S:.0f} s"))
        elif self._frame_begun_s is not None and now_s > self._frame_begun_s + FRAME_S:
            self.end(TimeoutError(f"a frame that takes more than {FRAME_S:.0f} s"))
        elif time.time() > self.certificate.ends_s:
            self.end(Refused("its certificate has expired"))
        elif self._is_stuck(now_s):
            self.end(TimeoutError(f"reads nothing for {SILENCE_S:.0f} s"))
        elif now_s > self._sent_s + PING_S and not self._unsent:
            self._unsent = memoryview(framed(PING))
            self._write()

    def end(self, error: Exception) -> None:
        """Ends the connection, once, and tells the other side why it is refused."""
        if self.error is not None:
            return
        self.error = error
        self._ended_s = time.monotonic()
        self._queue.clear()
        if not self.opened.done():
            self.opened.set_result(None)
        self._links.ended(self, error)
        is_accepted = self.expected is None
        if isinstance(error, ssl.SSLError) or (isinstance(error, Refused) and is_accepted):
            self._say_why(error)
        else:
            self.abort()

    def _say_why(self, error: Exception) -> None:
        """Sends TLS's alert, or the refusal, and lets the other side hang up: closing a socket
        with unread bytes destroys what is on its way.
        """
        if self._transport is None or self._transport.is_closing():
            return
        is_between_frames = self._tls.version() is not None and not self._unsent
        if isinstance(error, Refused) and is_between_frames:
            with contextlib.suppress(ssl.SSLError):
                self._tls.write(framed(refusal(reason(error))))
                self._tls.unwrap()
        self._flush()
        self._transport.resume_reading()
        self._transport.write_eof()

    def abort(self) -> None:
        """Closes the socket at once."""
        if self._transport is None:
            self._links.closed(self)
        else:
            self._transport.abort()

    # Reading

    def _proceed(self) -> None:
        """The handshake, then frames, as far as the bytes that have come go."""
        try:
            if self.certificate is None:
                self._tls.do_handshake()
                self.certificate = Certificate.of(self._tls.getpeercert() or {})
                self._links.admit(self)
                self._unsent = memoryview(framed(PING))
                self._write()
            self._read()
        except ssl.SSLWantReadError:
            self._flush()
        except ssl.SSLZeroReturnError:
            self.end(ConnectionResetError("closed by the other side"))
        except Exception as error:  # whatever it is, it ends this connection only
            self.end(error)

    def _read(self) -> None:
        """Reads frames. Raises SSLWantReadError where more bytes have to come first."""
        while not self._delivering and self.error is None:
            if self._length is None:
                self._fill(LENGTH.size)
                self._length = int(LENGTH.unpack(self._frame)[0])
                limit = MAX_FRAME_BYTES if self.up else MAX_FIRST_FRAME_BYTES
                if self._length > limit:
                    raise Refused(f"a frame of {self._length} bytes; the limit is {limit}")
                self._frame.clear()
            self._fill(self._length)
            frame, self._frame, self._length = self._frame, bytearray(), None
            self._frame_begun_s = None
            self._receive(frame)

    def _fill(self, length: int) -> None:
        """Reads until ``length`` bytes are there. Only what has come takes memory."""
        while len(self._frame) < length:
            piece = self._tls.read(min(length - len(self._frame), PIECE_BYTES))
            if not piece:
                raise ConnectionResetError("closed by the other side")
            if self._frame_begun_s is None:
                self._frame_begun_s = time.monotonic()
            self._frame += piece

    def _receive(self, frame: bytearray) -> None:
        if refusal_text := refusal_reason(frame):
            raise Refused(f"it refuses: {refusal_text}")
        if not self.up:
            self._links.take_up(self)
            self.up = True
            self.opened.set_result(None)
        if frame != PING:
            assert self._transport is not None
            self._delivering = True
            self._transport.pause_reading()
            self._links.deliver(self, frame)

    # Writing

    def _write(self) -> None:
        """Sends what is queued, as far as the socket takes it."""
        while self._writable and self.error is None:
            if not self._unsent:
                if not self._queue:
                    return
                self._unsent = memoryview(self._next_frame())
            piece, self._unsent = self._unsent[:PIECE_BYTES], self._unsent[PIECE_BYTES:]
            self._tls.write(piece)
            self._flush()

    def _next_frame(self) -> bytes:
        try:
            return framed(encode(*self._queue.popleft()))
        except Exception as error:  # what cannot be written does not end the link
            self._links.warn(f"link: a message to {self.peer.name} cannot be written: {error}")
            return framed(PING)

    def _flush(self) -> None:
        """Hands what TLS has written to the socket."""
        data = self._outgoing.read()
        if data and self._transport is not None:
            self._sent_s = time.monotonic()
            self._transport.write(data)

    def _is_stuck(self, now_s: float) -> bool:
        """Has the other side read nothing for too long?"""
        assert self._transport is not None
        unwritten_bytes = self._transport.get_write_buffer_size()
        if not unwritten_bytes or unwritten_bytes != self._unwritten_bytes:
            self._unwritten_bytes, self._moved_s = unwritten_bytes, now_s
        return now_s > self._moved_s + SILENCE_S
