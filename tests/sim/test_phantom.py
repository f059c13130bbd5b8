"""Section V-F: a car without cameras, helped by what another car's edge has seen."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.reading import read_scenario
from genie_sim.sim.cameras import POSITION_BYTES
from genie_sim.sim.method import OBJECTS
from genie_sim.sim.nodes import DetectorNode
from tests.make import build

EDGES = [{"name": f"edge{i}", "device": "agx_xavier"} for i in (1, 2)]
SEEING = {"name": "car1", "device": "jetson_tx2", "edge": "edge1"}
BLIND = {
    "name": "car2",
    "device": "jetson_tx2",
    "edge": "edge2",
    "cameras": False,
    "route": {"start": "2 s"},
}


def drive(*cars, method="genie"):
    """Frames and look-ups of cars on the made-up street, and the world they drove in."""
    setting = read_scenario({"name": "case", "edges": EDGES, "cars": list(cars)})
    world, tables = build(setting, method)
    world.run()
    return tables["frames"].to_frame(), tables["lookups"].to_frame(), world


@pytest.fixture(scope="module")
def both():
    return drive(SEEING, BLIND)


def test_the_blind_car_gets_objects_that_the_other_car_has_seen(both):
    """It uploads positions and no pictures."""
    frames, lookups, _ = both
    mine = frames[frames["car"] == "car2"]
    assert len(mine) == 240
    assert mine["first_answer_ns"].notna().mean() > 0.95
    assert mine["objects_served"].sum() > 100
    assert set(mine["bytes_up"]) <= {0, POSITION_BYTES}
    phantom = lookups[(lookups["genie"] == "car2/genie") & (lookups["kind"] != "image")]
    assert phantom["hits"].sum() > 0


def test_alone_on_the_street_it_gets_empty_answers():
    frames, _, _ = drive({**BLIND, "route": {}})
    assert frames["first_answer_ns"].notna().mean() > 0.95
    assert frames["objects_served"].sum() == 0


def test_nobody_detects_anything_where_the_phantoms_are(both):
    _, _, world = both
    detectors = {
        one.name.split("/")[0] for one in world.network.resources if isinstance(one, DetectorNode)
    }
    assert detectors == {"car1", "edge1"}
    phantom = world.edges["edge2"].graph.node("edge2/genie")
    assert OBJECTS in phantom.publishes, "the remote phantom took the detector's topics over"
    accelerators = {
        one.name: one.completed for one in world.network.resources if one.kind == "accelerator"
    }
    assert accelerators["car1.accelerator"] > 0
    assert accelerators["car2.accelerator"] == accelerators["edge2.accelerator"] == 0


def test_the_seeing_car_is_served_as_much(both):
    """Phantoms ask and never answer neighbours; their questions come in between, so answers are not
    the very same.
    """
    with_it, _, _ = both
    without, _, _ = drive(SEEING)
    ours = with_it[with_it["car"] == "car1"].reset_index(drop=True)
    assert len(ours) == len(without)
    assert (ours["objects_served"] == without["objects_served"]).mean() > 0.9


@pytest.mark.parametrize("method", ["local", "remote"])
def test_without_genie_a_car_without_cameras_has_nothing(method):
    frames, _, _ = drive(SEEING, BLIND, method=method)
    assert set(frames["car"]) == {"car1"}


@pytest.mark.parametrize(
    ("car", "genie", "message"),
    [
        (
            {**BLIND, "edge": "edge1"},
            {},
            r"cars\[1\].edge: serves car1's cameras; a car without needs one of its own",
        ),
        ({**BLIND, "edge": None}, {}, r"cars\[1\].cameras: a car without cameras needs an 'edge'"),
        (
            {**BLIND, "genie": False},
            {},
            r"cars\[1\].cameras: a car without cameras needs an 'edge' and 'genie: true'",
        ),
        (
            BLIND,
            {"similarity": "exact"},
            r"cars\[1\].cameras: a car without cameras has only its position",
        ),
    ],
)
def test_a_car_without_cameras_needs_somebody_to_ask(car, genie, message):
    with pytest.raises(UserError, match=message):
        read_scenario({"name": "blind", "edges": EDGES, "cars": [SEEING, car], "genie": genie})


def test_the_phantom_on_the_edge_is_an_edges_genie():
    genie = {"car_capacity": "3 entries", "capacity": "1000 entries", "share_requests": False}
    setting = read_scenario(
        {"name": "case", "edges": EDGES, "cars": [SEEING, BLIND], "genie": genie}
    )
    world, tables = build(setting, "genie")
    world.run()
    completed = {one.name: one.completed for one in world.network.resources}
    assert completed["edge2->edges"] == 0, "it shares no requests"
    lookups = tables["lookups"].to_frame()
    entries = lookups[lookups["kind"] == "image"].groupby("genie", observed=True)["entries"].max()
    assert entries["car2/genie"] <= 3 < entries["edge1/genie"]
