"""Checks that the nodes of a method are connected: where frames or answers would reach nobody, the
run ends before it begins.
"""

from genie_sim.base.errors import UserError
from genie_sim.sim.method import DETECTOR, IMAGES, OBJECTS, HostConfig
from genie_sim.sim.ros_graph import Graph


def check_car(graph: Graph, config: HostConfig) -> None:
    """Checks what a method runs on a car. Raises ``UserError``."""
    car, (inputs, outputs) = graph.name, _topics(graph)
    if config.uplink is not None:
        up, down = config.uplink
        if up != IMAGES and up not in outputs:
            raise UserError(
                f"frames of {car} do not go up: its uplink takes {up}, which nothing there "
                "publishes"
            )
        if down != OBJECTS and down not in inputs:
            raise UserError(
                f"answers to {car} go to no node: its uplink brings {down}, to which nothing there "
                "subscribes"
            )
        inputs.add(up)
    if IMAGES not in inputs:
        raise UserError(f"frames of {car} go to no node: nothing there subscribes to {IMAGES}")
    _check_detector(graph, config)


def check_edge(graph: Graph, config: HostConfig, car: str) -> None:
    """Checks what a method runs on an edge that gets the frames of a ``car``. Raises
    ``UserError``.
    """
    inputs, outputs = _topics(graph)
    if IMAGES not in inputs:
        raise UserError(
            f"frames of {car} go to no node: nothing on {graph.name} subscribes to {IMAGES}"
        )
    if OBJECTS not in outputs:
        raise UserError(f"{car} gets no answers: nothing on {graph.name} publishes {OBJECTS}")
    _check_detector(graph, config)


def _topics(graph: Graph) -> tuple[set[str], set[str]]:
    """What the nodes of a graph subscribe to, and what they publish."""
    topics = [graph.topics_of(node.name) for node in graph.nodes]
    return (
        {topic for inputs, _ in topics for topic in inputs},
        {topic for _, outputs in topics for topic in outputs},
    )


def _check_detector(graph: Graph, config: HostConfig) -> None:
    """Checks that an interceptor uses the detector behind it."""
    if config.interceptor is None or not config.detector or config.is_beside:
        return
    inputs, outputs = _topics(graph)
    frames, answers = graph.topics_of(f"{graph.name}/{DETECTOR}")
    for topic in set(frames) - outputs:
        raise UserError(
            f"frames of {graph.name} do not reach its detector: nothing publishes {topic}"
        )
    for topic in set(answers) - inputs:
        raise UserError(
            f"answers of {graph.name}'s detector go to no node: nothing subscribes to {topic}"
        )
