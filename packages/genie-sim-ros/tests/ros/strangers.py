"""Strangers at a port of this machine: ``strangers.py PORT SECONDS``.

400 sit there in silence, and up to 100 a second of them come back when they are sent away; 200 more
a second throw random bytes and leave. Prints ``busy`` when all have come, at the end how many
connections each kind has made.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time

IDLE, BACK_PER_S, GARBAGE_PER_S = 400, 100, 200


def main() -> None:
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    sitting: dict[int, socket.socket] = {}
    poll = select.poll()
    made = thrown = 0
    begun = time.monotonic()
    while (now := time.monotonic() - begun) < seconds:
        while len(sitting) < IDLE and made < IDLE + now * BACK_PER_S:
            with contextlib.suppress(OSError):
                one = socket.create_connection(("127.0.0.1", port), timeout=2)
                sitting[one.fileno()] = one
                poll.register(one, select.POLLIN)
            made += 1
            if made == IDLE:
                print("busy", flush=True)
        while thrown < now * GARBAGE_PER_S:
            thrown += 1
            with (
                contextlib.suppress(OSError),
                socket.create_connection(("127.0.0.1", port), timeout=2) as one,
            ):
                one.sendall(os.urandom(500))
        for number, _ in poll.poll(5):
            poll.unregister(number)
            sitting.pop(number).close()
    print(made, thrown, flush=True)


if __name__ == "__main__":
    main()
