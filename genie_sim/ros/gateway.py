"""Between a Genie and the world: which message goes to the node, to the robot's topics, or to another Genie.

Knows neither rospy nor rclpy nor sockets: those call in, and are called back through ``publish`` and ``Links``.

==================  ==============================  ============================================================
a Genie publishes   on a car                        on an edge
==================  ==============================  ============================================================
``T_local``         to its node                     to its node
``T_remote``        to its edge, which serves it    to the other edges, which look it up in their caches
                    as a client's request
``P``               to the robot's topic            to the car that asked, or to the edge's own topic
``P_remote``                                        to the other edges, or to the one that asked
==================  ==============================  ============================================================

The ``_remote`` topics are also ordinary topics of the own master.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import NamedTuple, Protocol

from genie_sim.core.node import GenieNode
from genie_sim.messages import Header, Observation, Publish
from genie_sim.ros.message import RosMessage

LOCAL, REMOTE = "_local", "_remote"  # "-" is not legal in the names of real ROS
OUTSTANDING = 10_000  # requests remembered at most, where they never expire


def plain(topic: str) -> str:
    """The topic as the robot calls it."""
    return topic.removesuffix(LOCAL).removesuffix(REMOTE)


class Peer(NamedTuple):
    """Another Genie, as its link has authenticated it. ``role`` is ``car`` or ``edge``."""

    name: str
    role: str


class Links(Protocol):
    """The authenticated links to other Genies."""

    def peers(self) -> list[Peer]:
        """Who is connected now."""

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        """Sends without waiting; what cannot be sent is dropped."""


class Gateway:
    """One Genie's effects carried out. Calls may come from any thread; they are served one after the other.

    ``publish`` gets a topic and a message. ``observe`` gets every record with the time.
    """

    def __init__(
        self, genie: GenieNode, role: str, requests: tuple[str, ...], answers: tuple[str, ...],
        publish: Callable[[str, RosMessage], None], observe: Callable[[Observation, int], None], links: Links,
    ) -> None:  # fmt: skip
        self.genie = genie
        self._role = role
        self._publish = publish
        self._observe = observe
        self._links = links
        self._to_node = {topic + LOCAL for topic in requests}
        self._from_node = {topic + LOCAL: topic for topic in answers}
        self._remote_requests = {topic + REMOTE: topic for topic in requests}
        self._remote_answers = {topic + REMOTE for topic in answers}
        self._answers = set(answers)
        self._by_stamp = genie.rules.header_identity == "stamp"
        # As the node sees it -> request, since when; the oldest first, and found at once.
        self._outstanding: OrderedDict[Hashable, tuple[Header, int]] = OrderedDict()
        self._lock = threading.Lock()

    def from_ros(self, topic: str, message: RosMessage, now_ns: int, sender: str) -> None:
        """A message on one of the own master's topics; ``sender`` is the node that published it."""
        with self._lock:
            if topic in self._from_node:
                request = self._asked(self._seen_by_node(message.header), now_ns)
                if request is None:  # unasked for, or too late: the robot gets what its node says
                    self._publish(self._from_node[topic], message)
                    return
                message = message.restamped(request)
            self._arrived(topic, message, now_ns, sender)

    def from_link(self, peer: Peer, topic: str, message: RosMessage, now_ns: int) -> None:
        """A message of an authenticated Genie. Raises ValueError, and does nothing, where it has no right to say so."""
        origin = message.header.origin
        with self._lock:
            if (
                self._role == "car"
                and peer.role == "edge"
                and topic in self._answers
                and origin == self.genie.name
            ):
                self._arrived(topic + REMOTE, message, now_ns, peer.name)
            elif (
                self._role == "edge"
                and peer.role == "car"
                and topic in self._remote_requests
                and origin == peer.name
            ):
                self._arrived(self._remote_requests[topic], message, now_ns, peer.name)
            elif self._role == peer.role == "edge" and (
                topic in self._remote_requests or topic in self._remote_answers
            ):
                self._arrived(topic, message, now_ns, peer.name)
            else:
                raise ValueError(f"{peer.role} {peer.name} may not send {topic} for {origin}")

    def on_timer(self, now_ns: int) -> None:
        """To be called a few times a second: forgets what nobody answered."""
        with self._lock:
            for effect in self.genie.on_deadline(now_ns):
                if not isinstance(effect, Publish):
                    self._observe(effect, now_ns)
            self._expire(now_ns)

    def _arrived(self, topic: str, message: RosMessage, now_ns: int, sender: str) -> None:
        for effect in self.genie.on_message(topic, message, now_ns, sender):
            if isinstance(effect, Publish):
                self._carry_out(effect, now_ns)
            else:
                self._observe(effect, now_ns)

    def _carry_out(self, effect: Publish, now_ns: int) -> None:
        topic, message = effect.topic, effect.message
        assert isinstance(message, RosMessage)
        if topic in self._to_node:
            self._publish(topic, message.restamped(self._remember(message.header, now_ns)))
        elif topic in self._answers:
            if message.header.origin == self.genie.name:
                self._publish(topic, message)
            else:
                self._send(topic, message, "car", message.header.origin)
        else:
            if self._role == "edge" or topic in self._remote_requests:
                self._send(topic, message, "edge", effect.to)
            self._publish(topic, message)

    def _send(self, topic: str, message: RosMessage, role: str, to: str | None) -> None:
        for peer in self._links.peers():
            if peer.role == role and to in (None, peer.name):
                self._links.send(peer.name, topic, message)

    def _remember(self, request: Header, now_ns: int) -> Header:
        """The header under which the node gets a request.

        It is the request's own, unless another car's request with the same stamp and frame is still with the node:
        then it is the next free nanosecond, for the node knows nothing of cars and answers by header.
        """
        header = request
        while self._outstanding.get(self._seen_by_node(header), (request, 0))[0] != request:
            header = header._replace(stamp_ns=header.stamp_ns + 1)
        self._outstanding[self._seen_by_node(header)] = request, now_ns
        return header

    def _asked(self, seen: Hashable, now_ns: int) -> Header | None:
        """The request that the node answers. It stays known: a node may answer on several topics."""
        self._expire(now_ns)
        request, _ = self._outstanding.get(seen, (None, 0))
        return request

    def _expire(self, now_ns: int) -> None:
        expiry_ns = self.genie.rules.request_expiry_ns
        while self._outstanding:
            oldest = next(iter(self._outstanding))
            late = expiry_ns is not None and now_ns - self._outstanding[oldest][1] >= expiry_ns
            if not late and len(self._outstanding) <= OUTSTANDING:
                return
            del self._outstanding[oldest]

    def _seen_by_node(self, header: Header) -> Hashable:
        return header.stamp_ns if self._by_stamp else (header.stamp_ns, header.frame_id)
