"""A run as a trace for Perfetto: hosts, lanes, slices in their order, and queues."""

from __future__ import annotations

import json
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import genie_sim as gs
from genie_sim.cli.main import main
from genie_sim.report import perfetto

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run() -> gs.Run:
    return gs.run("street_2car_homo", {"cars[0].route.window": ["0 s", "1 s"]})


@pytest.fixture(scope="module")
def events(run: gs.Run, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    path = tmp_path_factory.mktemp("perfetto") / "run.json"
    count = perfetto.export(run, path)
    found: list[dict[str, Any]] = json.loads(path.read_text())["traceEvents"]
    assert count == sum(event["ph"] != "M" for event in found)
    return found


def names(events: list[dict[str, Any]], what: str) -> dict[Any, str]:
    number = "pid" if what == "process_name" else "tid"
    return {one[number]: one["args"]["name"] for one in events if one["name"] == what}


def slices(events: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [event for event in events if event["ph"] == "X"]


def test_processes_are_hosts_under_a_method_and_threads_their_lanes(events):
    processes = names(events, "process_name")
    hosts = [f"{method}: {host}" for method in ("local", "genie") for host in ("car1", "car2")]
    assert {*hosts, "genie: edge1", "remote: edge2"} <= set(processes.values())
    kinds = {title.split()[0] for title in names(events, "thread_name").values()}
    assert kinds == {"accelerator", "cpu", "uplink", "downlink"}
    lanes = {
        (processes[one["pid"]], names(events, "thread_name")[one["tid"]].split()[0])
        for one in slices(events)
    }
    assert ("remote: car1", "uplink") in lanes and ("remote: edge1", "accelerator") in lanes
    assert ("genie: car1", "cpu") in lanes and ("remote: edge1", "uplink") not in lanes


def test_every_service_on_the_way_of_an_answer_is_one_slice(events, run):
    columns = ["method", "car", "stream", "stamp_ns", "part", "place", "begin_ns", "end_ns"]
    service = run.steps[run.steps["part"].isin(perfetto.LANES)]
    expected = service.drop_duplicates(columns)
    assert len(slices(events)) == len(expected) < len(service)
    stamp = run.frames.iloc[3]
    name = f"{stamp.car}/{stamp.stream} {stamp.frame}"
    of_frame = [one for one in slices(events) if one["name"] == name]
    assert of_frame and {one["args"]["stamp_ns"] for one in of_frame} == {stamp.stamp_ns}


def test_microseconds_are_whole_and_keep_the_order_of_nanoseconds(events):
    of_lane = defaultdict(list)
    for one in slices(events):
        assert type(one["ts"]) is int and type(one["dur"]) is int and one["dur"] >= 0
        assert one["ts"] == one["args"]["begin_ns"] // 1000
        assert one["ts"] + one["dur"] == one["args"]["end_ns"] // 1000
        of_lane[one["tid"]].append(one)
    timed = [event["ts"] for event in events if event["ph"] != "M"]
    assert timed == sorted(timed)
    for lane in of_lane.values():
        for before, after in pairwise(lane):
            assert before["args"]["begin_ns"] <= after["args"]["begin_ns"]
            assert before["ts"] + before["dur"] <= after["ts"], "slices of a lane never overlap"


def test_counters_are_the_queues_whenever_they_change(events, run):
    found = defaultdict(list)
    processes = names(events, "process_name")
    for one in events:
        if one["ph"] == "C":
            found[processes[one["pid"]], one["name"]].append((one["ts"], one["args"]["messages"]))
    rows = run.resources[run.resources["method"] == "local"]
    of_detector = rows[rows["resource"] == "car1/vision_darknet_detect"]
    told = dict(found["local: car1", "waiting for car1/vision_darknet_detect"])
    now = 0
    for t_ns, queue in zip(of_detector["t_ns"], of_detector["queue"], strict=True):
        now = told.get(t_ns // 1000, now)
        assert now == queue
    assert max(told.values()) > 0


def test_the_command_writes_the_methods_that_are_asked_for(run, capsys):
    folder = gs.run(run.scenario, out="results", report=False).folder
    assert main(["export", str(folder), "--format", "perfetto", "--methods", "remote"]) == 0
    path = folder / "run.perfetto.json"
    assert capsys.readouterr().out.startswith(f"{path}: ")
    processes = names(json.loads(path.read_text())["traceEvents"], "process_name").values()
    assert processes and all(name.startswith("remote: ") for name in processes)
    assert main(["export", str(folder), "--methods", "remot"]) == 1
    assert "--methods: unknown method 'remot' (did you mean 'remote'?)" in capsys.readouterr().err


def test_what_cannot_be_exported_gets_one_line(capsys):
    settings = {"cars[0].route.window": ["0 s", "0.3 s"], "record": ["poses"]}
    folder = gs.run("street_1car_homo", settings, out="bare", report=False).folder
    assert main(["export", str(folder), "--format", "perfetto"]) == 1
    assert "holds no steps, so there is nothing to show" in capsys.readouterr().err
    assert main(["export", str(folder), "--format", "perfeto"]) == 1
    said = capsys.readouterr().err
    assert "--format: unknown format 'perfeto' (did you mean 'perfetto'?); known: bag, mcap" in said
    assert not list(Path(folder).glob("run.perf*"))
