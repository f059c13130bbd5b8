"""A car with uplinks to several edges."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.base.errors import UserError
from genie_sim.methods.remote import Remote
from genie_sim.sim.method import DIRECT_UPLINK, HostConfig, HostContext
from tests.sim.street import build, fixed_device, scenario, street

CAR = {
    "name": "car1",
    "device": "jetson_tx2",
    "edge": "edge1",
    "further_uplinks": [{"edge": "edge2", "link": "wifi"}],
}
EDGES = [{"name": "edge1", "device": "agx_xavier"}, {"name": "edge2", "device": "quadro_rtx_4000"}]
DEVICES = {
    "jetson_tx2": fixed_device("jetson_tx2", detector="300 ms"),
    "agx_xavier": fixed_device("agx_xavier", detector="60 ms"),
    "quadro_rtx_4000": fixed_device("quadro_rtx_4000", detector="20 ms"),
}


class Twice(Remote):
    """Every frame goes up all uplinks."""

    title = "twice"

    def on_car(self, host: HostContext) -> HostConfig:
        further = dict.fromkeys(host.further_edges, DIRECT_UPLINK)
        return HostConfig(uplink=DIRECT_UPLINK, further_uplinks=further)


def ran(method: str = f"{__name__}:Twice", **settings: Any) -> tuple[Any, Any]:
    """The world of a run, and its frames."""
    usual = {
        "methods": [{"method": method}],
        "cameras": [{"name": "camera", "recording": "02", "rate": "2 Hz"}],
        "edges": EDGES,
    }
    setting = scenario([CAR], **usual | settings)
    world, tables = build(setting, setting.methods[0].name, street(seconds=2.0), DEVICES)
    world.run()
    return world, tables


def test_every_edge_gets_the_frames_and_the_first_answer_counts():
    world, tables = ran()
    assert {name for name in world.network.links if name.startswith("car1->")} == {
        "car1->edge1",
        "car1->edge2",
    }
    for edge in ("edge1", "edge2"):
        assert world.network.links[f"car1->{edge}"].completed == 4
        assert world.network.links[f"{edge}->car1"].completed == 4
    frames = tables["frames"].to_frame()
    assert set(frames["source"]) == {"edge_detector"}, "both edges are the car's own"
    hosts = tables["hosts"].to_frame().set_index("host")
    images = 2 * 4 * 1_397_297
    assert hosts.loc["car1", "bytes_up"] >= images


def test_a_method_that_asks_for_none_uses_none():
    world, _ = ran("remote")
    assert "car1->edge2" not in world.network.links


def test_an_outage_of_one_uplink_leaves_the_other():
    faults = [{"fault": "outage", "target": "car1->edge2", "begin": "0 s"}]
    _, tables = ran(faults=faults)
    frames = tables["frames"].to_frame()
    assert frames["first_answer_ns"].notna().all()


@pytest.mark.parametrize(
    ("car", "faults", "text"),
    [
        ({"further_uplinks": [{"edge": "edge3"}]}, [], "cars[0].further_uplinks[0].edge: unknown"),
        ({"further_uplinks": [{"link": "lte"}]}, [], "cars[0].further_uplinks[0].edge: missing"),
        ({"further_uplinks": [{"edge": "edge1"}]}, [], "further_uplinks[0].edge: duplicate"),
        ({"edge": None}, [], "cars[0].further_uplinks: need a car with an 'edge' and cameras"),
        (
            {},
            [{"fault": "hand_over", "target": "car1", "begin": "1 s", "edge": "edge2"}],
            "faults[0].edge: car1 has an uplink to edge2 already",
        ),
    ],
)
def test_an_uplink_to_no_edge_is_refused(car: dict[str, Any], faults: list[Any], text: str):
    with pytest.raises(UserError) as told:
        scenario([CAR | car], edges=EDGES, faults=faults)
    assert text in str(told.value)
