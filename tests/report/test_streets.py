"""The ground of a fleet's map on the page: borders, cells and streets, of a town and of any map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import genie_sim as gs
from genie_sim.report import html_page
from genie_sim.report.data import page_data
from genie_sim.report.streets import ground
from genie_sim.runs.folder import run_in_memory
from tests.fleet_maps import SOUTH_M, SPEED_MPS, WEST_M, on_map


@pytest.fixture(scope="module")
def on_plain():
    """Two cars that drive one way eastwards, the second one 3 s later; 300 m by 100 m."""
    return run_in_memory(on_map("Traffic"))


def test_a_map_has_the_borders_and_cells_of_its_source(on_plain):
    area = ground(on_plain)
    assert area.extent_m == (WEST_M, SOUTH_M, WEST_M + 300, SOUTH_M + 100)
    assert (area.columns, area.rows) == (3, 1)
    assert area.main_streets == []


def test_streets_are_drawn_where_cars_have_driven_each_once(on_plain):
    (street,) = ground(on_plain).streets
    corners = np.array(street).reshape(-1, 2)
    assert (corners[:, 1] == SOUTH_M + 50).all()
    assert (np.diff(corners[:, 0]) > 0).all()
    end_m = WEST_M + 9.5 * SPEED_MPS  # the last frame
    assert corners[0, 0] == pytest.approx(WEST_M, abs=5)
    assert corners[-1, 0] == pytest.approx(end_m, abs=5)


def test_streets_turn_with_the_cars(on_plain):
    poses = on_plain.tables["poses"]
    turn = poses.floats("stamp_ns") * 1e-9 * SPEED_MPS / 60.0  # a circle of 60 m radius
    round_poses = poses.assign(
        east_m=WEST_M + 150 + 60 * np.sin(turn), north_m=SOUTH_M + 50 - 60 * np.cos(turn)
    )
    tables = {**on_plain.tables, "poses": round_poses}
    streets = ground(replace(on_plain, tables=tables)).streets
    corners = np.concatenate([np.array(street).reshape(-1, 2) for street in streets])
    radii_m = np.hypot(corners[:, 0] - WEST_M - 150, corners[:, 1] - SOUTH_M - 50)
    assert radii_m == pytest.approx(60, abs=1)
    lengths_m = [np.hypot(*np.diff(np.reshape(s, (-1, 2)), axis=0).T).sum() for s in streets]
    assert sum(lengths_m) == pytest.approx(12.5 * SPEED_MPS, abs=15), "until the second one's end"


def test_a_town_has_its_streets_and_of_these_the_main_ones_apart():
    settings = {
        "fleet.cars": 1,
        "fleet.cell": "400 m",
        "perception.duration": "1 s",
        "perception.town": {"blocks": [5, 2], "block": "200 m", "main_every": 4},
        "methods": ["local"],
    }
    area = ground(gs.run("fleet_30", settings))
    assert area.extent_m == (0, 0, 1000, 400)
    assert (area.columns, area.rows) == (2, 1), "2.5 and 1 cells long"
    assert [0, 0, 0, 400] in area.main_streets and [800, 0, 800, 400] in area.main_streets
    assert len(area.main_streets) == 2 + 1
    assert [0, 200, 1000, 200] in area.streets and [1000, 0, 1000, 400] in area.streets
    assert len(area.streets) == 4 + 2


def test_results_that_do_not_say_where_the_map_ends_have_none(on_plain):
    facts = {name: value for name, value in on_plain.facts.items() if name != "map"}
    data = page_data(replace(on_plain, facts=facts))
    assert data["fleet"] is None
    assert any("do not say where its borders are" in note for note in data["notes"])


def test_the_page_draws_a_map_that_begins_anywhere(browser, on_plain, tmp_path):
    file = tmp_path / "r.html"
    html_page.write(file, on_plain)
    browser.open(file)
    assert browser.errors == []
    east = browser.evaluate("DATA.fleet.cars[0].east.at(-1)")
    assert east == WEST_M + 9.5 * SPEED_MPS
    assert "where a car has driven" in browser.evaluate("byId('fleet-legend').innerText")
    colors = {"h": "hit", "a": "hit", "m": "miss", "c": "coalesced", "n": "none"}
    outcome = browser.evaluate(
        "DATA.fleet.cars[0].outcomes[byId('fleet-method').value][Number(byId('fleet-time').value)]"
    )
    assert pixels_like(browser, colors[outcome]) > 10, "cars stand on the canvas"
    assert pixels_like(browser, "road") > 100, "and so does their street"


def test_an_address_names_an_instant_of_the_map(browser, on_plain, tmp_path):
    file = tmp_path / "r.html"
    html_page.write(file, on_plain)
    method = on_plain.methods[0].name
    browser.open(file, f"#fleet=3&method={method}&layer=unknown")
    clock = "byId('fleet-clock').textContent"
    assert browser.evaluate(clock) == "3.0 s"
    assert browser.evaluate("byId('fleet-method').value") == method
    browser.evaluate(
        "byId('fleet-map').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}))"
    )
    shown = browser.evaluate(clock).removesuffix(" s")
    assert browser.evaluate("location.hash").startswith(f"#fleet={shown}&method={method}&layer=")
    assert browser.errors == []


def pixels_like(browser, color: str) -> int:
    """How many pixels of the map have about a colour of the page."""
    return browser.evaluate(
        f"(() => {{ const c = byId('fleet-map'), p = c.getContext('2d'), want = looks().{color};"
        " p.fillStyle = want; const hex = p.fillStyle, rgb = [1, 3, 5].map((k) =>"
        " parseInt(hex.slice(k, k + 2), 16)), d = p.getImageData(0, 0, c.width, c.height).data;"
        " let n = 0; for (let k = 0; k < d.length; k += 4)"
        " n += d[k + 3] > 200 && rgb.every((v, i) => Math.abs(v - d[k + i]) < 12); return n })()"
    )
