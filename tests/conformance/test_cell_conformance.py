"""The radio cell, and recorded links."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from tests.conformance import small
from tests.conformance.link_models import LinkModelConformance

CELLS = [
    {"model": "cell"},
    {"model": "cell", "power": {"up": "-5 dBm"}, "interference_margin": "20 dB", "delay": "0 s"},
]


@pytest.mark.parametrize("link", CELLS)
class TestCell(LinkModelConformance):
    edges = ({"at": ["30 m", "-20 m"]}, {"at": ["-60 m", "40 m"]})


@pytest.mark.parametrize("link", [{"model": "trace", "offset": "begin", "up": "80 Mbit/s"}])
class TestTrace(LinkModelConformance):
    pass


def test_a_cell_is_recorded_and_its_cars_share_it():
    """Two cars at one edge get less than one alone, and the cell is busy as long as one sends."""
    link = {"model": "cell", "path_loss": "none"}
    cars = [small.car(1, link=link), small.car(2, link=link, edge="edge1")]
    both = small.tables(small.scenario(["remote"], cars=cars))
    apart = small.tables(small.scenario(["remote"], cars=[cars[0], small.car(2, link=link)]))
    share, share_alone = (
        tables["frames"].query("car == 'car1'")["fresh_answer_ns"].notna().mean()
        for tables in (both, apart)
    )
    assert 0 < share < 0.8 * share_alone
    cells = both["resources"].query("kind == 'cell'").groupby("resource").last()
    assert set(cells.index) == {f"edge{i}.cell_{way}" for i in (1, 2) for way in ("up", "down")}
    links = both["resources"].query("kind == 'link'").groupby("resource").last()
    up = links.loc[["car1->edge1", "car2->edge1"]]
    assert cells.at["edge1.cell_up", "bytes"] == up["bytes"].sum() > 0
    assert up["busy_ns"].max() <= cells.at["edge1.cell_up", "busy_ns"] < up["busy_ns"].sum()
    assert cells.at["edge2.cell_up", "busy_ns"] == 0
    assert both["resources"].query("resource == 'edge1.cell_up'")["queue"].max() == 2


def test_a_hand_over_leaves_nothing_in_the_old_cell():
    link = {"model": "cell", "path_loss": "none", "up": {"bandwidth": "3 MHz"}}
    cars = [small.car(1, link=link), small.car(2)]
    fault = {"fault": "hand_over", "target": "car1", "edge": "edge2", "begin": "1 s"}
    tables = small.tables(small.scenario(["remote"], cars=cars, faults=[fault]))
    small.check_conserved(tables["frames"], ["remote"])
    old = tables["resources"].query("resource == 'edge1.cell_up'")
    assert (old[old["t_ns"] > 10**9]["queue"] == 0).all()
    assert (old[old["t_ns"] < 10**9]["queue"] == 1).any()
    assert tables["resources"].query("resource == 'edge2.cell_up'")["bytes"].max() > 0
    assert "car1:hand_over" in set(tables["frames"]["drop"])


def test_without_coverage_frames_are_lost_on_the_link():
    link = {"model": "cell", "power": {"up": "-100 dBm"}}
    edges = [{"name": "edge1", "device": "agx_xavier", "at": ["0 m", "0 m"]}]
    cars = [small.car(1, link=link), small.car(2, link="ideal", edge="edge1")]
    tables = small.tables(small.scenario(["remote"], cars=cars, edges=edges))
    frames = tables["frames"].query("car == 'car1'")
    assert set(frames["drop"]) == {"car1->edge1"} and frames["first_answer_ns"].isna().all()
    dropped = tables["resources"].query("resource == 'edge1.cell_up'")["dropped"].max()
    assert 1 <= dropped <= 4, "each message takes a second to be given up"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "edges[0].at: missing; link model 'cell' needs it"),
        ({"edge_network": {"model": "cell"}}, "edge_network: link model 'cell' needs cars"),
        (
            {"methods": ["local", {"method": "remote", "edge_network": {"model": "cell"}}]},
            "methods[1].edge_network: link model 'cell' needs cars",
        ),
    ],
)
def test_a_cell_that_does_not_fit_the_scenario_is_one_line(settings: dict, message: str):
    link = {"model": "cell", "path_loss": "none" if settings else "umi"}
    cars = [small.car(1, link=link), small.car(2)]
    with pytest.raises(UserError) as error:
        small.scenario(**{"methods": ["remote"], "cars": cars, **settings})
    assert message in str(error.value) and "\n" not in str(error.value)
