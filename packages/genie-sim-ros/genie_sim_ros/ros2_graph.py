"""What ROS 2 knows of a node. Its graph knows no processes: the user names the node's process."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from genie_sim.base.errors import UserError, unknown
from genie_sim_ros.codec import MARKERS, Types, WireType
from genie_sim_ros.gateway import LOCAL
from genie_sim_ros.process import NodeProcess
from genie_sim_ros.typestore import class_of

INFRASTRUCTURE = ("/rosout", "/parameter_events", "/clock", "/tf", "/tf_static", "/diagnostics")
DISCOVERY_S = 5.0
# beginnings of the environment's variables that must be the same in every process
MIDDLEWARE = ("ROS_", "RMW_", "FASTRTPS_", "FASTDDS_", "CYCLONEDDS_")


class Ros2Graph:
    """The graph of the domain that a process takes part in."""

    module = "genie_sim_ros.ros2"
    image_type = "sensor_msgs/msg/Image"

    def __init__(self, pid: int) -> None:
        self._process = NodeProcess.of(pid)
        self.environment = {
            name: text for name, text in self._process.env.items() if name.startswith(MIDDLEWARE)
        }
        os.environ.update(self.environment)
        self.network = f"domain-{self.environment.get('ROS_DOMAIN_ID', '0')}"

    def process_of(self, node: str) -> NodeProcess:
        return self._process

    def topics_of(self, node: str) -> tuple[Types, Types]:
        """T_S and T_P. Raises UserError where no such node is discovered within a few seconds."""
        namespace, _, name = node.rpartition("/")
        whole = (name, namespace or "/")
        with _observer() as observer:
            _until(lambda: whole in observer.get_node_names_and_namespaces())
            nodes = observer.get_node_names_and_namespaces()
            if whole not in nodes:
                names = [f"{space.rstrip('/')}/{name}" for name, space in nodes]
                raise UserError(unknown("node", node, names))
            _until(lambda: _typed(observer, observer.get_publisher_names_and_types_by_node(*whole)))
            subscribed = observer.get_subscriber_names_and_types_by_node(*whole)
            published = observer.get_publisher_names_and_types_by_node(*whole)
            return _typed(observer, subscribed), _typed(observer, published)

    def has_header(self, wire_type: WireType) -> bool:
        return has_header(wire_type.name)

    def remapped(self, node: str, argv: Sequence[str], topics: Sequence[str]) -> tuple[str, ...]:
        """The command line under which ``topics`` get the local suffix and the node keeps its name.

        The first rule that fits a name counts, and only it: one that leads to a topic already is
        changed in place.
        """
        remapped = list(argv)
        for index, option in enumerate(argv[:-1]):
            source, sign, target = argv[index + 1].partition(":=")
            topic = target if target.startswith("/") else f"{node.rpartition('/')[0]}/{target}"
            if option in ("-r", "--remap") and sign and topic in topics:
                remapped[index + 1] = f"{source}:={topic}{LOCAL}"
        remapped.append("--ros-args")
        for topic in topics:
            remapped += ["-r", f"{topic}:={topic}{LOCAL}"]
        remapped += ["-r", f"__node:={node.rpartition('/')[2]}"]
        return tuple(remapped)


@contextmanager
def _observer() -> Iterator[Any]:
    """A node that only looks at the graph."""
    import rclpy
    from rclpy.context import Context

    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node(f"genie_attach_{os.getpid()}", context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def _until(condition: Callable[[], Any]) -> None:
    """Waits for a condition, but no longer than discovery takes."""
    deadline = time.monotonic() + DISCOVERY_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.1)


def _typed(observer: Any, topics: Iterable[tuple[str, Sequence[str]]]) -> Types:
    """Topics with their types, without those that every node has."""
    return {
        topic: WireType(types[0], _type_hash(observer, topic))
        for topic, types in sorted(topics)
        if topic not in INFRASTRUCTURE
    }


def _type_hash(observer: Any, topic: str) -> str:
    """The hash of a topic's type, as one of its nodes states it; empty if none does."""
    publishers = observer.get_publishers_info_by_topic(topic)
    subscribers = observer.get_subscriptions_info_by_topic(topic)
    for endpoint in (*publishers, *subscribers):
        if hasattr(endpoint, "topic_type_hash"):
            return str(endpoint.topic_type_hash)
    return ""


def has_header(name: str) -> bool:
    """Do messages of this type have a header to find an answer by?"""
    first = next(iter(class_of(name).get_fields_and_field_types().items()), None)
    return name == MARKERS or first == ("header", "std_msgs/Header")
