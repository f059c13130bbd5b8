"""What the Genie's processes of ROS 1 and ROS 2 share: how they begin, serve messages, and end."""

import logging
import signal
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from genie_sim.base.errors import UserError
from genie_sim.base.text import one_line
from genie_sim_ros.codec import Codec, codec_of
from genie_sim_ros.gateway import plain
from genie_sim_ros.links import Links
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan, Recorder, make_gateway
from genie_sim_ros.poses import Poses

log = logging.getLogger(__name__)
QUEUE_LENGTH = 10  # between a Genie and its own node; the node's own queue decides what is dropped
TICK_S = 0.1
POLL_S = 0.02
# some nodes announce a topic when they first publish on it; those are not waited for any longer
ANNOUNCED_S = 5.0


class GenieProcess(ABC):
    """A Genie that runs until ``ended`` is set. ``failure`` says why, unless it was stopped."""

    def __init__(self, plan: AttachPlan, ros: int) -> None:
        self.ended = threading.Event()
        self.failure: UserError | None = None
        self.plan = plan
        self.codecs: dict[str, Codec] = {
            topic: codec_of(kind, ros) for topic, kind in plan.types.items()
        }
        self._poses = None if plan.pose_topic is None else Poses(ros)
        self.links = Links(plan, self.codecs.get)
        answer_codecs = [self.codecs[topic] for topic in plan.answers if topic in self.codecs]
        self.gateway = make_gateway(
            plan,
            publish=self.publish,
            observe=Recorder(plan.record),
            links=self.links,
            object_codec=next((codec for codec in answer_codecs if codec.holds_objects), None),
        )

    def start(self) -> None:
        """Publishers first, then subscribers, then the links; returns at once."""
        self.connect()
        threading.Thread(target=self._tick, daemon=True).start()
        from_link = self.gateway.from_link
        self.links.start(
            lambda peer, topic, message: from_link(peer, topic, message, time.monotonic_ns())
        )

    @abstractmethod
    def connect(self) -> None:
        """Makes all publishers and subscribers; returns at once."""

    @abstractmethod
    def publish(self, topic: str, message: RosMessage) -> None:
        """Publishes a message, unless the topic's type is another one."""

    @abstractmethod
    def requests_have_subscriber(self) -> bool:
        """Does the node get the requests?"""

    @abstractmethod
    def answers_have_publisher(self) -> bool:
        """Does the Genie get the node's answers?"""

    @abstractmethod
    def stop(self) -> None:
        """Ends the node in ROS."""

    def from_ros(self, topic: str, payload: bytes, codec: Codec, sender: str) -> None:
        """A message of the own network. One that cannot be read is dropped: whatever is wrong with
        it, the middleware's thread, which calls this, goes on.
        """
        with self._dropping(f"{topic}: dropped a message"):
            is_answer = plain(topic) in self.plan.answers
            message = RosMessage.of(payload, codec, self.plan.name, is_answer)
            if self._poses is not None and not is_answer:
                message = replace(
                    message,
                    pose=self._poses.at(message.header.stamp_ns),
                    horizontal_fov_rad=self.plan.horizontal_fov_rad,
                )
            self.gateway.from_ros(topic, message, time.monotonic_ns(), sender)

    def from_pose_topic(self, type_name: str, payload: bytes) -> None:
        """A message of the pose topic. One that cannot be read is dropped."""
        with self._dropping(f"{self.plan.pose_topic}: dropped a pose"):
            assert self._poses is not None
            self._poses.receive(type_name, payload)

    @contextmanager
    def _dropping(self, what: str) -> Iterator[None]:
        """Logs what goes wrong within it; a UserError ends the process."""
        try:
            yield
        except UserError as error:
            self.fail(error)
        except Exception as error:
            log.warning("%s: %s", what, str(error) or type(error).__name__)

    def fail(self, error: UserError) -> None:
        """Ends the process; ``attach`` says why."""
        self.failure = error
        self.ended.set()

    def _tick(self) -> None:
        while not self.ended.wait(TICK_S):
            with self._dropping("timer"):
                self.gateway.on_timer(time.monotonic_ns())


def run(make: Callable[[AttachPlan], GenieProcess]) -> None:
    """The main program. The plan is the first line of standard input, which stays open as long as
    ``attach`` lives.

    Writes ``ready`` when the node is connected. Exits with status 1 and a line on standard error
    for a UserError.
    """
    plan = AttachPlan.from_json(sys.stdin.readline())
    try:
        genie = make(plan)
    except UserError as error:
        sys.exit(str(error))
    _log_to_stderr()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: genie.ended.set())
    try:
        _serve(genie)
    finally:
        genie.links.close()  # or its threads would keep the process
    sys.exit(str(genie.failure) if genie.failure is not None else 0)


def _serve(genie: GenieProcess) -> None:
    """Returns when the Genie has ended in ROS."""
    genie.start()
    threading.Thread(target=_until_orphaned, args=(genie.ended,), daemon=True).start()
    while not genie.requests_have_subscriber() and not genie.ended.wait(POLL_S):
        pass
    deadline = time.monotonic() + ANNOUNCED_S
    while not genie.answers_have_publisher() and time.monotonic() < deadline:
        if genie.ended.wait(POLL_S):
            break
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    genie.ended.wait()
    genie.stop()


def _until_orphaned(ended: threading.Event) -> None:
    """The pipe from ``attach`` ends when ``attach`` does, however it dies; then the node gets its
    topics back.
    """
    sys.stdin.read()
    if not ended.is_set():
        from genie_sim_ros.attach import restore_orphan

        restore_orphan()
        ended.set()


class OneLine(logging.Formatter):
    """A message in one line, whatever it quotes."""

    def format(self, record: logging.LogRecord) -> str:
        return one_line(super().format(record))


def _log_to_stderr() -> None:
    """rospy takes the root logger for its own files."""
    logger, handler = logging.getLogger(__package__), logging.StreamHandler()
    handler.setFormatter(OneLine())
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
