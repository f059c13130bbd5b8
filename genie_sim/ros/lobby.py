"""Where connections wait until they have proved who they are: one thread, however many strangers there are."""

import select
import socket
import ssl
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from genie_sim.ros.certificates import reason

STRANGERS, STRANGERS_OF_ONE_HOST = (
    64,
    16,
)  # at a time; the oldest that is silent makes room, else the oldest
HANDSHAKE_S = 2.0
BACKLOG = 1024
AT_ONCE = (
    8  # connections accepted before those that wait are heard: fewer than may wait from one host
)
STEP_S = 0.1
FULL_S = 0.02  # pause where the machine has no descriptor left


@dataclass
class Stranger:
    """A connection in its handshake. ``spoke``: has it said anything?"""

    sock: ssl.SSLSocket
    address: tuple[str, int]
    until: float
    spoke: bool = False


class Lobby:
    """Accepts at ``listener``. ``admit`` gets, in a thread of its own, whoever has shown a certificate, ``warn`` a line
    for everybody else."""

    def __init__(
        self, listener: socket.socket, context: ssl.SSLContext, admit: Callable[[ssl.SSLSocket, str], None],
        warn: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._listener, self._context, self._admit, self._warn = listener, context, admit, warn
        self._strangers: dict[int, Stranger] = {}  # by descriptor, the oldest first
        self._poll = select.poll()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        listener.setblocking(False)
        self._poll.register(listener, select.POLLIN)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """The address is free when this returns, so that another Genie can listen there at once."""
        self._closed.set()
        self._thread.join(FULL_S + 2 * STEP_S)

    def _run(self) -> None:
        while not self._closed.is_set():
            try:
                self._step()
            except (
                Exception
            ) as error:  # no descriptor, no thread, no memory: nothing may end this loop
                self._warn(f"link: cannot accept: {reason(error)}")
                if self._strangers:
                    self._refuse(next(iter(self._strangers.values())), "there is no room")
                self._closed.wait(FULL_S)
        for stranger in self._strangers.values():
            stranger.sock.close()
        self._listener.close()

    def _step(self) -> None:
        for number, _ in self._poll.poll(STEP_S * 1000):
            if number in self._strangers:
                self._go_on(self._strangers[number])
        while self._strangers:
            oldest = next(iter(self._strangers.values()))
            if time.monotonic() < oldest.until:
                break
            self._refuse(oldest, f"no certificate within {HANDSHAKE_S:.0f} s")
        for _ in range(AT_ONCE):
            try:
                sock, (host, port, *_) = self._listener.accept()
            except (BlockingIOError, ConnectionAbortedError):
                return
            self._enter(sock, (host, port))

    def _enter(self, sock: socket.socket, address: tuple[str, int]) -> None:
        try:
            sock.setblocking(False)
            secure = self._context.wrap_socket(
                sock, server_side=True, do_handshake_on_connect=False
            )
        except OSError as error:  # it has gone already
            sock.close()
            self._warn(f"link: refused {address[0]}:{address[1]}: {reason(error)}")
            return
        everybody = list(self._strangers.values())
        same = [one for one in everybody if one.address[0] == address[0]]
        for some, limit in ((same, STRANGERS_OF_ONE_HOST), (everybody, STRANGERS)):
            if len(some) >= limit:
                self._refuse(min(some, key=lambda one: one.spoke), "others have come since")
                break
        self._strangers[secure.fileno()] = Stranger(secure, address, time.monotonic() + HANDSHAKE_S)
        self._poll.register(secure, select.POLLIN)

    def _go_on(self, stranger: Stranger) -> None:
        stranger.spoke = True
        try:
            stranger.sock.do_handshake()
        except ssl.SSLWantReadError:
            self._poll.modify(stranger.sock, select.POLLIN)
        except ssl.SSLWantWriteError:
            self._poll.modify(stranger.sock, select.POLLOUT)
        except OSError as error:
            self._refuse(stranger, reason(error))
        else:
            self._forget(stranger)
            admitted = stranger.sock, f"{stranger.address[0]}:{stranger.address[1]}"
            threading.Thread(target=self._admit, args=admitted, daemon=True).start()

    def _refuse(self, stranger: Stranger, why: str) -> None:
        self._forget(stranger)
        stranger.sock.close()
        self._warn(f"link: refused {stranger.address[0]}:{stranger.address[1]}: {why}")

    def _forget(self, stranger: Stranger) -> None:
        del self._strangers[stranger.sock.fileno()]
        self._poll.unregister(stranger.sock)
