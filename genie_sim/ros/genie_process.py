"""What the Genie's processes of ROS 1 and ROS 2 have in common: how they begin, how they end, and their links."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from genie_sim.errors import UserError
from genie_sim.ros.gateway import Gateway, NoLinks
from genie_sim.ros.message import Codec, WireType
from genie_sim.ros.plan import Plan

TICK_S = 0.1
POLL_S = 0.02
FIRST_WORD_S = 5.0  # some nodes announce a topic when they first publish on it; those are not waited for any longer


class GenieProcess:
    """A Genie that runs until ``ended`` is set; ``failure`` says why, if it did not end as asked."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.failure: UserError | None = None

    def start(self) -> None:
        """Makes everything that listens and speaks; returns at once."""
        raise NotImplementedError

    def heard(self) -> bool:
        """Does the node hear the requests?"""
        raise NotImplementedError

    def hears(self) -> bool:
        """Are the node's answers heard?"""
        raise NotImplementedError

    def stop(self) -> None:
        """Takes leave of ROS."""
        raise NotImplementedError

    def fail(self, error: UserError) -> None:
        self.failure = error
        self.ended.set()

    def tick(self, gateway: Gateway) -> None:
        """A thread that lets requests expire."""
        while not self.ended.wait(TICK_S):
            gateway.on_timer(time.monotonic_ns())


def open_links(plan: Plan, codec_of: Callable[[WireType], Codec]) -> Any:
    """The links of a plan. Raises UserError for a key or an address that cannot be used."""
    if not plan.listen and not plan.connect:
        return NoLinks()
    from genie_sim.ros.link import TcpLinks

    return TcpLinks(plan, codec_of)


def run(make: Callable[[Plan], GenieProcess]) -> None:
    """The main program. The plan is the first line of standard input, which stays open as long as ``attach`` lives.

    Writes ``ready`` when the node is connected. Exits with status 1 and a line on standard error for a UserError.
    """
    plan = Plan.from_json(sys.stdin.readline())
    try:
        genie = make(plan)
    except UserError as error:
        sys.exit(str(error))
    _log_to_stderr()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: genie.ended.set())
    genie.start()
    threading.Thread(target=_until_orphaned, args=(genie.ended,), daemon=True).start()
    while not genie.heard() and not genie.ended.wait(POLL_S):
        pass
    deadline = time.monotonic() + FIRST_WORD_S
    while not genie.hears() and time.monotonic() < deadline and not genie.ended.wait(POLL_S):
        pass
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    genie.ended.wait()
    genie.stop()
    sys.exit(str(genie.failure) if genie.failure is not None else 0)


def _until_orphaned(ended: threading.Event) -> None:
    """The pipe from ``attach`` ends when ``attach`` does, however it dies; then the node gets its topics back."""
    sys.stdin.read()
    if not ended.is_set():
        from genie_sim.ros.attach import restore_orphan

        restore_orphan()
        ended.set()


def _log_to_stderr() -> None:
    """rospy takes the root logger for its own files."""
    ours = logging.getLogger("genie_sim")
    ours.addHandler(logging.StreamHandler())
    ours.setLevel(logging.INFO)
    ours.propagate = False
