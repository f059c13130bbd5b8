"""Paced looks in whole runs: nothing is lost unnoticed, whatever the links and edges do."""

from __future__ import annotations

import json
from typing import Any

import pytest

from genie_sim.record.columns import Columns
from genie_sim.record.results import Run
from genie_sim.runs.folder import run_in_memory
from genie_sim.scenario.reading import load_scenario, read_scenario

S = 1_000_000_000
RUNS: dict[str, Run] = {}
LOOKING = {"name": "looking", "method": "recommended"}


def two_cars(link: object = "wifi", laps: int = 1) -> list[dict[str, Any]]:
    """Two cars on one edge, for 3 s of the recorded drive."""
    return [
        {
            "name": f"car{number}",
            "device": "jetson_tx2",
            "edge": "edge1",
            "link": link,
            "route": {"window": [f"{number} s", f"{number + 3} s"], "laps": laps, "pause": "0 s"},
        }
        for number in (1, 2)
    ]


def run(link: object = "wifi", laps: int = 1, **settings: object) -> Run:
    """The recommended Genie on two cars, or with other settings; each run once."""
    scenario = {
        "name": "looks",
        "methods": [LOOKING],
        "edges": [{"name": name, "device": "agx_xavier"} for name in ("edge1", "edge2")],
        "cars": two_cars(link, laps),
        **settings,
    }
    text = json.dumps(scenario)
    if text not in RUNS:
        RUNS[text] = run_in_memory(read_scenario(scenario))
    return RUNS[text]


def outcomes(looks: Columns, way: str = "edge") -> dict[str, int]:
    """How often each outcome occurs."""
    events = looks.where(way=way)
    names = ("sent", "answered", "stale", "overtaken", "timed_out")
    return {name: len(events.where(outcome=name)) for name in names}


OUTAGE = {"fault": "outage", "target": "edge1", "begin": "1 s", "end": "2 s"}
HAND_OVER = {
    "fault": "hand_over",
    "target": "car1",
    "begin": "2 s",
    "edge": "edge2",
    "gap": "50 ms",
}


@pytest.mark.parametrize(
    ("settings", "loses"),
    [
        ({"edges": [{"name": "edge1", "device": "rtx_a4500"}]}, False),
        ({"link": {"like": "wifi", "loss": 0.3}}, True),
        ({"link": "lte"}, True),
        ({"faults": [OUTAGE]}, True),
        ({"faults": [HAND_OVER]}, True),
        (
            {
                "edges": [
                    {"name": "edge1", "device": "jetson_tx2"},
                    {"name": "edge2", "device": "jetson_tx2"},
                ]
            },
            True,
        ),
    ],
    ids=["wired", "lossy", "slow", "outage", "hand-over", "overloaded"],
)
def test_what_goes_up_is_answered_or_known_to_be_lost(settings: dict[str, object], loses: bool):
    """At the end nothing is in flight: runs last until everything has come or expired."""
    counts = outcomes(Columns.of(run(**settings).tables["looks"]))
    assert counts["sent"] >= 12
    ended = sum(counts.values()) - counts["sent"]
    assert ended == counts["sent"], counts
    assert (counts["overtaken"] + counts["timed_out"] > 0) == loses, counts


def test_every_frame_is_answered_at_once_even_while_the_edge_is_away():
    frames = Columns.of(run(faults=[OUTAGE]).tables["frames"])
    first_ms = (frames.floats("first_answer_ns") - frames.floats("received_ns")) / 1e6
    assert not any(first_ms != first_ms), "none without an answer"
    assert first_ms.max() < 40


def test_while_the_edge_is_away_the_own_detector_looks_on_and_then_both_do():
    looks = Columns.of(run(faults=[OUTAGE]).tables["looks"])
    away = (looks["t_ns"] > 1.2 * S) & (looks["t_ns"] < 2 * S)
    later = looks["t_ns"] > 2.3 * S
    assert outcomes(looks.rows(away), "own")["answered"] > 2
    assert outcomes(looks.rows(away))["answered"] == 0
    assert outcomes(looks.rows(later))["answered"] > 2


def test_a_dead_link_leaves_what_the_own_detector_gives():
    """Frames go up to nobody, and the car holds what one without an edge holds."""
    dead = {"fault": "outage", "target": "edge1", "begin": "0 s"}
    lone = [
        {key: value for key, value in car.items() if key not in ("edge", "link")}
        for car in two_cars()
    ]
    f1, own = {}, {}
    for name, settings in {"dead": {"faults": [dead]}, "alone": {"cars": lone}}.items():
        result = run(**settings)
        (f1[name],) = [
            metric.value
            for metric in result.measured
            if metric.metric == "streaming_f1" and not metric.component.startswith("zero")
        ]
        own[name] = outcomes(Columns.of(result.tables["looks"]), "own")["answered"]
    assert own["dead"] == own["alone"] > 10
    assert f1["dead"] == pytest.approx(f1["alone"], abs=0.01)


def test_a_repeated_route_is_looked_at_as_often_as_the_first_time():
    """A message cache would answer the second lap without any look."""
    result = run(laps=2)
    frames, looks = (Columns.of(result.tables[name]) for name in ("frames", "looks"))
    laps = [frames.where(lap=lap) for lap in (0, 1)]
    counts = [
        sum(
            len(looks.where(car=car, way="edge", outcome="sent").rows(_between(looks, car, lap)))
            for car in ("car1", "car2")
        )
        for lap in laps
    ]
    assert counts[1] == pytest.approx(counts[0], rel=0.15)


@pytest.mark.slow
def test_a_standing_car_is_looked_for_only_without_a_cache():
    """At a red light every frame equals the one before to a cache of poses."""
    result = run_in_memory(load_scenario("red_light"))
    f1, fresh = (
        {metric.method: metric.value for metric in result.measured if metric.metric == name}
        for name in ("streaming_f1", "fresh_answered_share")
    )
    assert fresh["genie"] < 0.1 and fresh["genie_recommended"] > 0.9
    assert f1["genie"] < 0.2 < f1["remote_tracker"]
    assert f1["genie_recommended"] > f1["remote_tracker"] - 0.05


def _between(looks: Columns, car: str, lap: Columns):
    """Rows of a car's sent looks at frames of one lap."""
    stamps = lap.where(car=car)["stamp_ns"]
    sent = looks.where(car=car, way="edge", outcome="sent")["stamp_ns"]
    return (sent >= stamps.min()) & (sent <= stamps.max())


TOWN = {
    "name": "town",
    "perception": {"source": "town", "duration": "4 s", "town": {"blocks": [2, 2]}},
    "cameras": [{"name": "camera_02", "recording": "02", "size": "90 kB"}],
    "fleet": {
        "cars": 8,
        "devices": "orin_nano",
        "edge_device": "rtx_a4500",
        "link": "ethernet_1g",
        "cell": "150 m",
    },
    "methods": [
        {"name": "sharing", "method": "recommended"},
        {"name": "alone", "method": "recommended", "sharing": None},
    ],
}


@pytest.mark.slow
def test_in_one_world_edges_tell_cars_of_what_others_see():
    result = run_in_memory(read_scenario(TOWN))
    frames, held = (Columns.of(result.tables[name]) for name in ("frames", "held"))
    down = {name: frames.where(method=name)["bytes_down"].sum() for name in ("sharing", "alone")}
    right = {name: held.where(method=name)["right"].sum() for name in ("sharing", "alone")}
    assert down["sharing"] > down["alone"]
    assert right["sharing"] > right["alone"]
