"""Puts a Genie in front of a running node, and takes it away again; the node's source is not
touched.

Names cannot be changed in a live node. So the node is stopped and started again with its topics
renamed (``topic:=topic_local``), and the Genie takes over the original names. Whatever ends, the
robot keeps its node:

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
from typing import Any

from genie_sim.base.errors import UserError, unknown
from genie_sim.base.paths import replace_durably
from genie_sim_ros import ros1_graph, ros2_graph
from genie_sim_ros.codec import Types, WireType
from genie_sim_ros.plan import AttachPlan, check
from genie_sim_ros.process import NodeProcess, boot, start_of

RosGraph = ros1_graph.Ros1Graph | ros2_graph.Ros2Graph
Say = Callable[[str], None]
log = logging.getLogger(__name__)
READY_S = 30.0
RESTORE_S = 30.0
WATCH_S = 0.1
STATE = "GENIE_SIM_ATTACHED"  # environment of the Genie's process: the file with the node's state


@dataclass(frozen=True)
class State:
    """The node as it was, and as it runs now behind its Genie (``None`` before it does).

    ``watchdog`` is the process of ``attach``: its id and when it began. Process ids hold for one
    ``boot`` only.
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
        replace_durably(beside, path)

    @classmethod
    def read(cls, path: Path) -> "State":
        data = json.loads(path.read_text(encoding="utf-8"))
        for name in ("original", "behind"):
            if data[name] is not None:
                data[name] = NodeProcess(**{**data[name], "argv": tuple(data[name]["argv"])})
        return cls(**{**data, "watchdog": tuple(data["watchdog"])})

    @classmethod
    def all(cls) -> "dict[Path, State]":
        """The nodes that have a Genie, by their state files. Deletes files from before the machine
        was last switched on.
        """
        states = {}
        for path in sorted(_states().glob("*.json")):
            state = cls.read(path)
            if state.boot == boot():
                states[path] = state
            else:
                path.unlink()
        return states


def attach(
    node: str,
    *,
    name: str | None = None,
    role: str = "car",
    requests: Sequence[str] = (),
    leave: Sequence[str] = (),
    pid: int | None = None,
    master_uri: str | None = None,
    say: Say = lambda line: None,
    **plan_fields: Any,
) -> None:
    """Attaches a Genie to ``node`` and stays until interrupted (SIGINT, SIGTERM, SIGHUP) or until
    ``detach``.

    Raises UserError, with everything put back, for a node that cannot be attached to, and when the
    node or the Genie ends by itself.

    Parameters
    ----------
    node : str
        The node's name in ROS.
    name : str, optional
        What other Genies call this one; by default the node's name.
    role : str
        ``car`` or ``edge``.
    requests : sequence of str
        Subscribed topics that go through the Genie. By default the one with images, or the only
        one whose messages have a header.
    leave : sequence of str
        Topics to be left alone.
    pid : int, optional
        The process of a ROS 2 node, whose graph knows none; without it the node is one of the
        ROS 1 master's.
    master_uri : str, optional
        The ROS 1 master, by default the environment's.
    say : callable
        Gets a line when the Genie is attached and when everything is back.
    **plan_fields
        Other fields of ``AttachPlan``.
    """
    node = "/" + node.strip("/")
    graph = _graph(pid, master_uri)
    inputs, answers, types = choose(graph, node, requests, leave)
    for file in ("keys", "record"):
        if plan_fields.get(file):
            plan_fields[file] = str(Path(plan_fields[file]).absolute())
    plan = AttachPlan(
        node=node,
        name=name or node.strip("/").replace("/", "_"),
        role=role,
        requests=tuple(inputs),
        answers=tuple(answers),
        types=types,
        **plan_fields,
    )
    check(plan)
    original = graph.process_of(node)
    path = _states() / (re.sub(r"[^\w.]+", "-", f"{graph.network}{node}") + ".json")
    with _locked(path) as is_ours:
        if not is_ours or path in State.all():
            raise UserError(
                f"{node}: already has a Genie; 'genie-sim ros detach {node}' puts it back"
            )
        state = State(
            network=graph.network,
            node=node,
            original=original,
            behind=None,
            watchdog=(os.getpid(), start_of(os.getpid())),
            boot=boot(),
        )
        state.write(path)
        with _interrupts() as interrupted:
            try:
                original.stop()
                argv = graph.remapped(node, original.argv, (*inputs, *answers))
                behind = original.start_again(argv, _log(path))
                replace(state, behind=behind).write(path)
                with _genie_process(plan, graph, path) as genie:
                    watch = _Watch(
                        plan=plan, path=path, behind=behind, genie=genie, interrupted=interrupted
                    )
                    watch.until_ready()
                    if not interrupted():
                        topics = f"{', '.join(plan.requests)} -> {', '.join(plan.answers)}"
                        say(f"{node}: Genie attached: {topics}")
                    watch.until_interrupted()
            finally:
                if restore(path):
                    say(f"{node}: back as it was")


def detach(node: str, network: str | None = None) -> None:
    """Takes a node's Genie away and returns when the node runs as it was. Raises UserError if it
    has none.

    ``network`` tells nodes of one name apart: ``localhost:11311`` for the master there,
    ``domain-0`` in ROS 2.
    """
    node = "/" + node.strip("/")
    states = {
        path: state
        for path, state in State.all().items()
        if state.node == node and network in (None, state.network)
    }
    if not states:
        raise UserError(f"{node}: has no Genie")
    if len(states) > 1:
        networks = ", ".join(state.network for state in states.values())
        raise UserError(f"{node}: has a Genie in each of {networks}; say in which network")
    (path,) = states
    pid, started = states[path].watchdog
    if start_of(pid) == started:
        os.kill(pid, signal.SIGTERM)
    deadline = time.monotonic() + RESTORE_S
    while path.exists():
        with _locked(path) as is_ours:
            if is_ours and path.exists():  # nobody watches any more
                restore(path)
                return
        if time.monotonic() > deadline:
            raise UserError(f"{node}: its Genie did not stop; see {_log(path)}")
        time.sleep(WATCH_S)


def restore(path: Path) -> bool:
    """Starts the node as it was, if there is a state file, and returns whether there was. To be
    called with the lock held.
    """
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


@contextlib.contextmanager
def _genie_process(
    plan: AttachPlan, graph: RosGraph, path: Path
) -> Iterator[subprocess.Popen[str]]:
    """The Genie's process, which is told its plan; it has ended when this is left."""
    with (
        _log(path).open("ab") as errors,
        subprocess.Popen(
            [sys.executable, "-m", graph.module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            env={**os.environ, **graph.environment, STATE: str(path)},
            text=True,
            start_new_session=True,
        ) as genie,
    ):
        assert genie.stdin is not None
        try:
            with contextlib.suppress(BrokenPipeError):  # it has ended: its last line says why
                genie.stdin.write(plan.to_json() + "\n")
                genie.stdin.flush()
            yield genie
        finally:
            if genie.poll() is None:
                genie.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                genie.wait(5)
            genie.kill()
            with contextlib.suppress(BrokenPipeError):
                genie.stdin.close()


@dataclass
class _Watch:
    """Watches the Genie and the node behind it. Raises UserError if one of them ends by itself."""

    plan: AttachPlan
    path: Path
    behind: NodeProcess
    genie: subprocess.Popen[str]
    interrupted: Callable[[], bool]

    def until_ready(self) -> None:
        """Returns when the Genie says that it is connected to the node, or on an interrupt."""
        node, output = self.plan.node, self.genie.stdout
        assert output is not None
        deadline = time.monotonic() + READY_S
        while not self.interrupted():
            if select.select([output], [], [], WATCH_S)[0]:
                if output.readline() == "ready\n":
                    return
                raise UserError(f"{node}: its Genie did not start ({_last_line(self.path)})")
            if not self.behind.alive():
                last_line = _last_line(self.path)
                raise UserError(f"{node}: ended when started with other topics ({last_line})")
            if time.monotonic() > deadline:
                raise UserError(
                    f"{node}: did not connect to its Genie within {READY_S:.0f} s; "
                    f"see {_log(self.path)}"
                )

    def until_interrupted(self) -> None:
        """Returns on an interrupt."""
        node = self.plan.node
        while not self.interrupted():
            if self.genie.poll() is not None:
                raise UserError(f"{node}: its Genie ended ({_last_line(self.path)})")
            if not self.behind.alive():
                self.path.unlink()  # somebody stopped the node: it must not come back
                raise UserError(
                    f"{node}: the node ended behind its Genie; it was not started again"
                )
            time.sleep(WATCH_S)


@contextlib.contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Signals that ask for an end are noted, not obeyed at once: the node comes first."""
    signals: list[int] = []
    handlers = {}
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        handlers[number] = signal.signal(number, lambda number, _: signals.append(number))
    try:
        yield lambda: bool(signals)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _locked(path: Path, wait: bool = False) -> Iterator[bool]:
    """Holds the lock of a state file; yields ``False`` where somebody else does. The lock ends with
    the process.
    """
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


def _graph(pid: int | None, master_uri: str | None) -> RosGraph:
    """ROS 1 or ROS 2. Raises UserError where it is not installed."""
    try:
        return ros1_graph.Ros1Graph(master_uri) if pid is None else ros2_graph.Ros2Graph(pid)
    except ImportError as error:
        raise UserError(
            f"ROS is not installed for {sys.executable}: {error}; see docs/ros.md"
        ) from error


def _log(path: Path) -> Path:
    """Where the node's and the Genie's own output goes."""
    return path.with_suffix(".log")


def _last_line(path: Path) -> str:
    lines = _log(path).read_text(encoding="utf-8", errors="replace").splitlines()
    return lines[-1] if lines else "(no output)"


def choose(
    graph: RosGraph, node: str, requested: Sequence[str], leave: Sequence[str]
) -> tuple[list[str], list[str], dict[str, WireType]]:
    """The topics that the Genie takes over: requests, answers, and the types of both as far as they
    are known.

    Requests are the ``requested`` topics, else every one whose messages have a header. A node that
    joins several inputs by stamp needs all of them or none, so that only one may go through the
    Genie; its other topics stay as they are. Where it is not clear which, and it is not the only
    one with images, a UserError asks.
    """
    subscribed, published = graph.topics_of(node)
    for topic in (*requested, *leave):
        if topic not in (*subscribed, *published):
            raise UserError(f"{node}: {unknown('topic', topic, [*subscribed, *published])}")

    def usable(topics: Types) -> list[str]:
        return [
            topic
            for topic, wire_type in topics.items()
            if topic not in leave and (not wire_type or graph.has_header(wire_type))
        ]

    requests, answers = list(requested) or usable(subscribed), usable(published)
    if len(requests) > 1 and not requested:
        candidates, requests = requests, []
        for topic in candidates:
            wire_type = subscribed[topic]
            if wire_type and wire_type.name == graph.image_type:
                requests.append(topic)
        if len(requests) != 1:
            topics = ", ".join(candidates)
            raise UserError(f"{node}: which topic carries the requests? It subscribes to {topics}")
    if not requests or not answers:
        verb = "publishes" if requests else "subscribes to"
        raise UserError(f"{node}: {verb} no topic whose messages have a header")
    all_types = {**subscribed, **published}
    types = {topic: all_types[topic] for topic in (*requests, *answers)}
    return requests, answers, {topic: kind for topic, kind in types.items() if kind}
