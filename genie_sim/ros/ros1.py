"""The Genie's process in front of a ROS 1 node: ``python -m genie_sim.ros.ros1``, started by ``attach``.

The plan comes as the first line of standard input, which then stays open as long as ``attach`` lives. ``ready`` is
written to standard output when the node is connected. Types are taken from the wire, so no catkin workspace is needed.
"""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
from typing import Any

import rospy

from genie_sim.errors import UserError
from genie_sim.ros.gateway import LOCAL, REMOTE, NoLinks, View
from genie_sim.ros.message import Codec, RosMessage, WireType
from genie_sim.ros.plan import Plan, Recorder, make_gateway
from genie_sim.ros.poses import Poses
from genie_sim.ros.ros1_codec import codec_of

log = logging.getLogger(__name__)
BUFFER_BYTES = 2**24  # rospy's 64 kB would hold an old image back instead of dropping it
QUEUE_LENGTH = 10  # between a Genie and its own node; the node's own queue decides what is dropped
TICK_S = 0.1
CONNECT_S = 2.0  # how long the first message of a type that was unknown waits for its subscriber


class Ros1Genie:
    """Subscribes to what the Genie listens to, and publishes what it says, byte for byte where nothing changed."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._types = dict(plan.types)
        self._publishers: dict[str, tuple[WireType, Any, Any]] = {}
        self._sent: dict[str, int] = {}
        self._poses = Poses()
        self.failure: UserError | None = None
        self.ended = threading.Event()
        links = self._open_links()
        self._gateway = make_gateway(plan, self._publish, Recorder(plan.record), links, self._object_codec())
        self._links = links

    def start(self) -> None:
        """Publishers first, then subscribers, then the links; returns at once."""
        for topic in self._gateway.genie.publications():
            wire_type = self._types.get(topic.removesuffix(LOCAL).removesuffix(REMOTE))
            if wire_type is not None:
                self._publisher(topic, wire_type)
        self._subscribers = [self._subscribe(topic) for topic in self._gateway.genie.subscriptions()]
        if self._plan.pose_topic is not None:
            self._subscribers.append(
                rospy.Subscriber(self._plan.pose_topic, rospy.AnyMsg, self._on_pose, queue_size=QUEUE_LENGTH)
            )
        threading.Thread(target=self._tick, daemon=True).start()
        if not isinstance(self._links, NoLinks):
            self._links.start(self._on_link)

    def connected(self) -> bool:
        """Does the node hear its requests and are its answers heard?"""
        to_node = [topic + LOCAL for topic in self._plan.requests]
        heard = [self._publishers[topic][1].get_num_connections() for topic in to_node if topic in self._publishers]
        from_node = {topic + LOCAL for topic in self._plan.answers}
        listening = [sub.get_num_connections() for sub in self._subscribers if sub.resolved_name in from_node]
        return all(heard) and all(listening)

    def _open_links(self) -> Any:
        if not self._plan.listen and not self._plan.connect:
            return NoLinks()
        from genie_sim.ros.link import TcpLinks

        return TcpLinks(self._plan, codec_of)

    def _object_codec(self) -> Codec | None:
        known = [codec_of(self._types[topic]) for topic in self._plan.answers if topic in self._types]
        return next((codec for codec in known if codec.holds_objects), None)

    def _subscribe(self, topic: str) -> Any:
        return rospy.Subscriber(
            topic,
            rospy.AnyMsg,
            self._on_message,
            callback_args=topic,
            queue_size=QUEUE_LENGTH if topic.endswith((LOCAL, REMOTE)) else 1,
            buff_size=BUFFER_BYTES,
            tcp_nodelay=True,
        )

    def _on_message(self, raw: Any, topic: str) -> None:
        connection = raw._connection_header
        if connection["callerid"] == rospy.get_name():
            return  # our own words on a -remote topic
        try:
            wire_type = WireType(connection["type"], connection["md5sum"], connection.get("message_definition", ""))
            name = topic.removesuffix(LOCAL).removesuffix(REMOTE)
            self._types.setdefault(name, wire_type)
            codec = codec_of(self._types[name])
            message = RosMessage.of(raw._buff, codec, self._plan.name, answer=name in self._plan.answers)
            view = View(self._poses.at(message.header.stamp_ns), self._plan.horizontal_fov_rad)
            self._gateway.from_ros(topic, message, time.monotonic_ns(), connection["callerid"], view)
        except ValueError as error:
            log.warning("%s: dropped a message: %s", topic, error)
        except UserError as error:
            self._fail(error)

    def _on_link(self, peer: Any, topic: str, message: RosMessage) -> None:
        known = self._types.setdefault(topic.removesuffix(REMOTE), message.codec.type)
        if known.md5sum != message.codec.type.md5sum:
            log.warning("%s: dropped a %s of %s; here it is %s", topic, message.codec.type.name, peer.name, known.name)
            return
        try:
            self._gateway.from_link(peer, topic, message, time.monotonic_ns())
        except UserError as error:
            self._fail(error)

    def _on_pose(self, raw: Any) -> None:
        try:
            self._poses.heard(raw._connection_header["type"], raw._buff)
        except ValueError as error:
            log.warning("%s: dropped a pose: %s", self._plan.pose_topic, error)
        except UserError as error:
            self._fail(error)

    def _tick(self) -> None:
        while not self.ended.wait(TICK_S):
            self._gateway.on_timer(time.monotonic_ns())

    def _publish(self, topic: str, message: RosMessage) -> None:
        wire_type = message.codec.type
        known, publisher, message_class = self._publisher(topic, wire_type)
        if known.md5sum != wire_type.md5sum:
            return  # map objects for a topic that holds none
        seq = None
        if topic in self._plan.answers:  # numbered like the messages of any ROS 1 publisher
            seq = self._sent[topic] = self._sent.get(topic, 0) + 1
        raw = message_class()
        raw._buff = message.encoded(seq)
        publisher.publish(raw)

    def _publisher(self, topic: str, wire_type: WireType) -> tuple[WireType, Any, Any]:
        if topic not in self._publishers:
            fields = {"_type": wire_type.name, "_md5sum": wire_type.md5sum, "_full_text": wire_type.definition}
            message_class = type("Bytes", (rospy.AnyMsg,), {**fields, "__slots__": []})
            publisher = rospy.Publisher(topic, message_class, queue_size=QUEUE_LENGTH, tcp_nodelay=True)
            self._publishers[topic] = (wire_type, publisher, message_class)
            if topic not in self._plan.types and topic.endswith(LOCAL) and hasattr(self, "_subscribers"):
                self._wait_for_subscriber(publisher)
        return self._publishers[topic]

    def _wait_for_subscriber(self, publisher: Any) -> None:
        deadline = time.monotonic() + CONNECT_S
        while not publisher.get_num_connections() and time.monotonic() < deadline:
            time.sleep(0.01)

    def _fail(self, error: UserError) -> None:
        self.failure = error
        self.ended.set()


def main() -> int:
    """Runs until told to stop or until ``attach`` is gone. Exit status 1: a UserError, on standard error."""
    plan = Plan.from_json(sys.stdin.readline())
    rospy.init_node("genie_" + plan.node.strip("/").replace("/", "_"), disable_signals=True)
    _log_to_stderr()
    try:
        genie = Ros1Genie(plan)
    except UserError as error:
        return _say(error)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: genie.ended.set())
    genie.start()
    threading.Thread(target=_until_orphaned, args=(genie.ended,), daemon=True).start()
    while not genie.connected() and not genie.ended.wait(0.02):
        pass
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    genie.ended.wait()
    rospy.signal_shutdown("detached")
    return _say(genie.failure) if genie.failure is not None else 0


def _until_orphaned(ended: threading.Event) -> None:
    """The pipe from ``attach`` ends when ``attach`` does, however it dies; then the node gets its topics back."""
    sys.stdin.read()
    if not ended.is_set():
        from genie_sim.ros.attach import restore_orphan

        restore_orphan()
        ended.set()


def _log_to_stderr() -> None:
    """rospy has taken the root logger for its own files."""
    ours = logging.getLogger("genie_sim")
    ours.addHandler(logging.StreamHandler())
    ours.setLevel(logging.INFO)
    ours.propagate = False


def _say(error: UserError) -> int:
    sys.stderr.write(f"{error}\n")
    return 1


if __name__ == "__main__":
    sys.exit(main())
