"""The speed benchmark compares what it says it compares. How fast anything is decides no test."""

from __future__ import annotations

import gc
import json
import random
import shutil
import sys
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from statistics import fmean
from types import SimpleNamespace

import pytest
from benchmarks.both_engines import Engines, Pair

from benchmarks import both_engines, genie_runs, peers, speed, speed_page
from benchmarks.genie_runs import (
    Drive,
    Footprint,
    bytes_per_frame,
    drive,
    fleet,
    run_genie,
    three_cars,
    work_of,
)
from benchmarks.speed import Costs, Race, Sizes
from benchmarks.station import (
    ENGINES,
    PERIOD_NS,
    Outcome,
    Station,
    heapq_station,
    simpy_station,
    station_of,
)
from genie_sim.errors import UserError
from genie_sim.runner import prepare

MS = 1_000_000
NO_PYTHON = "/no/such/python"
TINY = Sizes(
    rounds=2,
    laps=1,
    fleets={5: 0.2},
    curves={"street": (3, 6), "town": (2, 4)},
    curve_s=0.2,
    curve_frames=10,
    longest_s=60,
    minutes=2,
    memory_laps=(1, 3),
    profile_entries=3,
    engines={"laps": 1, "lap_times": 1, "cars": 5, "fleet_s": 0.2},
    parts=(4, 0.2),
)


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_frames_that_never_meet_take_their_service_time(engine):
    station = Station(tuple(range(0, 100 * MS, 25 * MS)), frames=42, servers=1, service_ns=25 * MS)
    assert station.utilisation == 1
    assert engine(station).responses_ns == (25 * MS,) * 42


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_frames_of_one_instant_are_served_one_after_the_other(engine):
    """n at once and c servers: the k-th of them leaves after ceil(k / c) service times."""
    station = Station((0,) * 6, frames=60, servers=2, service_ns=30 * MS)
    responses_ns = engine(station).responses_ns
    assert len(responses_ns) == 60
    assert fmean(responses_ns) == 2 * 30 * MS, "a third each of one, two and three service times"


@pytest.mark.parametrize("engine", ENGINES.values(), ids=ENGINES)
def test_the_station_is_a_queue(engine):
    """M/D/1, Pollaczek-Khinchine: waits rho / (2 (1 - rho)) service times in the mean. Cameras that
    take one frame each at exponential distances are Poisson arrivals. One run of 30,000 with rho =
    0.5, seed 8, margin 5 %.
    """
    drawn = random.Random(8)
    arrivals_ns = tuple(accumulate(int(drawn.expovariate(1 / (2 * MS))) for _ in range(30_000)))
    mean_ns = engine(Station(arrivals_ns, frames=30_000, servers=1, service_ns=MS)).mean_response_ns
    assert mean_ns / MS - 1 == pytest.approx(0.5, rel=0.05)


def test_the_anchor_and_the_ceiling_agree_on_every_response():
    station = station_of(500, genie_runs.phases_ns(12))
    anchor, ceiling = simpy_station(station), heapq_station(station)
    assert anchor.frames == ceiling.frames == 500
    assert sorted(anchor.responses_ns) == sorted(ceiling.responses_ns)
    assert max(anchor.responses_ns) > station.service_ns, (
        "some frames wait, or queues are not compared at all"
    )
    assert anchor.events == pytest.approx(6 * 500, rel=0.1) and ceiling.events == 2 * 500


def test_stations_of_all_sizes_are_used_alike():
    for cars in (1, 3, 100, 1000):
        station = station_of(10, genie_runs.phases_ns(4 * cars))
        assert station.utilisation == pytest.approx(0.7, rel=1e-6)
        assert all(0 <= phase_ns < PERIOD_NS for phase_ns in station.phases_ns)


@pytest.mark.parametrize("name", peers.PEERS)
def test_other_simulators_agree_on_the_mean_response(name: str):
    station = station_of(200, genie_runs.phases_ns(12))
    answer = peers.run_peer(sys.executable, name, station)
    if "skipped" in answer:
        pytest.skip(f"{name}: {answer['skipped']}")
    assert answer["frames"] == 200
    assert answer["mean_response_ns"] == pytest.approx(simpy_station(station).mean_response_ns)


def test_a_peer_that_cannot_run_is_left_out_with_the_reason():
    assert (
        "No such file"
        in peers.run_peer(NO_PYTHON, "ciw", station_of(5, genie_runs.phases_ns(4)))["skipped"]
    )


def test_a_slow_peer_is_left_out_of_large_fleets_only(monkeypatch: pytest.MonkeyPatch):
    asked: list[str] = []
    answer = {"frames": 8, "cpu_s": 1.0, "version": "1.0"}
    monkeypatch.setattr(
        peers, "run_peer", lambda python, name, station: asked.append(name) or answer
    )
    speed.race(100, {}, {}, 8, rounds=1, peers_python=NO_PYTHON, skipped={}, versions={})
    speed.race(101, {}, {}, 8, rounds=1, peers_python=NO_PYTHON, skipped={}, versions={})
    assert asked == ["leafsim", "ciw", "salabim", "leafsim", "ciw"]


def test_all_engines_take_turns_with_the_same_number_of_frames():
    prepared = prepare(fleet(2, 0.3))
    work = work_of(prepared)
    skipped: dict[str, str] = {}
    order: list[str] = []

    def genie() -> Outcome:
        order.append("Genie")
        return run_genie(prepared)

    race = speed.race(
        2,
        {"Genie": genie},
        {"Genie": work.events},
        work.frames,
        rounds=2,
        peers_python=NO_PYTHON,
        skipped=skipped,
        versions={},
    )
    assert {name: [one.frames for one in outcomes] for name, outcomes in race.rounds.items()} == {
        name: [work.frames] * 2 for name in ("Genie", "simpy", "heapq")
    }
    assert list(skipped) == list(peers.PEERS) and order == ["Genie", "Genie"]
    assert (
        race.events_per_frame("Genie") == work.events / work.frames > race.events_per_frame("heapq")
    )


def test_a_fleet_has_the_cars_edges_and_frames_asked_for():
    scenario = fleet(25, 0.2)
    assert len(scenario.cars) == 25 and [entry.name for entry in scenario.methods] == ["genie"]
    assert [edge.neighbours for edge in scenario.edges] == [
        ("edge2",),
        ("edge1", "edge3"),
        ("edge2",),
    ]
    assert work_of(prepare(scenario)).frames == pytest.approx(25 * 4 * 2, rel=0.1), (
        "10 frames/s from four cameras"
    )


def test_towns_of_all_sizes_are_as_densely_driven():
    small, large = genie_runs.town(10, 0.3), genie_runs.town(1000, 0.3)
    cells = [
        scenario.source.town.blocks[0] * scenario.source.town.blocks[1]
        for scenario in (small, large)
    ]
    assert cells[1] / cells[0] == pytest.approx(1000 / 10, rel=0.4), "whole blocks"
    assert work_of(prepare(small)).frames == pytest.approx(10 * 3, rel=0.4), "one camera a car"


def test_longer_runs_are_more_of_the_same():
    assert {car.route.laps for car in three_cars(3).cars} == {3}
    assert len(three_cars(1).cameras) == 4 and len(three_cars(1, cameras=1).cameras) == 1
    prepared = prepare(fleet(2, 0.2))
    assert run_genie(prepared, times=3).frames == 3 * run_genie(prepared).frames


def test_a_drive_is_timed_from_the_first_to_the_last_frame():
    prepared = prepare(fleet(2, 0.55))
    drove = drive(prepared)
    assert drove.simulated_s[0] == 0 and 0.4 < drove.simulated_s[-1] < 0.8, (
        "5 s for late answers are left out"
    )
    assert list(drove.cpu_s) == sorted(drove.cpu_s)
    work = work_of(prepared)
    assert (drove.frames, drove.events, drove.cameras) == (work.frames, work.events, 2 * 4)


def test_costs_of_a_drive():
    drove = Drive(
        simulated_s=(0.0, 10.0, 20.0), cpu_s=(5.0, 6.0, 9.0), frames=8, events=80, cameras=2
    )
    assert drove.cost_s == 0.5
    assert drove.between(0, 10) == 1 and drove.between(10, 20) == 3 and drove.between(5, 15) == 2


def test_ratios_are_taken_within_rounds():
    """A round that the machine was slow in slows both: the median of ratios, not the ratio of
    medians (4 here).
    """
    rounds = {
        "a": [Outcome(frames=10, cpu_s=one) for one in (1.0, 0.5, 0.25)],
        "b": [Outcome(frames=10, cpu_s=one) for one in (2.0, 1.0, 2.5)],
    }
    race = Race(3, rounds)
    assert race.ratios("a", "b") == [2, 2, 10]
    assert race.ratio("a", "b") == 2 and race.rate("a") == 20 and race.rate("b") == 5
    assert race.ratio("b", "b") == 1


def test_engines_are_compared_with_the_station_beside_them():
    """A round that the machine was slow in slows both: ratios within pairs, then the median."""
    pairs = [
        Pair(10, genie_sim_s, station_s) for genie_sim_s, station_s in ((1, 2), (3, 3), (2, 8))
    ]
    engines = Engines(
        goals={"`remote`": 1.3},
        pairs={"plain Python": {"`remote`": pairs}},
        missing={"compiled": "no compiler"},
    )
    assert engines.microseconds("plain Python", "`remote`") == 200_000
    assert engines.over_station("plain Python", "`remote`") == 2
    assert both_engines.rows(engines) == [("`remote`", "200000.0", "2", "", "", "1.3")]


def test_both_engines_run_like_for_like_first():
    cases = both_engines.cases(laps=2, lap_times=3, cars=5, fleet_s=0.2)
    assert list(cases)[:2] == ["`remote`", "`local`"]
    made = {name: case.make() for name, case in cases.items()}
    assert {name: scenario.methods[0].name for name, scenario in made.items()} == {
        name: name.strip("`") if "`" in name else "genie" for name in cases
    }
    assert {name for name, scenario in made.items() if scenario.record} == {
        "Genie, first lap, all tables",
        "Genie, 2 laps, all tables",
    }
    assert {name: made[name].cars[0].route.laps for name in made if "lap" in name} == {
        "Genie, first lap": 1,
        "Genie, 2 laps": 2,
        "Genie, first lap, all tables": 1,
        "Genie, 2 laps, all tables": 2,
    }
    assert {name: len(scenario.cars) for name, scenario in made.items()} == {
        name: case.cars for name, case in cases.items()
    }


def test_an_engine_that_is_not_there_is_left_out_with_the_reason(monkeypatch: pytest.MonkeyPatch):
    """The plain engine is forced by the variable; the compiled one says why it does not run."""
    asked: list[str] = []

    def child(command: list[str], *, env: dict[str, str], **_: object) -> object:
        asked.append(env["GENIE_SIM_PURE"])
        pair = {"frames": 4, "genie_sim_s": 2.0, "station_s": 1.0}
        answer = {"is_compiled": False, "title": "plain Python (stale)", "pairs": {"x": pair}}
        return SimpleNamespace(stdout=f"a warning\n{json.dumps(answer)}\n")

    monkeypatch.setattr(both_engines.subprocess, "run", child)
    engines = both_engines.measure(2, TINY.engines)
    assert asked == ["1", "0", "1"]
    assert engines.pairs == {"plain Python": {"x": [Pair(4, 2.0, 1.0)] * 2}}
    assert engines.missing == {"compiled": "plain Python (stale)"}


def test_memory_is_that_of_one_more_frame():
    short = Footprint(100, {"frames": 5_000, "lookups": 1_000}, process_bytes=50_000_000)
    long = Footprint(300, {"frames": 25_000, "lookups": 2_000}, process_bytes=50_060_000)
    assert bytes_per_frame(short, long) == {
        "frames": 100,
        "lookups": 5,
        "all tables": 105,
        "whole process": 300,
    }


def test_the_cost_curve_compares_with_the_smallest_fleet_around_it(monkeypatch: pytest.MonkeyPatch):
    """A machine that gets slower all the time makes no fleet look dearer; one that would take too
    long is left out.
    """
    genie_s, clock_s = iter([1.0, 2.0, 3.0, 8.0, 5.0]), iter([0, 0, 10, 10, 10, 40])

    def fake(prepared: object, least_frames: int) -> Costs:
        return Costs(
            next(genie_s),
            anchor_s=1.0 + (prepared == 30),
            frames=least_frames,
            events_per_frame=6.0,
        )

    monkeypatch.setattr(speed, "costs", fake)
    monkeypatch.setattr(speed, "prepare", lambda scenario: scenario)
    monkeypatch.setitem(genie_runs.FLEETS, "made_up", lambda cars, drive_s: cars)
    monkeypatch.setattr(speed.time, "process_time", lambda: next(clock_s))
    sizes = replace(TINY, curves={"made_up": (3, 30, 300)}, longest_s=50)
    first, second, third = speed.cost_curve("made_up", sizes, lambda _: None)
    assert (first.growth, first.anchor_growth) == (1.0, 1.0)
    assert (second.growth, second.anchor_growth) == (2.0, 2.0)
    assert third.growth is None and third.missing == "not measured: it would take about 300 s", (
        "ten times 30 s"
    )


def test_costs_are_of_as_many_frames_as_asked_for():
    prepared = prepare(fleet(2, 0.2))
    once = speed.costs(prepared, least_frames=1)
    several = speed.costs(prepared, least_frames=once.frames + 1)
    assert (
        several.frames == 2 * once.frames and several.events_per_frame == once.events_per_frame > 1
    )
    assert once.genie_s > 0 and once.anchor_s > 0


def test_a_page_without_a_place_for_a_table_is_refused():
    assert speed_page.filled(
        "a\n<!-- measured: x -->\nold\n<!-- end -->\nb", "x", "new", "p.md"
    ) == ("a\n<!-- measured: x -->\nnew\n<!-- end -->\nb")
    with pytest.raises(UserError, match=r"p\.md: no place for 'y'"):
        speed_page.filled("<!-- measured: x -->\n<!-- end -->", "y", "new", "p.md")


@pytest.mark.slow
def test_the_whole_benchmark_fills_the_page(tmp_path: Path):
    gc.freeze()  # what other tests left is not looked through again before each of the runs
    measured = speed.measure(TINY, NO_PYTHON, "python benchmarks/speed.py", lambda _: None)
    gc.unfreeze()
    assert [race.cars for race in measured.races] == [3, 5]
    assert measured.work["Genie, first lap"] == measured.work["Genie, 1 laps"], (
        "one lap is the first lap"
    )
    assert measured.memory["frames"] > 0 and len(measured.profile) == 3
    assert {
        name: tuple(point.cars for point in curve) for name, curve in measured.curves.items()
    } == TINY.curves
    assert all(
        point.growth and point.anchor_growth
        for curve in measured.curves.values()
        for point in curve
    )
    docs = Path(tmp_path / "docs")
    (docs / "images").mkdir(parents=True)
    shutil.copy(speed_page.DOCS / "speed.md", docs)
    speed_page.write(measured, docs)
    page = (docs / "speed.md").read_text(encoding="utf-8")
    for name, block in speed_page.blocks(measured).items():
        assert f"<!-- measured: {name} -->\n{block}\n<!-- end -->" in page
    for name in ("speed_cars", "speed_time"):
        assert (docs / "images" / f"{name}.png").is_file() and f"images/{name}.png" in page
