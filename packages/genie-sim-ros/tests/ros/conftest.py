"""Real ROS for the tests: a master of their own, processes that are nodes. Skipped, with the
reason, without ROS.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import sysconfig
import time
import xmlrpc.client
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.checkout import REPOSITORY
from tests.run_page import blocks, shell

HERE = Path(__file__).resolve().parent
ADD_ON = HERE.parent.parent
PYTHONPATH = f"{REPOSITORY}{os.pathsep}{ADD_ON}"  # of processes
DEBIAN_PACKAGES = Path("/usr/lib/python3/dist-packages")
IMAGES, OBJECTS = "/image_raw", "/detection/image_detector/objects"
DETECTOR = "/vision_darknet_detect"
PATIENCE_S = 120.0  # for a machine under load

ATTACH = """
import json, sys
from genie_sim.base.errors import UserError
from genie_sim_ros.attach import attach
try:
    attach(**json.loads(sys.argv[1]), say=lambda line: print(line, flush=True))
except UserError as error:
    sys.exit(str(error))
"""
DETACH = "import sys; from genie_sim_ros.attach import detach; detach(sys.argv[1])"


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """What ``condition`` returns as soon as it is true. Fails with ``what`` after the patience."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        if value := condition():
            return value
        time.sleep(0.05)
    raise AssertionError(f"not within {patience_s:.0f} s: {what}")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Keys:
    """Folders of keys, made by the commands of ``docs/keys.md``: ``keys("car1")`` is the
    folder of an authority that has issued a certificate to ``car1``, among others.
    """

    def __init__(self, folder: Path) -> None:
        page = (ADD_ON / "docs" / "keys.md").read_text(encoding="utf-8")
        self._authority, self._genie = (
            block.text for block in blocks(page) if block.language == "bash" and not block.not_run
        )
        self._folder = folder

    def __call__(self, name: str, authority: str = "ours", days: int = 365) -> str:
        """The folder of an authority, after it has issued a certificate to ``name``."""
        folder = self._folder / authority
        if not folder.exists():
            folder.mkdir()
            self.run(self._authority, folder)
        if not (folder / "keys" / f"{name}.pem").exists():
            commands = self._genie.replace("edge1 car1", name)
            self.run(commands.replace("-days 365", f"-days {days}"), folder)
        return str(folder / "keys")

    def run(self, commands: str, folder: Path) -> None:
        """Runs commands of a shell in a folder."""
        status, printed = shell(f"cd {folder}\n{commands}")
        assert status == 0, printed


@pytest.fixture(scope="session")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl, which makes keys")
    return Keys(tmp_path_factory.mktemp("keys"))


@pytest.fixture(scope="session")
def ros1_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python that has this environment's packages first and then Debian's, as
    ``--system-site-packages`` gives.
    """
    if not (DEBIAN_PACKAGES / "rospy").is_dir():
        pytest.skip(f"needs Debian's ROS 1: no rospy in {DEBIAN_PACKAGES} (.ci/install-ros)")
    folder = tmp_path_factory.mktemp("ros1") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    site = next(folder.glob("lib/python3*/site-packages"))
    (site / "ros1.pth").write_text(f"{sysconfig.get_path('purelib')}\n{DEBIAN_PACKAGES}\n")
    python = folder / "bin" / "python"
    tried = subprocess.run([python, "-c", "import rospy, rosbag"], capture_output=True, text=True)
    if tried.returncode:
        last_line = tried.stderr.splitlines()[-1]
        pytest.skip(f"Debian's ROS 1 is not for Python {sys.version.split()[0]}: {last_line}")
    return python


class Master:
    """A ROS 1 master (one virtual network) and the processes started with it."""

    def __init__(self, python: Path, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.uri = f"http://127.0.0.1:{free_port()}"
        self._python = python
        self._processes: list[subprocess.Popen[str]] = []
        self.env = {
            **os.environ,
            "ROS_MASTER_URI": self.uri,
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(folder / "ros_home"),
            "PYTHONPATH": PYTHONPATH,
        }
        self._proxy = xmlrpc.client.ServerProxy(self.uri)
        self.run(["roscore", "-p", self.uri.rpartition(":")[2]], "roscore")
        until(self._up, "roscore is up")

    def run(self, command: list[str | Path], log: str) -> subprocess.Popen[str]:
        """A process of this network. Its output comes through a pipe, its errors go to a file."""
        with (self.folder / f"{log}.err").open("a") as errors:
            process = subprocess.Popen(
                command,
                env=self.env,
                cwd=self.folder,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
            )
        self._processes.append(process)
        return process

    def start(self, script: str, *arguments: object) -> subprocess.Popen[str]:
        return self.run([self._python, HERE / script, *map(str, arguments)], script)

    def start_node(self, name: str, script: str, *arguments: object) -> subprocess.Popen[str]:
        """A node, ready to be found by the master."""
        process = self.start(script, *arguments)
        until(
            lambda: self.pid_of(name) == process.pid and self.topics_of(name)[0],
            f"{name} has started",
        )
        return process

    def attach(self, node: str = DETECTOR, **arguments: object) -> subprocess.Popen[str]:
        """``genie-sim ros attach`` in a process of its own; returns when the Genie is attached."""
        given = json.dumps({"node": node, "record": str(self.folder / "record.jsonl"), **arguments})
        process = self.run([self._python, "-c", ATTACH, given], "attach")
        assert process.stdout is not None
        line = process.stdout.readline()
        assert "Genie attached" in line, f"{line!r}, {self.errors_of('attach')}"
        return process

    def try_attach(self, node: str = DETECTOR, **arguments: object) -> str:
        """The one line with which ``attach`` refuses."""
        given = json.dumps({"node": node, **arguments})
        done = subprocess.run(
            [self._python, "-c", ATTACH, given],
            env=self.env,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
        )
        assert done.returncode == 1
        return done.stderr.strip()

    def detach(self, node: str = DETECTOR) -> None:
        subprocess.run(
            [self._python, "-c", DETACH, node], env=self.env, check=True, timeout=PATIENCE_S
        )

    def play(
        self, places: str, pause_s: float = 0.15, listen_s: float = 0.5, answers: str = OBJECTS
    ) -> list[dict[str, Any]]:
        """Shows places to the camera, and returns the answers in the order in which they came."""
        camera = self.camera(places, pause_s, listen_s, *([] if answers == OBJECTS else [answers]))
        output, _ = camera.communicate("go\n", timeout=PATIENCE_S)
        return [json.loads(line) for line in output.splitlines()]

    def camera(self, *arguments: object) -> subprocess.Popen[str]:
        """A camera that listens and waits for a line on its standard input."""
        camera = self.start("camera.py", *arguments)
        assert camera.stdout is not None
        assert camera.stdout.readline() == "up\n"
        topic = str(arguments[3]) if len(arguments) > 3 else OBJECTS
        until(
            lambda: any(node.startswith("/camera") for node in self.subscribers(topic)),
            "the camera listens",
        )
        time.sleep(0.5)  # the publishers of its topic connect
        return camera

    def outcomes(self) -> list[str]:
        """The outcomes of all look-ups so far, in order."""
        lines = (self.folder / "record.jsonl").read_text().splitlines()
        records = [json.loads(line) for line in lines]
        return [record["outcome"] for record in records if record["record"] == "ImageLookup"]

    def subscribers(self, topic: str) -> list[str]:
        return next((nodes for name, nodes in self._state()[1] if name == topic), [])

    def topics_of(self, node: str) -> tuple[list[str], list[str]]:
        """What a node subscribes to and publishes, by the master."""
        publishers, subscribers, _ = self._state()
        listed = [
            sorted(topic for topic, nodes in side if node in nodes)
            for side in (subscribers, publishers)
        ]
        return listed[0], [topic for topic in listed[1] if topic != "/rosout"]

    def pid_of(self, node: str) -> int | None:
        """The process that answers for a node."""
        try:
            code, _, uri = self._proxy.lookupNode("/test", node)
            return int(xmlrpc.client.ServerProxy(uri).getPid("/test")[2]) if code == 1 else None
        except OSError:
            return None

    def errors_of(self, log: str) -> str:
        return (self.folder / f"{log}.err").read_text()

    def log_of_genie(self) -> str:
        """What the Genie's process and the node behind it have said."""
        return "".join(
            log.read_text() for log in (self.folder / "ros_home" / "genie-sim").glob("*.log")
        )

    def close(self) -> None:
        """Ends every process of this network, also the nodes that a watchdog has started again."""
        roscore, *others = self._processes
        for process in reversed(others):
            end(process)
        end_all(self.env["ROS_HOME"], but=roscore.pid)
        end(roscore)

    def _state(self) -> Any:
        return self._proxy.getSystemState("/test")[2]

    def _up(self) -> bool:
        try:
            return any("/rosout" in nodes for _, nodes in self._state()[1])
        except OSError:
            return False


def end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        process.kill()


def end_all(ros_home: str, but: int | None = None) -> None:
    """Kills every process whose ``ROS_HOME`` is the test's own: also nodes that a watchdog has
    started again.
    """
    for environment in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):
            if (
                f"ROS_HOME={ros_home}\0".encode() in environment.read_bytes()
                and int(environment.parent.name) != but
            ):
                os.kill(int(environment.parent.name), signal.SIGKILL)


@pytest.fixture
def new_master(ros1_python: Path, tmp_path: Path) -> Iterator[Callable[[str], Master]]:
    """``new_master("car1")``: a virtual network."""
    masters: list[Master] = []

    def make(name: str) -> Master:
        masters.append(Master(ros1_python, tmp_path / name))
        return masters[-1]

    yield make
    for master in masters:
        master.close()


@pytest.fixture
def master(new_master: Callable[[str], Master]) -> Master:
    return new_master("car1")
