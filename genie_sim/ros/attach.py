"""Puts a Genie in front of a running node, and takes it away again; the node's source is not touched.

Names cannot be changed in a live node. So the node is stopped and started again with its topics renamed
(``topic:=topic_local``), and the Genie takes over the original names. Whatever ends, the robot keeps its node:

- the Genie ends, or is killed: ``attach``, which watches it, starts the node as it was;
- ``attach`` is killed: the Genie notices and starts the node as it was;
- both are killed: ``detach`` starts the node as it was.

A file in ``$ROS_HOME/genie-sim`` says how the node was; whoever restores it holds the file's lock.
"""

import contextlib
import fcntl
import json
import logging
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, Any

from genie_sim.errors import UserError, unknown
from genie_sim.ros import ros1_graph, ros2_graph
from genie_sim.ros.codec import Types, WireType
from genie_sim.ros.plan import Plan, check
from genie_sim.ros.process import NodeProcess, boot, start_of

Graph = ros1_graph.Graph | ros2_graph.Graph  # what is asked of the middleware
log = logging.getLogger(__name__)
READY_S = 30.0
RESTORE_S = 30.0
WATCH_S = 0.1
STATE = "GENIE_SIM_ATTACHED"  # environment of the Genie's process: the file with the node's state


@dataclass(frozen=True)
class State:
    """The node as it was, and as it runs now behind its Genie (``None`` before it does).

    ``watchdog`` is the process id of ``attach`` and when it began; all of it holds for one ``boot`` only.
    """

    network: str
    node: str
    original: NodeProcess
    behind: NodeProcess | None
    watchdog: tuple[int, int | None]
    boot: str

    def write(self, path: Path) -> None:
        beside = path.with_suffix(".new")
        beside.touch(mode=0o600)  # holds the node's environment: for nobody else to read
        beside.write_text(json.dumps(asdict(self)), encoding="utf-8")
        beside.replace(path)

    @classmethod
    def read(cls, path: Path) -> "State":
        data = json.loads(path.read_text(encoding="utf-8"))
        for name in ("original", "behind"):
            if data[name] is not None:
                data[name] = NodeProcess(**{**data[name], "argv": tuple(data[name]["argv"])})
        return cls(**{**data, "watchdog": tuple(data["watchdog"])})

    @classmethod
    def all(cls) -> "dict[Path, State]":
        """The nodes that have a Genie. What was so before the machine was last switched on is forgotten."""
        found = {path: cls.read(path) for path in sorted(_states().glob("*.json"))}
        for path in [path for path, state in found.items() if state.boot != boot()]:
            path.unlink()
            del found[path]
        return found


def attach(
    node: str, *, name: str | None = None, role: str = "car", requests: Sequence[str] = (), leave: Sequence[str] = (),
    pid: int | None = None, master_uri: str | None = None, say: Callable[[str], None] = lambda line: None,
    **of_plan: Any,
) -> None:  # fmt: skip
    """Attaches a Genie to ``node`` and stays until interrupted (SIGINT, SIGTERM, SIGHUP) or until ``detach``.

    ``requests`` names the subscribed topics that go through the Genie (default: the one with images, or the only one
    whose messages have a header), ``leave`` topics to be left alone. ``pid`` is the process of a ROS 2 node, whose
    graph knows none; without it the node is one of the ROS 1 master's. The other arguments are those of ``Plan``.
    ``say`` gets a line when the Genie is attached and when everything is back. Raises UserError, with everything put
    back, for a node that cannot be attached to, and when the node or the Genie ends by itself.
    """
    node = "/" + node.strip("/")
    graph = _graph(pid, master_uri)
    inputs, answers, types = choose(graph, node, requests, leave)
    for file in ("key_file", "record"):
        if of_plan.get(file):
            of_plan[file] = str(Path(of_plan[file]).absolute())
    plan = Plan(
        node,
        name or node.strip("/").replace("/", "_"),
        role,
        tuple(inputs),
        tuple(answers),
        types,
        **of_plan,
    )
    check(plan)
    original = graph.process_of(node)
    path = _states() / (re.sub(r"[^\w.]+", "-", f"{graph.network}{node}") + ".json")
    with _locked(path) as held:
        if not held or path in State.all():
            raise UserError(f"{node}: already has a Genie; 'genie-sim detach {node}' puts it back")
        state = State(
            graph.network, node, original, None, (os.getpid(), start_of(os.getpid())), boot()
        )
        state.write(path)
        with _interrupts() as interrupted:
            try:
                original.stop()
                behind = original.start_again(
                    graph.remapped(node, original.argv, (*inputs, *answers)), _log(path)
                )
                replace(state, behind=behind).write(path)
                _watch(plan, graph, path, behind, interrupted, say)
            finally:
                if restore(path):
                    say(f"{node}: back as it was")


def detach(node: str, network: str | None = None) -> None:
    """Takes a node's Genie away and returns when the node runs as it was. Raises UserError if it has none.

    ``network`` tells nodes of one name apart: ``localhost:11311`` for the master there, ``domain-0`` in ROS 2.
    """
    node = "/" + node.strip("/")
    found = {path: state for path, state in State.all().items() if state.node == node}
    paths = {
        path: state.network for path, state in found.items() if network in (None, state.network)
    }
    if not paths:
        raise UserError(f"{node}: has no Genie")
    if len(paths) > 1:
        raise UserError(
            f"{node}: has a Genie in each of {', '.join(paths.values())}; say in which network"
        )
    path = next(iter(paths))
    pid, started = found[path].watchdog
    if start_of(pid) == started:
        os.kill(pid, signal.SIGTERM)
    deadline = time.monotonic() + RESTORE_S
    while path.exists():
        with _locked(path) as held:
            if held and path.exists():  # nobody watches any more
                restore(path)
                return
        if time.monotonic() > deadline:
            raise UserError(f"{node}: its Genie does not let go; see {_log(path)}")
        time.sleep(WATCH_S)


def restore(path: Path) -> bool:
    """Starts the node as it was, if a state file says so. To be called with the lock held. ``False``: it is back."""
    if not path.exists():
        return False
    state = State.read(path)
    if state.behind is not None:
        state.behind.stop()
    if not state.original.alive():  # it may never have been stopped
        state.original.start_again(state.original.argv, _log(path))
    path.unlink()
    return True


def restore_orphan() -> None:
    """Called by the Genie when ``attach`` has died."""
    path = Path(os.environ[STATE])
    with _locked(path, wait=True):
        restore(path)


def _watch(
    plan: Plan, graph: Graph, path: Path, behind: NodeProcess, interrupted: Callable[[], bool],
    say: Callable[[str], None],
) -> None:  # fmt: skip
    """Runs the Genie's process until somebody wants it to end; leaves it ended."""
    environment = {**os.environ, **graph.environment, STATE: str(path)}
    command = [sys.executable, "-m", graph.module]
    with (
        _log(path).open("ab") as errors,
        subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            env=environment,
            text=True,
            start_new_session=True,
        ) as genie,
    ):
        assert genie.stdin is not None and genie.stdout is not None
        try:
            genie.stdin.write(plan.to_json() + "\n")
            genie.stdin.flush()
            _await_ready(plan, genie.stdout, path, behind, interrupted)
            if not interrupted():
                say(
                    f"{plan.node}: Genie attached: {', '.join(plan.requests)} -> {', '.join(plan.answers)}"
                )
            while not interrupted():
                if genie.poll() is not None:
                    raise UserError(f"{plan.node}: its Genie ended ({_last_line(path)})")
                if not behind.alive():
                    path.unlink()  # somebody stopped the node: it must not come back
                    raise UserError(
                        f"{plan.node}: the node ended behind its Genie; it was not started again"
                    )
                time.sleep(WATCH_S)
        finally:
            if genie.poll() is None:
                genie.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                genie.wait(5)
            genie.kill()


def _await_ready(
    plan: Plan, output: IO[str], path: Path, behind: NodeProcess, interrupted: Callable[[], bool]
) -> None:
    deadline = time.monotonic() + READY_S
    while not interrupted():
        if select.select([output], [], [], WATCH_S)[0]:
            if output.readline() == "ready\n":
                return
            raise UserError(f"{plan.node}: its Genie did not start ({_last_line(path)})")
        if not behind.alive():
            raise UserError(
                f"{plan.node}: ended when started with other topics ({_last_line(path)})"
            )
        if time.monotonic() > deadline:
            raise UserError(
                f"{plan.node}: did not connect to its Genie within {READY_S:.0f} s; see {_log(path)}"
            )


@contextlib.contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Signals that ask for an end are noted, not obeyed at once: the node comes first."""
    seen: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.signal(number, lambda number, _: seen.append(number)) for number in numbers]
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


@contextlib.contextmanager
def _locked(path: Path, wait: bool = False) -> Iterator[bool]:
    """Holds the lock of a state file; yields ``False`` where somebody else does. The lock ends with the process."""
    with path.with_suffix(".lock").open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            yield False
            return
        yield True


def _states() -> Path:
    home = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "genie-sim"
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    return home


def _graph(pid: int | None, master_uri: str | None) -> Graph:
    """ROS 1 or ROS 2. Raises UserError where it is not installed."""
    try:
        return ros1_graph.Graph(master_uri) if pid is None else ros2_graph.Graph(pid)
    except ImportError as error:
        raise UserError(
            f"ROS is not there for {sys.executable}: {error}; see docs/ros.md"
        ) from error


def _log(path: Path) -> Path:
    """Where the node's and the Genie's own output goes."""
    return path.with_suffix(".log")


def _last_line(path: Path) -> str:
    lines = _log(path).read_text(encoding="utf-8", errors="replace").splitlines()
    return lines[-1] if lines else "it said nothing"


def choose(
    graph: Graph, node: str, asked_for: Sequence[str], leave: Sequence[str]
) -> tuple[list[str], list[str], dict[str, WireType]]:
    """The topics that the Genie takes over: requests, answers, and the types of both as far as they are known.

    Requests are the topics ``asked_for``, else every one whose messages have a header. A node that joins several inputs
    by stamp needs all of them or none, so that only one may go through the Genie; its other topics stay as they are.
    Where it is not clear which, and it is not the only one with images, a UserError asks.
    """
    subscribed, published = graph.topics_of(node)
    for topic in (*asked_for, *leave):
        if topic not in (*subscribed, *published):
            raise UserError(f"{node}: {unknown('topic', topic, [*subscribed, *published])}")

    def usable(topics: Types) -> list[str]:
        return [
            topic
            for topic, kind in topics.items()
            if topic not in leave and (not kind or graph.has_header(kind))
        ]

    requests, answers = list(asked_for) or usable(subscribed), usable(published)
    if len(requests) > 1 and not asked_for:
        images = [
            topic
            for topic in requests
            if (kind := subscribed[topic]) and kind.name == graph.image_type
        ]
        if len(images) != 1:
            raise UserError(
                f"{node}: which topic carries the requests? It subscribes to {', '.join(requests)}"
            )
        requests = images
    if not requests or not answers:
        verb = "publishes" if requests else "subscribes to"
        raise UserError(f"{node}: {verb} no topic whose messages have a header")
    types = {**subscribed, **published}
    return (
        requests,
        answers,
        {topic: kind for topic in (*requests, *answers) if (kind := types[topic])},
    )
