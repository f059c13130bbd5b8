"""A node's process: stopped, and started again as it was."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from genie_sim.base.errors import UserError
from genie_sim_ros import process
from genie_sim_ros.process import NodeProcess, start_of
from tests.ros.conftest import until

SLOW_END = """
import signal, sys, time
signal.signal(signal.SIGINT, lambda *_: (time.sleep(0.5), sys.exit()))
print("up", flush=True)
time.sleep(60)
"""
STUBBORN = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("up", flush=True)
time.sleep(60)
"""


@pytest.fixture
def start() -> Iterator[Callable[[str], NodeProcess]]:
    """Starts a program that prints ``up``."""
    processes: list[subprocess.Popen[str]] = []

    def started(program: str) -> NodeProcess:
        command = [sys.executable, "-c", program]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        assert processes[-1].stdout is not None and processes[-1].stdout.readline() == "up\n"
        return NodeProcess.of(processes[-1].pid)

    yield started
    for running in processes:
        running.kill()
        running.wait()


@pytest.mark.process
def test_stop_returns_when_the_process_has_ended(start: Callable[[str], NodeProcess]):
    """Two nodes of one name would shut each other down."""
    node = start(SLOW_END)
    assert node.alive()
    node.stop()
    assert not node.alive() and start_of(node.pid) is None


@pytest.mark.process
def test_who_does_not_hear_is_killed(
    start: Callable[[str], NodeProcess], monkeypatch: pytest.MonkeyPatch
):
    node = start(STUBBORN)
    polite = ((signal.SIGINT, 0.1), (signal.SIGTERM, 0.1))
    monkeypatch.setattr(process, "STOP", polite)
    with pytest.raises(UserError, match=f"process {node.pid}: does not end"):
        node.stop()
    monkeypatch.setattr(process, "STOP", (*polite, (signal.SIGKILL, 5.0)))
    node.stop()
    assert not node.alive()


@pytest.mark.process
def test_another_process_of_the_same_id_is_left_alone(start: Callable[[str], NodeProcess]):
    node = start(SLOW_END)
    former = NodeProcess(node.pid, node.started - 1, argv=node.argv, env=node.env, cwd=node.cwd)
    assert not former.alive()
    former.stop()
    assert node.alive()


@pytest.mark.process
def test_it_starts_again_in_its_folder_and_environment(
    start: Callable[[str], NodeProcess], tmp_path: Path
):
    node = start(SLOW_END)
    script = "import os; print(os.getcwd(), os.environ['COLOUR'])"
    described = NodeProcess(
        node.pid, node.started, argv=node.argv, env={"COLOUR": "blue"}, cwd=str(tmp_path)
    )
    again = described.start_again((sys.executable, "-c", script), tmp_path / "log")
    until(lambda: not again.alive(), "it has ended")
    assert (tmp_path / "log").read_text() == f"{tmp_path} blue\n"
