"""Between a Genie and the world: which message goes to the node, to the robot's topics, or to
another Genie.

Knows neither rospy nor rclpy nor sockets: those call in, and are called back through ``publish``
and ``PeerLinks``.

=============  =============================  ================================================
a Genie's      go on a car                    go on an edge
=============  =============================  ================================================
``T_local``    to its node                    to its node
``T_remote``   to its edge, which serves      to the other edges, which look it up in their
               it as a client's request       caches
``P``          to the robot's topic           to the car that requested, or to the edge's topic
``P_remote``                                  to the other edges, or to the one that requested
=============  =============================  ================================================

The ``_remote`` topics are also ordinary topics of the own master.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import NamedTuple, Protocol

from genie_sim.core.messages import Effect, Header, Observation, Publish
from genie_sim.core.node import GenieNode
from genie_sim.core.rules import GenieRules
from genie_sim_ros.looks import StampClock
from genie_sim_ros.message import RosMessage

LOCAL, REMOTE = "_local", "_remote"  # "-" is not legal in the names of real ROS
MAX_OUTSTANDING = 10_000  # requests that are remembered where they never expire


def plain(topic: str) -> str:
    """The topic as the robot calls it."""
    return topic.removesuffix(LOCAL).removesuffix(REMOTE)


class Peer(NamedTuple):
    """Another Genie, as its link has authenticated it. ``role`` is ``car`` or ``edge``."""

    name: str
    role: str


class AnyGenie(Protocol):
    """What decides about messages: ``core.node.GenieNode``, an ``EdgeRelay``, or
    ``recommended.paced_genie.PacedGenie``.
    """

    name: str

    def subscriptions(self) -> tuple[str, ...]:
        """Every topic that it listens to."""

    def publications(self) -> tuple[str, ...]:
        """Every topic that it may publish on."""

    def on_message(
        self, topic: str, message: RosMessage, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        """What follows from a message."""

    def on_deadline(self, now_ns: int) -> list[Effect]:
        """What follows from the time."""


class PeerLinks(Protocol):
    """The authenticated links to other Genies."""

    def peers(self) -> list[Peer]:
        """Who is connected now."""

    def send(self, peer: str, topic: str, message: RosMessage) -> None:
        """Sends without waiting; what cannot be sent is dropped."""


class Gateway:
    """Carries out one Genie's effects. Calls may come from any thread; they are served one after
    the other.

    Parameters
    ----------
    genie : AnyGenie
        The Genie.
    rules : GenieRules
        Its settings.
    role : str
        ``car`` or ``edge``.
    requests, answers : tuple of str
        The topics that the Genie takes over.
    publish : callable
        Gets a topic and a message for the own ROS network.
    observe : callable
        Gets every record, and its time [ns].
    links : PeerLinks
        Other Genies.
    """

    def __init__(
        self,
        genie: AnyGenie,
        *,
        rules: GenieRules,
        role: str,
        requests: tuple[str, ...],
        answers: tuple[str, ...],
        publish: Callable[[str, RosMessage], None],
        observe: Callable[[Observation, int], None],
        links: PeerLinks,
    ) -> None:
        self.genie = genie
        self._role = role
        self._publish = publish
        self._observe = observe
        self._links = links
        self._requests = set(requests)
        self._to_node = {topic + LOCAL for topic in requests}
        self._from_node = {topic + LOCAL: topic for topic in answers}
        self._remote_requests = {topic + REMOTE: topic for topic in requests}
        self._remote_answers = {topic + REMOTE for topic in answers}
        self._answers = set(answers)
        self._by_stamp = rules.header_identity == "stamp"
        self._expiry_ns = rules.request_expiry_ns
        # A Genie that paces its looks compares stamps with the time, and asks a single edge.
        self._clock = None if isinstance(genie, GenieNode) else StampClock()
        # The header that the node sees -> the request's header and its time; the oldest first.
        self._outstanding: OrderedDict[Hashable, tuple[Header, int]] = OrderedDict()
        self._lock = threading.Lock()

    def from_ros(self, topic: str, message: RosMessage, now_ns: int, sender: str) -> None:
        """A message on one of the own master's topics; ``sender`` is the node that published it."""
        with self._lock:
            if topic in self._from_node:
                request = self._request_of(self._seen_by_node(message.header), now_ns)
                if request is None:  # no pending request: forward the node's message unchanged
                    self._publish(self._from_node[topic], message)
                    return
                message = message.restamped(request)
            self._arrived(topic, message, now_ns, sender)

    def from_link(self, peer: Peer, topic: str, message: RosMessage, now_ns: int) -> None:
        """A message of an authenticated Genie. Raises ValueError, and does nothing, for a message
        that the peer has no right to send.
        """
        own_topic = self._topic_of_peer(peer, topic, message.header.origin)
        if own_topic is None:
            raise ValueError(
                f"{peer.role} {peer.name} may not send {topic} for {message.header.origin}"
            )
        with self._lock:
            self._arrived(own_topic, message, now_ns, peer.name)

    def _topic_of_peer(self, peer: Peer, topic: str, origin: str) -> str | None:
        """The topic on which the Genie gets a peer's message; ``None`` if the peer may not send it.

        A car gets answers to its own requests from edges. An edge gets requests from cars, each in
        its own name, and what edges share.
        """
        is_shared = topic in self._remote_requests or topic in self._remote_answers
        match self._role, peer.role:
            case "car", "edge" if topic in self._answers and origin == self.genie.name:
                return topic + REMOTE
            case "edge", "car" if topic in self._remote_requests and origin == peer.name:
                return self._remote_requests[topic]
            case "edge", "edge" if is_shared:
                return topic
        return None

    def on_timer(self, now_ns: int) -> None:
        """Forgets what nobody has answered. To be called a few times a second."""
        with self._lock:
            for effect in self.genie.on_deadline(self._genies_time_ns(now_ns)):
                if not isinstance(effect, Publish):
                    self._observe(effect, now_ns)
            self._expire(now_ns)

    def _arrived(self, topic: str, message: RosMessage, now_ns: int, sender: str) -> None:
        if self._clock is not None and topic in self._requests:
            self._clock.received(message.header.stamp_ns, now_ns)
        genies_ns = self._genies_time_ns(now_ns)
        for effect in self.genie.on_message(topic, message, genies_ns, sender):
            if isinstance(effect, Publish):
                self._carry_out(effect, now_ns)
            else:
                self._observe(effect, now_ns)

    def _genies_time_ns(self, now_ns: int) -> int:
        return now_ns if self._clock is None else self._clock.now_ns(now_ns)

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
        peers = [
            peer.name
            for peer in self._links.peers()
            if peer.role == role and to in (None, peer.name)
        ]
        if self._clock is not None and role == "edge":
            peers = peers[:1]
        for name in peers:
            self._links.send(name, topic, message)

    def _remember(self, request: Header, now_ns: int) -> Header:
        """The header under which the node gets a request.

        It is the request's own, unless another car's request with the same stamp and frame is still
        with the node: then it is the next free nanosecond, for the node knows nothing of cars and
        answers by header.
        """
        header = request
        while self._outstanding.get(self._seen_by_node(header), (request, 0))[0] != request:
            header = header._replace(stamp_ns=header.stamp_ns + 1)
        self._outstanding[self._seen_by_node(header)] = request, now_ns
        return header

    def _request_of(self, seen: Hashable, now_ns: int) -> Header | None:
        """The request that the node answers. It stays pending: a node may answer on several
        topics.
        """
        self._expire(now_ns)
        request, _ = self._outstanding.get(seen, (None, 0))
        return request

    def _expire(self, now_ns: int) -> None:
        expiry_ns = self._expiry_ns
        while self._outstanding:
            oldest = next(iter(self._outstanding))
            is_late = expiry_ns is not None and now_ns - self._outstanding[oldest][1] >= expiry_ns
            if not is_late and len(self._outstanding) <= MAX_OUTSTANDING:
                return
            del self._outstanding[oldest]

    def _seen_by_node(self, header: Header) -> Hashable:
        return header.stamp_ns if self._by_stamp else (header.stamp_ns, header.frame_id)
