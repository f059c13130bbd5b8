"""One method of a fleet in several processes: the tables of one process, to the byte."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import genie_sim as gs
from genie_sim import part_processes, runner, split
from genie_sim.cli import main
from genie_sim.errors import UserError
from genie_sim.part_processes import PartJob, PartTables, _by_camera, _by_event, in_parts
from genie_sim.recording import later_places
from genie_sim.recording.columns import Columns
from genie_sim.recording.records import Tables
from genie_sim.runner import prepare, simulate, simulate_with
from genie_sim.scenario.scenario import Scenario, load_scenario, read_scenario
from genie_sim.sim.settings import Car
from genie_sim.sim.share import EDGES, Exchange, OrderUnknown
from genie_sim.sim.timeline import Timeline
from tests.test_method_processes import written

OF_PARTS = ["lookups", "looks", "resources", "poses", "held"]


def fleet(methods: list[Any] | None = None, **settings: Any) -> Scenario:
    """Twelve cars that change between four edges, and lose messages in doing so."""
    usual = {
        "name": "parts",
        "methods": ["genie"] if methods is None else methods,
        "record": OF_PARTS,
        "perception": {
            "source": "town",
            "duration": "5 s",
            "town": {"blocks": [2, 2], "block": "80 m"},
        },
        "cameras": [
            {"name": "camera_02", "recording": "02", "size": "60 kB"},
            {"name": "camera_03", "recording": "03", "size": "30 kB", "phase": "30 ms"},
        ],
        "fleet": fleet_settings(),
    }
    return read_scenario(usual | settings)


def fleet_settings(**settings: Any) -> dict[str, Any]:
    return {
        "cars": 12,
        "devices": {"jetson_tx2": 0.5, "orin_nano": 0.5},
        "edge_device": "agx_xavier",
        "cell": "80 m",
        "hysteresis": "1 m",
    } | settings


@pytest.fixture
def in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts run in threads, which start faster than processes and connect in the same way."""

    def run_all(
        run: Callable[[PartJob], Any], jobs: list[PartJob], workers: int, ordered: bool = True
    ) -> Iterator[Any]:
        assert workers == len(jobs), "each part needs a process, or all wait for ever"
        with ThreadPoolExecutor(workers) as pool:
            yield from pool.map(run, jobs)

    monkeypatch.setattr(part_processes, "in_processes", run_all)


def refuse_one_process(*_: Any) -> Tables:
    raise AssertionError("one process simulates all of it")


@pytest.mark.parametrize("workers", [2, 3])
@pytest.mark.parametrize(
    "method",
    [
        "genie",
        "remote",
        "local",
        "central",
        {"name": "looking", "method": "genie", "genie": "recommended"},
        {"name": "waiting", "method": "genie", "genie": {"miss_policy": "blocking"}},
    ],
    ids=str,
)
def test_parts_together_write_the_tables_of_one_process(
    method: Any, workers: int, tmp_path: Path, in_threads: None, monkeypatch: pytest.MonkeyPatch
):
    prepared = prepare(fleet([method]))
    tables = simulate(prepared)
    frames, hosts = tables["frames"].to_frame(), tables["hosts"].to_frame()
    assert len(tables["faults"])
    held = tables["held"].to_frame()
    assert {"consumer", "zero_delay"} == set(held["what"]) and held["moved_away"].sum()
    if method == "remote":
        assert {"car", "edge"} <= set(frames["drop"].dropna().str.extract("^(car|edge)")[0])
        assert frames["drop"].dropna().str.contains("hand_over").any()
    if method != "local":
        assert hosts["bytes_down"].sum() and hosts["transfer_ns"].sum()
    one = written(tables, tmp_path / "one")
    monkeypatch.setattr(runner, "simulate", refuse_one_process)
    monkeypatch.setattr(later_places, "INSTANTS_AT_ONCE", 50)  # of several hundred
    spill = tmp_path / "spill"
    spill.mkdir()
    parts = written(simulate_with(prepared, workers, spill=spill), tmp_path / "parts")
    assert [name for name in one if parts[name] != one[name]] == []
    assert not list(spill.iterdir())


def test_where_the_order_of_events_is_unknown_one_process_simulates_all(
    tmp_path: Path, in_threads: None, monkeypatch: pytest.MonkeyPatch
):
    """All cars take their frames at the same instants, and all links take the same times."""
    link = {"like": "nr5g", "jitter": "0 ms"}
    prepared = prepare(fleet(["remote"], start_jitter="0 s", fleet=fleet_settings(link=link)))
    one = written(simulate(prepared), tmp_path / "one")
    asked = []
    monkeypatch.setattr(
        runner, "in_parts", lambda *given, **named: asked.append(in_parts(*given, **named))
    )
    assert written(simulate_with(prepared, 2), tmp_path / "two") == one
    assert asked == [None]


def connected(job: PartJob, tables: PartTables, exchange: Exchange, _: Any) -> None:
    """Parts that only say what they are, more than a connection holds, and listen later."""
    tables.begin(lambda: 0)
    others = range(1, job.parts) if job.number == EDGES else [EDGES]
    much = b"x" * 3_000_000
    for turn in range(3):
        exchange.give({other: (turn, job.number, other, much) for other in others})
    for turn in range(3):
        assert exchange.take() == {other: (turn, other, job.number, much) for other in others}


def test_parts_hear_what_others_tell_them_in_its_order(in_threads: None):
    tables = in_parts(connected, 3, cars=["car1"], hosts=["car1"], streams=["camera"])
    assert tables is not None and not any(map(len, tables.values()))


def broken(job: PartJob, tables: PartTables, exchange: Exchange, _: Any) -> None:
    tables.begin(lambda: 0)
    if job.number == 1:
        raise UserError("no such thing")
    exchange.give({1: None, 2: None} if job.number == EDGES else {EDGES: None})
    exchange.take()


def test_what_is_wrong_in_one_part_is_told_and_not_that_others_miss_it(in_threads: None):
    with pytest.raises(UserError, match=r"^no such thing$"):
        in_parts(broken, 3, cars=[], hosts=[], streams=[])


def killed(job: PartJob, tables: PartTables, exchange: Exchange, _: Any) -> None:
    if job.number == 1:
        os._exit(3)
    exchange.give({1: None})
    exchange.take()


def test_a_killed_part_is_told_in_one_line():
    with pytest.raises(UserError, match=r"^a worker process was killed"):
        in_parts(killed, 2, cars=[], hosts=[], streams=[])


@pytest.mark.nightly
def test_processes_write_the_results_of_one_process():
    one, two = (
        gs.run(fleet().to_yaml(), out=f"with {workers}", workers=workers) for workers in (1, 2)
    )
    assert one.run_id == two.run_id
    names = {path.name for path in one.folder.iterdir()} - {"run.json"}
    for name in names:
        assert (one.folder / name).read_bytes() == (two.folder / name).read_bytes(), name


# The order of rows


@given(
    st.lists(st.tuples(st.integers(0, 30), st.integers(1, 6)), min_size=1, max_size=6),
    st.integers(1, 9),
)
def test_rows_of_frames_are_in_the_order_in_which_one_timeline_takes_them(
    cameras: list[tuple[int, int]], interval_ns: int
):
    timeline, rows = Timeline(), []

    def take(camera: int, frames: int) -> None:
        rows.append((timeline.now, camera))
        if frames > 1:
            timeline.after(interval_ns, take, (camera, frames - 1))

    for camera, (begin_ns, frames) in enumerate(cameras):
        timeline.after(begin_ns, take, (camera, frames))
    timeline.pass_time(100)
    stamp_ns, camera = np.array(sorted(rows, key=lambda row: row[1])).T
    order = _by_camera(stamp_ns, camera)
    assert list(zip(stamp_ns[order].tolist(), camera[order].tolist(), strict=True)) == rows


def of_events(*events: tuple[int, int]) -> Columns:
    return Columns(dict(zip(("t_ns", "scheduled_ns"), np.array(events).T, strict=True)))


def test_rows_of_events_are_in_the_order_in_which_one_timeline_has_them():
    rows = of_events((7, 4), (9, 1), (9, 1), (7, 3), (9, 0), (8, 8))
    part = np.array([0, 0, 0, 1, 1, 1])
    assert _by_event(rows, part).tolist() == [3, 0, 5, 4, 1, 2]


def test_rows_of_two_parts_that_only_one_process_could_order_are_refused():
    part = np.array([0, 1])
    with pytest.raises(OrderUnknown):
        _by_event(of_events((7, 4), (7, 4)), part)
    assert _by_event(of_events((7, 4), (7, 4)), part * 0).tolist() == [0, 1]


def test_frames_at_changing_intervals_have_no_known_order():
    with pytest.raises(OrderUnknown):
        _by_camera(np.array([0, 10, 30]), np.array([0, 0, 0]))


# What can be split


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({}, ""),
        ({"record": ["lookups", "steps", "answers"]}, "it records answers, steps"),
        ({"judged": "all"}, "every stream of a car is judged"),
        ({"methods": ["sim_lru"]}, "sim_lru cannot be split"),
        ({"image_encoding": "jpeg90"}, "images are encoded"),
        (
            {"faults": [{"fault": "outage", "target": "car1", "begin": "1 s", "end": "2 s"}]},
            "it has the fault outage",
        ),
        ({"methods": ["tests.conformance.own:Again"]}, "Again cannot be split"),
        (
            {"genie": {"eviction": "tests.conformance.own:OwnEviction", "capacity": "9 entries"}},
            "it runs code of its own",
        ),
    ],
)
def test_what_cannot_be_split_says_why(settings: dict[str, Any], reason: str):
    scenario = fleet(**settings)
    assert split.obstacle(scenario, scenario.methods[0]) == reason


@pytest.mark.parametrize("link", ["ideal", {"model": "cell"}])
def test_links_that_do_not_tell_their_delay_are_not_split(link: Any):
    scenario = fleet(fleet=fleet_settings(link=link))
    assert split.obstacle(scenario, scenario.methods[0]).startswith(
        "a message may take less than 100 us on the cars' link"
    )


def test_cars_that_are_no_fleet_are_not_split():
    scenario = load_scenario("3car_hetero", ["methods=[genie]", "record=[]"])
    assert split.obstacle(scenario, scenario.methods[0]) == "it has no fleet"


@pytest.mark.parametrize("processes", [2, 3, 7])
@pytest.mark.parametrize("record", [[], ["held"]])
def test_each_process_gets_cars_and_the_one_with_the_edges_fewer(processes: int, record: list[str]):
    cars = tuple(Car(f"car{number}", "orin_nano") for number in range(1000))
    owner = split.owners(replace(fleet(record=record), cars=cars), processes)
    assert list(owner) == [car.name for car in cars]
    counts = np.bincount(list(owner.values()), minlength=processes)
    others = counts[1:]
    assert others.min() > 0.9 * others.max() and counts[EDGES] < others.min()
    share = split.EDGES_SHARE_JUDGED if record else split.EDGES_SHARE
    load = counts / 1000 * (1 - share) + share * (np.arange(processes) == EDGES)
    if share < 1 / processes:
        assert np.ptp(load) < 0.02


def test_the_command_line_says_why_a_run_is_not_split(capsys):
    settings = ["--set", "perception.duration=1 s", "--set", "fleet.cars=3", "--no-report"]
    assert main(["run", "fleet_30", "--methods", "genie", "--workers", "2", *settings]) == 0
    line = capsys.readouterr().out.splitlines()[0]
    assert line.startswith("fleet_30 runs in one process, because it records answers, held_objects")
