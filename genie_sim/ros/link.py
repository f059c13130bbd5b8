"""TLS links between Genies: each side shows a certificate, and connections come back after cuts.

One thread runs an event loop with all connections, another one hands over the messages that have
come: whoever receives them may take its time, while the links stay alive.
"""

import asyncio
import contextlib
import logging
import random
import re
import socket
import ssl
import threading
import time
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any

from genie_sim.errors import UserError, as_user_error
from genie_sim.ros.certificates import (
    NAME,
    Certificate,
    Credentials,
    Refused,
    RevocationList,
    check,
    reason,
)
from genie_sim.ros.connection import HANDSHAKE_S, Connection
from genie_sim.ros.frames import CodecOf, decode
from genie_sim.ros.gateway import REMOTE, Peer
from genie_sim.ros.listener import BACKLOG, HandshakeLimiter, accept_all
from genie_sim.ros.message import RosMessage
from genie_sim.ros.plan import AttachPlan

log = logging.getLogger(__name__)
RETRY_S = (0.2, 1.5)  # first and longest wait before dialling again
STABLE_S = 5.0  # a connection that was up for so long: the next one is dialled without delay
REFUSED_S = 10.0  # wait of a Genie that was refused
# so long before a certificate ends a dialler looks for a newer one, and how often
RENEW_S, RENEW_EVERY_S = 600.0, 60.0
TICK_S = 0.1  # between two looks at the connections' deadlines
FILES_S = 0.5  # between two looks at the key file and the list of revoked certificates
WARNINGS_PER_S = 20  # a stranger must not fill a disk
CLOSE_S = 2.0

OnMessage = Callable[[Peer, str, RosMessage], None]


class TlsLinks:
    """All links of one Genie. Raises UserError for a key, a list or an address that cannot be used.

    Only the event loop's thread changes what the links hold.
    """

    def __init__(self, plan: AttachPlan, codec_of: CodecOf) -> None:
        self._own = Peer(plan.name, plan.role)
        self._codec_of = codec_of
        self._requests = frozenset(topic + REMOTE for topic in plan.requests)
        self._connections: dict[str, Connection] = {}  # those that are up, by the peer's name
        self._lock = threading.Lock()  # of _connections, which other threads read
        self._open: set[Connection] = set()  # all whose socket is open
        self._limiter = HandshakeLimiter()
        self._warnings = LimitedLog()
        self._addresses = [_named_address(text) for text in plan.connect]
        self._listener: socket.socket | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop, self._renewed = asyncio.Event(), asyncio.Event()
        self._received: SimpleQueue[tuple[Connection, bytearray] | None] = SimpleQueue()
        if not plan.listen and not plan.connect:
            return  # a Genie on its own
        assert plan.key_file is not None
        self._credentials = Credentials(plan.key_file)
        self._revoked = RevocationList(plan.revoked_file)
        self._check_owner(self._credentials)
        if plan.listen is not None:
            with as_user_error(f"link: cannot listen on {plan.listen}", OSError):
                self._listener = socket.create_server(_address(plan.listen), backlog=BACKLOG)
                self._listener.setblocking(False)

    def start(self, on_message: OnMessage) -> None:
        """From now on ``on_message`` is called, from a thread; what it raises is logged."""
        if self._listener is None and not self._addresses:
            return
        self._on_message = on_message
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=(self._loop,), daemon=True)
        self._thread.start()
        threading.Thread(target=self._hand_over, daemon=True).start()

    def peers(self) -> list[Peer]:
        """The Genies that are connected now."""
        with self._lock:
            return [connection.peer for connection in self._connections.values()]

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        """Sends without waiting; drops the message if the peer is not connected."""
        with self._lock:
            connection = self._connections.get(peer)
        if connection is not None:
            self._call(connection.send, topic, message)

    def close(self) -> None:
        """Ends all links. The address is free when this returns."""
        if self._loop is not None:
            self._received.put(None)
            self._call(self._stop.set)
            self._thread.join(CLOSE_S)
        elif self._listener is not None:
            self._listener.close()

    # What the connections call

    def admit(self, connection: Connection) -> None:
        """Checks who the other side is. Raises Refused for one that is not welcome."""
        assert connection.certificate is not None
        check(connection.peer, self._own, connection.expected)
        self._check_certificate(connection.certificate)
        self._limiter.identify(connection.certificate)

    def take_up(self, connection: Connection) -> None:
        """Lets a connection count. It takes the place of an older one. Raises Refused."""
        assert connection.certificate is not None
        self._check_certificate(connection.certificate)
        name, role = connection.peer
        older = self._connections.get(name)
        with self._lock:
            self._connections[name] = connection
        self._limiter.leave(connection)
        log.info("link: %s %s is connected", role, name)
        # a dialler leaves it to the listener to end the older one, once it has seen the new one
        if older is not None and connection.expected is None:
            older.end(ConnectionAbortedError("replaced"))

    def deliver(self, connection: Connection, frame: bytearray) -> None:
        """Hands a message over, in the other thread."""
        self._received.put((connection, frame))

    def ended(self, connection: Connection, error: Exception) -> None:
        """Forgets a connection that counted, or says why it never did."""
        if connection.up:
            log.info("link: %s is cut: %s", connection.peer.name, reason(error))
            with self._lock:
                if self._connections.get(connection.peer.name) is connection:
                    del self._connections[connection.peer.name]
        elif connection.expected is None:
            self.warn(f"link: refused {connection.where}: {reason(error)}")

    def closed(self, connection: Connection) -> None:
        """Forgets a connection whose socket is closed."""
        self._limiter.leave(connection)
        self._open.discard(connection)

    def warn(self, text: str) -> None:
        """Writes a line of the log, if there are not too many."""
        self._warnings.write(text)

    # The threads

    def _run(self, loop: asyncio.AbstractEventLoop) -> None:
        """Serves all connections until ``close``."""
        loop.set_exception_handler(lambda _, context: self.warn(f"link: {context['message']}"))
        loop.run_until_complete(self._serve())
        loop.close()

    async def _serve(self) -> None:
        tasks = [asyncio.create_task(self._watch())]
        if self._listener is not None:
            accept = accept_all(self._listener, self._accepted, self._refuse_one)
            tasks.append(asyncio.create_task(accept))
        for name, address in self._addresses:
            tasks.append(asyncio.create_task(self._keep_dialling(name, address)))
        await self._stop.wait()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if self._listener is not None:
            self._listener.close()
        for connection in list(self._open):
            connection.end(ConnectionAbortedError("this Genie ends"))
            connection.abort()
        await asyncio.sleep(0)  # the sockets are closed

    def _hand_over(self) -> None:
        """Reads messages and gives them to the receiver, one after the other."""
        while (entry := self._received.get()) is not None:
            connection, frame = entry
            try:
                topic, message = decode(frame, self._codec_of)
                self._on_message(connection.peer, topic, message)
            except Exception as error:  # a peer's message must not end anything here
                self.warn(f"link: dropped a message of {connection.peer.name}: {error}")
            self._call(connection.delivered)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Has the event loop's thread call a function, unless the loop has ended."""
        assert self._loop is not None
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function, *arguments)

    # In the event loop

    def _new_connection(self, where: str, expected: str | None = None) -> Connection:
        connection = Connection(
            self._credentials,
            links=self,
            requests=self._requests,
            where=where,
            expected=expected,
        )
        self._open.add(connection)
        return connection

    def _accepted(self, host: str, port: int) -> Connection:
        connection = self._new_connection(f"{host}:{port}")
        self._limiter.enter(connection, host)
        return connection

    def _refuse_one(self, error: Exception) -> None:
        self.warn(f"link: cannot accept: {reason(error)}")
        self._limiter.make_room()

    async def _keep_dialling(self, name: str, address: tuple[str, int]) -> None:
        """Dials whenever the peer is not connected, or a newer certificate is to be shown."""
        where = f"{name}@{address[0]}:{address[1]}"
        wait_s, complaint = RETRY_S[0], ""
        while True:
            try:
                begun_s = time.monotonic()
                if name not in self._connections or self._is_outdated(self._connections[name]):
                    await self._dial(name, address, where)
                complaint = ""
                await self._until_cut(name)
                is_stable = time.monotonic() > begun_s + STABLE_S
                wait_s = RETRY_S[0] if is_stable else RETRY_S[1]
            except Exception as error:  # whatever it was: dial again
                if reason(error) != complaint:
                    complaint = reason(error)
                    self.warn(f"link: {where}: {complaint}")
                wait_s = REFUSED_S if is_refusal(error) else min(2 * wait_s, RETRY_S[1])
            # so that two who dial each other do not meet for ever
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._renewed.wait(), wait_s * random.uniform(0.5, 1.0))

    async def _dial(self, name: str, address: tuple[str, int], where: str) -> None:
        """Returns when the connection is up. Raises why it did not come about."""
        loop = asyncio.get_running_loop()
        with_name = partial(self._new_connection, where, name)
        try:
            async with asyncio.timeout(HANDSHAKE_S):
                _, connection = await loop.create_connection(with_name, *address)
        except TimeoutError as error:
            raise TimeoutError("timed out") from error
        await connection.opened
        if connection.error is not None:
            raise connection.error

    async def _until_cut(self, name: str) -> None:
        """Returns when the peer is not connected, or has to be dialled again all the same."""
        while name in self._connections and not self._is_outdated(self._connections[name]):
            await asyncio.sleep(RETRY_S[0])

    def _is_outdated(self, connection: Connection) -> bool:
        """Should a new connection take over, because there is, or may be, a newer certificate?"""
        assert connection.certificate is not None
        ends_soon = connection.certificate.ends_s - time.time() < RENEW_S
        is_old = time.monotonic() - connection.made_s > RENEW_EVERY_S
        return connection.credentials is not self._credentials or (ends_soon and is_old)

    async def _watch(self) -> None:
        """Looks after deadlines and files."""
        next_look_s = 0.0
        while True:
            try:
                now_s = time.monotonic()
                for connection in list(self._open):
                    connection.check(now_s)
                if now_s > next_look_s:
                    next_look_s = now_s + FILES_S
                    self._read_files()
            except Exception as error:
                self.warn(f"link: {reason(error)}")
            await asyncio.sleep(TICK_S)

    def _read_files(self) -> None:
        """Takes a renewed key, and ends connections whose certificates have been revoked."""
        try:
            if (renewed := self._credentials.renewed()) is not None:
                self._check_owner(renewed)
                self._credentials = renewed
                log.info("link: a new key counts from now on")
                self._renewed.set()
                self._renewed.clear()
        except UserError as error:
            self.warn(f"link: {error}; the key that was read before still counts")
        try:
            self._revoked.reload()
        except UserError as error:
            self.warn(f"link: {error}; the list that was read before still counts")
        for connection in list(self._open):
            if connection.certificate is not None and connection.certificate in self._revoked:
                connection.end(Refused(f"the certificate of {connection.peer.name} is revoked"))

    def _check_owner(self, credentials: Credentials) -> None:
        if credentials.owner != self._own:
            name, role = credentials.owner
            raise UserError(
                f"{credentials.path}: key: of {role} {name}; "
                f"this Genie is {self._own.role} {self._own.name}"
            )

    def _check_certificate(self, certificate: Certificate) -> None:
        """Raises Refused for one that is revoked, or was not issued later than another one of this
        name that is connected.
        """
        name, role = certificate.owner
        if certificate in self._revoked:
            raise Refused(f"the certificate of {name} is revoked")
        present = self._connections.get(name)
        if (
            present is not None
            and present.certificate is not None
            and present.certificate != certificate
            and present.certificate.issued_s >= certificate.issued_s
        ):
            raise Refused(f"{role} {name} is connected with another certificate")


class LimitedLog:
    """Log lines, so many a second; the next one counts those that were left out."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._second, self._written, self._left_out = 0, 0, 0

    def write(self, text: str) -> None:
        """Logs a warning, or only counts it."""
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


def is_refusal(error: Exception) -> bool:
    """Is it pointless to dial again at once? One side does not accept the other's certificate."""
    about_certificate = any(words in reason(error) for words in ("certificate", "unknown ca"))
    return isinstance(error, Refused) or (isinstance(error, ssl.SSLError) and about_certificate)


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
