"""TCP links between Genies: one process a master, joined by authenticated connections that come back after cuts."""

from __future__ import annotations

import contextlib
import logging
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable

from genie_sim.errors import UserError
from genie_sim.ros.gateway import Peer
from genie_sim.ros.message import Codec, RosMessage, WireType
from genie_sim.ros.plan import Plan
from genie_sim.ros.wire import (
    LENGTH,
    MAX_FRAME_BYTES,
    MAX_GREETING_BYTES,
    PING,
    Handshake,
    Reader,
    Refused,
    Session,
    Writer,
    frame_length,
    read_key,
)

log = logging.getLogger(__name__)
GREETING_S = 5.0  # for the whole handshake
PING_S = 1.0
SILENCE_S = 5  # after which a link counts as cut
RETRY_S = (0.2, 5.0)  # first and longest wait before dialling again
STRANGERS = 16  # connections that have not proved the key yet, at a time
QUEUE_LENGTH = 10  # messages a slow link holds; the oldest goes first

CodecOf = Callable[[WireType], Codec]
OnMessage = Callable[[Peer, str, RosMessage], None]


class TcpLinks:
    """All links of one Genie. Raises UserError for a key or an address that cannot be used."""

    def __init__(self, plan: Plan, codec_of: CodecOf) -> None:
        assert plan.key_file is not None
        self._key = read_key(plan.key_file)
        self._me = Peer(plan.name, plan.role)
        self._codec_of = codec_of
        self._connections: dict[str, Connection] = {}
        self._lock = threading.Lock()
        self._strangers = threading.BoundedSemaphore(STRANGERS)
        self._closed = threading.Event()
        self._others = [_address(text) for text in plan.connect]
        self._listener: socket.socket | None = None
        if plan.listen is not None:
            try:
                self._listener = socket.create_server(_address(plan.listen))
            except OSError as error:
                raise UserError(f"link: cannot listen on {plan.listen}: {error.strerror}") from error

    def start(self, on_message: OnMessage) -> None:
        """From now on ``on_message`` is called, from several threads."""
        self._on_message = on_message
        if self._listener is not None:
            threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()
        for address in self._others:
            threading.Thread(target=self._keep_dialling, args=(address,), daemon=True).start()

    def peers(self) -> list[Peer]:
        with self._lock:
            return [connection.peer for connection in self._connections.values()]

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        with self._lock:
            connection = self._connections.get(peer)
        if connection is not None:
            connection.send(topic, message)

    def close(self) -> None:
        self._closed.set()
        if self._listener is not None:
            with contextlib.suppress(OSError):
                self._listener.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
            self._listener.close()
        with self._lock:
            connections = list(self._connections.values())
        for connection in connections:
            connection.close()

    def _accept(self, listener: socket.socket) -> None:
        while not self._closed.is_set():
            self._strangers.acquire()
            try:
                sock, address = listener.accept()
            except OSError:  # closed
                return
            threading.Thread(target=self._serve, args=(sock, address), daemon=True).start()

    def _serve(self, sock: socket.socket, address: object) -> None:
        try:
            connection = self._meet(sock, dialling=False)
        finally:
            self._strangers.release()
        if connection is None:
            log.warning("link: refused %s", address)
        else:
            self._run(connection)

    def _keep_dialling(self, address: tuple[str, int]) -> None:
        wait_s = RETRY_S[0]
        while not self._closed.is_set():
            with contextlib.suppress(OSError):
                connection = self._meet(socket.create_connection(address, timeout=GREETING_S), dialling=True)
                if connection is not None:
                    wait_s = RETRY_S[0]
                    self._run(connection)
            self._closed.wait(wait_s)
            wait_s = min(2 * wait_s, RETRY_S[1])

    def _meet(self, sock: socket.socket, dialling: bool) -> Connection | None:
        """The connection, once the other side has proved the key; else the socket is closed."""
        try:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer, session = _shake_hands(sock, Handshake(self._key, self._me, dialling), dialling)
            return Connection(sock, peer, session, self._codec_of)
        except (Refused, OSError) as error:
            log.warning("link: %s", error)
            sock.close()
            return None

    def _run(self, connection: Connection) -> None:
        """Serves a connection until it is cut. A newer one of the same Genie takes an older one's place."""
        with self._lock:
            older = self._connections.get(connection.peer.name)
            self._connections[connection.peer.name] = connection
        if older is not None:
            older.close()
        log.info("link: %s %s is connected", *reversed(connection.peer))
        try:
            connection.run(self._on_message)
        finally:
            with self._lock:
                if self._connections.get(connection.peer.name) is connection:
                    del self._connections[connection.peer.name]
            log.info("link: %s is cut", connection.peer.name)


class Connection:
    """An authenticated connection: one thread reads, one writes."""

    def __init__(self, sock: socket.socket, peer: Peer, session: Session, codec_of: CodecOf) -> None:
        self.peer = peer
        self._sock = sock
        self._session = session
        self._codec_of = codec_of
        self._waiting: deque[tuple[str, RosMessage]] = deque(maxlen=QUEUE_LENGTH)
        self._changed = threading.Condition()
        self._closed = False

    def send(self, topic: str, message: RosMessage) -> None:
        with self._changed:
            self._waiting.append((topic, message))
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        with contextlib.suppress(OSError):
            self._sock.shutdown(socket.SHUT_RDWR)

    def run(self, on_message: OnMessage) -> None:
        """Reads until the connection ends, however it does."""
        threading.Thread(target=self._write, daemon=True).start()
        reader = Reader(self._codec_of)
        try:
            self._sock.settimeout(None)  # the kernel's timeouts count from the last byte, Python's from the first
            for side in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
                self._sock.setsockopt(socket.SOL_SOCKET, side, struct.pack("@ll", SILENCE_S, 0))
            while True:
                length = frame_length(_read(self._sock, LENGTH.size), MAX_FRAME_BYTES)
                found = reader.message(self._session.open(_read(self._sock, length)))
                if found is not None:
                    on_message(self.peer, *found)
        except Refused as error:
            log.warning("link: %s: %s", self.peer.name, error)
        except OSError as error:
            log.info("link: %s: %s", self.peer.name, error)
        finally:
            self.close()
            self._sock.close()

    def _write(self) -> None:
        writer = Writer()
        try:
            while True:
                with self._changed:
                    if not self._waiting and not self._closed:
                        self._changed.wait(PING_S)
                    if self._closed:
                        return
                    following = self._waiting.popleft() if self._waiting else None
                for body in [PING] if following is None else writer.bodies(*following):
                    self._sock.sendall(self._session.seal(body))
        except OSError:
            self.close()


def _shake_hands(sock: socket.socket, handshake: Handshake, dialling: bool) -> tuple[Peer, Session]:
    deadline = time.monotonic() + GREETING_S

    def say(text: bytes) -> None:
        sock.sendall(LENGTH.pack(len(text)) + text)

    def hear() -> bytes:
        return _read(sock, frame_length(_read(sock, LENGTH.size, deadline), MAX_GREETING_BYTES), deadline)

    if dialling:
        say(handshake.greeting)
        peer = handshake.meet(hear())
        say(handshake.proof())
        return peer, handshake.check(hear())
    peer = handshake.meet(hear())
    say(handshake.greeting)
    session = handshake.check(hear())
    say(handshake.proof())
    return peer, session


def _read(sock: socket.socket, length: int, deadline: float | None = None) -> bytes:
    """Exactly ``length`` bytes. Raises OSError when the connection ends, falls silent or the deadline passes."""
    buffer = bytearray(length)
    view, got = memoryview(buffer), 0
    while got < length:
        if deadline is not None:
            sock.settimeout(max(deadline - time.monotonic(), 0.001))
        count = sock.recv_into(view[got:])
        if count == 0:
            raise ConnectionResetError("the connection was closed")
        got += count
    return bytes(buffer)


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon or not port.isdigit() or int(port) > 65535:
        raise UserError(f"link: {text!r} is no address; write host:port")
    return host, int(port)
