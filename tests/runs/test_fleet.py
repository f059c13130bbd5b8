"""A fleet: its cells, its cars, their hand-overs, and that a run of it is as reproducible as any
other.
"""

from __future__ import annotations

import gc
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from genie_sim.base.errors import UserError
from genie_sim.base.settings import from_plain, plain_data
from genie_sim.base.units import NS_PER_MS, NS_PER_S
from genie_sim.record.records import Tables
from genie_sim.runs.fleet import CHECK_NS, Cells, device_of_each
from genie_sim.runs.folder import rerun, run_in_memory, run_to_folder
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.faults import FaultEntry
from genie_sim.scenario.fleet import Fleet
from genie_sim.scenario.reading import load_scenario, read_scenario
from genie_sim.scenario.scenario import Scenario, as_yaml
from genie_sim.scenario.yaml_input import parse
from genie_sim.study.design import load_design
from genie_sim.study.plan import plan
from genie_sim.study.work import Parts
from genie_sim.worlds.town import Town

SMALL: dict[str, Any] = {
    "name": "small",
    "methods": ["genie"],
    "perception": {
        "source": "town",
        "duration": "6 s",
        "town": {"blocks": [3, 2], "block": "100 m"},
    },
    "cameras": [{"name": "camera_02", "recording": "02", "size": "100 kB"}],
    "fleet": {
        "cars": 5,
        "devices": "jetson_tx2",
        "edge_device": "rtx_a4500",
        "cell": "100 m",
        "hysteresis": "5 m",
    },
}


WHOLE = {"town": {**SMALL["perception"]["town"], "parked_cars_per_100m": 15, "popularity": 1}}


def small(**settings: Any) -> Scenario:
    return read_scenario({**SMALL, **settings})


def fleet(**settings: Any) -> dict[str, Any]:
    return {**SMALL["fleet"], **settings}


# Cells


def test_cells_fill_the_town_in_rows_from_the_south_west():
    cells = Cells((0.0, 0.0, 300.0, 200.0), 100.0)
    assert (len(cells), cells.columns, cells.rows) == (6, 3, 2)
    assert [cells.name(cell) for cell in range(6)] == [
        f"edge_{c}_{r}" for r in range(2) for c in range(3)
    ]
    assert [cells.at(*place) for place in ((1, 1), (150, 99), (299, 1), (1, 101), (299, 199))] == [
        0,
        1,
        2,
        3,
        5,
    ]
    assert cells.at(-5, -5) == 0 and cells.at(305, 205) == 5, (
        "streets along the rim lie half outside"
    )
    assert cells.distance_m(4, 150.0, 110.0) == 40.0
    assert len(Cells((0.0, 0.0, 300.0, 200.0), 130.0)) == 4, (
        "as many as fit best: 2.3 and 1.5 in a row are 2 and 2"
    )
    assert len(Cells((0.0, 0.0, 300.0, 200.0), 5000.0)) == 1


def test_neighbours_are_the_cells_beyond_a_border_and_have_each_other():
    cells = Cells((0.0, 0.0, 300.0, 300.0), 100.0)
    assert cells.neighbours(4) == [1, 3, 5, 7]
    assert cells.neighbours(0) == [1, 3]
    assert all(
        cell in cells.neighbours(other) for cell in range(9) for other in cells.neighbours(cell)
    )


@given(st.floats(-50, 450), st.floats(-50, 350), st.floats(80, 500))
def test_no_other_middle_is_nearer(east_m: float, north_m: float, cell_m: float):
    cells = Cells((0.0, 0.0, 400.0, 300.0), cell_m)
    nearest = min(cells.distance_m(cell, east_m, north_m) for cell in range(len(cells)))
    assert cells.distance_m(cells.at(east_m, north_m), east_m, north_m) == pytest.approx(nearest)


def test_a_car_is_handed_over_the_hysteresis_behind_each_border():
    """10 m/s east through cells of 100 m, 50 m from their middles: ``x`` behind a border the old
    middle is farther by hypot(50 + x, 50) - hypot(50 - x, 50) = 2 x / sqrt(2) or a little less; 14
    m then need 10 m, just over a second.
    """
    cells = Cells((0.0, 0.0, 400.0, 200.0), 100.0)
    found = cells.passed(
        lambda t_ns: (t_ns / NS_PER_S * 10.0, 100.0 - 1e-9), 39 * NS_PER_S, 14.0, 0
    )
    assert [cell for _, cell in found] == [0, 1, 2, 3]
    for number, (since_ns, _) in enumerate(found[1:], 1):
        behind_m = since_ns / NS_PER_S * 10.0 - 100.0 * number
        assert 9.9 < behind_m < 10.1 + CHECK_NS / NS_PER_S * 10.0
        assert since_ns % CHECK_NS == 0


def test_no_hand_over_for_moves_smaller_than_the_hysteresis():
    cells = Cells((0.0, 0.0, 200.0, 100.0), 100.0)

    def swaying(t_ns: int) -> tuple[float, float]:
        return 100.0 + (4.0 if t_ns // NS_PER_S % 2 else -4.0), 50.0

    assert len(cells.passed(swaying, 60 * NS_PER_S, 10.0, 0)) == 1
    assert len(cells.passed(swaying, 60 * NS_PER_S, 7.0, 0)) == 60, "8 m of difference"
    slow = cells.passed(swaying, 60 * NS_PER_S, 7.0, 3 * NS_PER_S)
    assert all(later - earlier >= 3 * NS_PER_S for (earlier, _), (later, _) in pairwise(slow[1:]))
    assert slow[1] == cells.passed(swaying, 60 * NS_PER_S, 7.0, 0)[1], (
        "before the first, no gap keeps it from looking"
    )


def test_cells_of_a_map_that_begins_elsewhere():
    here, there = Cells((0.0, 0.0, 300.0, 200.0), 100.0), Cells((-50.0, 700.0, 250.0, 900.0), 100.0)
    for east_m, north_m in ((1.0, 1.0), (150.0, 99.0), (299.0, 1.0), (1.0, 101.0)):
        assert there.at(east_m - 50.0, north_m + 700.0) == here.at(east_m, north_m)
        for cell in range(6):
            away_m = there.distance_m(cell, east_m - 50.0, north_m + 700.0)
            assert away_m == pytest.approx(here.distance_m(cell, east_m, north_m))


# Cars


def test_devices_have_their_shares_and_one_more_car_changes_nobody_elses():
    shares = {"jetson_tx2": 0.7, "orin_nano": 0.2, "agx_orin": 0.1}
    several = [list(device_of_each(shares, cars)) for cars in (1000, 1001)]
    assert several[1][:1000] == several[0]
    assert {name: count / 1000 for name, count in Counter(several[0]).items()} == pytest.approx(
        shares, abs=0.005
    )


def test_the_order_in_which_shares_are_written_is_nobodys_choice():
    """Run ids do not see it, so cars must not either."""
    orders = {"jetson_tx2": 0.5, "orin_nano": 0.5}, {"orin_nano": 0.5, "jetson_tx2": 0.5}
    one, other = (from_plain(Fleet, fleet(devices=devices)) for devices in orders)
    assert list(device_of_each(one.devices, 9)) == list(device_of_each(other.devices, 9))


def test_one_more_car_changes_nobody_elses_way_or_device():
    devices = {"jetson_tx2": 0.5, "orin_nano": 0.5}
    nine, ten = (prepare(small(fleet=fleet(cars=cars, devices=devices))) for cars in (9, 10))
    assert ten.scenario.cars[:9] == nine.scenario.cars
    for name, drive in nine.drives.items():
        assert [frame.pose for frame in drive.frames["02"]] == [
            frame.pose for frame in ten.drives[name].frames["02"]
        ]


def test_whole_numbers_and_fractions_make_the_same_town():
    default, whole = (
        prepare(small(perception={**SMALL["perception"], **more})) for more in ({}, WHOLE)
    )
    assert default.facts == whole.facts
    frames = [prepared.drives["car1"].frames["02"][0] for prepared in (default, whole)]
    assert frames[0].detections == frames[1].detections and frames[0].digest == frames[1].digest


def hand_overs(whole: Scenario, car: str) -> list[FaultEntry]:
    """Those of one car, in order of time."""
    return [one for one in whole.faults if one.fault.name == "hand_over" and one.target == car]


def test_every_car_begins_at_the_nearest_edge_and_changes_to_known_edges():
    prepared = prepare(small(fleet=fleet(cars=40)))
    whole, truth = prepared.scenario, prepared.frames.scene
    assert isinstance(truth, Town)
    names = {edge.name for edge in whole.edges}
    assert (
        len(whole.cars)
        == 40
        == len({drive.frames["02"][0].pose for drive in prepared.drives.values()})
    )
    cells = Cells((0.0, 0.0, *truth.size_m), 100.0)
    assert len(names) == len(cells) == 6
    assert len(whole.faults) > 5
    for car in whole.cars:
        drive: Any = prepared.drives[car.name]
        assert car.edge == cells.name(cells.at(*drive.position(0)))
        assert drive.start_ns == whole.start_ns(car), "it sees the town as it is when it is there"
        for one in hand_overs(whole, car.name):
            assert one.begin_ns is not None
            at = drive.position(one.begin_ns - drive.start_ns)
            assert one.fault.parameters["edge"] == cells.name(cells.at(*at))
    checked = read_scenario(plain_data(replace(whole, fleet=None)))
    expanded = whole.cars, whole.edges, whole.faults
    assert (
        checked.cars,
        checked.edges,
        checked.faults,
    ) == expanded, "what was not validated would have passed"


def test_what_is_written_down_stays_small_and_reads_back():
    setting = small(fleet=fleet(cars=1000, devices={"jetson_tx2": 0.5, "orin_nano": 0.5}))
    assert len(as_yaml(plain_data(setting))) < 6000
    assert read_scenario(parse(as_yaml(plain_data(setting)), "resolved")) == setting
    assert len(str(prepare(setting).facts)) < 20_000


def test_another_seed_is_another_town_with_other_ways():
    first, again, other = (prepare(small(seed=seed)) for seed in (1, 1, 2))
    assert first.facts["traces"] == again.facts["traces"] != other.facts["traces"]
    poses = [prepared.drives["car1"].frames["02"][0].pose for prepared in (first, again, other)]
    assert poses[0] == poses[1] != poses[2]


def alone(**settings: Any) -> Scenario:
    car = {"name": "a", "device": "jetson_tx2", "edge": "e", **settings}
    return small(fleet=None, cars=[car], edges=[{"name": "e", "device": "agx_xavier"}])


def test_explicit_cars_may_drive_in_a_town_too():
    frames = simulate(prepare(alone(route={"start": "1 s"})))["frames"].to_frame()
    assert len(frames) == 60 and set(frames["car"]) == {"a"}


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            {"route": {"window": ["1 s", "3 s"]}},
            r"cars\[0\].route.window: a town's clock never goes back",
        ),
        (
            {"route": {"laps": 2}},
            r"cars\[0\].route.laps: a town's clock never goes back; use 'perception.duration'",
        ),
        (
            {"cameras": False},
            r"cars\[0\].cameras: without cameras, cars drive recorded streets only",
        ),
    ],
)
def test_what_a_town_cannot_do_is_refused(setting: dict[str, Any], message: str):
    with pytest.raises(UserError, match=message):
        alone(**setting)


def test_what_a_fleet_costs_to_expand_grows_with_its_cars_only(monkeypatch: pytest.MonkeyPatch):
    """Every car looks for its cell at its start and at every check, however many others there
    are.
    """
    looks: Counter[str] = Counter()
    at = Cells.at

    def counted(self: Cells, east_m: float, north_m: float) -> int:
        looks["at"] += 1
        return at(self, east_m, north_m)

    monkeypatch.setattr(Cells, "at", counted)
    checks = -(-6 * NS_PER_S // CHECK_NS)
    for cars in (10, 100):
        looks.clear()
        prepare(small(fleet=fleet(cars=cars)))
        assert looks["at"] == cars * (checks + 1)


# Runs


@pytest.fixture(scope="module")
def tables() -> Tables:
    return simulate(prepare(small()))


def test_every_frame_of_every_car_is_answered_dropped_or_in_flight(tables: Tables):
    frames = tables["frames"].to_frame()
    assert Counter(frames["car"]) == dict.fromkeys((f"car{n}" for n in range(1, 6)), 60)
    assert not (frames["result_answer_ns"].notna() & frames["drop"].notna()).any()
    assert frames["first_answer_ns"].notna().mean() > 0.9


def test_the_resources_of_a_fleet_are_those_of_its_edges(tables: Tables):
    resources = set(tables["resources"].to_frame()["resource"].astype(str))
    assert resources and all(name.startswith("edge_") and "car" not in name for name in resources)


@pytest.mark.parametrize("record", [("lookups", "poses"), ("resources", "objects")])
def test_tables_that_are_left_out_are_empty_and_change_no_other(
    tables: Tables, record: tuple[str, str]
):
    without = simulate(prepare(small(record=[*record, "answers", "held", "held_objects", "steps"])))
    for name, table in tables.items():
        if name in {"lookups", "resources", "poses", "objects"} - {*record}:
            assert len(table) > 0 and len(without[name]) == 0
        else:
            assert without[name].to_frame().equals(table.to_frame()), name


@pytest.mark.parametrize(("name", "cars_to_a_cell"), [("fleet_30", 7.5), ("fleet_1000", 20.4)])
def test_shipped_fleets_can_be_expanded(name: str, cars_to_a_cell: float):
    """With as many cars to a cell in the mean as their comments say; one short drive each here."""
    setting = load_scenario(name, ["perception.duration=1 s"])
    assert setting.fleet is not None and setting.fleet.cars == int(name.removeprefix("fleet_"))
    whole = prepare(setting).scenario
    assert len(whole.cars) / len(whole.edges) == pytest.approx(cars_to_a_cell, abs=0.05)


def test_caches_on_cars_may_have_a_capacity_of_their_own():
    limits = {"eviction": "lru", "capacity": "40 entries", "car_capacity": "3 entries"}
    rows = simulate(prepare(small(genie=limits)))["lookups"].to_frame().query("kind == 'image'")
    assert dict(rows.groupby("placement", observed=True)["entries"].max()) == {"car": 3, "edge": 40}


@pytest.mark.slow
def test_a_fleets_folder_is_made_again_byte_for_byte(tmp_path: Path):
    result = run_to_folder(small(), tmp_path)
    assert set(rerun(result.folder).values()) == {"identical"}


@pytest.mark.slow
def test_a_sweep_over_fleets_gives_each_run_what_it_gives_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("small.yaml").write_text(as_yaml(plain_data(small())))
    Path("s.yaml").write_text(
        "scenario: ./small.yaml\nseeds: [1, 2]\naxes: {cars: {set: fleet.cars, list: [1, 2]}}\n"
    )
    made = plan(load_design(Path("s.yaml")), "s.yaml")
    assert len(made.runs) == 4
    parts = Parts(tmp_path)
    parts.run(list(made.runs.values()), 1)
    table = parts.read(made.runs)
    for run_id, one in made.runs.items():
        mine = table[(table["run_id"] == run_id) & (table["component"] == "")]
        mine = mine.set_index("metric")["value"]
        measured = run_in_memory(one.scenario).measured
        alone = {metric.metric: metric.value for metric in measured if not metric.component}
        for name in ("answered_share", "first_answer_mean", "ghost_share"):
            assert mine[name] == alone[name], (one.scenario.seed, name)


def test_a_camera_that_no_car_in_town_has_is_told():
    with pytest.raises(
        UserError, match=r"scenario: cameras\[0\].recording: unknown recording '04'"
    ):
        prepare(small(cameras=[{"name": "camera_04", "recording": "04"}]))


def test_a_fleet_changes_edges_without_delay_between_old_and_new():
    """The gap is the fleet's: a car with a gap of 2 s is not handed over twice within it."""
    whole = prepare(small(fleet=fleet(cars=40, hysteresis="0 m", hand_over_gap="2 s"))).scenario
    assert {one.fault.parameters["gap_ns"] for one in whole.faults} == {2000 * NS_PER_MS}
    for car in whole.cars:
        for earlier, later in pairwise(hand_overs(whole, car.name)):
            assert earlier.begin_ns is not None and later.begin_ns is not None
            assert later.begin_ns - earlier.begin_ns >= 2000 * NS_PER_MS


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings", [("street_3car_hetero",), ("fleet_30", "perception.duration=3 s")]
)
def test_a_run_makes_nothing_that_only_the_cycle_collector_frees(settings):
    """It is off meanwhile, and on again afterwards."""
    scenario, *overrides = settings
    prepared = prepare(load_scenario(scenario, ["methods=[genie]", *overrides]))
    gc.collect()
    found: list[int] = []

    def look(simulated_s: float, end_s: float, _: str) -> None:
        if simulated_s > 0.9 * end_s and not found:
            assert not gc.isenabled()
            found.append(gc.collect())

    simulate(prepared, look)
    assert found == [0] and gc.isenabled()
