"""Edges share with their neighbours and with nobody else."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim import topology
from genie_sim.sim.settings import Edge
from tests.make import build, drive, scenario, street

NAMES = ("edge1", "edge2", "edge3")


def three(**neighbours: list[str] | None) -> Scenario:
    """Three cars, each with its edge."""
    edges = [
        {"name": name, "device": "agx_xavier", "neighbours": neighbours.get(name)} for name in NAMES
    ]
    return scenario(3, edges=edges, methods=["genie"])


def heard(setting: Scenario) -> dict[str, set[str]]:
    """Of each edge: those whose requests or answers reached it over the edge network."""
    world, _ = build(setting, "genie", street(seconds=2.0))
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


def edges(*places: tuple[float, float] | None, **named: list[str]) -> list[Edge]:
    """Edges ``e0``, ``e1``, ... at these places."""
    return [
        Edge(f"e{number}", "agx_xavier", neighbours=named.get(f"e{number}"), at_m=place)
        for number, place in enumerate(places)
    ]


def test_up_to_six_edges_all_share_and_of_more_each_with_the_four_nearest():
    six, twelve = (topology.neighbours(edges(*[None] * number)) for number in (6, 12))
    assert all(len(others) == 5 for others in six.values())
    assert twelve["e5"] == ["e3", "e4", "e6", "e7"]
    assert twelve["e0"] == ["e1", "e2", "e3", "e4"], "in the order of the scenario"
    assert twelve["e4"] == ["e0", "e1", "e2", "e3", "e5", "e6"], "both share"


def test_the_nearest_edges_are_those_on_the_ground_and_both_share():
    line = edges((0, 0), (1000, 0), (10, 0), (990, 0), (20, 0), (980, 0))
    near = topology.neighbours(line, 1)
    assert near == {
        "e0": ["e2"],
        "e1": ["e3"],
        "e2": ["e0", "e4"],
        "e3": ["e1", "e5"],
        "e4": ["e2"],
        "e5": ["e3"],
    }
    assert all(name in near[other] for name, others in near.items() for other in others)


def test_named_neighbours_stay_however_far_they_are():
    line = edges(*[(100.0 * number, 0) for number in range(9)], e0=["e8"])
    near = topology.neighbours(line, 1)
    assert near["e0"] == ["e8"] and near["e8"] == ["e0", "e7"] and "e0" not in near["e1"]


def test_an_edge_that_names_none_shares_with_nobody():
    near = topology.neighbours(edges(*[None] * 9, e4=[]), 2)
    assert near["e4"] == [] and "e4" not in near["e3"] and near["e3"]


def test_naming_all_others_is_the_same_as_naming_none():
    named = three(**{name: [other for other in reversed(NAMES) if other != name] for name in NAMES})
    unnamed = drive(three(), street(seconds=2.0))
    for table, rows in drive(named, street(seconds=2.0)).items():
        assert rows.equals(unnamed[table]), table


@pytest.mark.parametrize(
    ("neighbours", "message"),
    [
        (
            {"edge1": ["edge4"]},
            r"edges\[0\].neighbours\[0\]: unknown edge 'edge4' \(did you mean 'edge3'\?\)",
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
    edges = [Edge(name, "agx_xavier", neighbours=lists[name]) for name in lists]
    assert topology.neighbours(edges) == {
        "edge1": ["edge3"],
        "edge2": ["edge3"],
        "edge3": ["edge1", "edge2"],
    }
