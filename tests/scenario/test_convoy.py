"""The short form of cars that play one drive: what it is turned into, and what it refuses."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_S
from genie_sim.scenario.reading import read_scenario

QUADRO, XAVIER = "quadro_rtx_4000", "agx_xavier"
THREE = {"cars": 3, "device": "jetson_tx2"}


def scenario(**convoy):
    return read_scenario({"name": "x", "convoy": {**THREE, **convoy}})


def test_a_convoy_is_short_for_cars_and_edges():
    route = {"start": "2 s", "window": ["1 s", "4 s"], "laps": 2, "pause": "0 s"}
    short = scenario(
        edges=[QUADRO, XAVIER], route=route, start_every="1.5 s", ahead="500 ms", link="wifi"
    )
    windows = [["1 s", "4 s"], ["1.5 s", "4.5 s"], ["2 s", "5 s"]]
    cars = [
        {
            "name": f"car{place + 1}",
            "device": "jetson_tx2",
            "edge": edge,
            "link": "wifi",
            "route": {**route, "start": start, "window": windows[place]},
        }
        for place, (edge, start) in enumerate(
            (("edge1", "2 s"), ("edge2", "3.5 s"), ("edge1", "5 s"))
        )
    ]
    edges = [{"name": "edge1", "device": QUADRO}, {"name": "edge2", "device": XAVIER}]
    assert short == read_scenario({"name": "x", "cars": cars, "edges": edges})


@pytest.mark.parametrize(
    ("devices", "edges"),
    [
        ([], [None, None, None]),
        ([QUADRO], ["edge1", "edge1", "edge1"]),
        ([QUADRO, XAVIER, XAVIER], ["edge1", "edge2", "edge3"]),
    ],
)
def test_cars_are_given_to_edges_in_turn(devices, edges):
    made = scenario(edges=devices)
    assert [car.edge for car in made.cars] == edges
    assert [edge.device for edge in made.edges] == devices
    assert all((car.link is None) == (car.edge is None) for car in made.cars)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"convoy": {**THREE, "cars": 0}}, "scenario: convoy.cars: must be from 1 to 1,000, not 0"),
        ({"convoy": {**THREE, "ahead": "1 s"}}, "scenario: convoy.ahead: needs 'route.window'"),
        (
            {"convoy": {**THREE, "route": {"lap": 2}}},
            "scenario: convoy.route.lap: unknown field; did you mean 'laps'?",
        ),
        (
            {"convoy": THREE, "edges": [{"name": "a", "device": XAVIER}]},
            "scenario: edges: a convoy brings its own",
        ),
        (
            {"convoy": {**THREE, "edges": ["xavier"]}},
            "scenario: edges[0].device: unknown device 'xavier'",
        ),
        ({"convoy": 3}, "scenario: convoy: must be a mapping, not 3"),
    ],
)
def test_a_mistake_in_a_convoy_is_told_in_one_line(data, said):
    with pytest.raises(UserError) as told:
        read_scenario({"name": "x", **data})
    assert str(told.value).startswith(said) and "\n" not in str(told.value)


def test_cars_of_a_convoy_start_one_after_another():
    assert [car.route.start_ns // NS_PER_S for car in scenario(start_every="2 s").cars] == [0, 2, 4]
