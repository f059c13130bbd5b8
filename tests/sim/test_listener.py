"""Where an answer comes from, seen from the car."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from genie_sim.core.messages import Detections, Header
from genie_sim.sim.clock import Clock
from genie_sim.sim.listener import CarListener
from genie_sim.sim.method import IMAGES, OBJECTS

HEADER = Header(7, "camera", "car1")
ASKED = SimpleNamespace(header=HEADER)


class Street:
    """The car's graph and its monitor, which note what is told."""

    name = "car1"

    def __init__(self) -> None:
        self.clock = Clock()
        self.clock.run(until=9)
        self.topics: list[str] = []
        self.told: list[tuple[Any, ...]] = []

    def subscribe(self, topic: str, node: object) -> None:
        self.topics.append(topic)

    def answered(self, answer: Detections, source: str, now_ns: int, path: object) -> None:
        self.told.append(("answered", answer.header, source, now_ns))

    def received(self, header: Header, now_ns: int) -> None:
        self.told.append(("received", header, now_ns))

    def dropped(self, message: Any, where: str) -> None:
        self.told.append(("dropped", message.header, where))


def listener(street: Street, edge: str | None, is_answered: bool = True) -> CarListener:
    uplink: Any = None if edge is None else SimpleNamespace(edge=edge)
    graph: Any = street
    return CarListener(graph, graph, connection=uplink, is_answered=is_answered)


@pytest.mark.parametrize(
    ("source", "served_by", "edge", "told"),
    [
        ("map", "edge1/genie", "edge1", "map"),
        ("detector", "car1/detector", "edge1", "own_detector"),
        ("detector", "edge1/detector", "edge1", "edge_detector"),
        ("detector", "edge2/detector", "edge1", "edge_detector"),
        ("cache", "car1/genie", "edge1", "own_cache"),
        ("cache", "car1/genie", None, "own_cache"),
        ("cache", "edge1/genie", "edge1", "edge_cache"),
        ("cache", "edge2/genie", "edge1", "peer_cache"),
        ("cache", "car2/genie", None, "peer_cache"),
    ],
)
def test_the_source_of_an_answer(source: str, served_by: str, edge: str | None, told: str):
    street = Street()
    answer = Detections(HEADER, (), source, served_by)
    listener(street, edge).deliver(OBJECTS, answer, "somebody")
    assert street.told == [("answered", HEADER, told, 9)]
    assert set(street.topics) == {IMAGES, OBJECTS}


def test_a_frame_is_received_or_lost_because_nobody_serves_it():
    street, message = Street(), ASKED
    listener(street, "edge1").deliver(IMAGES, message, "camera")  # type: ignore[arg-type]
    listener(street, None, is_answered=False).deliver(IMAGES, message, "camera")  # type: ignore[arg-type]
    assert street.told == [("received", HEADER, 9), ("dropped", HEADER, "car1:no_edge")]
