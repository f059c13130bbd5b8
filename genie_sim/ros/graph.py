"""What a Genie takes over of a node, whichever ROS it is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

from genie_sim.errors import UserError, unknown
from genie_sim.ros.codec import WireType
from genie_sim.ros.process import NodeProcess


class Graph(Protocol):
    """What ``attach`` asks the middleware. Everything raises UserError for what is not there.

    ``module`` is the program of the Genie's process, ``environment`` what it needs beside ours, ``network`` a name for
    the master or domain.
    """

    module: str
    image_type: str
    environment: dict[str, str]
    network: str

    def topics_of(self, node: str) -> tuple[list[str], list[str]]: ...

    def types(self, topics: Iterable[str]) -> dict[str, WireType]: ...

    def has_header(self, wire_type: WireType) -> bool: ...

    def process_of(self, node: str) -> NodeProcess: ...

    def remapped(self, node: str, argv: Sequence[str], topics: Sequence[str]) -> tuple[str, ...]: ...


def choose(
    graph: Graph, node: str, asked_for: Sequence[str], leave: Sequence[str]
) -> tuple[list[str], list[str], dict[str, WireType]]:
    """The topics that the Genie takes over: requests, answers, and the types of both as far as they are known.

    Requests are the topics ``asked_for``, else every one whose messages have a header. A node that joins several inputs
    by stamp needs all of them or none, so that only one may go through the Genie; its other topics stay as they are.
    Where it is not clear which, and it is not the only one with images, a UserError asks.
    """
    subscribed, published = graph.topics_of(node)
    for topic in (*asked_for, *leave):
        if topic not in (*subscribed, *published):
            raise UserError(f"{node}: {unknown('topic', topic, [*subscribed, *published])}")
    types = graph.types([*subscribed, *published])

    def usable(topics: Iterable[str]) -> list[str]:
        left = [topic for topic in topics if topic not in leave]
        return [topic for topic in left if topic not in types or graph.has_header(types[topic])]

    requests, answers = list(asked_for) or usable(subscribed), usable(published)
    if len(requests) > 1 and not asked_for:
        images = [topic for topic in requests if topic in types and types[topic].name == graph.image_type]
        if len(images) != 1:
            raise UserError(f"{node}: which topic carries the requests? It subscribes to {', '.join(requests)}")
        requests = images
    if not requests or not answers:
        verb = "publishes" if requests else "subscribes to"
        raise UserError(f"{node}: {verb} no topic whose messages have a header")
    return requests, answers, {topic: types[topic] for topic in (*requests, *answers) if topic in types}
