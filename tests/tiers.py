"""Tiers of tests: what ``python -m pytest`` runs, what it leaves out, and what each test costs.

A test is in the fast tier unless it is marked otherwise: it starts no process, needs nothing but
the packages of ``.[test]``, and takes at most a second of CPU. Fixtures that need more mark the
tests that ask for them; ``slow`` and ``process`` are marked by hand, too. README.md of this folder
tells which tier to run after which change.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.checkout import REPOSITORY

# The most demanding first: a test of several tiers is counted in the first of them.
TIERS = ("nightly", "data", "ros", "browser", "process", "slow")
FAST = "not (slow or process or browser or ros or data or nightly)"  # -m, as in pyproject.toml

TIER_OF_FIXTURE = {
    "kitti_root": "data",
    "weights_dir": "data",
    "v2v4real_root": "data",
    "ros1_python": "ros",
    "ros2_python": "ros",
    "program": "browser",
    "run_process": "process",
    "keys": "process",
}
WEIGHT = {"ros": 30, "slow": 10, "process": 10, "browser": 3}  # a test of the fast tier: 1

MAX_CPU_S = 1.0  # of a test of the fast tier
STARTS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn"}  # audit events
MAY_START = {"git", "lscpu", "uname"}  # what a run asks of its machine, in milliseconds

IN_WORKER = "PYTEST_XDIST_WORKER" in os.environ

left_out: Counter[str] = Counter()
cpu_s: dict[str, float] = {}  # of tests of the fast tier
cpu_of_files_s: Counter[str] = Counter()  # of their tests and fixtures
cpu_of_workers_s: list[float] = []


def tier_of(item: pytest.Item) -> str:
    """The tier that a test is counted in; ``fast`` where no mark says otherwise."""
    marks = {mark.name for mark in item.iter_markers()}
    return next((tier for tier in TIERS if tier in marks), "fast")


def noted(report: Any, name: str) -> list[Any]:
    """What a test has noted under a name, for whoever reads its report."""
    return [value for key, value in getattr(report, "user_properties", ()) if key == name]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--cpu-file", metavar="FILE", help="where to write the CPU of each test, JSON")
    parser.addoption(
        "--max-cpu-s", type=float, metavar="S", help="print the CPU of each file; fail above this"
    )


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int | None:
    """A single file runs in this process: workers take longer to start."""
    paths = {argument.partition("::")[0] for argument in config.args}
    return 0 if len(paths) == 1 and Path(paths.pop()).is_file() else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        for fixture in getattr(item, "fixturenames", ()):
            if fixture in TIER_OF_FIXTURE:
                item.add_marker(TIER_OF_FIXTURE[fixture])
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.no_cover)
        if sys.platform == "win32" and item.get_closest_marker("unix"):
            item.add_marker(pytest.mark.skip(reason="needs the signals and terminals of Unix"))
        item.user_properties.append(("tier", tier_of(item)))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Files that take long come first, so that no process has one left when others are done."""
    if IN_WORKER:
        weights: Counter[Path] = Counter()
        for item in session.items:
            weights[item.path] += WEIGHT.get(tier_of(item), 1)
        session.items.sort(key=lambda item: -weights[item.path])


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    left_out.update(tier_of(item) for item in items)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if IN_WORKER:
        told = session.config.workeroutput  # type: ignore[attr-defined]
        told |= {"left_out": dict(left_out), "cpu_s": time.process_time()}
    elif _is_over(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Every worker has left out the same tests."""
    told = getattr(node, "workeroutput", {})
    left_out.clear()
    left_out.update(told.get("left_out", {}))
    cpu_of_workers_s.append(told.get("cpu_s", 0.0))


def _whole_cpu_s() -> float:
    """Of this run so far, with its workers that have ended."""
    return time.process_time() + sum(cpu_of_workers_s)


def _is_over(config: pytest.Config) -> bool:
    """Whether the run has taken more CPU than it may."""
    most_s: float | None = config.option.max_cpu_s
    return most_s is not None and _whole_cpu_s() > most_s


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Where pytest-xdist runs several tests at a time, one that is marked ``alone`` waits until no
    other is running, and keeps the others waiting.
    """
    if not IN_WORKER or sys.platform == "win32":
        return (yield)
    with _turn(alone=item.get_closest_marker("alone") is not None):
        return (yield)


@contextmanager
def _turn(alone: bool) -> Iterator[None]:
    """A lock that many share or one has, between processes; no file is needed but those that are
    there.
    """
    import fcntl

    with (
        (REPOSITORY / "README.md").open() as queue,
        (REPOSITORY / "pyproject.toml").open() as running,
    ):
        fcntl.flock(queue, fcntl.LOCK_EX)  # who waits to be alone is not overtaken
        fcntl.flock(running, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(queue, fcntl.LOCK_UN)
        try:
            yield
        finally:
            fcntl.flock(running, fcntl.LOCK_UN)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "teardown" and not IN_WORKER:
        own_s = sum(noted(report, "cpu_s"))
        if noted(report, "tier") == ["fast"]:
            cpu_s[report.nodeid] = own_s
        file = report.nodeid.partition("::")[0]
        cpu_of_files_s[file] += own_s + sum(noted(report, "cpu_of_fixtures_s"))


class _Starts:
    """Which programs are started while a test of the fast tier runs."""

    def __init__(self) -> None:
        self.watching = False
        self.seen: list[str] = []

    def note(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.watching and event in STARTS:
            program = os.fsdecode(arguments[0]) if arguments else event
            if Path(program).name not in MAY_START:
                self.seen.append(program)


starts = _Starts()
sys.addaudithook(starts.note)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Measures the CPU of a test, without that of its fixtures, which it may share. Fails a test of
    the fast tier that starts a process.
    """
    starts.watching, starts.seen = tier_of(item) == "fast", []
    began_s = time.process_time()
    try:
        outcome = yield
    finally:
        starts.watching = False
        item.user_properties.append(("cpu_s", time.process_time() - began_s))
    if starts.seen:
        pytest.fail(f"starts {starts.seen[0]}: mark it @pytest.mark.process", pytrace=False)
    return outcome


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """Measures the CPU of fixtures, also those that later tests of the file share."""
    began_s = time.process_time()
    try:
        return (yield)
    finally:
        item.user_properties.append(("cpu_of_fixtures_s", time.process_time() - began_s))


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    lines = [*_of_skips(terminalreporter.stats.get("skipped", [])), *_of_left_out(config)]
    lines += _of_cpu(config)
    if lines:
        terminalreporter.section("tiers")
        for line in lines:
            terminalreporter.line(line)


def _of_skips(reports: Sequence[Any]) -> Iterator[str]:
    """A line for each tier: how many tests were skipped, and what most of them need."""
    reasons: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for report in reports:
        why = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        reasons[next(iter(noted(report, "tier")), "all tiers")][why.removeprefix("Skipped: ")] += 1
    for tier, counts in reasons.items():
        first, *others = counts.most_common()
        more = f" ({len(others)} other reasons: -rs lists them)" if others else ""
        yield f"{counts.total():,} of {tier} skipped: {first[0]}{more}"


def _of_left_out(config: pytest.Config) -> Iterator[str]:
    """How many tests of other tiers the fast one leaves out, and how to run them."""
    if config.option.markexpr == FAST:
        for tier in reversed(TIERS):
            if left_out[tier]:
                yield f"{left_out[tier]:,} of {tier} left out: python -m pytest -m {tier}"


def _of_cpu(config: pytest.Config) -> Iterator[str]:
    """The tests of the fast tier that take too long for it."""
    if config.option.cpu_file:
        Path(config.option.cpu_file).write_text(json.dumps(cpu_s), encoding="utf-8")
    slow = sorted(
        ((spent, name) for name, spent in cpu_s.items() if spent > MAX_CPU_S), reverse=True
    )
    if slow:
        yield f"{len(slow):,} took more than {MAX_CPU_S:g} s of CPU and are not marked slow:"
    yield from (f"  {spent:5.1f} s  {name}" for spent, name in sorted(slow, reverse=True)[:10])
    if config.option.max_cpu_s is not None:
        yield from _of_files(config.option.max_cpu_s)


def _of_files(most_s: float) -> Iterator[str]:
    """The CPU of each file, the most first, and whether the whole is too much."""
    yield "CPU of each file, with its fixtures:"
    yield from (f"  {spent:5.1f} s  {name}" for name, spent in cpu_of_files_s.most_common())
    whole_s, in_tests_s = _whole_cpu_s(), cpu_of_files_s.total()
    yield f"  {whole_s - in_tests_s:5.1f} s  imports, collecting, reports"
    verdict = "more than" if whole_s > most_s else "of at most"
    yield f"{whole_s:.0f} s of CPU, {verdict} {most_s:g} s"
