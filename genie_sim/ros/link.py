"""TLS links between Genies: each side shows a certificate, and connections come back after cuts."""

import logging
import random
import re
import socket
import ssl
import threading
import time

from genie_sim.errors import UserError, as_user_error
from genie_sim.ros.certificates import NAME, Credentials, Refused, check, reason
from genie_sim.ros.connection import CodecOf, Connection, OnMessage
from genie_sim.ros.gateway import REMOTE, Peer
from genie_sim.ros.lobby import BACKLOG, HANDSHAKE_S, Lobby
from genie_sim.ros.message import RosMessage
from genie_sim.ros.plan import Plan

log = logging.getLogger(__name__)
RETRY_S = (0.2, 1.5)  # first and longest wait before dialling again
WARNINGS_PER_S = 20  # a stranger must not fill a disk


class TlsLinks:
    """All links of one Genie. Raises UserError for a key or an address that cannot be used."""

    def __init__(self, plan: Plan, codec_of: CodecOf) -> None:
        self._me = Peer(plan.name, plan.role)
        self._codec_of = codec_of
        self._requests = frozenset(topic + REMOTE for topic in plan.requests)
        self._connections: dict[str, Connection] = {}
        self._lock = threading.Lock()
        self._warn = _Warnings()
        self._closed = threading.Event()
        self._others = [_named_address(text) for text in plan.connect]
        self._lobby: Lobby | None = None
        if not plan.listen and not plan.connect:
            return  # a Genie on its own
        assert plan.key_file is not None
        self._credentials = Credentials(plan.key_file)
        if self._credentials.owner != self._me:
            name, role = self._credentials.owner
            raise UserError(
                f"{plan.key_file}: key: of {role} {name}; this Genie is {plan.role} {plan.name}"
            )
        if plan.listen is not None:
            with as_user_error(f"link: cannot listen on {plan.listen}", OSError):
                listener = socket.create_server(_address(plan.listen), backlog=BACKLOG)
            self._lobby = Lobby(listener, self._credentials.listening, self._serve, self._warn)

    def start(self, on_message: OnMessage) -> None:
        """From now on ``on_message`` is called, from several threads; what it raises is logged."""
        self._on_message = on_message
        if self._lobby is not None:
            self._lobby.start()
        for other in self._others:
            threading.Thread(target=self._keep_dialling, args=other, daemon=True).start()

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
        if self._lobby is not None:
            self._lobby.close()
        with self._lock:
            connections = list(self._connections.values())
        for connection in connections:
            connection.close()

    def _serve(self, sock: ssl.SSLSocket, where: str) -> None:
        try:
            self._hold(sock, None)
        except Exception as error:
            self._warn(f"link: refused {where}: {reason(error)}")

    def _keep_dialling(self, name: str, address: tuple[str, int]) -> None:
        wait_s, said = RETRY_S[0], ""
        while not self._closed.is_set():
            try:
                if name not in self._connections:  # the other one may have dialled us
                    self._hold(self._dialled(address), name)
                    wait_s, said = RETRY_S[0], ""
            except Exception as error:  # whatever it was: dial again
                if reason(error) != said:
                    said = reason(error)
                    self._warn(f"link: {name}@{address[0]}:{address[1]}: {said}")
            self._closed.wait(
                wait_s * random.uniform(0.5, 1.0)
            )  # so that two who dial each other do not meet for ever
            wait_s = min(2 * wait_s, RETRY_S[1])

    def _dialled(self, address: tuple[str, int]) -> ssl.SSLSocket:
        with socket.create_connection(
            address, timeout=HANDSHAKE_S
        ) as sock:  # TLS takes the socket over
            return self._credentials.dialling.wrap_socket(sock)

    def _hold(self, sock: ssl.SSLSocket, expected: str | None) -> None:
        """Serves a connection from its handshake to its end. Raises why it did not come about."""
        with sock:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection = Connection(sock, self._requests, self._warn)
            check(connection.peer, self._me, expected)
            try:
                connection.run(self._codec_of, self._on_message, self._up)
            except Exception as error:
                if not connection.up:
                    raise
                log.info("link: %s is cut: %s", connection.peer.name, reason(error))
            finally:
                with self._lock:
                    if self._connections.get(connection.peer.name) is connection:
                        del self._connections[connection.peer.name]

    def _up(self, connection: Connection) -> None:
        """A connection counts from its first frame on: a dialler is through before the listener has seen who it is.

        It takes the place of an older one of the same certificate. Raises Refused beside one of another certificate.
        """
        name, role = connection.peer
        with self._lock:
            older = self._connections.get(name)
            if older is not None and older.certificate != connection.certificate:
                raise Refused(f"{role} {name} is connected with another certificate")
            self._connections[name] = connection
        if older is not None:
            older.close()
        log.info("link: %s %s is connected", role, name)


class _Warnings:
    """Log lines, so many a second; the next one counts those that were left out."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._second, self._written, self._left_out = 0, 0, 0

    def __call__(self, text: str) -> None:
        with self._lock:
            second = int(time.monotonic())
            if second != self._second:
                self._second, self._written = second, 0
            if self._written >= WARNINGS_PER_S:
                self._left_out += 1
                return
            more = f" (and {self._left_out} more lines like this)" if self._left_out else ""
            self._written, self._left_out = self._written + 1, 0
        log.warning("%s%s", text, more)


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon or re.fullmatch("[0-9]{1,5}", port) is None or int(port) > 65535:
        raise UserError(f"link: {text!r} is no address; write host:port")
    return host, int(port)


def _named_address(text: str) -> tuple[str, tuple[str, int]]:
    """``edge1@192.168.0.7:7411``."""
    name, at, address = text.partition("@")
    if not at or not NAME.fullmatch(name):
        raise UserError(f"link: {text!r} does not say whom to connect to; write name@host:port")
    return name, _address(address)
