"""One end of a link in a process of its own: ``link_peer.py PLAN [PER_S]``, PLAN in JSON.

Prints ``ready``, ``up`` and ``down`` with the peer's name, and the second of each image that
arrives. With PER_S it sends so many images a second to everybody, numbered from 1.
"""

from __future__ import annotations

import logging
import sys
import time

from genie_sim_ros.links import Links
from genie_sim_ros.plan import AttachPlan
from tests.ros.test_links import CODECS, image

logging.basicConfig(level=logging.INFO, format="%(message)s")


def say(*words: object) -> None:
    # in one piece: two threads tell, and print() writes each word by itself
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


def main() -> None:
    links = Links(AttachPlan.from_json(sys.argv[1]), CODECS.get)
    links.start(lambda peer, topic, message: say("got", message.header.stamp_ns // 10**9))
    pause_s = 1 / float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
    say("ready")
    known: set[str] = set()
    second = 0
    while True:
        now = {peer.name for peer in links.peers()}
        for name in now - known:
            say("up", name)
        for name in known - now:
            say("down", name)
        known = now
        if pause_s and known:
            second += 1
            for name in known:
                links.send(name, "/image_raw_remote", image(second))
        time.sleep(pause_s or 0.02)


if __name__ == "__main__":
    main()
