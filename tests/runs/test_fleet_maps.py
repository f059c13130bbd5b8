"""Fleets on maps other than the town: a source of frames of the user's own."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.base.units import NS_PER_S
from genie_sim.runs.folder import run_in_memory
from genie_sim.runs.prepare import prepare
from genie_sim.scenario.reading import read_scenario
from tests.fleet_maps import on_map


def test_a_fleet_drives_on_a_map_that_begins_anywhere():
    prepared = prepare(on_map("Plain", cars=2))
    assert [edge.name for edge in prepared.scenario.edges] == ["edge_0_0", "edge_1_0", "edge_2_0"]
    assert [car.edge for car in prepared.scenario.cars] == ["edge_0_0", "edge_0_0"]
    edges = [fault.fault.parameters["edge"] for fault in prepared.scenario.faults]
    assert edges == ["edge_1_0"] * 2, "after 10 s at 20 m/s it is at the border of the third cell"


def test_a_map_that_has_cars_says_when_they_start():
    prepared = prepare(on_map("Traffic"))
    frames: Any = prepared.frames
    assert frames.asked == [("veh_7", None, 0), ("veh_9", None, 3 * NS_PER_S)]
    begins = [
        (fault.fault.parameters["target"], fault.begin_ns) for fault in prepared.scenario.faults
    ]
    assert begins[1][1] is not None and begins[0][1] is not None
    assert [name for name, _ in begins] == ["veh_7", "veh_9"]
    assert begins[1][1] - begins[0][1] == 3 * NS_PER_S
    run = run_in_memory(on_map("Traffic"))
    first_ns = run.frames[run.frames["method"] == "local"].groupby("car")["stamp_ns"].min()
    assert dict(first_ns) == {"veh_7": 0, "veh_9": 3 * NS_PER_S}


@pytest.mark.parametrize(
    ("source", "fleet", "message"),
    [
        ("Plain", {}, "fleet.cars: missing"),
        ("Traffic", {"cars": 5}, "fleet.cars: .*Traffic has 2 cars of its own: leave it out"),
        ("NoMap", {"cars": 2}, "fleet: needs a town to drive in"),
        ("Nowhere", {"cars": 2}, "car1 is at no place of the map"),
        ("Flat", {"cars": 2}, "fleet: the map has no extent"),
        ("Plain", {"cars": 2, "cell": "1 cm"}, "fleet.cell: makes more than 100,000 edges"),
    ],
)
def test_what_does_not_fit_a_map_is_refused_in_one_line(source, fleet, message):
    with pytest.raises(UserError, match=message) as error:
        prepare(on_map(source, **fleet))
    assert "\n" not in str(error.value)


def test_a_route_may_name_what_only_its_source_knows():
    scenario = read_scenario(
        {
            "name": "plain",
            "methods": ["local"],
            "perception": {"source": "tests.fleet_maps:Plain"},
            "start_jitter": "0 s",
            "cameras": [{"name": "front", "recording": "front"}],
            "cars": [{"name": "car1", "device": "jetson_tx2", "route": {"trace": "veh 7"}}],
        }
    )
    frames: Any = prepare(scenario).frames
    assert frames.asked == [("car1", "veh 7", 0)]
