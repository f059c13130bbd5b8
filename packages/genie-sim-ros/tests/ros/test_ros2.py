"""A Genie in front of an unmodified ROS 2 node; virtual networks are domains."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros.conftest import (
    ATTACH,
    DETACH,
    HERE,
    PATIENCE_S,
    PYTHONPATH,
    Keys,
    end,
    end_all,
    free_port,
    until,
)

pytestmark = pytest.mark.slow
DETECTOR = "/detector"
NODES = """
import json, time, rclpy
rclpy.init()
node = rclpy.create_node("observer")
time.sleep(1.5)
def topics(get):
    infrastructure = ("/rosout", "/parameter_events")
    return [topic for topic, _ in get("detector", "/") if topic not in infrastructure]
try:
    subscribes = topics(node.get_subscriber_names_and_types_by_node)
    publishes = topics(node.get_publisher_names_and_types_by_node)
    print(json.dumps({"subscribes": subscribes, "publishes": publishes}))
except rclpy.node.NodeNameNonExistentError:
    print("null")
"""
UNTOUCHED = {"subscribes": ["/image_raw"], "publishes": ["/objects"]}
BEHIND_GENIE = {"subscribes": ["/image_raw_local"], "publishes": ["/objects_local"]}


@pytest.fixture(scope="session")
def ros2_python() -> Path:
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    python = (
        Path(os.environ.get("GENIE_SIM_ROS2_VENV") or cache / "genie-sim" / "ros2")
        / "bin"
        / "python"
    )
    if not python.exists():
        pytest.skip(f"needs ROS 2's wheels: no {python} (.ci/install-ros)")
    version = "import sys, rclpy; print(sys.version_info[:2])"
    tried = subprocess.run([python, "-c", version], capture_output=True, text=True)
    if tried.stdout.strip() != str(sys.version_info[:2]):
        pytest.skip(
            f"ROS 2 in {python} is for Python {tried.stdout.strip() or tried.stderr.strip()}"
        )
    return python


class Domain:
    """One ROS 2 domain and the processes started in it."""

    def __init__(self, python: Path, folder: Path, number: int) -> None:
        self.folder = folder
        folder.mkdir()
        self._python = python
        self._processes: list[subprocess.Popen[str]] = []
        self.env = {
            **os.environ,
            "ROS_DOMAIN_ID": str(number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_HOME": str(folder / "ros_home"),
            "PYTHONPATH": f"{PYTHONPATH}:{sysconfig.get_path('purelib')}",
        }

    def start(self, *command: object, **env: str) -> subprocess.Popen[str]:
        with (self.folder / "errors").open("a") as errors:
            process = subprocess.Popen(
                [self._python, *map(str, command)],
                env={**self.env, **env},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
            )
        self._processes.append(process)
        return process

    def start_detector(self, seconds: float = 0.05, **env: str) -> subprocess.Popen[str]:
        process = self.start(HERE / "detector2.py", DETECTOR_SECONDS=str(seconds), **env)
        until(lambda: self.topics() == UNTOUCHED, "the detector has started")
        return process

    def attach(self, pid: int, **arguments: object) -> subprocess.Popen[str]:
        given = {
            "node": DETECTOR,
            "pid": pid,
            "record": str(self.folder / "record.jsonl"),
            **arguments,
        }
        process = self.start("-c", ATTACH, json.dumps(given))
        assert process.stdout is not None
        assert "Genie attached" in process.stdout.readline(), (self.folder / "errors").read_text()
        return process

    def detach(self) -> None:
        subprocess.run(
            [self._python, "-c", DETACH, DETECTOR], env=self.env, check=True, timeout=PATIENCE_S
        )

    def play(
        self, places: str, pause_s: float = 0.15, listen_s: float = 0.5
    ) -> list[dict[str, Any]]:
        output, _ = self.start(HERE / "camera2.py", places, pause_s, listen_s).communicate(
            timeout=PATIENCE_S
        )
        return [json.loads(line) for line in output.splitlines()]

    def topics(self) -> dict[str, list[str]] | None:
        return json.loads(self.start("-c", NODES).communicate(timeout=PATIENCE_S)[0])

    def lookups(self) -> list[tuple[str, str]]:
        records = map(json.loads, (self.folder / "record.jsonl").read_text().splitlines())
        return [
            (one["header"]["origin"], one["outcome"])
            for one in records
            if one["record"] == "ImageLookup"
        ]

    def looks(self, way: str, outcome: str) -> list[int]:
        """The numbers of the frames whose looks had an outcome, in order of time."""
        records = map(json.loads, (self.folder / "record.jsonl").read_text().splitlines())
        return [
            record["header"]["stamp_ns"] // 10**9
            for record in records
            if record["record"] == "LookEvent"
            and (record["way"], record["outcome"]) == (way, outcome)
        ]

    def pid_of_detector(self) -> int | None:
        """Also of one that a watchdog has started again."""
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                ours = f"ROS_HOME={self.env['ROS_HOME']}\0".encode()
                if ours in (process / "environ").read_bytes():
                    command = (process / "cmdline").read_bytes().split(b"\0")
                    if str(HERE / "detector2.py").encode() in command:
                        return int(process.name)
        return None

    def log_of_genie(self) -> str:
        return "".join(
            log.read_text() for log in (self.folder / "ros_home" / "genie-sim").glob("*.log")
        )

    def close(self) -> None:
        for process in reversed(self._processes):
            end(process)
        end_all(self.env["ROS_HOME"])


@pytest.fixture
def new_domain(ros2_python: Path, tmp_path: Path) -> Iterator[Callable[[str, int], Domain]]:
    domains: list[Domain] = []

    def make(name: str, number: int) -> Domain:
        domains.append(Domain(ros2_python, tmp_path / name, number))
        return domains[-1]

    yield make
    for domain in domains:
        domain.close()


def genie_of(attached: subprocess.Popen[str]) -> int:
    """The process of the Genie that ``attach`` has started."""
    children = Path(f"/proc/{attached.pid}/task/{attached.pid}/children").read_text().split()
    return next(
        int(pid)
        for pid in children
        if b"genie_sim_ros.ros2" in Path(f"/proc/{pid}/cmdline").read_bytes()
    )


def test_the_second_time_at_a_place_is_a_hit(new_domain: Callable[[str, int], Domain]):
    car = new_domain("car1", 71)
    detector = car.start_detector()
    attached = car.attach(detector.pid)
    until(lambda: car.topics() == BEHIND_GENIE, "the master knows the new topics")

    answers = car.play("1,2,3,1,2,3")

    assert [outcome for _, outcome in car.lookups()] == ["miss"] * 3 + ["hit"] * 3
    assert [answer["stamp_ns"] for answer in answers] == [
        second * 10**9 + 7 for second in range(1, 7)
    ]
    assert {answer["frame_id"] for answer in answers} == {"camera_02"}
    assert [answer["objects"] for answer in answers] == [
        [["car", place, 0.75, f"place {place}"]] for place in (1, 2, 3, 1, 2, 3)
    ]
    car.detach()
    assert attached.wait(PATIENCE_S) == 0
    until(lambda: car.topics() == UNTOUCHED, "the node has its own topics again")


def test_a_killed_genie_leaves_the_robot_with_its_node(new_domain: Callable[[str, int], Domain]):
    car = new_domain("car1", 72)
    attached = car.attach(car.start_detector().pid)
    os.kill(genie_of(attached), signal.SIGKILL)
    assert attached.wait(PATIENCE_S) == 1
    until(lambda: car.topics() == UNTOUCHED, "the watchdog has restored the node")


def test_two_domains_are_two_virtual_networks(new_domain: Callable[[str, int], Domain], keys: Keys):
    """The car's detector takes a minute, the edge's 50 ms; only the link joins their domains."""
    car, edge = new_domain("car1", 73), new_domain("edge1", 74)
    address = f"127.0.0.1:{free_port()}"
    at = {"role": "edge", "name": "edge1", "listen": address, "cars": ["car1"]}
    edge.attach(edge.start_detector().pid, **at, keys=keys("edge1"))
    detector = car.start_detector(seconds=60.0)
    car.attach(detector.pid, name="car1", connect=[f"edge1@{address}"], keys=keys("car1"))
    until(lambda: "edge edge1 is connected" in car.log_of_genie(), "the link is up")
    answers = car.play("1,2,1", pause_s=1.3, listen_s=0.8)
    assert car.lookups() == [("car1", "miss"), ("car1", "miss"), ("car1", "hit")]
    assert edge.lookups() == [("car1", "miss")] * 2
    assert [answer["objects"][0][1] for answer in answers] == [1, 2, 1]


@pytest.mark.alone
@pytest.mark.nightly
def test_paced_looks_outlive_edges_that_leave_hang_and_come_back(
    new_domain: Callable[[str, int], Domain], keys: Keys
):
    """A frame comes every second, as its stamp says. The first edge leaves, the second hangs for
    longer than any backoff, and the first comes back.
    """
    car, *edges = new_domain("car1", 75), new_domain("edge1", 76), new_domain("edge2", 77)
    addresses = {edge.folder.name: f"127.0.0.1:{free_port()}" for edge in edges}
    paced = {
        "settings": {"method": "recommended", "in_flight": 1, "stale": "3 s"},
        "pose_topic": "/current_pose",
        "horizontal_fov_rad": 1.4,
    }

    def attach(edge: Domain) -> subprocess.Popen[str]:
        pid = until(edge.pid_of_detector, "the detector runs")
        name = edge.folder.name
        at = {"role": "edge", "name": name, "listen": addresses[name], "cars": ["car1"]}
        return edge.attach(pid, **at, keys=keys(name), **paced)

    def looks_again(what: str) -> None:
        before = len(car.looks("edge", "answered"))
        until(lambda: len(car.looks("edge", "answered")) >= before + 3, what)

    attached = []
    for edge in edges:
        edge.start_detector(DETECTOR_FRAME="map")
        attached.append(attach(edge))
    detector = car.start_detector(0.4, DETECTOR_FRAME="map")
    peers = [f"{name}@{address}" for name, address in addresses.items()]
    car.attach(detector.pid, name="car1", connect=peers, keys=keys("car1"), **paced)
    for name in addresses:
        until(lambda name=name: f"edge {name} is connected" in car.log_of_genie(), "a link is up")
    time.sleep(6)
    assert "is cut" not in car.log_of_genie(), "also without a camera"
    assert (car.folder / "record.jsonl").read_text() == ""

    camera = car.start(HERE / "camera2.py", ",".join(["2@9"] * 3000), 0.9, 1.0)
    looks_again("an edge looks")
    edges[0].detach()
    until(lambda: "edge1 is cut" in car.log_of_genie(), "the first edge has left")
    looks_again("the second edge looks")
    genie = genie_of(attached[1])
    before = len(car.looks("edge", "timed_out")), len(car.looks("own", "answered"))
    os.kill(genie, signal.SIGSTOP)
    until(lambda: len(car.looks("edge", "timed_out")) >= before[0] + 5, "the backoff grows")
    until(lambda: "edge2 is cut" in car.log_of_genie(), "the car notices")
    assert len(car.looks("own", "answered")) >= before[1] + 5, "the own detector looks on"
    os.kill(genie, signal.SIGCONT)
    looks_again("the second edge looks again")
    attach(edges[0])
    until(lambda: car.log_of_genie().count("edge edge1 is connected") == 2, "it is back")
    edges[1].detach()
    looks_again("the first edge looks again")
    camera.terminate()
    answers = [json.loads(line) for line in camera.communicate(timeout=PATIENCE_S)[0].splitlines()]
    stamps = sorted({answer["stamp_ns"] // 10**9 for answer in answers})
    assert stamps == list(range(1, len(stamps) + 1)), "no frame is without an answer"
    assert sum(len(answer["objects"]) for answer in answers) > len(answers) // 2
    sent = car.looks("edge", "sent")
    assert len(sent) == len(set(sent)), "each frame goes up but once"
