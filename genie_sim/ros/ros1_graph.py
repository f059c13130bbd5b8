"""What the ROS 1 master knows of a node: its process, its topics and their types."""

import io
import os
import socket
import xmlrpc.client
from collections.abc import Iterable, Sequence
from typing import Any
from urllib.parse import urlparse

from genie_sim.errors import UserError, as_user_error, unknown
from genie_sim.ros.codec import Types, WireType, begins_with_header
from genie_sim.ros.gateway import LOCAL
from genie_sim.ros.process import NodeProcess, listens_on

CALLER = "/genie_attach"
NEVER = (
    "/rosout",
    "/rosout_agg",
    "/clock",
    "/tf",
    "/tf_static",
    "/diagnostics",
)  # infrastructure, not data
PATIENCE_S = 3.0


class Graph:
    """The graph of one master. Raises UserError where there is no master or no such node."""

    module = "genie_sim.ros.ros1"
    image_type = "sensor_msgs/Image"

    def __init__(self, master_uri: str | None) -> None:
        import rosgraph

        master_uri = (
            master_uri or os.environ.get("ROS_MASTER_URI") or "http://localhost:11311"
        ).rstrip("/")
        self.environment = {"ROS_MASTER_URI": master_uri}
        self.network = master_uri.partition("://")[2]
        self._master = rosgraph.Master(CALLER, master_uri=master_uri)
        with as_user_error(f"no ROS master at {master_uri}", OSError):
            self._publishers, self._subscribers, _ = self._master.getSystemState()

    def topics_of(self, node: str) -> tuple[Types, Types]:
        """T_S and T_P, without the topics that every node has, and their types as far as they can be known now."""
        nodes = {name for _, names in (*self._publishers, *self._subscribers) for name in names}
        if node not in nodes:
            raise UserError(unknown("node", node, nodes))
        return self._typed(node, self._subscribers), self._typed(node, self._publishers)

    def process_of(self, node: str) -> NodeProcess:
        """Raises UserError if the node runs on another machine, in another container, or as another user."""
        import rosgraph.network

        uri = urlparse(str(self._master.lookupNode(node)))
        if (
            uri.hostname is None
            or uri.port is None
            or not rosgraph.network.is_local_address(uri.hostname)
        ):
            raise UserError(f"{node}: runs on {uri.hostname}; attach there")
        try:
            pid = _node_at(uri.geturl()).getPid(CALLER)[2]
        except OSError as error:
            raise UserError(
                f"{node}: does not answer ({error.strerror}); is it still there?"
            ) from error
        process = NodeProcess.of(pid)
        if not listens_on(pid, uri.port):
            raise UserError(
                f"{node}: process {pid} is not the node; attach inside the container that it runs in"
            )
        if process.argv[0].endswith("/nodelet") and process.argv[1:2] == ("manager",):
            raise UserError(
                f"{node}: is a nodelet manager; its nodelets cannot be renamed from outside"
            )
        return process

    def _typed(self, node: str, topics: Iterable[tuple[str, Sequence[str]]]) -> Types:
        """The topics of a node; their types from a publisher's connection header, else from an installed package."""
        publishers, names = dict(self._publishers), dict(self._master.getTopicTypes())
        found: Types = {}
        for topic in sorted(
            topic for topic, nodes in topics if node in nodes and topic not in NEVER
        ):
            said = (self._asked(publisher, topic) for publisher in publishers.get(topic, ()))
            found[topic] = next(filter(None, said), None) or _installed(names.get(topic, "*"))
        return found

    def has_header(self, wire_type: WireType) -> bool:
        return begins_with_header(wire_type.definition)

    def remapped(self, node: str, argv: Sequence[str], topics: Sequence[str]) -> tuple[str, ...]:
        """The command line under which ``topics`` get the local suffix and the node keeps its name.

        ROS applies one remapping to a name, never two in a row, so an argument that leads to one of the topics already
        is changed in place.
        """
        import rosgraph.names

        made = []
        for argument in argv:
            source, found, target = argument.partition(":=")
            resolved = (
                rosgraph.names.resolve_name(target, node)
                if found and not source.startswith("_")
                else None
            )
            made.append(f"{source}:={resolved}{LOCAL}" if resolved in topics else argument)
        made += [f"{topic}:={topic}{LOCAL}" for topic in topics]
        if not any(argument.startswith("__name:=") for argument in argv):
            made.append(f"__name:={node.rpartition('/')[2]}")
        return tuple(made)

    def _asked(self, node: str, topic: str) -> WireType | None:
        """The type that a publisher states when a subscriber connects."""
        import rosgraph.network

        try:
            _, _, chosen = _node_at(self._master.lookupNode(node)).requestTopic(
                CALLER, topic, [["TCPROS"]]
            )
            with socket.create_connection((chosen[1], chosen[2]), timeout=PATIENCE_S) as connection:
                said = {"topic": topic, "callerid": CALLER, "md5sum": "*", "type": "*"}
                rosgraph.network.write_ros_handshake_header(connection, said)
                header = rosgraph.network.read_ros_handshake_header(connection, io.BytesIO(), 65536)
        except (OSError, xmlrpc.client.Error, rosgraph.network.ROSHandshakeException, IndexError):
            return None  # this publisher is gone; another one may tell
        if "message_definition" not in header:
            return None
        return WireType(header["type"], header["md5sum"], header["message_definition"])


def _node_at(uri: str) -> Any:
    return xmlrpc.client.ServerProxy(uri)


def _installed(name: str) -> WireType | None:
    import roslib.message

    found: Any = roslib.message.get_message_class(name) if "/" in name else None
    return None if found is None else WireType(name, found._md5sum, found._full_text)
