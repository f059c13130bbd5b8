"""The central cache: where it is, and that its edge sends nothing unasked."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.core.messages import Header
from genie_sim.sim.method import IMAGES, OBJECTS, REMOTE
from tests.conformance import small


@pytest.mark.parametrize(("at", "hub"), [({}, "edge1"), ({"at": "edge2"}, "edge2")])
def test_the_first_edge_has_the_cache_unless_another_is_named(at: dict[str, str], hub: str):
    setting = small.scenario([{"name": "central", "method": "central", **at}])
    lookups = small.tables(setting)["lookups"]
    other = "edge2" if hub == "edge1" else "edge1"
    assert set(lookups["genie"]) == {f"{hub}/genie", f"{other}/asker"}
    stored = lookups[lookups["kind"] == "image"].groupby("genie")["entries"].max()
    assert stored[f"{hub}/genie"] > 0 == stored[f"{other}/asker"]


def test_the_cache_is_an_edge_s_whatever_cars_may_store():
    rules = {"car_capacity": "1 entries", "capacity": "50 entries", "eviction": "lru"}
    lookups = small.tables(small.scenario(["central"], genie=rules))["lookups"]
    of_hub = lookups[(lookups["kind"] == "image") & (lookups["genie"] == "edge1/genie")]
    assert 1 < of_hub["entries"].max() <= 50


def test_its_edge_answers_requests_of_other_edges_and_sends_nothing_else():
    world, _ = small.world(small.scenario(["central"]))
    requested: set[Header] = set()
    answers: list[tuple[str | None, Header]] = []
    for edge in world.edges.values():

        def spy(
            node: Any,
            topic: str,
            message: Any,
            to: str | None = None,
            edge: Any = edge,
            publish: Any = edge.graph.publish,
        ) -> None:
            if edge.name == "edge2" and topic == IMAGES + REMOTE:
                requested.add(message.header)
            if edge.name == "edge1" and topic == OBJECTS + REMOTE:
                answers.append((to, message.header))
            publish(node, topic, message, to)

        edge.graph.publish = spy
    world.run()
    assert answers and {to for to, _ in answers} == {"edge2/asker"}
    assert {header for _, header in answers} <= requested
    assert {header.origin for _, header in answers} == {"car2"}
