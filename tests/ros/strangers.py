"""Strangers at a port of this machine: ``strangers.py PORT SECONDS [IDLE] [GARBAGE_PER_S]``, by default 400 and 200.

Idle ones sit there, and come back when they are sent away; the others throw random bytes and leave. Prints ``busy`` when
all are there, at the end how many connections each kind has made.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import sys
import time


def main() -> None:
    port, seconds = int(sys.argv[1]), float(sys.argv[2])
    idle, garbage_per_s = (int(sys.argv[i]) if len(sys.argv) > i else number for i, number in ((3, 400), (4, 200)))
    sitting: dict[int, socket.socket] = {}
    poll = select.poll()
    made = thrown = 0
    begun = time.monotonic()
    said = False
    while (now := time.monotonic() - begun) < seconds:
        for _ in range(min(idle - len(sitting), 20)):
            with contextlib.suppress(OSError):
                one = socket.create_connection(("127.0.0.1", port), timeout=2)
                sitting[one.fileno()] = one
                poll.register(one, select.POLLIN)
                made += 1
        if made >= idle and not said:
            said = True
            print("busy", flush=True)
        while thrown < now * garbage_per_s:
            thrown += 1
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=2) as one:
                one.sendall(os.urandom(500))
        for number, _ in poll.poll(5):
            poll.unregister(number)
            sitting.pop(number).close()
    print(made, thrown, flush=True)


if __name__ == "__main__":
    main()
