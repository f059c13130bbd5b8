"""A car that paces its looks and its edge in real ROS 1: two masters and a link that fails.

Nightly: Genies are attached three times, and frames are taken for as long.
"""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from tests.ros.conftest import DETECTOR, Keys, Master, free_port, until

pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.nightly]
FRAMES = 90


def looks(master: Master, way: str, outcome: str) -> list[int]:
    """The numbers of the frames whose looks had an outcome, in order of time."""
    records = map(json.loads, (master.folder / "record.jsonl").read_text().splitlines())
    return [
        record["header"]["stamp_ns"] // 10**9
        for record in records
        if record["record"] == "LookEvent" and (record["way"], record["outcome"]) == (way, outcome)
    ]


def test_an_edge_dies_and_comes_back(new_master: Callable[[str], Master], keys: Keys):
    """The camera stands 11 m before the car that its detectors see; a frame comes every 200 ms."""
    car, edge = new_master("car1"), new_master("edge1")
    car.start_node(DETECTOR, "detector.py", "_seconds:=0.4")
    edge.start_node(DETECTOR, "detector.py")
    address = f"127.0.0.1:{free_port()}"
    paced = {
        "settings": {"algorithm": "recommended"},
        "pose_topic": "/current_pose",
        "horizontal_fov_rad": 1.4,
    }
    at_edge = {
        "role": "edge",
        "name": "edge1",
        "listen": address,
        "key_file": keys("edge1", "edge"),
    }
    edge.attach(**at_edge, **paced)
    car.attach(name="car1", connect=[f"edge1@{address}"], key_file=keys("car1", "car"), **paced)
    until(lambda: "edge edge1 is connected" in car.log_of_genie(), "the link is up")

    camera = car.camera(",".join(["2@9"] * FRAMES), 0.1, 1.0)
    camera.stdin.write("go\n")
    camera.stdin.flush()
    until(lambda: len(looks(car, "edge", "answered")) >= 5, "the edge looks")
    edge.detach()
    until(lambda: len(looks(car, "edge", "timed_out")) >= 2, "the car notices")
    until(lambda: len(looks(car, "own", "answered")) >= 5, "the own detector looks on")
    before = len(looks(car, "edge", "answered"))
    edge.attach(**at_edge, **paced)
    until(lambda: len(looks(car, "edge", "answered")) >= before + 5, "the edge looks again")

    answers = [json.loads(line) for line in camera.communicate(timeout=60)[0].splitlines()]
    first_s: dict[int, float] = {}
    for answer in answers:
        first_s.setdefault(answer["stamp_ns"] // 10**9, answer["after_s"])
    assert sorted(first_s) == list(range(1, FRAMES + 1)), "no frame is without an answer"
    assert sorted(first_s.values())[FRAMES // 2] < 0.02, "out of the map, not out of a detector"
    shown = [len(answer["objects"]) for answer in answers]
    assert max(shown) == 1 and sum(shown) > 0.8 * len(shown)
