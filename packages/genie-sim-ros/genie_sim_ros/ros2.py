"""The Genie's process in front of a ROS 2 node: ``python -m genie_sim_ros.ros2``, started by
``attach``.

The same plan, gateway and links as in ROS 1. Messages stay serialised from subscription to
publication. Genies speak to each other over links only: in ROS 2 a node cannot tell its own
messages on a ``_remote`` topic from another node's.
"""

import threading
from functools import partial
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from genie_sim.base.errors import UserError
from genie_sim_ros.gateway import LOCAL, plain
from genie_sim_ros.genie_process import QUEUE_LENGTH, GenieProcess, run
from genie_sim_ros.message import RosMessage
from genie_sim_ros.plan import AttachPlan
from genie_sim_ros.ros2_graph import has_header
from genie_sim_ros.typestore import class_of

POSE = "geometry_msgs/msg/PoseStamped"


class Ros2Genie(GenieProcess):
    """A Genie as a node of ROS 2. One thread serves all subscriptions."""

    def __init__(self, plan: AttachPlan) -> None:
        for wire_type in plan.types.values():
            if not has_header(wire_type.name):
                raise UserError(
                    f"{wire_type.name}: messages of this type have no header to find an answer by"
                )
        super().__init__(plan, 2)
        self._publishers: dict[str, Any] = {}
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node(
            "genie_" + plan.node.strip("/").replace("/", "_"), context=self._context
        )

    def connect(self) -> None:
        local_requests = [topic + LOCAL for topic in self.plan.requests]
        local_answers = [topic + LOCAL for topic in self.plan.answers]
        for topic in (*local_requests, *self.plan.answers):
            self._publishers[topic] = self._node.create_publisher(
                self._class(topic), topic, self._quality(topic)
            )
        for topic in (*self.plan.requests, *local_answers):
            self._node.create_subscription(
                self._class(topic),
                topic,
                partial(self._on_message, topic),
                self._quality(topic),
                raw=True,
            )
        if self.plan.pose_topic is not None:
            on_pose = partial(self.from_pose_topic, POSE)
            self._node.create_subscription(
                class_of(POSE), self.plan.pose_topic, on_pose, QUEUE_LENGTH, raw=True
            )
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        threading.Thread(target=executor.spin, daemon=True).start()

    def publish(self, topic: str, message: RosMessage) -> None:
        publisher = self._publishers.get(topic)
        if publisher is None:
            return  # a _remote topic
        if self.codecs[plain(topic)].type.name != message.codec.type.name:
            return  # map objects for a topic that holds none
        publisher.publish(message.encoded())

    def requests_have_subscriber(self) -> bool:
        return all(
            self._publishers[topic + LOCAL].get_subscription_count() for topic in self.plan.requests
        )

    def answers_have_publisher(self) -> bool:
        return all(self._node.count_publishers(topic + LOCAL) for topic in self.plan.answers)

    def stop(self) -> None:
        rclpy.shutdown(context=self._context)

    def _on_message(self, topic: str, payload: bytes) -> None:
        self.from_ros(topic, payload, self.codecs[plain(topic)], "")

    def _class(self, topic: str) -> Any:
        return class_of(self.codecs[plain(topic)].type.name)

    def _quality(self, topic: str) -> QoSProfile:
        """Reliable, unless a publisher of the topic offers less: its messages would not come at
        all.
        """
        profiles = [
            publisher.qos_profile for publisher in self._node.get_publishers_info_by_topic(topic)
        ]
        reliability, durability = ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE
        if any(profile.reliability == ReliabilityPolicy.BEST_EFFORT for profile in profiles):
            reliability = ReliabilityPolicy.BEST_EFFORT
        latched = DurabilityPolicy.TRANSIENT_LOCAL
        if profiles and all(profile.durability == latched for profile in profiles):
            durability = latched
        return QoSProfile(depth=QUEUE_LENGTH, reliability=reliability, durability=durability)


if __name__ == "__main__":
    run(Ros2Genie)
