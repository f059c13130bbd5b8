"""The Genie's process in front of a ROS 1 node: ``python -m genie_sim.ros.ros1``, started by ``attach``.

Types are taken from the wire, so no catkin workspace is needed.
"""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

import rospy

from genie_sim.errors import UserError
from genie_sim.ros.gateway import LOCAL, REMOTE, View
from genie_sim.ros.genie_process import GenieProcess, open_links, run
from genie_sim.ros.message import Codec, RosMessage, WireType
from genie_sim.ros.plan import Plan, Recorder, make_gateway
from genie_sim.ros.poses import Poses
from genie_sim.ros.ros1_codec import codec_of

log = logging.getLogger(__name__)
BUFFER_BYTES = 2**24  # rospy's 64 kB would hold an old image back instead of dropping it
QUEUE_LENGTH = 10  # between a Genie and its own node; the node's own queue decides what is dropped
CONNECT_S = 2.0  # how long the first message of a type that was unknown waits for its subscriber


class Ros1Genie(GenieProcess):
    """Subscribes to what the Genie listens to, and publishes what it says, byte for byte where nothing changed."""

    def __init__(self, plan: Plan) -> None:
        super().__init__()
        rospy.init_node("genie_" + plan.node.strip("/").replace("/", "_"), disable_signals=True)
        self._plan = plan
        self._types = dict(plan.types)
        self._publishers: dict[str, tuple[WireType, Any, Any]] = {}
        self._sent: dict[str, int] = {}
        self._poses = Poses()
        self._links = open_links(plan, codec_of)
        self._gateway = make_gateway(plan, self._publish, Recorder(plan.record), self._links, self._object_codec())

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
        threading.Thread(target=self.tick, args=(self._gateway,), daemon=True).start()
        self._links.start(self._on_link)

    def heard(self) -> bool:
        to_node = [topic + LOCAL for topic in self._plan.requests]
        return all(self._publishers[topic][1].get_num_connections() for topic in to_node if topic in self._publishers)

    def hears(self) -> bool:
        from_node = {topic + LOCAL for topic in self._plan.answers}
        return all(one.get_num_connections() for one in self._subscribers if one.resolved_name in from_node)

    def stop(self) -> None:
        rospy.signal_shutdown("detached")

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
            self.fail(error)

    def _on_link(self, peer: Any, topic: str, message: RosMessage) -> None:
        known = self._types.setdefault(topic.removesuffix(REMOTE), message.codec.type)
        if known.md5sum != message.codec.type.md5sum:
            log.warning("%s: dropped a %s of %s; here it is %s", topic, message.codec.type.name, peer.name, known.name)
            return
        try:
            self._gateway.from_link(peer, topic, message, time.monotonic_ns())
        except UserError as error:
            self.fail(error)

    def _on_pose(self, raw: Any) -> None:
        try:
            self._poses.heard(raw._connection_header["type"], raw._buff)
        except ValueError as error:
            log.warning("%s: dropped a pose: %s", self._plan.pose_topic, error)
        except UserError as error:
            self.fail(error)

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


if __name__ == "__main__":
    run(Ros1Genie)
