"""Accepts connections, and bounds how many of them may be there before they count."""

import asyncio
import socket
from collections.abc import Callable
from functools import partial

from genie_sim.ros.certificates import Certificate
from genie_sim.ros.connection import Connection

# connections that are not up, at a time; the oldest that is silent makes room, else the oldest
MAX_PENDING, MAX_PENDING_OF_ONE_HOST = 64, 16
MAX_PENDING_OF_ONE_CERTIFICATE = 2
BACKLOG = 1024
# connections accepted before those that wait are heard: fewer than may wait from one host
AT_ONCE = 8
FULL_S = 0.02  # pause where the machine has no descriptor left


class HandshakeLimiter:
    """The connections that are not up yet, the oldest first. One that is too many ends the oldest.

    Whoever is in its handshake is a stranger, and whoever is through with it may still open many
    connections, so both are bounded.
    """

    def __init__(self) -> None:
        self.pending: dict[Connection, str] = {}  # with the host that each comes from

    def enter(self, connection: Connection, host: str) -> None:
        """A connection was accepted."""
        same_host = [other for other, its_host in self.pending.items() if its_host == host]
        if len(same_host) >= MAX_PENDING_OF_ONE_HOST:
            self._end_oldest(same_host)
        elif len(self.pending) >= MAX_PENDING:
            self._end_oldest(list(self.pending))
        self.pending[connection] = host

    def identify(self, certificate: Certificate) -> None:
        """A connection has shown its certificate."""
        same = [other for other in self.pending if other.certificate == certificate]
        if len(same) > MAX_PENDING_OF_ONE_CERTIFICATE:
            self._end_oldest(same)

    def leave(self, connection: Connection) -> None:
        """A connection is up, or over."""
        self.pending.pop(connection, None)

    def make_room(self) -> None:
        """Ends a connection, if there is one: the machine has no descriptor left."""
        if self.pending:
            self._end_oldest(list(self.pending))

    def _end_oldest(self, connections: list[Connection]) -> None:
        oldest = min(connections, key=lambda connection: connection.has_spoken)
        oldest.end(ConnectionAbortedError("others have come since"))
        oldest.abort()
        self.leave(oldest)


async def accept_all(
    listener: socket.socket,
    new_connection: Callable[[str, int], Connection],
    refuse_one: Callable[[Exception], None],
) -> None:
    """Accepts connections until it is cancelled.

    Parameters
    ----------
    listener : socket.socket
        Listens, without blocking.
    new_connection : callable
        Makes a connection from the other side's host and port.
    refuse_one : callable
        Makes room where the machine has no descriptor or memory left.
    """
    loop = asyncio.get_running_loop()
    while True:
        try:
            for _ in range(AT_ONCE):
                accepted, (host, port, *_) = await loop.sock_accept(listener)
                await loop.connect_accepted_socket(partial(new_connection, host, port), accepted)
            await asyncio.sleep(0)
        except Exception as error:  # nothing may end this loop
            refuse_one(error)
            await asyncio.sleep(FULL_S)
