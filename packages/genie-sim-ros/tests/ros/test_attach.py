"""Attaching to a node of a network that is made up: what is started, and that everything is put
back.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim_ros import attach
from genie_sim_ros.codec import WireType
from genie_sim_ros.process import NodeProcess
from tests.ros.conftest import until

pytestmark = pytest.mark.unix
NODE = """
import pathlib, sys, time
with pathlib.Path(sys.argv[1]).open("a") as file:
    print(*sys.argv[2:], file=file)
print("up", flush=True)
time.sleep(60)
"""


class Graph:
    """A network with one node, and a Genie that ends at once."""

    network, module, environment, image_type = "here", "no_such_module", {}, "sensor_msgs/Image"

    def __init__(self, process: NodeProcess) -> None:
        self.process = process
        self.started_again: list[NodeProcess] = []

    def process_of(self, node: str) -> NodeProcess:
        assert node == "/detector"
        return self.process

    def topics_of(self, node: str) -> tuple[dict, dict]:
        images, objects = WireType("sensor_msgs/Image"), WireType("vision_msgs/Detections")
        return {"/images": images, "/clock": None}, {"/objects": objects}

    def has_header(self, wire_type: WireType) -> bool:
        return True

    def remapped(self, node: str, argv: tuple[str, ...], topics: tuple[str, ...]) -> tuple:
        return (*argv, node, *topics)


@pytest.fixture
def starts(tmp_path: Path) -> Path:
    """A file to which the node writes how it was started."""
    return tmp_path / "starts.txt"


@pytest.fixture
def graph(tmp_path: Path, starts: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    command = [sys.executable, "-c", NODE, str(starts), "whole"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None and first.stdout.readline() == "up\n"
        graph = Graph(NodeProcess.of(first.pid))
        monkeypatch.setattr(attach, "_graph", lambda pid, master_uri: graph)
        start_again = NodeProcess.start_again

        def noted(self: NodeProcess, argv: tuple[str, ...], log: Path) -> NodeProcess:
            graph.started_again.append(start_again(self, argv, log))
            return graph.started_again[-1]

        monkeypatch.setattr(NodeProcess, "start_again", noted)
        yield graph
        first.kill()
        for process in graph.started_again:
            process.stop()


@pytest.mark.process
def test_a_genie_that_does_not_start_leaves_the_node_as_it_was(
    graph: Graph, starts: Path, tmp_path: Path
):
    lines: list[str] = []
    with pytest.raises(UserError, match="/detector: its Genie did not start"):
        attach.attach("detector", requests=["/images"], say=lines.append)
    assert lines == ["/detector: back as it was"]
    remapped, restored = graph.started_again
    assert remapped.argv == (*graph.process.argv, "/detector", "/images", "/objects")
    assert restored.argv == graph.process.argv
    # The remapped node may be stopped before it writes its line.
    until(lambda: starts.read_text().splitlines()[1:][-1:] == ["whole"], "it runs again")
    assert restored.alive() and not remapped.alive()
    assert not graph.process.alive(), "the first one was stopped"
    assert not list((tmp_path / "genie-sim").glob("*.json"))


def test_a_topic_that_the_node_has_not_is_refused_before_anything_stops(graph: Graph):
    with pytest.raises(UserError, match=r"/detector: unknown topic '/image' \(did you mean"):
        attach.attach("/detector", requests=["/image"])
    assert graph.process.alive()
