"""Broadcasts: what a host publishes on some topics reaches every host that hears it."""

from collections.abc import Callable, Mapping

from genie_sim.core.messages import Message
from genie_sim.sim.bends import Border
from genie_sim.sim.link import Link
from genie_sim.sim.link_models import BroadcastSender
from genie_sim.sim.ros_graph import Graph, Subscriber


class Broadcast(Subscriber):
    """Sends what a host publishes on the ``topics`` to all hosts in range, on the same topics.

    Parameters
    ----------
    graph : Graph
        The host's graph.
    topics : tuple of str
        What it broadcasts.
    sender : BroadcastSender
        The host on the medium.
    link : Link
        The queue in front of the sender.
    others : mapping
        All broadcasts of the run, by host.
    border : callable
        The two ends of the way from one host to another, by their names.
    """

    def __init__(
        self,
        graph: Graph,
        topics: tuple[str, ...],
        *,
        sender: BroadcastSender,
        link: Link,
        others: "Mapping[str, Broadcast]",
        border: Callable[[str, str], Border],
    ) -> None:
        self.address = f"{graph.name}/broadcast"
        self.host = graph.name
        self.link = link
        self._graph = graph
        self._sender = sender
        self._others = others
        self._border = border
        for topic in topics:
            graph.bridge(topic, self)

    def deliver(self, topic: str, message: Message, sender: str) -> None:
        """The host has published something: it waits for the medium."""
        heard_by: list[str] = []  # the hosts; ``carried`` fills it in before anything arrives
        self.link.send(
            (topic, message.header.frame_id),
            message,
            self._arrive,
            (topic, message, sender, heard_by),
            carried=lambda _: heard_by.extend(self._sender.heard_by),
        )

    def _arrive(self, topic: str, message: Message, sender: str, heard_by: list[str]) -> None:
        """The message reaches the hosts that have heard it, but for those that a fault has cut
        off.
        """
        for host in heard_by:
            other = self._others[host]
            received = None if other.link.down_by else self._across(message, host)
            if received is None:
                other.link.drops += 1
            else:
                other._graph.inject(topic, received, sender)

    def _across(self, message: Message, host: str) -> Message | None:
        """The message as it arrives at a host; ``None`` if a fault loses it."""
        border = self._border(self.host, host)
        left = border.leave(message)
        if isinstance(left, str):  # what it is lost by
            return None
        arrived = border.enter(left)
        return None if isinstance(arrived, str) else arrived
