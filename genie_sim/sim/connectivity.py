"""Checks that the nodes of a method are connected: where frames or answers would reach nobody, the
run ends before it begins.
"""

from genie_sim.base.errors import UserError
from genie_sim.sim.method import DETECTOR, IMAGES, OBJECTS, HostConfig, UplinkTopics
from genie_sim.sim.ros_graph import Graph


def check_car(graph: Graph, config: HostConfig) -> None:
    """Checks what a method runs on a car. Raises ``UserError``."""
    subscribed, published = _topics(graph)
    if config.uplink is not None:
        _check_uplink(graph.name, config.uplink, subscribed, published)
        subscribed.add(config.uplink.up)
    if IMAGES not in subscribed:
        raise UserError(
            f"frames of {graph.name} go to no node: nothing there subscribes to {IMAGES}"
        )
    if config.interceptor is not None:
        _check_detector(graph, config)


def check_edge(graph: Graph, config: HostConfig, car: str) -> None:
    """Checks what a method runs on an edge that gets the frames of a ``car``. Raises
    ``UserError``.
    """
    subscribed, published = _topics(graph)
    if IMAGES not in subscribed:
        raise UserError(
            f"frames of {car} go to no node: nothing on {graph.name} subscribes to {IMAGES}"
        )
    if OBJECTS not in published:
        raise UserError(f"{car} gets no answers: nothing on {graph.name} publishes {OBJECTS}")
    if config.interceptor is not None:
        _check_detector(graph, config)


def _topics(graph: Graph) -> tuple[set[str], set[str]]:
    """What the nodes of a graph subscribe to, and what they publish."""
    subscribed: set[str] = set()
    published: set[str] = set()
    for node in graph.nodes:
        inputs, outputs = graph.topics_of(node.name)
        subscribed.update(inputs)
        published.update(outputs)
    return subscribed, published


def _check_uplink(
    car: str, uplink: UplinkTopics, subscribed: set[str], published: set[str]
) -> None:
    if uplink.up != IMAGES and uplink.up not in published:
        raise UserError(
            f"frames of {car} do not go up: its uplink takes {uplink.up}, which nothing there "
            "publishes"
        )
    if uplink.down != OBJECTS and uplink.down not in subscribed:
        raise UserError(
            f"answers to {car} go to no node: its uplink brings {uplink.down}, to which nothing "
            "there subscribes"
        )


def _check_detector(graph: Graph, config: HostConfig) -> None:
    """Checks that the interceptor uses the detector behind it."""
    if not config.detector or config.is_beside:
        return
    subscribed, published = _topics(graph)
    inputs, outputs = graph.topics_of(f"{graph.name}/{DETECTOR}")
    for topic in inputs:
        if topic not in published:
            raise UserError(
                f"frames of {graph.name} do not reach its detector: nothing publishes {topic}"
            )
    for topic in outputs:
        if topic not in subscribed:
            raise UserError(
                f"answers of {graph.name}'s detector go to no node: nothing subscribes to {topic}"
            )
