"""Edges share with their neighbours and with nobody else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from sim.street import build, drive, scenario

from genie_sim.errors import UserError
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim import topology

NAMES = ("edge1", "edge2", "edge3")


def three(**neighbours: list[str] | None) -> Scenario:
    """Three cars, each with its edge."""
    edges = [
        {"name": name, "device": "agx_xavier", "neighbours": neighbours.get(name)} for name in NAMES
    ]
    return scenario(3, edges=edges, methods=["genie"])


def heard(setting: Scenario) -> dict[str, set[str]]:
    """Of each edge: those whose requests or answers reached it over the edge network."""
    world, _ = build(setting, "genie")
    reached: dict[str, set[str]] = {name: set() for name in NAMES}
    for name, edge in world.edges.items():
        deliver = edge.graph.inject

        def spy(
            topic: str, message: Any, sender: str, name: str = name, deliver: Any = deliver
        ) -> None:
            if sender.startswith("edge"):
                reached[name].add(sender.split("/")[0])
            deliver(topic, message, sender)

        edge.graph.inject = spy  # type: ignore[method-assign]
    world.run()
    return reached


def test_without_a_word_every_edge_shares_with_all_others():
    assert heard(three()) == {
        "edge1": {"edge2", "edge3"},
        "edge2": {"edge1", "edge3"},
        "edge3": {"edge1", "edge2"},
    }


def test_a_row_of_edges_shares_with_the_next_ones_only():
    row = three(edge1=["edge2"], edge2=["edge3", "edge1"], edge3=["edge2"])
    assert heard(row) == {"edge1": {"edge2"}, "edge2": {"edge1", "edge3"}, "edge3": {"edge2"}}


def test_an_edge_that_leaves_another_out_is_not_asked_by_it_either():
    assert heard(three(edge1=[])) == {"edge1": set(), "edge2": {"edge3"}, "edge3": {"edge2"}}
    assert heard(three(edge1=["edge2"])) == {
        "edge1": {"edge2"},
        "edge2": {"edge1", "edge3"},
        "edge3": {"edge2"},
    }


def test_naming_all_others_is_the_same_as_naming_none():
    named = three(**{name: [other for other in reversed(NAMES) if other != name] for name in NAMES})
    for table, rows in drive(named).items():
        assert rows.equals(drive(three())[table]), table


@pytest.mark.parametrize(
    ("neighbours", "message"),
    [
        (
            {"edge1": ["edge4"]},
            r"edges\[0\].neighbours\[0\]: unknown edge 'edge4' \(did you mean 'edge3'\?\); known: ",
        ),
        (
            {"edge2": ["edge1", "edge2"]},
            r"edges\[1\].neighbours\[1\]: edge2 is no neighbour of itself",
        ),
        (
            {"edge1": ["edge2"], "edge2": ["edge3"]},
            r"edges\[0\].neighbours\[0\]: edge2 does not have edge1 among its own neighbours",
        ),
        ({"edge1": ["edge2", "edge2"]}, r"edges\[0\].neighbours\[1\]: duplicate name 'edge2'"),
    ],
)
def test_neighbours_that_cannot_be_are_told_in_one_line(
    neighbours: dict[str, list[str]], message: str
):
    with pytest.raises(UserError, match=message):
        three(**neighbours)


def test_an_edge_without_a_list_is_no_neighbour_of_who_leaves_it_out():
    lists = {"edge1": None, "edge2": ("edge3",), "edge3": None}
    edges: list[Any] = [SimpleNamespace(name=name, neighbours=lists[name]) for name in lists]
    assert topology.neighbours(edges) == {
        "edge1": ["edge3"],
        "edge2": ["edge3"],
        "edge3": ["edge1", "edge2"],
    }
