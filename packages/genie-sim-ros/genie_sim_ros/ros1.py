"""The Genie's process in front of a ROS 1 node: ``python -m genie_sim_ros.ros1``, started by
``attach``.

Types are taken from this network's publishers, so no catkin workspace is needed.
"""

import time
from typing import Any

import rospy

from genie_sim.base.errors import UserError
from genie_sim_ros.codec import Codec, WireType, codec_of
from genie_sim_ros.gateway import LOCAL, REMOTE, plain
from genie_sim_ros.genie_process import QUEUE_LENGTH, GenieProcess, run
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan

BUFFER_BYTES = 2**24  # rospy's 64 kB would hold an old image back instead of dropping it
CONNECT_S = 2.0  # how long the first message of a type that was unknown waits for its subscriber


class Ros1Genie(GenieProcess):
    """A Genie as a node of ROS 1. Messages keep their bytes where nothing has changed."""

    def __init__(self, plan: AttachPlan) -> None:
        rospy.init_node("genie_" + plan.node.strip("/").replace("/", "_"), disable_signals=True)
        self._publishers: dict[str, tuple[WireType, Any, Any]] = {}
        self._subscribers: list[Any] = []
        self._sent: dict[str, int] = {}
        super().__init__(plan, 1)

    def connect(self) -> None:
        for topic in self.gateway.genie.publications():
            codec = self.codecs.get(plain(topic))
            if codec is not None:
                self._publisher(topic, codec.type)
        for topic in self.gateway.genie.subscriptions():
            queue_length = QUEUE_LENGTH if topic.endswith((LOCAL, REMOTE)) else 1
            subscriber = rospy.Subscriber(
                topic,
                rospy.AnyMsg,
                callback=self._on_message,
                callback_args=topic,
                queue_size=queue_length,
                buff_size=BUFFER_BYTES,
                tcp_nodelay=True,
            )
            self._subscribers.append(subscriber)
        if self.plan.pose_topic is not None:
            self._pose_subscriber = rospy.Subscriber(
                self.plan.pose_topic, rospy.AnyMsg, self._on_pose, queue_size=10
            )

    def publish(self, topic: str, message: RosMessage) -> None:
        wire_type = message.codec.type
        topic_type, publisher, message_class = self._publisher(topic, wire_type)
        if topic_type.checksum != wire_type.checksum:
            return  # map objects for a topic that holds none
        seq = None
        if topic in self.plan.answers:  # numbered like the messages of any ROS 1 publisher
            seq = self._sent[topic] = self._sent.get(topic, 0) + 1
        raw = message_class()
        raw._buff = message.encoded(seq)
        publisher.publish(raw)

    def requests_have_subscriber(self) -> bool:
        to_node = [topic + LOCAL for topic in self.plan.requests]
        return all(
            self._publishers[topic][1].get_num_connections()
            for topic in to_node
            if topic in self._publishers
        )

    def answers_have_publisher(self) -> bool:
        from_node = {topic + LOCAL for topic in self.plan.answers}
        return all(
            subscriber.get_num_connections()
            for subscriber in self._subscribers
            if subscriber.resolved_name in from_node
        )

    def stop(self) -> None:
        rospy.signal_shutdown("detached")

    def _on_message(self, raw: Any, topic: str) -> None:
        connection = raw._connection_header
        if connection["callerid"] == rospy.get_name():
            return  # the Genie's own message on a _remote topic
        try:
            codec = self._codec(plain(topic), connection)
        except UserError as error:
            self.fail(error)
        else:
            self.from_ros(topic, raw._buff, codec, connection["callerid"])

    def _on_pose(self, raw: Any) -> None:
        self.from_pose_topic(raw._connection_header["type"], raw._buff)

    def _codec(self, name: str, connection: dict[str, str]) -> Codec:
        if name not in self.codecs:
            wire_type = WireType(
                name=connection["type"],
                checksum=connection["md5sum"],
                definition=connection.get("message_definition", ""),
            )
            self.codecs[name] = codec_of(wire_type, 1)
        return self.codecs[name]

    def _publisher(self, topic: str, wire_type: WireType) -> tuple[WireType, Any, Any]:
        """The type, the publisher and the message class of a topic, made at its first use."""
        if topic not in self._publishers:
            fields = {
                "_type": wire_type.name,
                "_md5sum": wire_type.checksum,
                "_full_text": wire_type.definition,
            }
            message_class = type("Bytes", (rospy.AnyMsg,), {**fields, "__slots__": []})
            publisher = rospy.Publisher(
                topic, message_class, queue_size=QUEUE_LENGTH, tcp_nodelay=True
            )
            self._publishers[topic] = (wire_type, publisher, message_class)
            deadline = time.monotonic() + CONNECT_S
            if plain(topic) not in self.plan.types and topic.endswith(LOCAL) and self._subscribers:
                while not publisher.get_num_connections() and time.monotonic() < deadline:
                    time.sleep(0.01)
        return self._publishers[topic]


if __name__ == "__main__":
    run(Ros1Genie)
