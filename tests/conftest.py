"""What every test may ask for: real data, the command line, and a folder of its own to write
into.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import settings

from tests.browser import Browser, installed

REPOSITORY = Path(__file__).resolve().parent.parent

os.environ.setdefault("MPLBACKEND", "Agg")
os.fsync = lambda descriptor: None  # no test cuts the power, and disks take their time
# Without --jobs a command starts no processes: the tests keep every core busy themselves.
os.environ["LOKY_MAX_CPU_COUNT"] = "1"
os.environ["GENIE_SIM_PROGRESS"] = "off"  # lines of progress would come where a machine is slow
settings.register_profile("genie_sim", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("genie_sim")

# Long files first, so that no process has one left when the others are done; files of real ROS
# early, too, because they mostly wait while others compute.
FIRST = (
    "test_docs.py",
    "test_study.py",
    "test_ros1.py",
    "test_sweep_page.py",
    "test_seed_studies.py",
    "test_search.py",
    "test_two_networks.py",
    "test_ros2.py",
    "test_notebooks.py",
    "test_readme.py",
    "test_method_conformance.py",
    "test_conservation.py",
    "test_report.py",
    "test_figures.py",
    "test_reproduce.py",
    "test_fuzz.py",
    "test_links.py",
    "test_mishaps.py",
    "test_interrupted.py",
    "test_feel.py",
    "test_device_fit.py",
    "test_queues.py",
    "test_api.py",
    "test_accessible.py",
    "test_fleet.py",
    "test_own_code.py",
    "test_scenario.py",
    "test_clock_fault.py",
    "test_sources.py",
    "test_algorithm2.py",
    "test_baselines.py",
)
LAST = "test_reality.py"  # runs alone

CommandLine = Callable[..., subprocess.CompletedProcess[str]]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--nightly", action="store_true", help="also what takes minutes: tests marked nightly"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:  # alone, the order is as given
        order = {name: place - len(FIRST) for place, name in enumerate(FIRST)} | {LAST: 1}
        items.sort(key=lambda item: order.get(item.path.name, 0))
    for item in items:
        if item.get_closest_marker("nightly") and not config.getoption("--nightly"):
            item.add_marker(pytest.mark.skip(reason="takes minutes: --nightly"))
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.no_cover)
        if sys.platform == "win32" and item.get_closest_marker("unix"):
            item.add_marker(pytest.mark.skip(reason="needs the signals and terminals of Unix"))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Where pytest-xdist runs several tests at a time, one that is marked ``alone`` waits until no
    other is running, and keeps the others waiting.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ or sys.platform == "win32":
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


@pytest.fixture(autouse=True)
def _own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each test starts in an empty folder: nothing written to a relative path ends up in the
    checkout.
    """
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="session")
def kitti_root() -> Path:
    """The folder of real KITTI frames; skips the test where there is none."""
    return _real_data("GENIE_SIM_KITTI", "real KITTI frames")


@pytest.fixture(scope="session")
def weights_dir() -> Path:
    """The folder of real detector weights; skips the test where there is none."""
    return _real_data("GENIE_SIM_WEIGHTS", "real detector weights")


@pytest.fixture(scope="session")
def v2v4real_root() -> Path:
    """The folder of DMSTrack's text files of V2V4Real; skips the test where there is none."""
    return _real_data("GENIE_SIM_V2V4REAL", "the text files of V2V4Real")


def _real_data(variable: str, what: str) -> Path:
    value = os.environ.get(variable)
    if not value:
        pytest.skip(f"needs {what}: {variable} is not set")
    if not Path(value).is_dir():
        pytest.skip(f"needs {what}: {variable}={value} is not a folder")
    return Path(value).resolve()


@pytest.fixture
def run_cli(tmp_path: Path) -> CommandLine:
    """``run_cli("run", "3car_hetero")`` runs this checkout's ``genie-sim`` in the test's folder.

    Returns the ``CompletedProcess``, with exit status and texts. ``env`` adds environment
    variables.
    """

    def run(
        *arguments: str, env: dict[str, str] | None = None, timeout_s: float = 300
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "genie_sim", *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY), **(env or {})},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
        )

    return run


@pytest.fixture(scope="session")
def program() -> str:
    """The program of a browser; skips the test where there is none."""
    found = installed()
    if found is None:
        pytest.skip("needs Chromium: none of its programs is installed")
    return found


@pytest.fixture(scope="module")
def one_browser(program: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    browser = Browser(program, tmp_path_factory.mktemp("profile"))
    yield browser
    browser.close()


@pytest.fixture
def browser(one_browser: Browser) -> Browser:
    """The browser, with nothing noted so far, in a common window."""
    one_browser.errors.clear()
    one_browser.requests.clear()
    one_browser.size(1200, 900)
    return one_browser
