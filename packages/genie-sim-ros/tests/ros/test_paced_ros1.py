"""A car that paces its looks and its edges in real ROS 1: a master for each, and links that fail.

Nightly: Genies are attached several times, and frames are taken for as long.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.ros.conftest import DETECTOR, PATIENCE_S, Keys, Master, free_port, until

pytestmark = [pytest.mark.slow, pytest.mark.alone, pytest.mark.nightly]
FRAMES = 3000  # more than any test waits for


def looks(master: Master, way: str, outcome: str) -> list[int]:
    """The numbers of the frames whose looks had an outcome, in order of time."""
    records = map(json.loads, (master.folder / "record.jsonl").read_text().splitlines())
    return [
        record["header"]["stamp_ns"] // 10**9
        for record in records
        if record["record"] == "LookEvent" and (record["way"], record["outcome"]) == (way, outcome)
    ]


class Cars:
    """A car with its detector of 400 ms, and edges with theirs of 50 ms, linked to it."""

    def __init__(
        self, new_master: Callable[[str], Master], keys: Keys, *edges: str, **looks: object
    ) -> None:
        self._keys = keys
        self._paced = {
            "settings": {"method": "recommended", **looks},
            "pose_topic": "/current_pose",
            "horizontal_fov_rad": 1.4,
        }
        self._addresses = {name: f"127.0.0.1:{free_port()}" for name in edges}
        self.attached: dict[str, subprocess.Popen[str]] = {}  # of edges
        self.car, self.edges = new_master("car1"), {name: new_master(name) for name in edges}
        self.car.start_node(DETECTOR, "detector.py", "_seconds:=0.4")
        for name, edge in self.edges.items():
            edge.start_node(DETECTOR, "detector.py")
            self.attach_edge(name)
        peers = [f"{name}@{address}" for name, address in self._addresses.items()]
        self.car.attach(name="car1", connect=peers, keys=keys("car1"), **self._paced)
        for name in edges:
            until(lambda name=name: self.times_connected(name) == 1, f"the link to {name} is up")

    def attach_edge(self, name: str) -> None:
        at = {"role": "edge", "name": name, "listen": self._addresses[name], "cars": ["car1"]}
        edge = self.edges[name]
        until(lambda: edge.pid_of(DETECTOR), f"the detector of {name} runs")
        self.attached[name] = edge.attach(**at, keys=self._keys(name), **self._paced)

    def times_connected(self, name: str) -> int:
        return self.car.log_of_genie().count(f"edge {name} is connected")

    def camera(self, frames: int, pause_s: float) -> subprocess.Popen[str]:
        """Frames of a camera that stands 11 m before the car that its detectors see; each comes
        100 ms after its pose.
        """
        camera = self.car.camera(",".join(["2@9"] * frames), pause_s, 1.0)
        assert camera.stdin is not None
        camera.stdin.write("go\n")
        camera.stdin.flush()
        return camera


def genie_of(attached: subprocess.Popen[str]) -> int:
    """The process of the Genie that ``attach`` has started."""
    children = Path(f"/proc/{attached.pid}/task/{attached.pid}/children").read_text().split()
    return next(
        int(pid)
        for pid in children
        if b"genie_sim_ros.ros1" in Path(f"/proc/{pid}/cmdline").read_bytes()
    )


def test_an_outage_is_longer_than_any_backoff(new_master: Callable[[str], Master], keys: Keys):
    """The edge's Genie hangs until its link counts as cut and timeouts grow no more. A frame comes
    every second, as its stamp says.
    """
    cars = Cars(new_master, keys, "edge1", in_flight=1, stale="3 s")
    car = cars.car
    camera = cars.camera(FRAMES, 0.9)
    until(lambda: len(looks(car, "edge", "answered")) >= 3, "the edge looks")
    genie = genie_of(cars.attached["edge1"])
    os.kill(genie, signal.SIGSTOP)
    until(lambda: len(looks(car, "edge", "timed_out")) >= 5, "the backoff is at its most")
    until(lambda: "edge1 is cut" in car.log_of_genie(), "the car notices")
    assert len(looks(car, "own", "answered")) >= 5, "the own detector looks on"
    sent = looks(car, "edge", "sent")
    assert max(later - earlier for earlier, later in pairwise(sent)) <= 6, "5 s and a frame"
    before = len(looks(car, "edge", "answered"))
    os.kill(genie, signal.SIGCONT)
    until(lambda: len(looks(car, "edge", "answered")) >= before + 3, "the edge looks again")
    camera.terminate()
    answers = [json.loads(line) for line in camera.communicate(timeout=PATIENCE_S)[0].splitlines()]
    stamps = sorted({answer["stamp_ns"] // 10**9 for answer in answers})
    assert stamps == list(range(1, len(stamps) + 1)), "no frame is without an answer"


def test_after_a_hand_over_frames_go_to_the_other_edge(
    new_master: Callable[[str], Master], keys: Keys
):
    """Both are connected; frames go up to one alone, and when it leaves, to the other."""
    cars = Cars(new_master, keys, "edge1", "edge2", stale="3 s")
    car = cars.car
    camera = cars.camera(FRAMES, 0.9)
    until(lambda: len(looks(car, "edge", "answered")) >= 3, "an edge looks")
    cars.edges["edge1"].detach()
    until(lambda: "edge1 is cut" in car.log_of_genie(), "the first edge has left")
    after = len(looks(car, "edge", "answered"))
    until(lambda: len(looks(car, "edge", "answered")) >= after + 3, "the other edge looks")
    assert "edge2 is cut" not in car.log_of_genie()
    cars.attach_edge("edge1")
    until(lambda: cars.times_connected("edge1") == 2, "the first edge is back")
    cars.edges["edge2"].detach()
    until(lambda: "edge2 is cut" in car.log_of_genie(), "the other edge has left")
    after = len(looks(car, "edge", "answered"))
    until(lambda: len(looks(car, "edge", "answered")) >= after + 3, "the first looks again")
    camera.terminate()
    camera.communicate(timeout=PATIENCE_S)
    sent = looks(car, "edge", "sent")
    assert len(sent) == len(set(sent)), "each frame goes up but once"


def test_a_car_without_cameras_asks_for_nothing(new_master: Callable[[str], Master], keys: Keys):
    """Its link stays up, longer than a silent one would."""
    cars = Cars(new_master, keys, "edge1")
    time.sleep(6)
    assert "is cut" not in cars.car.log_of_genie()
    assert (cars.car.folder / "record.jsonl").read_text() == ""


def test_an_edge_dies_and_comes_back(new_master: Callable[[str], Master], keys: Keys):
    """The camera stands 11 m before the car that its detectors see; a frame comes every 200 ms."""
    cars = Cars(new_master, keys, "edge1")
    car, edge = cars.car, cars.edges["edge1"]
    camera = cars.camera(FRAMES, 0.1)
    until(lambda: len(looks(car, "edge", "answered")) >= 5, "the edge looks")
    edge.detach()
    until(lambda: len(looks(car, "edge", "timed_out")) >= 2, "the car notices")
    until(lambda: len(looks(car, "own", "answered")) >= 5, "the own detector looks on")
    before = len(looks(car, "edge", "answered"))
    cars.attach_edge("edge1")
    until(lambda: len(looks(car, "edge", "answered")) >= before + 5, "the edge looks again")

    camera.terminate()
    answers = [json.loads(line) for line in camera.communicate(timeout=PATIENCE_S)[0].splitlines()]
    first: dict[int, list[Any]] = {}
    for answer in answers:
        first.setdefault(answer["stamp_ns"] // 10**9, answer["objects"])
    assert sorted(first) == list(range(1, len(first) + 1)), "no frame is without an answer"
    of_map = [objects for objects in first.values() if not any(one[3] for one in objects)]
    assert len(of_map) > len(first) // 2, "not out of a detector, which says more of an object"
    shown = [len(answer["objects"]) for answer in answers]
    assert max(shown) == 1 and sum(shown) > 0.8 * len(shown)
