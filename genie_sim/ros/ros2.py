"""The Genie's process in front of a ROS 2 node: ``python -m genie_sim.ros.ros2``, started by ``attach``.

The same plan, gateway and links as in ROS 1. Messages stay serialised from subscription to publication. Genies speak
to each other over links only: a node here cannot tell its own words on a ``_remote`` topic from another's.
"""

from __future__ import annotations

import logging
import threading
import time
from functools import partial
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from genie_sim.errors import UserError
from genie_sim.messages import CameraPose
from genie_sim.ros.gateway import LOCAL, REMOTE, View
from genie_sim.ros.genie_process import GenieProcess, open_links, run
from genie_sim.ros.message import Codec, RosMessage
from genie_sim.ros.plan import Plan, Recorder, make_gateway
from genie_sim.ros.poses import Poses, heading_of_quaternion
from genie_sim.ros.ros1_codec import NS_PER_S
from genie_sim.ros.ros2_codec import class_of, codec_of

log = logging.getLogger(__name__)
QUEUE_LENGTH = 10


class Ros2Genie(GenieProcess):
    """Subscribes to what the Genie listens to, and publishes what it says. One thread serves all subscriptions."""

    def __init__(self, plan: Plan) -> None:
        super().__init__()
        self._plan = plan
        self._poses = Poses()
        topics = (*plan.requests, *plan.answers)
        self._codecs: dict[str, Codec] = {topic: codec_of(plan.types[topic]) for topic in topics}
        self._publishers: dict[str, Any] = {}
        self._links = open_links(plan, codec_of)
        objects = next((self._codecs[topic] for topic in plan.answers if self._codecs[topic].holds_objects), None)
        self._gateway = make_gateway(plan, self._publish, Recorder(plan.record), self._links, objects)
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("genie_" + plan.node.strip("/").replace("/", "_"), context=self._context)

    def start(self) -> None:
        """Publishers first, then subscribers, then the links; returns at once."""
        for topic in (*(topic + LOCAL for topic in self._plan.requests), *self._plan.answers):
            self._publishers[topic] = self._node.create_publisher(self._class(topic), topic, self._quality(topic))
        for topic in (*self._plan.requests, *(topic + LOCAL for topic in self._plan.answers)):
            self._node.create_subscription(
                self._class(topic), topic, partial(self._on_message, topic), self._quality(topic), raw=True
            )
        if self._plan.pose_topic is not None:
            pose_class = class_of("geometry_msgs/msg/PoseStamped")
            self._node.create_subscription(pose_class, self._plan.pose_topic, self._on_pose, QUEUE_LENGTH)
        executor = SingleThreadedExecutor(context=self._context)
        executor.add_node(self._node)
        threading.Thread(target=executor.spin, daemon=True).start()
        threading.Thread(target=self.tick, args=(self._gateway,), daemon=True).start()
        self._links.start(self._on_link)

    def heard(self) -> bool:
        return all(self._publishers[topic + LOCAL].get_subscription_count() for topic in self._plan.requests)

    def hears(self) -> bool:
        return all(self._node.count_publishers(topic + LOCAL) for topic in self._plan.answers)

    def stop(self) -> None:
        rclpy.shutdown(context=self._context)

    def _class(self, topic: str) -> Any:
        return class_of(self._codecs[topic.removesuffix(LOCAL)].type.name)

    def _quality(self, topic: str) -> QoSProfile:
        """Reliable, unless a publisher of the topic offers less, which then would not be heard at all."""
        found = self._node.get_publishers_info_by_topic(topic)
        best_effort = any(one.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT for one in found)
        latched = bool(found) and all(
            one.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in found
        )
        return QoSProfile(
            depth=QUEUE_LENGTH,
            reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )

    def _on_message(self, topic: str, payload: bytes) -> None:
        name = topic.removesuffix(LOCAL)
        try:
            message = RosMessage.of(payload, self._codecs[name], self._plan.name, answer=name in self._plan.answers)
            view = View(self._poses.at(message.header.stamp_ns), self._plan.horizontal_fov_rad)
            self._gateway.from_ros(topic, message, time.monotonic_ns(), "", view)
        except ValueError as error:
            log.warning("%s: dropped a message: %s", topic, error)
        except UserError as error:
            self.fail(error)

    def _on_link(self, peer: Any, topic: str, message: RosMessage) -> None:
        known = self._codecs.get(topic.removesuffix(REMOTE))
        if known is None or known.type.name != message.codec.type.name:
            log.warning("%s: dropped a %s of %s", topic, message.codec.type.name, peer.name)
            return
        try:
            self._gateway.from_link(peer, topic, message, time.monotonic_ns())
        except UserError as error:
            self.fail(error)

    def _on_pose(self, message: Any) -> None:
        place, turn, stamp = message.pose.position, message.pose.orientation, message.header.stamp
        heading_rad = heading_of_quaternion(turn.x, turn.y, turn.z, turn.w)
        self._poses.add(stamp.sec * NS_PER_S + stamp.nanosec, CameraPose(place.x, place.y, place.z, heading_rad))

    def _publish(self, topic: str, message: RosMessage) -> None:
        publisher = self._publishers.get(topic)
        if publisher is None or self._codecs[topic.removesuffix(LOCAL)].type.name != message.codec.type.name:
            return  # a -remote topic, or map objects for a topic that holds none
        publisher.publish(message.encoded())


if __name__ == "__main__":
    run(Ros2Genie)
