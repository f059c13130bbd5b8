"""What the ROS 1 master knows of a node: its process, its topics and their types."""

import io
import os
import socket
import xmlrpc.client
from collections.abc import Iterable, Sequence
from typing import Any
from urllib.parse import urlparse

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim_ros.codec import Types, WireType, begins_with_header
from genie_sim_ros.gateway import LOCAL
from genie_sim_ros.process import NodeProcess, listens_on

CALLER = "/genie_attach"
# infrastructure, not data: a Genie leaves these topics alone
INFRASTRUCTURE = ("/rosout", "/rosout_agg", "/clock", "/tf", "/tf_static", "/diagnostics")
PATIENCE_S = 3.0


class Ros1Graph:
    """The graph of one master. Raises UserError where there is no master or no such node."""

    module = "genie_sim_ros.ros1"
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
        """T_S and T_P, without the topics that every node has, and their types as far as they can
        be known now.
        """
        nodes = {name for _, names in (*self._publishers, *self._subscribers) for name in names}
        if node not in nodes:
            raise UserError(unknown("node", node, nodes))
        return self._typed(node, self._subscribers), self._typed(node, self._publishers)

    def process_of(self, node: str) -> NodeProcess:
        """Raises UserError if the node runs on another machine, in another container, or as another
        user.
        """
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
                f"{node}: process {pid} is not the node; "
                "attach inside the container that the node runs in"
            )
        if process.argv[0].endswith("/nodelet") and process.argv[1:2] == ("manager",):
            raise UserError(
                f"{node}: is a nodelet manager; its nodelets cannot be renamed from outside"
            )
        return process

    def _typed(self, node: str, topics: Iterable[tuple[str, Sequence[str]]]) -> Types:
        """The topics of a node. Their types come from a publisher's connection header, else from an
        installed package.
        """
        publishers, type_names = dict(self._publishers), dict(self._master.getTopicTypes())
        types: Types = {}
        for topic, nodes in sorted(topics):
            if node in nodes and topic not in INFRASTRUCTURE:
                for publisher in publishers.get(topic, ()):
                    wire_type = self._stated_type(publisher, topic)
                    if wire_type is not None:
                        break
                else:
                    wire_type = _installed(type_names.get(topic, "*"))
                types[topic] = wire_type
        return types

    def has_header(self, wire_type: WireType) -> bool:
        return begins_with_header(wire_type.definition)

    def remapped(self, node: str, argv: Sequence[str], topics: Sequence[str]) -> tuple[str, ...]:
        """The command line under which ``topics`` get the local suffix and the node keeps its name.

        ROS applies one remapping to a name, never two in a row, so an argument that leads to one of
        the topics already is changed in place.
        """
        import rosgraph.names

        remapped = []
        for argument in argv:
            source, sign, target = argument.partition(":=")
            if sign and not source.startswith("_"):
                topic = rosgraph.names.resolve_name(target, node)
                if topic in topics:
                    argument = f"{source}:={topic}{LOCAL}"
            remapped.append(argument)
        remapped += [f"{topic}:={topic}{LOCAL}" for topic in topics]
        if not any(argument.startswith("__name:=") for argument in argv):
            remapped.append(f"__name:={node.rpartition('/')[2]}")
        return tuple(remapped)

    def _stated_type(self, node: str, topic: str) -> WireType | None:
        """The type that a publisher states when a subscriber connects; ``None`` if it is gone."""
        import rosgraph.network

        network = rosgraph.network
        request = {"topic": topic, "callerid": CALLER, "md5sum": "*", "type": "*"}
        try:
            publisher = _node_at(self._master.lookupNode(node))
            _, _, protocol = publisher.requestTopic(CALLER, topic, [["TCPROS"]])
            if not protocol:
                return None
            _, host, port = protocol
            with socket.create_connection((host, port), timeout=PATIENCE_S) as connection:
                network.write_ros_handshake_header(connection, request)
                header = network.read_ros_handshake_header(connection, io.BytesIO(), 65536)
        except (OSError, xmlrpc.client.Error, network.ROSHandshakeException, ValueError):
            return None
        if "message_definition" not in header:
            return None
        return WireType(header["type"], header["md5sum"], header["message_definition"])


def _node_at(uri: str) -> Any:
    return xmlrpc.client.ServerProxy(uri)


def _installed(name: str) -> WireType | None:
    """A type of an installed package; ``None`` if there is none of this name."""
    import roslib.message

    message_class: Any = roslib.message.get_message_class(name) if "/" in name else None
    if message_class is None:
        return None
    return WireType(name, message_class._md5sum, message_class._full_text)
